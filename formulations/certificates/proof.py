"""The bound that a proof proves: the largest bound of its leaves.

A branch says of some resource: at most k robots use it, or at least k + 1 do. Any plan goes one
of the two ways, so that the leaves below cover all plans. A leaf's multipliers bound the plans
that obey the decisions on the way to it.
"""

import math
from collections.abc import Callable

from cocap_opt.formulations.certificates.format import Branch, CertificateError, Leaf, ProofFile
from cocap_opt.formulations.certificates.pricing import Pricing, price
from cocap_opt.model import Model


def price_proof(
    model: Model, proof: ProofFile, progress: Callable[[int, int], None] = lambda done, total: None
) -> Pricing:
    """Returns the upper bound on J that a proof proves.

    Parameters
    ----------
    progress : told how many leaves are done, and of how many

    Raises
    ------
    CertificateError
        If the nodes are no tree, a resource does not exist, or a leaf is not valid.
    """
    _check_branches(model, proof)
    worst = Pricing(-math.inf, 0.0)
    total = sum(isinstance(node, Leaf) for node in proof.nodes)
    for done, (n, leaf, decisions) in enumerate(proof.leaves()):
        try:
            pricing = price(model, leaf.certificate, decisions)
        except CertificateError as error:
            raise CertificateError(f"nodes[{n}].{error}") from error
        if not pricing.bound <= worst.bound:
            worst = pricing
        progress(done + 1, total)
    return worst


def _check_branches(model: Model, proof: ProofFile) -> None:
    """Refuses branches on what does not exist."""
    for n, node in enumerate(proof.nodes):
        if isinstance(node, Branch):
            if wrong := node.resource.why_absent(model):
                raise CertificateError(f"nodes[{n}].resource.{wrong}")
            most = len(model.problem.robots)
            if not 0 <= node.robots <= most:
                raise CertificateError(f"nodes[{n}].robots: must be 0..{most}")
