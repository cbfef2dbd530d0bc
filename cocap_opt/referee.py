"""The referee, which checks if a plan is feasible and computes its J.

It trusts no planner, no reward code and no solver: it recomputes both from the problem alone, in
slow, simple loops. The only code that it shares with planners computes coverage and solid matter.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache

import numpy as np

from cocap_opt.data import LARGEST
from cocap_opt.graph.motion import Window
from cocap_opt.problem import (
    CollisionRules,
    GoalArea,
    Motion,
    Objective,
    Plan,
    Problem,
    Robot,
    State,
)
from cocap_opt.problem.rules import TOLERANCE
from cocap_opt.text import in_ranges
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.views import StateViews

_LESS = 1e-9  # m
_SHARE = 1e-9  # relative tolerance of a length, for rounding
_Coverage = list[list[float]]  # [T+1][W] of one robot
_Position = tuple[float, float, float]  # cells and altitude (m), or all in m


@dataclass(frozen=True)
class Verdict:
    """The findings of the referee.

    Attributes
    ----------
    violations : motions that no robot can fly, in words, one line each
    conflicts : collision rules that are broken, in words, one line each
    reward : J
    reward_at_start : view reward at t = 0; 0 if it does not count
    reward_per_step : [T] view reward at t = 1..T, without rewards per move
    reward_moves : rewards per move, such as for staying
    face_reward : [F] view reward of each face over all steps
    count_reward : [A] reward for the drones that see each person, over all steps; () if they do
        not count
    """

    violations: tuple[str, ...]
    conflicts: tuple[str, ...]
    reward: float
    reward_at_start: float
    reward_per_step: tuple[float, ...]
    reward_moves: float
    face_reward: tuple[float, ...]
    count_reward: tuple[float, ...] = ()

    @property
    def valid(self) -> bool:
        """True if the plan can be flown and no rule is broken."""
        return not self.violations and not self.conflicts


@lru_cache(maxsize=16)
def check(problem: Problem, plan: Plan) -> Verdict:
    """Returns the verdict on a plan; its rewards are nan if it cannot be flown.

    The last verdicts are kept, as one plan passes from method to method, with and without rules;
    the rules affect only the conflicts.
    """
    free = problem.without_rules()
    if free is problem:
        return _Referee(problem).verdict(plan)
    verdict = check(free, plan)
    if verdict.violations:
        return verdict
    return replace(verdict, conflicts=tuple(_Referee(problem).conflicts(plan)))


def rewards_of_move(objective: Objective, a: State, b: State) -> Iterator[float]:
    """Yields the rewards of a robot's move from one state to another."""
    if a == b:
        yield objective.stationarity
    if (a.x, a.y, a.layer) == (b.x, b.y, b.layer):
        yield objective.keep_cell
    if a.heading == b.heading:
        yield objective.keep_heading
    if (b.x - a.x) + (b.y - a.y) == 0:
        yield objective.balanced


