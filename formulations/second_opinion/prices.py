"""The sums of a certificate, in plain loops over what drones reach and see."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache

from cocap_opt.formulations.certificates import (
    ClassCurve,
    Decision,
    EnvelopeCut,
    Multipliers,
    ReferencePixels,
)
from cocap_opt.formulations.certificates.format import Certificate
from cocap_opt.formulations.second_opinion.paths import Worth, longest_path
from cocap_opt.formulations.second_opinion.sight import seen_by_robots
from cocap_opt.formulations.second_opinion.uses import uses_of
from cocap_opt.graph.networks import reached_graph
from cocap_opt.problem import Problem

MOST_CORNERS = 50_000  # of a cut, that are gone through in plain loops


class TooLargeError(ValueError):
    """The graphs are larger than networkx can price in minutes; the message says how large."""


def _classes(problem: Problem, single: bool) -> list[int]:
    """Returns the number of each robot's class [R]: alike but for the start, or one each."""
    kinds: dict[object, int] = {}
    for i, robot in enumerate(problem.robots):
        kinds.setdefault(i if single else (robot.motion, robot.camera, robot.goal), len(kinds))
    return [
        kinds[i if single else (robot.motion, robot.camera, robot.goal)]
        for i, robot in enumerate(problem.robots)
    ]


def class_sizes(problem: Problem, single: bool) -> dict[int, int]:
    """Returns the number of robots of each class."""
    numbers = _classes(problem, single)
    return {number: numbers.count(number) for number in numbers}


class Prices:
    """The prices of a problem's nodes and moves under certificates."""

    def __init__(self, problem: Problem, single: bool) -> None:
        self._problem = problem
        self._classes = _classes(problem, single)
        self._sizes = class_sizes(problem, single)
        self._graphs = [reached_graph(problem, i) for i in range(len(problem.robots))]
        self._seen = seen_by_robots(problem, self._graphs)
        self._visible = {
            (self._row(t), face)
            for seen in self._seen for (_, t), faces in seen.items() for face, _ in faces
        }  # fmt: skip

    def of(self, certificate: Certificate, decisions: Sequence[Decision]) -> Worth:
        """Returns the bound on plans that obey the decisions."""
        if isinstance(certificate, Multipliers):
            terms = list(self._constants(certificate, decisions))
        else:
            terms = list(self._constants_at_reference(certificate))
        total, magnitude = math.fsum(terms), math.fsum(map(abs, terms))
        for robot, number in enumerate(self._classes):
            pay = self._payment(certificate, number)
            paid = {
                (state, t): math.fsum(
                    self._weight(t, face) * pay(self._row(t), face, pixels)
                    for face, pixels in faces
                )
                for (state, t), faces in self._seen[robot].items()
            }
            uses = uses_of(certificate, decisions, number)
            best = longest_path(self._problem, robot, self._graphs[robot], paid, uses)
            total, magnitude = total + best.value, magnitude + best.magnitude
        return Worth(total, magnitude)

    def _row(self, t: int) -> int:
        """Returns the row of a table in which the pixels of step t count."""
        return 0 if self._problem.objective.over_time else t

    def _weight(self, t: int, face: int) -> float:
        """Returns the weight of a face at a step, 0 where the step does not count."""
        if self._problem.objective.over_time:
            return float(self._problem.step_weights[0, face])
        return float(self._problem.step_weights[t, face]) * (t >= self._problem.first_step)

    def _constants(
        self, certificate: Multipliers, decisions: Sequence[Decision]
    ) -> Iterator[float]:
        """Yields what multipliers cost whatever is flown: kappa, cuts, rows and decisions."""
        shares: dict[tuple[int, int], list[float]] = {}
        for cut in certificate.cuts:
            shares.setdefault((cut.t, cut.face), []).append(cut.share)
            most = _highest_corner(cut.curves, tuple(self._sizes.items()))
            yield self._weight(cut.t, cut.face) * cut.share * most
        for row, face in self._visible:
            alpha, beta = certificate.alpha[row][face], certificate.beta[row][face]
            rest = 1 - math.fsum(shares.get((row, face), []))
            if self._weight(row, face) > 0 and alpha < rest:
                yield self._weight(row, face) * (rest - alpha) ** 2 / (4 * beta)
        for mu in certificate.rows:
            yield mu.multiplier
        for decision, nu in zip(decisions, certificate.decisions, strict=True):
            if not decision.closes:
                yield decision.sign * nu * decision.robots

    def _constants_at_reference(self, certificate: ReferencePixels) -> Iterator[float]:
        """Yields the roots of the reference pixels."""
        for row, faces in enumerate(certificate.pixels):
            for face, pixels in enumerate(faces):
                yield self._weight(row, face) * math.sqrt(pixels)

    def _payment(self, certificate: Certificate, number: int) -> Callable[[int, int, float], float]:
        """Returns what a class is paid for pixels of a face in a row, before weights."""
        if isinstance(certificate, ReferencePixels):
            reference = certificate.pixels
            return lambda row, face, pixels: (
                pixels
                / (math.sqrt(reference[row][face] + pixels) + math.sqrt(reference[row][face]))
            )
        cuts: dict[tuple[int, int], list[EnvelopeCut]] = {}
        for cut in certificate.cuts:
            cuts.setdefault((cut.t, cut.face), []).append(cut)

        def pay(row: int, face: int, pixels: float) -> float:
            root = math.sqrt(pixels)
            paid = certificate.alpha[row][face] * root + certificate.beta[row][face] * pixels
            return paid + math.fsum(
                cut.share * _phi(cut.curves, number, root) for cut in cuts.get((row, face), ())
            )

        return pay


def _phi(curves: Sequence[ClassCurve], number: int, root: float) -> float:
    """Returns phi of a class at a root: linear between breakpoints, slope 1 beyond the last."""
    for curve in curves:
        if curve.class_number == number:
            before, height = 0.0, 0.0
            for at, value in zip(curve.roots, curve.values, strict=True):
                if root <= at:
                    return height + (value - height) * (root - before) / (at - before)
                before, height = at, value
            return height + root - before
    return root


@lru_cache(maxsize=4096)  # the leaves of a proof share most of their cuts
def _highest_corner(curves: tuple[ClassCurve, ...], sizes: tuple[tuple[int, int], ...]) -> float:
    """Returns the least constant of a cut: its largest excess at a corner, or 0.

    A corner has every robot of the curves' classes at a breakpoint, or at 0: robot by robot, those
    are kept that no other betters in both pixels and value.
    """
    corners = [(0.0, 0.0)]
    for curve in curves:
        points = [(0.0, 0.0), *zip((r * r for r in curve.roots), curve.values, strict=True)]
        for _ in range(dict(sizes)[curve.class_number]):
            corners = _unbettered((p + q, v + w) for p, v in corners for q, w in points)
            if len(corners) > MOST_CORNERS:
                raise TooLargeError(
                    f"a cut has more than {MOST_CORNERS:,} corners, which is too many for plain "
                    "loops"
                )
    return max(0.0, max(math.sqrt(pixels) - value for pixels, value in corners))


def _unbettered(corners: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Returns the corners (pixels, value) of which no other has more pixels for less value."""
    kept: list[tuple[float, float]] = []
    for pixels, value in sorted(set(corners), key=lambda corner: (-corner[0], corner[1])):
        if not kept or value < kept[-1][1]:
            kept.append((pixels, value))
    return kept
