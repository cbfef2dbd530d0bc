"""Plans from fractional mixtures: rounding, best responses, and best pairs.

All of it obeys the collision rules. Rounding fixes the most used columns that do not
conflict. A best response is one robot's best path against all others. A best pair (`pairs`)
is that of two robots over the arcs of the restricted master: local search on the restricted
integer master, two robots changed at a time.
"""

from collections.abc import Collection, Sequence
from operator import eq
from typing import NamedTuple

import numpy as np

from cocap_opt.coordination.constraints import avoid_paths
from cocap_opt.data import FloatArray
from cocap_opt.formulations.column_generation.master import Arc, Column, arcs_of, make_column
from cocap_opt.formulations.column_generation.pairs import best_pair
from cocap_opt.graph.move_rewards import bonuses_of
from cocap_opt.model import Model, Path
from cocap_opt.objective import marginal_reward, no_pixels, objective_of, view_sum_weights
from cocap_opt.problem.plan import conflicts
from cocap_opt.stop import Limit, Stop, never

MOST_PARTNERS = 5  # robots with which each is paired
KICKED = 3  # robots that are planned anew at a time
PROMISING = 0.01  # relative loss up to which a local optimum is worth best pairs
LEAST_GAIN = 1e-12  # relative, so that rounding is no gain


class Incumbent(NamedTuple):
    """A plan that obeys all rules, as one column per robot."""

    value: float  # J
    columns: tuple[Column, ...]  # robot by robot

    @property
    def paths(self) -> tuple[Path, ...]:
        """Paths of all robots."""
        return tuple(column.path for column in self.columns)


def incumbent_of(model: Model, columns: Sequence[Column]) -> Incumbent | None:
    """The plan made of one column per robot; None if it breaks a rule."""
    paths = [column.path for column in columns]
    if next(conflicts(model.problem, model.plan(paths)), None) is not None:
        return None
    return Incumbent(objective_of(model, paths), tuple(columns))


def incumbent_along(model: Model, paths: Sequence[Path]) -> Incumbent | None:
    """The plan of one path per robot; None if it breaks a rule."""
    return incumbent_of(model, [make_column(model, i, path) for i, path in enumerate(paths)])


def improved(
    model: Model,
    columns: Sequence[Column],
    mixture: FloatArray,
    arcs: Collection[Arc],
    stop: Stop = never,
) -> Incumbent | None:
    """The best plan found from a mixture of columns; None if none was found."""
    chosen = _rounded(model, columns, mixture, stop)
    if chosen is None:
        return None
    return polished(model, respond(model, chosen, stop), arcs, stop)


def polished(
    model: Model, best: Incumbent | None, arcs: Collection[Arc], stop: Stop = never
) -> Incumbent | None:
    """Best pairs, each followed by best responses, until no pair gains."""
    if best is None:
        return None
    value = -np.inf
    while best.value > value * (1 + LEAST_GAIN) if np.isfinite(value) else True:
        value = best.value
        for pair in _pairs(model, best):
            if stop() is not Limit.NONE:
                return best
            better = _with_best_pair(model, best, pair, arcs)
            if better is not None and better.value > best.value * (1 + LEAST_GAIN):
                best = respond(model, better.columns, stop) or better
    return best


def kicked(
    model: Model,
    plan: Incumbent,
    arcs: Collection[Arc],
    rng: np.random.Generator,
    stop: Stop = never,
) -> Incumbent | None:
    """What becomes of a plan when a few of its robots are planned anew, one after the other.

    Iterated local search: best responses lead to another local optimum, best pairs on from it
    if it is nearly as good. None where the robots leave one another no way.
    """
    robots = len(plan.columns)
    if robots < 2:
        return None
    anew = rng.permutation(robots)[: min(KICKED, robots - 1)].tolist()
    columns = [column for column in plan.columns if column.robot not in anew]
    for robot in anew:
        answer = best_response(model, robot, columns)
        if answer is None:
            return None
        columns.append(answer)
    best = respond(model, sorted(columns, key=lambda column: column.robot), stop)
    if best is None or best.value < plan.value * (1 - PROMISING):
        return best
    return polished(model, best, arcs, stop)