@dataclass(frozen=True)
class _Referee:
    """The judge of all plans of one problem."""

    problem: Problem

    def verdict(self, plan: Plan) -> Verdict:
        """Returns the verdict on a plan; its rewards are nan if it cannot be flown."""
        violations = self.violations(plan)
        if violations:
            return Verdict(tuple(violations), (), math.nan, math.nan, (), math.nan, ())
        seen = self._seen(plan)
        rewards, counts = self._view_rewards(seen), self._count_rewards(seen)
        per_step = [math.fsum(a + b) for a, b in zip(rewards, counts, strict=True)]
        moves = self._move_rewards(plan)
        return Verdict(
            violations=(),
            conflicts=tuple(self.conflicts(plan)),
            reward=math.fsum([*per_step, moves]),
            reward_at_start=per_step[0],
            reward_per_step=tuple(per_step[1:]),
            reward_moves=moves,
            face_reward=tuple(math.fsum(column) for column in zip(*rewards, strict=True)),
            count_reward=tuple(math.fsum(column) for column in zip(*counts, strict=True)),
        )

    def violations(self, plan: Plan) -> list[str]:
        """Returns the reasons why the plan cannot be flown, in words, robot by robot."""
        if len(plan.paths) != len(self.problem.robots):
            words = f"must be {len(self.problem.robots)}, one for each drone, not {len(plan.paths)}"
            return [f"paths: {words}"]
        found, horizon = [], self.problem.horizon
        for i, (robot, path) in enumerate(zip(self.problem.robots, plan.paths, strict=True)):
            where = f"paths[{i}]"
            if len(path) != horizon + 1:
                words = f"must have {horizon + 1} states, for the steps 0..{horizon}"
                found.append(f"{where}: {words}, not {len(path)}")
                continue
            if not robot.may_start_in(path[0]):
                start = robot.start
                wanted = (
                    f"at {tuple(start)}" if isinstance(start, State) else "in one of its starts"
                )
                found.append(f"{where}: must start {wanted}, not at {tuple(path[0])}")
            faults = [self._misplaced(robot, state) for state in path]
            if any(faults):
                found += [f"{where}: {words}" for words in _by_kind(faults)]
                continue
            for t in range(horizon):
                if fault := self._broken_move(robot, path[t], path[t + 1]):
                    found.append(f"{where}: step {t} to {t + 1} {fault}")
            found += [f"{where}: {words}" for words in self._near_people(robot, path)]
            if not robot.may_end_in(path[-1]):
                goal = robot.goal
                wanted = "in one of its goals" if isinstance(goal, GoalArea) else f"in cell {goal}"
                found.append(
                    f"{where}: must end {wanted}, not in cell ({path[-1].x}, {path[-1].y})"
                )
        return found

    def conflicts(self, plan: Plan) -> list[str]:
        """Returns the collision rules that are broken, in words, step by step."""
        rules, found = self.problem.rules, []
        if rules.none:
            return []
        at = [
            [(state.x, state.y, self._altitude(robot, state)) for state in path]
            for robot, path in zip(self.problem.robots, plan.paths, strict=True)
        ]
        for t in range(self.problem.horizon + 1):
            for i in range(len(plan.paths)):
                for k in range(i + 1, len(plan.paths)):
                    a, b = at[i][t], at[k][t]
                    near = _too_near(self._way(a, b), rules)
                    if rules.vertex and a == b:
                        found.append(f"step {t}: drones {i} and {k} are in one cell")
                    elif rules.vertex and near:
                        found.append(f"step {t}: drones {i} and {k} are {near}")
                    if t == self.problem.horizon:
                        continue
                    c, d = at[i][t + 1], at[k][t + 1]
                    if rules.swap and a != b and (c, d) == (b, a) and not near:
                        found.append(f"step {t} to {t + 1}: drones {i} and {k} swap cells")
                    elif rules.separation and (
                        near := _pass_too_near(self._way(a, b), self._way(c, d), rules, rules)
                    ):
                        found.append(f"step {t} to {t + 1}: drones {i} and {k} pass {near}")
        return found

    def _way(self, a: _Position, b: _Position) -> _Position:
        """Returns the vector (m) from one position to another."""
        size = self.problem.height_map.resolution
        return (b[0] - a[0]) * size, (b[1] - a[1]) * size, b[2] - a[2]

    def _move_rewards(self, plan: Plan) -> float:
        """Returns the rewards per move of all robots together."""
        objective, moves = self.problem.objective, range(self.problem.horizon)
        return math.fsum(
            reward
            for path in plan.paths
            for t in moves
            for reward in rewards_of_move(objective, path[t], path[t + 1])
        )

    def _seen(self, plan: Plan) -> list[_Coverage]:
        """Returns the coverage [R][T+1][W] by all robots: of faces, then of people who count."""
        geometry = FaceGeometry(self.problem)
        paths = zip(self.problem.robots, plan.paths, strict=True)
        cells = [(state.x, state.y) for path in plan.paths for state in path]
        window = Window.around(cells, 0, self.problem.workspace)
        return [self._coverage(geometry, robot, path, window) for robot, path in paths]

    def _count_rewards(self, seen: list[_Coverage]) -> list[list[float]]:
        """Returns the reward [T+1][A] at every step for the drones that see each person."""
        views, first = self.problem.objective.views, len(self.problem.face_weights)
        if views is None:
            return [[] for _ in range(self.problem.horizon + 1)]
        weights = views.weights(len(self.problem.actors))
        rewards = [[0.0 for _ in weights] for _ in range(self.problem.horizon + 1)]
        for t in range(self.problem.first_step, self.problem.horizon + 1):
            for j, actor in enumerate(self.problem.actors):
                drones = sum(coverage[t][first + j] for coverage in seen)
                importance = 1.0 if actor.importance is None else actor.importance[t]
                importance *= float(self.problem.chances[j])
                rewards[t][j] = weights[j] * importance * min(drones, views.cameras)
        return rewards

    def _view_rewards(self, seen: list[_Coverage]) -> list[list[float]]:
        """Returns the view reward of every step and face [T+1][F].

        If pixels add up over time, a step's reward is its gain over the steps before.
        """
        rewards = []
        before = [0.0 for _ in self.problem.face_weights]
        for t in range(self.problem.horizon + 1):
            pixels = [0.0 for _ in self.problem.face_weights]
            for coverage in seen:
                if t >= self.problem.first_step:
                    faces = coverage[t][: len(pixels)]
                    pixels = [a + b for a, b in zip(pixels, faces, strict=True)]
            weights = self.problem.step_weights[t].tolist()
            if self.problem.objective.over_time:
                pixels = [a + b for a, b in zip(before, pixels, strict=True)]
            gained = [w * math.sqrt(z) for w, z in zip(weights, pixels, strict=True)]
            if self.problem.objective.over_time:
                so_far = [w * math.sqrt(z) for w, z in zip(weights, before, strict=True)]
                gained = [a - b for a, b in zip(gained, so_far, strict=True)]
                before = pixels
            rewards.append(gained)
        return rewards

    def _coverage(
        self, geometry: FaceGeometry, robot: Robot, path: tuple[State, ...], window: Window
    ) -> list[list[float]]:
        """Returns the coverage [T+1][W] that a robot has along its path, which is in the window."""
        views = StateViews.within(window, geometry, self.problem, robot)
        states = np.array([views.graph.index(state) for state in path[: self.problem.horizon + 1]])
        coverage: list[list[float]] = views.along(0, states).tolist()
        return coverage

    def _misplaced(self, robot: Robot, state: State) -> str:
        """Says why a robot cannot be in a state; empty if it can."""
        width, depth = self.problem.height_map.shape
        if not (0 <= state.x < width and 0 <= state.y < depth):
            return "outside the map"
        if not 0 <= state.layer < len(robot.motion.layers):
            return "at a height that the drone does not have"
        if not 0 <= state.heading < robot.motion.headings:
            return "at a heading that the drone does not have"
        if not 0 <= state.pitch < len(robot.camera.tilts):
            return "at a tilt that the camera does not have"
        altitude = self._altitude(robot, state)
        if not self._is_free(robot, state.x, state.y, (altitude, altitude)):
            clearance = robot.motion.clearance
            near = f", or within {clearance:g} m above or below one" if clearance else ""
            return f"inside an obstacle{near}"
        return self._closed(state.x, state.y, (altitude, altitude))

    def _altitude(self, robot: Robot, state: State) -> float:
        return self.problem.height_map.altitude(state.x, state.y, robot.motion.layers[state.layer])

    def _is_free(self, robot: Robot, x: int, y: int, altitudes: tuple[float, float]) -> bool:
        """Returns True if a cell has no matter between two altitudes or within the clearance."""
        for bottom, top in self.problem.workspace.columns.at(x, y):
            above = bottom > max(altitudes) + robot.motion.clearance
            below = top < min(altitudes) - robot.motion.clearance
            if not above and not below:
                return False
        return True

    def _broken_move(self, robot: Robot, a: State, b: State) -> str:
        motion = robot.motion
        if max(abs(b.x - a.x), abs(b.y - a.y)) > motion.radius:
            return f"moves more than {motion.radius} cells"
        if (b.x - a.x) % motion.spacing or (b.y - a.y) % motion.spacing:
            return f"does not move by a multiple of {motion.spacing} cells"
        if abs(b.layer - a.layer) > motion.climb:
            return f"climbs more than {motion.climb} layers"
        turn = abs(b.heading - a.heading)
        if min(turn, motion.headings - turn) > motion.turn:
            return f"turns more than {motion.turn} headings"
        if abs(b.pitch - a.pitch) > motion.pitch_turn:
            return f"pitches more than {motion.pitch_turn} steps"
        altitudes = self._altitude(robot, a), self._altitude(robot, b)
        if words := self._too_long(motion, a, b, altitudes[1] - altitudes[0]):
            return words
        for x in range(min(a.x, b.x), max(a.x, b.x) + 1):
            for y in range(min(a.y, b.y), max(a.y, b.y) + 1):
                closed = self._closed(x, y, altitudes)
                if closed and _line_touches(a, b, x, y):
                    return f"passes the cell ({x}, {y}), which is {closed}"
                blocked = not motion.corner_cutting and not self._is_free(robot, x, y, altitudes)
                if blocked and _line_touches(a, b, x, y):
                    return f"passes the blocked cell ({x}, {y})"
        return ""

    def _too_long(self, motion: Motion, a: State, b: State, rise: float) -> str:
        """Says which limit of its stride a move exceeds; empty if none. `rise` is in m."""
        if motion.stride is None:
            return ""
        size = self.problem.height_map.resolution
        aside = math.sqrt(((b.x - a.x) * size) ** 2 + ((b.y - a.y) * size) ** 2)
        space = math.sqrt(aside**2 + rise**2)
        for length, most, words in (
            (aside, motion.stride.aside, "aside"),
            (abs(rise), motion.stride.upright, "up or down"),
            (space, motion.stride.space, "in space"),
        ):
            if most is not None and length > most * (1 + _SHARE):
                return f"moves {length:.4g} m {words}, more than {most:.4g} m"
        return ""

    def _closed(self, x: int, y: int, altitudes: tuple[float, float]) -> str:
        """Names the zone or ceiling that closes a cell between two altitudes; empty if open."""
        for low, high in self.problem.workspace.forbidden.at(x, y):
            if low <= max(altitudes) and high >= min(altitudes):
                return "above the ceiling" if high == math.inf else "in a no-fly zone"
        return ""

    def _near_people(self, robot: Robot, path: tuple[State, ...]) -> Iterator[str]:
        """Says when a robot comes too close to a person."""
        airspace, height_map = self.problem.airspace, self.problem.height_map
        if not airspace.people_aside:
            return
        at = [(*height_map.centre(s.x, s.y), self._altitude(robot, s)) for s in path]
        for j, actor in enumerate(self.problem.actors):
            half, rules = actor.shape.height / 2, airspace.rules_beside(actor)
            who = f"{self.problem.person(j)}{actor.told_swerve}"
            body = [(x, y, z + half) for x, y, z, _ in actor.poses.tolist()]
            ways = [(x - u, y - v, z - w) for (x, y, z), (u, v, w) in zip(at, body, strict=False)]
            for t, way in enumerate(ways):
                if _too_near(way, rules):
                    away = actor.nearest(math.hypot(*way[:2]))
                    yield f"step {t} is {away:.3g} m from {who}"
                elif t + 1 < len(ways) and _pass_too_near(
                    way, ways[t + 1], rules, self._with_stray(rules, at[t], at[t + 1])
                ):
                    yield f"step {t} to {t + 1} passes too close to {who}"

    def _with_stray(self, rules: CollisionRules, a: _Position, b: _Position) -> CollisionRules:
        """Returns the rules near people for a move (m) that may deviate from constant speed."""
        stray = self.problem.airspace.people_stray
        if not stray:
            return rules
        aside, rise = math.hypot(b[0] - a[0], b[1] - a[1]), abs(b[2] - a[2])
        return rules.replace(
            separation=rules.separation + stray * aside,
            vertical=min(rules.vertical + stray * rise, LARGEST),
        )


