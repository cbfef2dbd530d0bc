"""An audit: checks that an instance describes its scene correctly.

All facts except coverage are recomputed and compared. Coverage is checked for selected states:
those of plans, those with the most pixels, and some that are drawn at random from all states that
drones reach, which also finds missing numbers. Each number must be inside its enclosure.
"""

import heapq
import math
import random
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, Any

from cocap_opt.formulations.independent.differences import of_facts, of_sight, told_state
from cocap_opt.formulations.independent.instance_facts import Instance, Sight
from cocap_opt.formulations.independent.scene_facts import Facts, Kind, Place, Turned

if TYPE_CHECKING:
    from cocap_opt.formulations.independent.enclosures import Enclosures

# An enclosure that is wider than both limits, a share of its upper end and a number of px/m2, is
# left undecided. The numbers of cones have other units, and are small.
NARROW, LITTLE, LITTLE_IN_CONE = 1e-6, 1e-4, 1e-12

_ROUNDED = 1e-14  # relative rounding error of a weight
_AT_ONCE = 100  # states between two progress reports
Progress = Callable[[int, int], None]
Key = tuple[int, int, Place, Turned]  # kind in the scene, step, place, orientation
Interval = tuple[float, float]  # lower and upper end
Path = Sequence[Sequence[int]]  # states x, y, layer, heading, tilt at steps 0..T


@dataclass
class CoverageAudit:
    """The findings on the numbers of selected states.

    Attributes
    ----------
    states, numbers : how many were checked; numbers that are 0 on both sides are not counted
    undecided : how many numbers are inside an enclosure that is too wide to be conclusive
    wide_share, wide_pixels : width of the widest other enclosure, relative to its upper end if that
        is at least `LITTLE / NARROW`, and in px/m2
    differences : numbers outside their enclosures
    left : how many states were not checked because time ran out
    """

    states: int = 0
    numbers: int = 0
    undecided: int = 0
    wide_share: float = 0.0
    wide_pixels: float = 0.0
    differences: list[str] = field(default_factory=list)
    left: int = 0


@dataclass
class Audit:
    """The findings on an instance: everything in which it differs from its scene.

    Attributes
    ----------
    places, moves, unsure : number of places and moves that were compared, and of those so close to
        the minimum distance from a person that either answer is accepted
    reached : number of states that drones reach at steps that count
    sights : number of these that, by the instance, see anything
    differences : lines, each of which gives both values
    coverage : None if it was not requested
    rewards : an interval that contains J of each plan, by the scene alone
    """

    places: int
    moves: int
    unsure: int
    reached: int
    sights: int
    differences: list[str]
    coverage: CoverageAudit | None = None
    rewards: list[Interval] = field(default_factory=list)


