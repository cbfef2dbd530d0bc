"""The player's data of a plan: views and rewards of drones, close approaches, and the gap.

Coverage comes from the model's tables, from which the referee's rewards can be computed (tests
compare both). Steps that do not count have a reward of 0.
"""

import math
from collections.abc import Container, Iterator
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.flight.trajectory import Trajectory, in_steps
from cocap_opt.formulations.explanation import Explanation
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.model import compiled
from cocap_opt.output.conflicts import told_conflict
from cocap_opt.player.player_approaches import Approaches
from cocap_opt.player.player_flight import knots, smooth_flight
from cocap_opt.player.player_scene import PlayerScene
from cocap_opt.player.player_tasks import tasks
from cocap_opt.problem import Conflict, Plan, Problem, Robot, State, VertexConflict
from cocap_opt.referee import check

_DIGITS = 5  # digits of px/m2 and shares as they are shown; rewards have all digits
_COSTLIEST = 5  # number of moves that are marked
_LEAST = 5e-6  # share of the bound, the smallest loss that is shown

Data = dict[str, Any]


class PlayerPlan:
    """A plan of a scene, as JSON values.

    Parameters
    ----------
    judged : the problem whose rules apply
    gap : the terms of its gap; None if unknown
    absent : numbers of the drones that are not shown, as their starts are still to be chosen; they
        have no path and see nothing
    """

    def __init__(
        self,
        scene: PlayerScene,
        judged: Problem,
        plan: Plan,
        gap: Explanation | None,
        absent: Container[int] = (),
    ) -> None:
        self._scene, self._problem, self._judged = scene, scene.problem, judged
        self._plan, self._gap = plan, gap
        self._there = [i for i in range(len(plan.paths)) if i not in absent]

    @cached_property
    def _own_coverage(self) -> FloatArray:
        """The coverage [R, T+1, W] of faces, then of people whom drones count, by each drone."""
        problem = self._problem
        found = np.zeros((len(problem.robots), problem.horizon + 1, problem.step_width))
        if not self._there:
            return found
        model = compiled(problem)
        paths = model.paths(self._plan)
        for i in self._there:
            found[i] = model.views(model.class_of[i]).along(0, np.array(paths[i]))
        return found

    @property
    def own_pixels(self) -> FloatArray:
        """The coverage [R, T+1, F] (px/m2; 1/m2 for cones) that each drone has."""
        return self._own_coverage[..., : len(self._problem.face_weights)]

    @cached_property
    def seen(self) -> FloatArray:
        """The coverage [T+1, F] (px/m2) that all drones together have."""
        total: FloatArray = self.own_pixels.sum(axis=0)
        return total

    def data(self) -> Data:
        """Returns all data that the player has of the plan; steps t, drones i, faces f.

        `rewards[t]` is the referee's view reward of a step, `seen[t][f]` the coverage of each face
        (px/m2) by all drones together, `meanPixels` its mean over faces and the steps that count,
        and `ownPixels[i][t]` the mean coverage of a face by one drone. `films[i][t]` is the person
        of whom a drone has most pixels, None if it sees nobody. `adds[i][t]` is the part of a
        step's reward that would be lost without a drone, empty if pixels add up over time.
        `tasks[i]` is the group of people (of the scene) of whom it has most pixels over all steps.
        `heights[i]` are flight heights (m), one if it is the same at all steps. `near` are moments
        at which two drones nearly touch, or a drone comes near a person without a rule, `closest`
        is the closest approach of two drones, and `besidePeople` says where one comes too close to
        a person. `knots` are those of the smooth flight (`player_flight`), None if drones fly
        straight.
        """
        reward, moves, rewards, is_valid = self._rewards()
        flown = self._flown()
        straight = Trajectory.straight(in_steps(self._problem), self._plan)
        approaches = Approaches(self._problem, self._plan, self._there, flown or straight)
        counted = self.seen[self._problem.first_step :]
        return {
            "reward": reward,
            "moves": moves,
            "rewards": rewards,
            "meanPixels": digits(float(_means(counted).mean())),
            "seen": [[digits(value) for value in row] for row in self.seen.tolist()],
            "ownPixels": [
                [digits(value) for value in _means(pixels).tolist()] for pixels in self.own_pixels
            ],
            "films": self._films(),
            "tasks": tasks(self._problem, self.own_pixels, self._scene.groups),
            "adds": [[digits(value) for value in row] for row in self._adds().tolist()],
            "conflicts": [
                self._conflict(conflict) for conflict in self._plan.conflicts(self._problem)
            ],
            "near": approaches.near(),
            "closest": approaches.closest(straight),
            "besidePeople": [*self._beside_people()],
            "knots": None if flown is None else knots(self._scene, flown),
            "gap": None if self._gap is None else _gap(self._problem, self._gap, is_valid),
        } | self._flight()

    def _rewards(self) -> tuple[float, float, list[float], bool]:
        """Returns J, its part for moves, the reward of each step, and True if all rules hold."""
        judged, plan = self._judged, self._plan
        if not self._there:
            return 0.0, 0.0, [0.0] * (judged.horizon + 1), True
        if len(self._there) < len(plan.paths):
            judged = judged.replace(robots=tuple(judged.robots[i] for i in self._there))
            plan = Plan(paths=tuple(plan.paths[i] for i in self._there))
        verdict = check(judged, plan)
        rewards = [verdict.reward_at_start, *verdict.reward_per_step]
        return verdict.reward, verdict.reward_moves, rewards, verdict.valid

    def _beside_people(self) -> Iterator[str]:
        """Yields the place where each drone first comes too close to a person, in words.

        The referee checks plans, so only drones that wait at their starts can be too close.
        """
        for i in self._there:
            at = self._problem.where(self._problem.robots[i], self._plan.paths[i])
            found = [
                near for j in range(len(self._problem.actors)) for near in self._near_to(j, at)
            ]
            if found:
                t, aside, j = min(found)
                yield (
                    f"drone {i} is {aside:.1f} m from {self._problem.person(j)} at step {t:.3g}; "
                    f"rule {self._problem.airspace.people_aside:g} m"
                )

    def _near_to(self, j: int, at: FloatArray) -> Iterator[tuple[float, float, int]]:
        """Yields the times at which a drone at places [T+1, 3] (m) is too close to a person, and
        the distances, less the person's `swerve`.
        """
        actor, airspace = self._problem.actors[j], self._problem.airspace
        ways = at - actor.middles[: len(at)]
        for t in range(len(at) - 1):
            if airspace.near_person(actor, t, at[t], at[t + 1]):
                share = float(airspace.rules_beside(actor).closest(ways[t], ways[t + 1])[0])
                x, y, _ = (1 - share) * ways[t] + share * ways[t + 1]
                yield t + share, actor.nearest(math.hypot(x, y)), j

    def _flown(self) -> Trajectory | None:
        """Returns the smooth flight; None if drones fly straight or stay."""
        paths = self._plan.paths
        stay = len(self._there) < len(paths) or all(len(set(path)) == 1 for path in paths)
        return None if stay else smooth_flight(self._problem, self._plan)

    def _flight(self) -> Data:
        scene, robots = self._scene, self._problem.robots
        flown = [path if i in self._there else () for i, path in enumerate(self._plan.paths)]
        return {
            "paths": [
                scene.rounded(scene.path(robot, path)) if path else []
                for robot, path in zip(robots, flown, strict=True)
            ],
            "heights": [_heights(robot, path) for robot, path in zip(robots, flown, strict=True)],
        }

    def _films(self) -> list[list[int | None]]:
        """Returns the person whom each drone sees best at each step; None if it sees nobody."""
        problem = self._problem
        if not problem.actors:
            return [[None] * (problem.horizon + 1) for _ in problem.robots]
        is_of = problem.face_owner[:, None] == np.arange(len(problem.actors))
        seen = self.own_pixels @ is_of.astype(np.float64)
        best, most = seen.argmax(axis=2).tolist(), seen.max(axis=2).tolist()
        return [
            [j if pixels > 0 else None for j, pixels in zip(people, row, strict=True)]
            for people, row in zip(best, most, strict=True)
        ]

    def _adds(self) -> FloatArray:
        """Returns the part of each step's reward [R, T+1] that would be lost without each drone."""
        problem = self._problem
        if problem.objective.over_time:
            return np.empty((0, 0))
        others = np.maximum(self.seen - self.own_pixels, 0.0)
        roots = np.sqrt(self.seen) - np.sqrt(others)
        adds: FloatArray = (problem.step_weights * roots).sum(axis=2)
        if problem.objective.views is not None:
            cameras = problem.objective.views.cameras
            counts = self._own_coverage[..., len(problem.face_weights) :]
            total = counts.sum(axis=0)
            lost = np.minimum(total, cameras) - np.minimum(total - counts, cameras)
            adds += (problem.count_weights * lost).sum(axis=2)
        adds[:, : problem.first_step] = 0.0
        return adds

    def _conflict(self, conflict: Conflict) -> Data:
        return {
            "step": conflict.t,
            "robots": list(conflict.robots),
            "between": not isinstance(conflict, VertexConflict),
            "words": told_conflict(self._problem, conflict),
        }


