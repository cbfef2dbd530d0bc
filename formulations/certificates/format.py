"""The format of certificate and proof files.

Both are documents (`cocap_opt.files.documents`): JSON with a `format` and a `version`, read
strictly. A certificate holds one set of numbers that bounds J. A proof holds a tree of
decisions, and such numbers at each of its leaves.

What may come has its place, and raises the version: how coverage was computed is a field of
`_Claim`, with a default that older files then have; a set of moves is one more class of
`Resource`; payments per step, and a chain of stages of fixing, are one more class of
`Certificate` with a tag of its own. Readers of an older version refuse such files in words.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import msgspec

from cocap_opt.files.documents import Document, decode_document, read_bytes
from cocap_opt.formulations.certificates.resources import Resource

MOST_NODES = 1_000_000

# The numbers of classes in a file count the classes of robots that differ only in their start
# ("alike"), or robots, each of which is a class of its own ("single").
Classes = Literal["alike", "single"]
Table = tuple[tuple[float, ...], ...]  # [T+1][F], or [1][F] where pixels add up over time


class CertificateError(ValueError):
    """A certificate does not fit its problem or is not valid; the message names the field."""


class _Part(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of the parts of a file."""


class Row(_Part, frozen=True):
    """A row "at most one robot uses this resource", by the scene's collision rules."""

    resource: Resource
    multiplier: float  # mu >= 0


class Decision(_Part, frozen=True):
    """A decision: at most, or at least, so many robots use this resource."""

    resource: Resource
    sense: Literal["at most", "at least"]
    robots: int

    @property
    def closes(self) -> bool:
        """True where nobody may use the resource."""
        return self.sense == "at most" and self.robots <= 0

    @property
    def sign(self) -> int:
        """1 where the resource is to be used less, -1 where more."""
        return 1 if self.sense == "at most" else -1


class ClassCurve(_Part, frozen=True):
    """The function phi of one class: linear between breakpoints, of slope 1 after the last."""

    class_number: int = msgspec.field(name="robot_class")
    roots: tuple[float, ...]  # [K] breakpoints > 0, increasing, px^0.5/m
    values: tuple[float, ...]  # [K] phi at them, >= 0


class EnvelopeCut(_Part, frozen=True):
    """Functions phi that bound the root of view sum (t, face); the constant is recomputed."""

    t: int
    face: int
    curves: tuple[ClassCurve, ...]  # of classes in increasing order; the others have phi(s) = s
    share: float  # theta, the share of the root that this cut bounds, 0..1


class Multipliers(_Part, frozen=True, tag="multipliers", omit_defaults=True):
    """Multipliers of view sums, conflict rows, envelope cuts and decisions."""

    alpha: Table
    beta: Table  # m/px^0.5
    rows: tuple[Row, ...] = ()
    cuts: tuple[EnvelopeCut, ...] = ()
    decisions: tuple[float, ...] = ()  # nu >= 0, one per decision on the way to the leaf


class ReferencePixels(_Part, frozen=True, tag="reference"):
    """Pixels at which marginal gains are taken; those of a plan give the online bound."""

    pixels: Table  # px/m2


Certificate = Multipliers | ReferencePixels


class _Claim(Document, frozen=True, kw_only=True):
    """The claim of a file that proves a bound, and the scene that it belongs to."""

    scene: str
    digest: str  # of the problem
    method: str
    classes: Classes = "alike"
    bound: float | None  # None: -infinity, there is no plan

    @property
    def proved(self) -> float:
        """The claimed bound as a number."""
        return -math.inf if self.bound is None else self.bound


class CertificateFile(_Claim, frozen=True, kw_only=True):
    """A certificate with the bound it claims and the digest of its scene."""

    format: Literal["cocap-opt certificate"] = "cocap-opt certificate"
    version: Literal[3] = 3
    certificate: Certificate


class Branch(_Part, frozen=True, tag="branch"):
    """A node of a proof: at most `robots` robots use the resource, or at least one more."""

    resource: Resource
    robots: int
    at_most: int  # number of the node in which at most `robots` use it
    at_least: int  # number of the node in which more do


class Leaf(_Part, frozen=True, tag="leaf"):
    """Multipliers that bound the plans of a leaf."""

    certificate: Multipliers


class ProofFile(_Claim, frozen=True, kw_only=True):
    """A proof with the bound it claims and the digest of its scene."""

    format: Literal["cocap-opt proof"] = "cocap-opt proof"
    version: Literal[2] = 2
    nodes: tuple[Branch | Leaf, ...]  # the first is the root; children come after their parent

    def leaves(self) -> Iterator[tuple[int, Leaf, tuple[Decision, ...]]]:
        """Yields number and content of each leaf, and the decisions on the way to it.

        Raises
        ------
        CertificateError
            If the nodes are no tree: every node but the first must be the child of exactly
            one branch before it.
        """
        parents = self._parents()
        for n, node in enumerate(self.nodes):
            if isinstance(node, Leaf):
                yield n, node, _way(parents, n)

    def _parents(self) -> list[tuple[int, Decision] | None]:
        """Returns each node's parent, and the decision that leads from there."""
        if not 1 <= len(self.nodes) <= MOST_NODES:
            raise CertificateError(f"nodes: must be 1..{MOST_NODES} nodes")
        parents: list[tuple[int, Decision] | None] = [None] * len(self.nodes)
        for n, node in enumerate(self.nodes):
            if n and parents[n] is None:
                raise CertificateError(f"nodes[{n}]: is the child of no branch before it")
            if isinstance(node, Leaf):
                continue
            sides = (
                (node.at_most, Decision(node.resource, "at most", node.robots)),
                (node.at_least, Decision(node.resource, "at least", node.robots + 1)),
            )
            for child, decision in sides:
                if not n < child < len(self.nodes) or parents[child] is not None:
                    raise CertificateError(f"nodes[{n}]: {child} cannot be its child")
                parents[child] = n, decision
        return parents


def _way(parents: list[tuple[int, Decision] | None], n: int) -> tuple[Decision, ...]:
    """Returns the decisions from the root down to a node."""
    decisions = []
    while (parent := parents[n]) is not None:
        n, decision = parent
        decisions.append(decision)
    return tuple(reversed(decisions))


def read_certificate(path: Path) -> CertificateFile | ProofFile:
    """Reads a certificate or a proof, by the format that the file names.

    Raises
    ------
    FileError
        One line with the file's name, the field and what is allowed.
    """
    return decode_certificate(read_bytes(path), str(path))


def decode_certificate(content: bytes, name: str) -> CertificateFile | ProofFile:
    """Returns a certificate or a proof from the content of the file of that name.

    Raises
    ------
    FileError
        One line with the file's name, the field and what is allowed.
    """
    kinds: tuple[type[CertificateFile | ProofFile], ...] = (CertificateFile, ProofFile)
    return decode_document(content, name, *kinds)
