"""The second opinion on a file, and what is too large for one."""

import math
from collections.abc import Callable
from typing import NamedTuple

from cocap_opt.formulations.certificates import Branch, CertificateFile, Pricing, ProofFile, Staged
from cocap_opt.formulations.second_opinion.prices import Leaf, Prices, TooLargeError
from cocap_opt.graph.networks import edges_in_reach
from cocap_opt.problem import Problem

TOLERANCE = 1e-9  # of the absolute values that a bound is made of, by which two opinions may part
MOST_EDGES = 2_000_000  # of one drone's graph: a gigabyte
MOST_WORK = 40_000_000  # edges of all drones at all leaves: some minutes


class SecondOpinion(NamedTuple):
    """The bound that a certificate or a proof proves, by networkx."""

    bound: float
    magnitude: float  # sum of the absolute values that it is made of

    @classmethod
    def of(
        cls,
        problem: Problem,
        file: CertificateFile | ProofFile,
        progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> "SecondOpinion":
        """Returns the bound of a certificate, or the largest of all leaves of a proof.

        Parameters
        ----------
        file : valid, as `certificates.verify` finds it
        progress : told how many best paths are found, and of how many

        Raises
        ------
        TooLargeError
            If that would take longer than some minutes, or more than a gigabyte for a drone.
        """
        require_small(problem, file)
        leaves: list[Leaf]
        if isinstance(file, ProofFile):
            leaves = [(leaf.certificate, decisions) for _, leaf, decisions in file.leaves()]
        else:
            assert not isinstance(file.certificate, Staged)
            leaves = [(file.certificate, ())]
        return cls(*max(Prices(problem, file.classes == "single").of(leaves, progress)))

    def agrees(self, pricing: Pricing) -> bool:
        """Returns True if the sweep finds the same bound.

        They may part by 1e-9 of the absolute values that the bound is made of, and by what the
        sweep has added for rounding.
        """
        if math.inf in (abs(self.bound), abs(pricing.bound)):
            return self.bound == pricing.bound
        rounding = math.nextafter(pricing.rounding, math.inf) * (1 + TOLERANCE)  # even that of 0
        return abs(self.bound - pricing.bound) <= TOLERANCE * self.magnitude + rounding


def require_small(problem: Problem, file: CertificateFile | ProofFile) -> None:
    """Raises TooLargeError if pricing a file would take too long, by an estimate.

    It is also raised for a staged certificate, whose joint states networkx knows nothing of.
    """
    if isinstance(file, CertificateFile) and isinstance(file.certificate, Staged):
        raise TooLargeError(
            "the certificate narrows joint states down in stages, which networkx cannot price; "
            "on scenes of a few steps `bound` with --method envelope gives one of multipliers alone"
        )
    known: dict[tuple[object, ...], int] = {}
    edges = 0
    for i, robot in enumerate(problem.robots):
        alike = robot.motion, len(robot.camera.tilts), robot.start
        if alike not in known:
            known[alike] = edges_in_reach(problem, i, MOST_EDGES)
        if known[alike] > MOST_EDGES:
            raise TooLargeError(
                f"the graph of robots[{i}] has more than {MOST_EDGES:,} edges, which is too large "
                "for networkx"
            )
        edges += known[alike]
    leaves = 1
    if isinstance(file, ProofFile):
        leaves = sum(not isinstance(node, Branch) for node in file.nodes)
    if edges * leaves > MOST_WORK:
        raise TooLargeError(
            f"networkx would price {edges:,} edges at {leaves:,} "
            f"{'leaf' if leaves == 1 else 'leaves'}; at most {MOST_WORK:,} in all are allowed"
        )