def _by_kind(faults: list[str]) -> Iterator[str]:
    """Yields each fault once, with all steps at which a path has it; empty texts are skipped."""
    for fault in dict.fromkeys(filter(None, faults)):
        steps = [t for t, words in enumerate(faults) if words == fault]
        which = f"steps {in_ranges(steps)} are" if len(steps) > 1 else f"step {steps[0]} is"
        yield f"{which} {fault}"


def _too_near(way: _Position, rules: CollisionRules) -> str:
    """Says how close two robots are, given the vector (m) between them; empty if far enough."""
    apart = math.hypot(*way)
    if not rules.vertical:
        near = apart < rules.separation - TOLERANCE
        return f"{apart:.3g} m apart, less than {rules.separation:g} m" if near else ""
    aside, above = math.hypot(way[0], way[1]), abs(way[2])
    if aside < rules.separation - TOLERANCE and above < rules.vertical - TOLERANCE:
        return (
            f"{aside:.3g} m apart and {above:.3g} m in height, less than "
            f"{rules.separation:g} m and {rules.vertical:g} m"
        )
    return ""


@lru_cache(maxsize=1 << 14)  # on a grid, the same few moves past each other occur repeatedly
def _pass_too_near(
    before: _Position, after: _Position, at_ends: CollisionRules, rules: CollisionRules
) -> str:
    """Says how close robots pass during a step at whose begin and end they obey the rules there.

    The distance from a point to a line, and the height, are convex over the step: each of
    them is below a limit in one interval of the step.
    """
    if _too_near(before, at_ends) or _too_near(after, at_ends):
        return ""

    def way(share: float) -> _Position:
        x, y, z = (a + share * (b - a) for a, b in zip(before, after, strict=True))
        return x, y, z

    def aside(share: float) -> float:
        return math.hypot(*way(share)[: 2 if rules.vertical else 3])

    first, last = 0.0, 1.0
    if rules.vertical:
        # A little less, so that the ends of the interval count.
        most = rules.vertical - TOLERANCE - _LESS
        first, last = _interval(lambda share: abs(way(share)[2]), most)
    return _too_near(way(_least(aside, first, last)), rules) if first < last else ""