def _pairs(model: Model, plan: Incumbent) -> list[tuple[int, int]]:
    """Pairs of robots, those whose views overlap most first; a few for each robot."""
    roots = np.zeros((len(plan.columns), len(view_sum_weights(model.problem))))
    for row, column in zip(roots, plan.columns, strict=True):
        row[column.view_sums] = np.sqrt(column.pixels)
    pairs = []
    for i in range(len(roots)):
        shared = np.minimum(roots, roots[i]).sum(axis=1)
        shared[i] = -1.0
        for k in np.argsort(-shared, kind="stable")[:MOST_PARTNERS].tolist():
            if k != i:
                pairs.append((float(shared[k]), min(i, k), max(i, k)))
    return [(i, k) for _, i, k in sorted(set(pairs), key=lambda p: (-p[0], p[1:]))]


def _with_best_pair(
    model: Model, plan: Incumbent, pair: tuple[int, int], arcs: Collection[Arc]
) -> Incumbent | None:
    """The plan with the best paths of two robots over some arcs and their own."""
    others = [column for column in plan.columns if column.robot not in pair]
    own = [arc for robot in pair for arc in arcs_of(plan.columns[robot].flight)]
    found = best_pair(model, pair, {*arcs, *own}, others)
    if found is None:
        return None
    changed = [*plan.columns]
    for column in found:
        changed[column.robot] = column
    return incumbent_of(model, changed)


def _rounded(
    model: Model, columns: Sequence[Column], mixture: FloatArray, stop: Stop
) -> list[Column] | None:
    """One column per robot without conflicts: the most used first, then best responses."""
    chosen: dict[int, Column] = {}
    for n in np.argsort(-mixture, kind="stable").tolist():
        column = columns[n]
        if mixture[n] < 1e-6 or len(chosen) == len(model.problem.robots):
            break
        if column.robot not in chosen and not any(
            in_conflict(model, column, other) for other in chosen.values()
        ):
            chosen[column.robot] = column
    for robot in range(len(model.problem.robots)):
        if robot not in chosen:
            late = stop() is not Limit.NONE
            answer = None if late else best_response(model, robot, list(chosen.values()))
            if answer is None:
                return None
            chosen[robot] = answer
    return [chosen[robot] for robot in range(len(model.problem.robots))]


def in_conflict(model: Model, a: Column, b: Column) -> bool:
    """Whether the collision rules keep two paths apart."""
    problem = model.problem
    if problem.rules.none:
        return False
    p, q = a.flight.cells, b.flight.cells
    if problem.rules.separation:
        if any(problem.too_close(c, d) for c, d in zip(p, q, strict=True)):
            return True
    elif any(map(eq, p, q)):
        return True
    return problem.rules.swap and any(
        p[t] == q[t + 1] and p[t + 1] == q[t] and p[t] != p[t + 1] for t in range(len(p) - 1)
    )


def best_response(model: Model, robot: int, others: Sequence[Column]) -> Column | None:
    """A robot's best path against other robots' columns; None where they leave it none."""
    problem, robot_class = model.problem, model.class_of[robot]
    pixels = no_pixels(problem)
    for column in others:
        pixels[column.view_sums] += column.pixels
    states = [(c.robot, [model.class_of[c.robot].graph.state(s) for s in c.path]) for c in others]
    charges = avoid_paths(model, robot_class, states)
    bonuses = bonuses_of(problem.objective)
    reward = marginal_reward(model, robot_class, pixels)
    value = robot_class.graph.backward_sweep(reward, bonuses, charges, robot_class.goal)
    path = robot_class.graph.best_path(value, model.start(robot), bonuses, charges)
    return None if path is None else make_column(model, robot, tuple(path))


def respond(model: Model, columns: Sequence[Column], stop: Stop = never) -> Incumbent | None:
    """Best responses of one robot after the other until none gains."""
    best = incumbent_of(model, columns)
    quiet = 0  # robots in a row that could gain nothing
    robot = 0
    while best is not None and quiet < len(best.columns) and stop() is Limit.NONE:
        others = [column for column in best.columns if column.robot != robot]
        answer = best_response(model, robot, others)
        if answer is not None and answer.key != best.columns[robot].key:
            changed = [*best.columns]
            changed[robot] = answer
            better = incumbent_of(model, changed)
            if better is not None and better.value > best.value * (1 + LEAST_GAIN):
                best, quiet = better, 0
        quiet += 1
        robot = (robot + 1) % len(best.columns)
    return best
