"""Proofs of branch and price: a tree of decisions with a certificate at each leaf.

A branch says of some resource: at most k robots use it, or at least k + 1 do. Whatever a
plan does, it goes one of the two ways, so that the leaves below cover all plans. A leaf's
multipliers bound the plans that obey the decisions on the way to it; the proof's bound is the
largest of its leaves'.
"""

import math
from collections.abc import Callable, Iterator
from typing import Literal

import msgspec

from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.certificates.certificate import (
    CertificateError,
    Claim,
    Decision,
    Multipliers,
    Pricing,
    model_of,
    price,
)
from cocap_opt.formulations.certificates.resources import Resource, misuse
from cocap_opt.model import Model
from cocap_opt.problem.problem import Problem

MOST_NODES = 1_000_000


class Branch(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="branch"):
    """At most `robots` robots use the resource, or at least one more; nodes by their number."""

    resource: Resource
    robots: int
    at_most: int  # number of the node in which at most `robots` use it
    at_least: int  # number of the node in which more do


class Leaf(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="leaf"):
    """Multipliers that bound the plans of this leaf."""

    certificate: Multipliers


class ProofFile(Claim, frozen=True, kw_only=True):
    """A proof with the bound it claims and the digest of its scene."""

    format: Literal["cocap-opt proof"] = "cocap-opt proof"
    version: Literal[2] = 2
    nodes: tuple[Branch | Leaf, ...]  # the first is the root; children come after their parent


def leaves(proof: ProofFile) -> Iterator[tuple[int, tuple[Decision, ...]]]:
    """Numbers of the leaves, each with the decisions on the way to it.

    Raises
    ------
    CertificateError
        If the nodes are no tree: every node but the first must be the child of exactly one
        branch before it.
    """
    if not 1 <= len(proof.nodes) <= MOST_NODES:
        raise CertificateError(f"nodes: must be 1..{MOST_NODES} nodes")
    parents: list[tuple[int, Decision] | None] = [None] * len(proof.nodes)
    for n, node in enumerate(proof.nodes):
        if n and parents[n] is None:
            raise CertificateError(f"nodes[{n}]: is the child of no branch before it")
        if isinstance(node, Branch):
            sides = (
                (node.at_most, Decision(node.resource, "at most", node.robots)),
                (node.at_least, Decision(node.resource, "at least", node.robots + 1)),
            )
            for child, decision in sides:
                if not n < child < len(proof.nodes) or parents[child] is not None:
                    raise CertificateError(f"nodes[{n}]: {child} cannot be its child")
                parents[child] = n, decision
    for n, node in enumerate(proof.nodes):
        if isinstance(node, Leaf):
            yield n, _way(parents, n)


def _way(parents: list[tuple[int, Decision] | None], n: int) -> tuple[Decision, ...]:
    """Decisions from the root down to a node."""
    decisions = []
    while (parent := parents[n]) is not None:
        n, decision = parent
        decisions.append(decision)
    return tuple(reversed(decisions))


def price_proof(
    model: Model, proof: ProofFile, progress: Callable[[int, int], None] = lambda done, total: None
) -> Pricing:
    """Upper bound on J that a proof proves: the largest bound of its leaves."""
    for n, node in enumerate(proof.nodes):
        if isinstance(node, Branch):
            if wrong := misuse(model, node.resource):
                raise CertificateError(f"nodes[{n}].resource.{wrong}")
            most = len(model.problem.robots)
            if not 0 <= node.robots <= most:
                raise CertificateError(f"nodes[{n}].robots: must be 0..{most}")
    worst = Pricing(-math.inf, 0.0)
    total = sum(isinstance(node, Leaf) for node in proof.nodes)
    for done, (n, decisions) in enumerate(leaves(proof)):
        leaf = proof.nodes[n]
        assert isinstance(leaf, Leaf)
        try:
            pricing = price(model, leaf.certificate, decisions)
        except CertificateError as error:
            raise CertificateError(f"nodes[{n}].{error}") from error
        if not pricing.bound <= worst.bound:
            worst = pricing
        progress(done + 1, total)
    return worst


def verify_proof(
    problem: Problem,
    proof: ProofFile,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Pricing:
    """Recompute a proof's bound from the problem alone, with fresh coverage.

    Raises
    ------
    CertificateError
        If it belongs to another scene, is no tree, a leaf is not valid, or it claims less
        than it proves.
    """
    if proof.digest != problem_digest(problem):
        raise CertificateError("digest: the proof belongs to another scene")
    pricing = price_proof(model_of(problem, proof.classes), proof, progress)
    if not pricing.bound <= proof.proved:
        raise CertificateError(
            f"bound: claims {proof.proved!r}, but the leaves prove only {pricing.bound!r}"
        )
    return pricing