def _least(function: Callable[[float], float], first: float, last: float) -> float:
    """Returns the point of an interval at which a convex function is least, by ternary search."""
    for _ in range(100):
        left, right = first + (last - first) / 3, last - (last - first) / 3
        if function(left) < function(right):
            last = right
        else:
            first = left
    return (first + last) / 2


def _interval(function: Callable[[float], float], most: float) -> tuple[float, float]:
    """Returns the ends of the interval of 0..1 in which a convex function is at most `most`.

    If it never is, the first end is beyond the second.
    """
    least = _least(function, 0.0, 1.0)
    if function(least) > most:
        return 1.0, 0.0
    ends = []
    for outside in (0.0, 1.0):
        inside = least
        if function(outside) <= most:
            inside = outside
        for _ in range(100):
            middle = (inside + outside) / 2
            if function(middle) <= most:
                inside = middle
            else:
                outside = middle
        ends.append(inside)
    return ends[0], ends[1]


def _line_touches(a: State, b: State, x: int, y: int) -> bool:
    """Returns True if the line between two cell centres meets the closed square of a cell."""
    enter, leave = Fraction(0), Fraction(1)
    for start, end, centre in ((a.x, b.x, x), (a.y, b.y, y)):
        low, high = Fraction(2 * centre - 1, 2), Fraction(2 * centre + 1, 2)
        if start == end:
            if not low <= start <= high:
                return False
        else:
            first, second = (low - start) / (end - start), (high - start) / (end - start)
            enter, leave = max(enter, min(first, second)), min(leave, max(first, second))
    return enter <= leave