class Auditor:
    """Compares an instance with a scene.

    Parameters
    ----------
    problem : the content of the scene's JSON file
    scene : the facts of the scene
    """

    def __init__(self, problem: dict[str, Any], scene: Facts, instance: Instance) -> None:
        self._problem, self._scene, self._instance = problem, scene, instance
        self._first_step = 0 if problem["objective"]["count_start"] else 1
        self._kind_of = {i: k for k, kind in enumerate(scene.kinds) for i in kind.drones}

    def facts(self) -> Audit:
        """Returns the audit of all facts except coverage."""
        found = [*of_facts(self._scene, self._instance.facts)]
        sights, known = 0, set[Key]()
        for sight in self._instance.sights():
            sights += 1
            key = self._key(sight)
            if key is None:
                continue  # a kind without drones, which the comparison of facts reports
            if key in known:
                found.append(
                    f"{told_state(*key[1:])}: given once by the scene, twice by the instance"
                )
            known.add(key)
            kind = self._scene.kinds[key[0]]
            found += of_sight(sight, self._scene, kind, self._first_step)
        kinds = self._scene.kinds
        return Audit(
            sum(len(kind.places) for kind in kinds), sum(len(kind.moves) for kind in kinds),
            sum(len(kind.unsure) for kind in kinds),
            sum(map(sum, self._reached_by_step())), sights, found,
        )  # fmt: skip

    def _key(self, sight: Sight) -> Key | None:
        drones = self._instance.facts.kinds[sight.kind].drones
        if not drones or drones[0] not in self._kind_of:
            return None
        return self._kind_of[drones[0]], sight.step, sight.place, sight.turned

    def _reached_by_step(self) -> list[list[int]]:
        """Returns the number of reached states that count, for each kind and step."""
        return [
            [
                sum(map(len, step.values())) if t >= self._first_step else 0
                for t, step in enumerate(kind.reached)
            ]
            for kind in self._scene.kinds
        ]

    def coverage(
        self,
        plans: Iterable[Sequence[Path]],
        views: float,
        seed: int,
        progress: Progress = lambda done, total: None,
        is_over: Callable[[], bool] = lambda: False,
    ) -> CoverageAudit:
        """Returns the audit of the views of states, those of plans first.

        Parameters
        ----------
        plans : plans whose states are checked, as paths of all drones
        views : number of states with the most pixels, and number of states drawn at random, that
            are checked, too; inf: all states
        seed : seed of the random draws
        progress : called now and then with the number of states checked so far, and the total
        is_over : returns True once no further state is to be checked

        Raises
        ------
        ImportError
            If python-flint is not installed.
        UnknownError
            If the scene has a feature that enclosures do not support.
        """
        chosen: dict[Key, None] = {
            (self._kind_of[i], t, (x, y, layer), (heading, tilt)): None
            for paths in plans for i, path in enumerate(paths)
            for t, (x, y, layer, heading, tilt) in enumerate(path)
            if t >= self._first_step
        }  # fmt: skip
        planned = sorted(chosen)
        if math.isinf(views):
            chosen |= dict.fromkeys(self._all_states())
        else:
            chosen |= dict.fromkeys(self._largest(int(views)))
            chosen |= dict.fromkeys(self._drawn(int(views), random.Random(seed)))
        amounts: dict[Key, dict[int, float]] = {}
        for sight in self._instance.sights():
            key = self._key(sight)
            if key is not None and key in chosen:
                amounts[key] = sight.amounts
        audit = CoverageAudit()
        for done, state in enumerate([*planned, *sorted(chosen.keys() - set(planned))]):
            if done % _AT_ONCE == 0:
                progress(done, len(chosen))
            if is_over():
                audit.left = len(chosen) - done
                break
            self._look(audit, state, amounts.get(state, {}))
        return audit

    @cached_property
    def _enclosures(self) -> "Enclosures":
        from cocap_opt.formulations.independent.enclosures import Enclosures

        return Enclosures(self._problem)

    def reward(self, paths: Sequence[Path]) -> Interval:
        """Returns an enclosure of J of a plan, computed from the scene alone.

        Parameters
        ----------
        paths : paths of all drones
        """
        sums: dict[int, Interval] = {}
        total = (0.0, 0.0)
        for i, path in enumerate(paths):
            robot = self._problem["robots"][i]
            for t, state in enumerate(path):
                if t >= self._first_step:
                    for group, ends in self._ends(robot, t, state).items():
                        sums[group] = _added(sums.get(group, (0.0, 0.0)), ends)
            for tail, head in pairwise(path):
                total = _added(total, self._of_move(tail, head))
        for group, ends in sums.items():
            weight, cameras = self._scene.weights.get(group, (0.0, 0))
            low, high = (min(end, cameras) if cameras else math.sqrt(end) for end in ends)
            # The weight is a product, which may have been rounded differently; this exceeds the
            # rounding error of a root.
            total = _added(total, (weight * low * (1 - _ROUNDED), weight * high * (1 + _ROUNDED)))
        return total

    def _of_move(self, tail: Sequence[int], head: Sequence[int]) -> Interval:
        """Returns an enclosure of the reward for a move."""
        objective, found = self._problem["objective"], (0.0, 0.0)
        for name, is_earned in (
            ("stationarity", [*tail] == [*head]), ("keep_cell", [*tail[:3]] == [*head[:3]]),
            ("keep_heading", tail[3] == head[3]),
            ("balanced", head[0] - tail[0] + head[1] - tail[1] == 0),
        ):  # fmt: skip
            if is_earned:
                found = _added(found, (objective[name], objective[name]))
        return found

    def _all_states(self) -> Iterable[Key]:
        for k, kind in enumerate(self._scene.kinds):
            for t, step in enumerate(kind.reached):
                if t >= self._first_step:
                    for place, orientations in step.items():
                        yield from ((k, t, place, turned) for turned in orientations)

    def _largest(self, views: int) -> list[Key]:
        """Returns the states with the most pixels of a face."""
        rows, faces = self._scene.single["rows of groups"], self._scene.single["faces"]
        candidates = (
            (max((a for g, a in sight.amounts.items() if g < rows * faces), default=0.0), key)
            for sight in self._instance.sights()
            if (key := self._key(sight)) is not None
        )
        return [key for _, key in heapq.nlargest(views, candidates)]

    def _drawn(self, views: int, draws: random.Random) -> list[Key]:
        """Returns a random sample of the states that drones reach at steps that count."""
        of_step = [
            ((k, t), count)
            for k, steps in enumerate(self._reached_by_step()) for t, count in enumerate(steps)
        ]  # fmt: skip
        ends = [0, *accumulate(count for _, count in of_step)]
        numbers = sorted(draws.sample(range(ends[-1]), min(views, ends[-1])))
        found, at = list[Key](), 0
        states: list[tuple[Place, Turned]] = []
        loaded = None
        for number in numbers:
            while number >= ends[at + 1]:
                at += 1
            (k, t), _ = of_step[at]
            if loaded != at:
                step = self._scene.kinds[k].reached[t]
                states = sorted((place, turned) for place, all_ in step.items() for turned in all_)
                loaded = at
            found.append((k, t, *states[number - ends[at]]))
        return found

    def _ends(self, robot: dict[str, Any], t: int, state: Sequence[int]) -> dict[int, Interval]:
        """Returns enclosures of the amounts that a state adds to groups; others are certainly 0."""
        single = self._scene.single
        rows, faces, people = (
            single[name] for name in ("rows of groups", "faces", "people who count")
        )
        x, y, layer, heading, tilt = state
        seen = self._enclosures.seen(robot, t, (x, y, layer, heading, tilt))
        first = 0 if rows == 1 else t * faces
        ends = {first + f: end for f, end in seen.faces.items()}
        return ends | {rows * faces + t * people + j: end for j, end in seen.people.items()}

    def _look(self, audit: CoverageAudit, key: Key, amounts: dict[int, float]) -> None:
        """Checks all numbers of a state at a step."""
        k, t, place, turned = key
        kind: Kind = self._scene.kinds[k]
        robot = self._problem["robots"][kind.drones[0]]
        ends = self._ends(robot, t, (*place, *turned))
        pixels = self._scene.single["rows of groups"] * self._scene.single["faces"]
        little = LITTLE_IN_CONE if robot["camera"]["type"] == "cone" else LITTLE
        audit.states += 1
        for group in sorted({*ends} | {*amounts}):
            low, high = ends.get(group, (0.0, 0.0))
            amount = amounts.get(group, 0.0)
            audit.numbers += 1
            if not low <= amount <= high:
                audit.differences.append(
                    f"{told_state(t, place, turned)}, group {group}: scene {low!r} to {high!r}, "
                    f"instance {amount!r}"
                )
            elif high - low > max(NARROW * high, little if group < pixels else 0.0):
                audit.undecided += 1
            else:
                audit.wide_pixels = max(audit.wide_pixels, high - low)
                if high >= little / NARROW:
                    audit.wide_share = max(audit.wide_share, (high - low) / high)


def _added(a: Interval, b: Interval) -> Interval:
    return _down(a[0] + b[0]), _up(a[1] + b[1])


def _down(value: float) -> float:
    return math.nextafter(value, -math.inf) if value else value


def _up(value: float) -> float:
    return math.nextafter(value, math.inf) if value else value