def _heights(robot: Robot, path: tuple[State, ...]) -> list[float]:
    """Returns the flight heights (m) of a path, one if it is the same at all steps."""
    heights = [digits(robot.motion.layers[state.layer]) for state in path]
    return heights if len(set(heights)) > 1 else heights[:1]


def digits(value: float) -> float:
    """Returns a number rounded to the digits that the player shows."""
    short = float(f"{value:.{_DIGITS}g}")
    return int(short) if short.is_integer() else short


def _means(seen: FloatArray) -> FloatArray:
    """Returns the mean [n] over faces of coverage [n, F]; 0 if there are no people."""
    means: FloatArray = seen.sum(axis=1) / max(seen.shape[1], 1)
    return means


def _gap(problem: Problem, gap: Explanation, obeys: bool) -> Data:
    """Returns a bound, and the terms of the gap to it, as shares of the bound.

    Only a plan that obeys the rules can be optimal; J of others may exceed the bound.
    `losses[i][t]` is the loss of drone i by its move after step t; the largest are in `costliest`.
    `faces[t][f]` is the overestimate of a face. For an optimum, all terms are 0, as terms that
    cancel are not shown.
    """
    optimal = obeys and gap.share(gap.gap) <= OPTIMALITY
    if optimal:
        gap = replace(gap, terms=tuple(term._replace(amount=0.0) for term in gap.terms))
    first = np.searchsorted(problem.face_owner, np.arange(len(problem.actors)))
    faces = np.zeros((problem.view_sum_steps, len(problem.face_weights)))
    for term in gap.of_kind("face"):
        assert term.actor is not None
        assert term.face is not None
        faces[term.step or 0, first[term.actor] + term.face] += gap.share(term.amount)
    return {
        "bound": gap.bound,
        "total": gap.share(gap.gap),
        "optimal": optimal,
        "costliest": _costliest(gap),
        "losses": [[digits(gap.share(x)) for x in row] for row in gap.losses().tolist()],
        "faces": [[digits(value) for value in row] for row in faces.tolist()],
        "rules": gap.share(gap.total("row", "decision")),
        "rest": gap.share(gap.total("views", "leaves", "stages", "claim", "rounding")),
    }


def _costliest(gap: Explanation) -> list[Data]:
    """Returns the moves with the largest losses, sorted by step."""
    moves = sorted(gap.of_kind("path"), key=lambda term: -term.amount)[:_COSTLIEST]
    costly = [move for move in moves if gap.share(move.amount) >= _LEAST]
    return [
        {"step": move.step, "robot": move.robot, "share": digits(gap.share(move.amount))}
        for move in sorted(costly, key=lambda term: term.step or 0)
    ]
