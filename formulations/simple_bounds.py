"""Computes bounds with single-robot sweeps only.

Source of the online bound: Minoux 1978; Leskovec et al. 2007 (for a budget); here the maximum is
over one path per robot.

The early bound is available after any limit, even if coverage is incomplete. At steps with unknown
coverage, drones see people as if nothing hid them, which gives an upper bound on the pixels
(`vision.ceilings`). On the true coverage, the same multipliers prove a bound that is no higher than
the claimed one. All faces of a step share one multiplier, of one of two kinds (see the inequality
in `certificates.pricing`): each drone as if it were alone, alpha = 1; or a tangent of the root at z
pixels, alpha = 0 and beta = 1 / (2 sqrt z). Here z is a share of the pixels that all drones would
have of a face at the step if each had the most that any of them can have. If the drones that see
people are counted, each drone gets full credit, gamma = 1, or, if that share of all drones is more
than the number that counts, none, gamma = 0.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from msgspec import UNSET

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.certificates import (
    CertificateFile,
    Multipliers,
    ReferencePixels,
)
from cocap_opt.formulations.certificates.format import OPTIMISTIC, tables_of
from cocap_opt.formulations.certificates.sweep import reward_of_staying
from cocap_opt.formulations.result import (
    CertifiedResult,
    Report,
    certify,
    checked_start,
    silent,
)
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.value_iteration import backward_sweep
from cocap_opt.model import Model, compiled
from cocap_opt.problem import COVERAGE_VERSION, Plan, Problem
from cocap_opt.result import Reason
from cocap_opt.stop import Limit, LimitReached, Stop, never
from cocap_opt.timing import timed
from cocap_opt.vision.ceilings import ceiling

__all__ = ["alone", "early_bound", "online"]

METHOD = "step-multipliers"
# relative; much larger than the rounding errors here and in a certificate's pricing
_ROUNDING = 1e-9
_MANY = 10_000_000  # states over all steps; above this, only one bound is computed
_TOO_MANY = 30_000_000  # above this, no bound is computed: each value iteration would take seconds
_AT_ONCE = 100_000  # states whose ceilings are computed together
_STEP_DOWN = 0.4  # factor from one share of the visible pixels to the next


def early_bound(problem: Problem, limit: Limit) -> CertifiedResult:
    """Returns the result of a method that a limit has stopped before it had computed a bound.

    This takes up to a few seconds, for which `Model.prepare` reserves time.
    """
    model = compiled(problem)
    prices = _StepMultipliers(model)
    best = prices.quick_file() if prices.are_dear else prices.best_file()
    if best.proved == math.inf:
        return CertifiedResult(None, -math.inf, Reason.STOPPED, limit)
    if best.proved < 0:  # a drone has no path
        return CertifiedResult.bounded(best, {})
    steps = problem.horizon + 1
    words = f"coverage computed for only {model.covered_steps} of {steps} steps; "
    words += "for the other steps, the bound assumes that nothing hides anybody"
    return CertifiedResult(
        None, -math.inf, Reason.STOPPED, limit, best.proved, certificate=best,
        message=words if model.covered_steps < steps else "",
    )  # fmt: skip


# The largest amounts that the states of a robot class see, weighted and added up over the faces:
# roots w px^0.5/m and pixels w px/m2 [T+1, S]; and over the people who count. If there are too many
# states for value iteration, S is 1, and the entry is the largest amount of any state.
_Sums = tuple[FloatArray, FloatArray, FloatArray]


class _Steps(NamedTuple):
    """The multipliers of all steps."""

    alpha: FloatArray  # one number for all faces of each step [T+1], or of all steps together [1]
    beta: FloatArray  # as for alpha
    gamma: FloatArray  # [T+1] for all people who count


class _StepMultipliers:
    """Bounds by multipliers, on coverage where it is known and on ceilings elsewhere."""

    def __init__(self, model: Model) -> None:
        problem, self._model = model.problem, model
        visible = np.zeros(len(problem.view_sum_weights), dtype=bool)
        collect = _most if _states(model) > _TOO_MANY else _sums
        self._sums = [collect(model, k, visible) for k in range(len(model.classes))]
        self._digest = problem_digest(problem)
        weights, n = np.where(visible, problem.view_sum_weights, 0.0), problem.returns.n_roots
        self._weights = weights[:n].reshape(problem.view_sum_steps, -1).sum(axis=1)
        people = (weights[n:] * problem.returns.caps).reshape(problem.count_weights.shape)
        self._counts = people.sum(axis=1)  # [T+1] the most that counted people contribute

    def alone(self) -> _Steps:
        """Returns the multipliers that price each drone as if it were alone."""
        steps = self._model.problem.view_sum_steps
        return _Steps(np.ones(steps), np.zeros(steps), np.ones(self._model.problem.horizon + 1))

    def tangents(self) -> Iterator[_Steps]:
        """Yields tangents at fewer and fewer pixels."""
        most = np.max([pixels.max(axis=1) for _, pixels, _ in self._sums], axis=0)  # [T+1]
        problem = self._model.problem
        if problem.objective.over_time:
            most = most.sum(keepdims=True)
        seen = (most > 0) & (self._weights > 0)
        full = len(problem.robots) * most[seen] / self._weights[seen]
        share, cameras = 1.0, self._cameras
        while (seen.any() or cameras) and share > 1 / (4 * len(problem.robots)):
            steps = self.alone()
            steps.alpha[seen], steps.beta[seen] = 0.0, 1 / (2 * np.sqrt(share * full))
            if cameras and share * len(problem.robots) > cameras:
                steps.gamma[:] = 0.0
            yield steps
            share *= _STEP_DOWN

    @property
    def _cameras(self) -> int:
        """Largest number of drones that count for a person; 0 if drones are not counted."""
        views = self._model.problem.objective.views
        return 0 if views is None else views.cameras

    @property
    def are_dear(self) -> bool:
        """True if value iteration has so many states that a single bound takes long."""
        return _states(self._model) > _MANY

    def quick_file(self) -> CertificateFile:
        """Returns the certificate of the multipliers that would be best if drones could jump
        anywhere.

        If value iteration would take too long, the certificate claims only the bound for such
        drones.
        """
        best = min((self.alone(), *self.tangents()), key=self.without_motion)
        if _states(self._model) <= _TOO_MANY:
            return self.file(best)
        return self.file(best, _rounded_up(self.without_motion(best)))

    def best_file(self) -> CertificateFile:
        """Returns the certificate of the best multipliers that were tried."""
        best, lowest = self.file(self.alone()), math.inf
        for tangents in self.tangents():
            file = self.file(tangents)
            best = min(best, file, key=lambda candidate: candidate.proved)
            if not file.proved < lowest:
                break
            lowest = file.proved
        return best

    def without_motion(self, steps: _Steps) -> float:
        """Returns the bound that multipliers prove if drones can be anywhere at any step.

        Each move earns the largest reward that any move has.
        """
        problem = self._model.problem
        moves = len(problem.robots) * problem.horizon
        total = self._constants(steps) + moves * reward_of_staying(problem.objective)
        for robot_class, sums in zip(self._model.classes, self._sums, strict=True):
            each = (np.broadcast_to(x, len(sums[0])) for x in steps)
            total += len(robot_class.robots) * sum(
                float(_paid(*row).max()) for row in zip(*sums, *each, strict=True)
            )
        return total

    def _constants(self, steps: _Steps) -> float:
        """Returns the part of the bound that does not depend on the drones."""
        alpha, beta, gamma = steps
        tangent = beta > 0
        constants = (1 - alpha[tangent]) ** 2 / (4 * beta[tangent])
        total = float(self._weights[tangent] @ constants)
        return total + float(self._counts @ (1 - gamma)) if self._cameras else total

    def file(self, steps: _Steps, bound: float | None = None) -> CertificateFile:
        """Returns the certificate of multipliers, which claims the bound that they prove.

        Parameters
        ----------
        bound : a known bound that is not lower than the proved one; None: compute the bound
        """
        problem, faces = self._model.problem, self._model.n_faces
        people = int(problem.count_weights.shape[1])
        alpha, beta, gamma = (
            tuple((x,) * n for x in values.tolist())
            for n, values in zip((faces, faces, people), steps, strict=True)
        )
        bound = self._bound(steps) if bound is None else bound
        return CertificateFile(
            scene=problem.name,
            digest=self._digest,
            coverage_version=COVERAGE_VERSION,
            method=METHOD,
            coverage=OPTIMISTIC if self._model.covered_steps <= problem.horizon else UNSET,
            bound=None if bound == -math.inf else bound,
            certificate=Multipliers(alpha=alpha, beta=beta, views=gamma if people else ()),
        )

    def _bound(self, steps: _Steps) -> float:
        total = self._constants(steps)
        bonuses = Bonuses.of(self._model.problem.objective)
        for robot_class, sums in zip(self._model.classes, self._sums, strict=True):
            reward = robot_class.graph.no_reward(self._model.problem.horizon)
            steps_of = np.broadcast_arrays(reward[:, 0], *steps)[1:]
            # One step at a time, as arrays of all states at all steps are large.
            for gained, *row in zip(reward, *sums, *steps_of, strict=True):
                gained += _paid(*row)
            value = backward_sweep(robot_class.graph, reward, bonuses, goal=robot_class.goal)
            total += sum(float(value[0, starts].max()) for starts in robot_class.starts)
        return total if total == -math.inf else _rounded_up(total)


def _paid(
    roots: FloatArray, pixels: FloatArray, counts: FloatArray,
    alpha: float, beta: float, gamma: float,
) -> FloatArray:  # fmt: skip
    """Returns the credit [S] of the states of a step; amounts with price 0 may be infinite."""
    parts = ((alpha, roots), (beta, pixels), (gamma, counts))
    return np.asarray(sum((price * part for price, part in parts if price), 0.0 * counts))


def _rounded_up(bound: float) -> float:
    """Returns a bound raised by more than its rounding errors."""
    return math.nextafter(bound + _ROUNDING * abs(bound), math.inf)


def _states(model: Model) -> int:
    """Returns the number of states of all robot classes over all steps."""
    return (model.problem.horizon + 1) * sum(c.graph.n_states for c in model.classes)


def _sums(model: Model, number: int, visible: BoolArray) -> _Sums:
    """Returns the sums of a class, and marks the view sums that it can see in `visible` [Z]."""
    graph = model.classes[number].graph
    sums = np.zeros((3, model.problem.horizon + 1, graph.n_states))
    nodes, known = _known(model, number, visible)
    for whole, values in zip(sums, known, strict=True):
        whole.reshape(-1)[nodes] = values
    shape = graph.n_orientations, graph.n_places
    for t, places, *most in _ceilings(model, number, visible):
        for whole, values in zip(sums, most, strict=True):
            whole[t].reshape(shape)[:, places] = values
    return sums[0], sums[1], sums[2]


def _most(model: Model, number: int, visible: BoolArray) -> _Sums:
    """Returns a class's largest sums at each step, and marks the view sums that it can see in
    `visible` [Z].
    """
    sums = np.zeros((3, model.problem.horizon + 1, 1))
    nodes, known = _known(model, number, visible)
    for whole, values in zip(sums, known, strict=True):
        np.maximum.at(whole[:, 0], nodes // model.classes[number].graph.n_states, values)
    for t, _, *most in _ceilings(model, number, visible):
        for whole, values in zip(sums, most, strict=True):
            whole[t] = max(whole[t, 0], values.max())
    return sums[0], sums[1], sums[2]


def _known(model: Model, number: int, visible: BoolArray) -> tuple[IntArray, _Sums]:
    """Returns the nodes [n] of a class with known coverage, and their sums [n]."""
    table, _ = model.coverage_so_far(model.classes[number])
    visible[table.view_sums] = True
    weights = model.problem.view_sum_weights[table.view_sums]
    of_counts = np.zeros(len(weights))
    of_counts[table.counts] = weights[table.counts]
    weights[table.counts] = 0.0
    roots, pixels = (table.row_sums(x * weights) for x in (np.sqrt(table.pixels), table.pixels))
    return table.nodes, (roots, pixels, table.row_sums(of_counts))


def _ceilings(
    model: Model, number: int, visible: BoolArray
) -> Iterator[tuple[int, IntArray, FloatArray, FloatArray, FloatArray]]:
    """Yields the steps with unknown coverage, the places [n] reached at them, and their sums [O,
    n].

    Places are processed in blocks that fit into the processor's cache.
    """
    problem, robot_class = model.problem, model.classes[number]
    graph, weights = robot_class.graph, problem.view_sum_weights
    _, steps = model.coverage_so_far(robot_class)
    views, reachable = model.views(robot_class), model.reachable(robot_class)
    for t in range(max(steps, problem.first_step), problem.horizon + 1):
        reached = reachable[t].reshape(graph.n_orientations, graph.n_places).any(axis=0)
        at, places = problem.view_sums_at(t), np.flatnonzero(reached)
        parts = -(-len(places) * graph.n_orientations // _AT_ONCE)
        for chunk in np.array_split(places, parts) if parts else []:
            most = ceiling(views, t, chunk, weights[at])
            visible[at] |= most.visible
            yield t, chunk, most.roots, most.pixels, most.people


@timed
def alone(
    problem: Problem, stop: Stop = never, start: Plan | None = None, report: Report = silent
) -> CertifiedResult:
    """Computes the sum over drones of the largest J that each could achieve alone."""
    model = compiled(problem)
    try:
        model.prepare_all(stop)
    except LimitReached as reached:
        return early_bound(problem, reached.limit)
    return CertifiedResult.bounded(_at_pixels(model, problem.no_pixels(), "alone"), {})


@timed
def online(
    problem: Problem, stop: Stop = never, start: Plan | None = None, report: Report = silent
) -> CertifiedResult:
    """Computes the online bound of a plan P: J(P) + sum over drones of max_path gain(path | P).

    If the bound `alone` is lower, or if there is no plan, the result is the bound `alone`. (The
    rewards for moves in J(P) are bounded by those of the best paths, so they are not counted
    twice.)
    """
    plan, message = checked_start(problem, start)
    if plan is None:
        message = f"{message or 'no plan to start from'}; the bound is that of method `alone`"
    model = compiled(problem)
    try:
        model.prepare_all(stop)
    except LimitReached as reached:
        early = early_bound(problem, reached.limit)
        words = "; ".join(filter(None, (message, early.message)))
        return replace(early, message=words)
    references = [problem.no_pixels()]
    if plan is not None:
        references.append(_pixels_of(model, plan))
    files = [_at_pixels(model, pixels, "online") for pixels in references]
    best = min(files, key=lambda file: file.proved)
    return replace(CertifiedResult.bounded(best, {}), message=message)


def _pixels_of(model: Model, plan: Plan) -> FloatArray:
    """Returns the pixels of each view sum that all robots of a plan have together [Z]."""
    pixels = model.problem.no_pixels()
    for robot, path in enumerate(model.paths(plan)):
        pixels = pixels + model.robot_pixels(robot, path)
    return pixels


def _at_pixels(model: Model, pixels: FloatArray, method: str) -> CertificateFile:
    """Returns the certificate of the marginal gains at given pixels [Z]."""
    certificate = ReferencePixels(*tables_of(model.problem, pixels))
    return certify(model.problem, model, method, certificate)
