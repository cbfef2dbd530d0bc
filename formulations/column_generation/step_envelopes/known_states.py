"""The joint states and the paths that are known to step envelopes, and local search from them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from cocap_opt.formulations.certificates.staged import JointStates, compiled_search
from cocap_opt.formulations.certificates.staged.search import plain_nodes
from cocap_opt.formulations.column_generation.parameters import BundleParameters
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.step_envelopes.joint_ascent import (
    ascended,
    heights,
    that_count,
)
from cocap_opt.model import Path
from cocap_opt.stop import Stop

JointKey = tuple[tuple[int, int], ...]  # class and state number of each robot, sorted


@dataclass
class Known:
    """The joint states and the paths that were found so far.

    Attributes
    ----------
    rng : of local searches
    parameters : how many local searches there are
    paths : class numbers and paths
    is_thorough : true once a search has been long: then local search is compiled, too, which takes
        some seconds on a machine the first time, and begins at more joint states
    """

    rng: np.random.Generator
    parameters: BundleParameters
    paths: dict[tuple[int, Path], None] = field(default_factory=dict)
    is_thorough: bool = False
    _joint: dict[int, dict[JointKey, None]] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        incumbent: Incumbent,
        steps: Iterable[int],
        rng: np.random.Generator,
        parameters: BundleParameters,
    ) -> "Known":
        """Returns the paths and the joint states of a plan."""
        known = cls(rng, parameters)
        known.add_plan(incumbent, steps)
        return known

    def add_plan(self, plan: Incumbent, steps: Iterable[int]) -> None:
        """Remembers the paths and the joint states of a plan."""
        numbers = [column.along.class_number for column in plan.columns]
        for number, path in zip(numbers, plan.paths, strict=True):
            self.add_path(number, path)
        for t in steps:
            at = ((number, path[t]) for number, path in zip(numbers, plan.paths, strict=True))
            self._joint.setdefault(t, {})[tuple(sorted(at))] = None

    def add_path(self, number: int, path: Path) -> bool:
        """Remembers a path of a class; returns True if it is new."""
        is_new = (number, path) not in self.paths
        self.paths[number, path] = None
        return is_new

    def add(self, joint: JointStates, positions: Sequence[int]) -> bool:
        """Remembers a joint state, if there is one; returns True if it is new."""
        if not positions:
            return False
        key = tuple(sorted(joint.keys[k] for k in positions))
        states = self._joint.setdefault(joint.t, {})
        is_new = key not in states
        states[key] = None
        return is_new

    def note(self, nodes: int, joint: JointStates, stop: Stop) -> None:
        """Takes down how many nodes a search took; raises no limit."""
        if nodes > plain_nodes(joint):
            self.is_thorough |= compiled_search.may_take_over(stop)

    def at(self, joint: JointStates) -> list[list[int]]:
        """Returns the positions of the joint states that are known and still count."""
        at = {place: k for k, place in enumerate(joint.keys)}
        keys = self._joint.get(joint.t, {})
        found = [[at[place] for place in key] for key in keys if all(place in at for place in key)]
        if not found:
            return []
        teams = np.array(found, dtype=np.int64)
        counts = that_count(joint, teams).tolist()
        return [team for team, does_count in zip(found, counts, strict=True) if does_count]

    def ascended(self, joint: JointStates) -> list[tuple[int, ...]]:
        """Returns joint states that count and that no robot can raise alone."""
        robots, known = sum(joint.sizes), self.at(joint)
        self.rng.shuffle(known)
        starts: list[Sequence[int]] = [*known[: self.parameters.known_starts]]
        if self.is_thorough and known:
            highest = np.argsort(-heights(joint, np.array(known)), kind="stable")
            starts = [known[k] for k in highest[: self.parameters.highest_starts]] + starts
        for start in starts[
            : self.parameters.many_random_starts
            if self.is_thorough
            else self.parameters.random_starts
        ]:
            changed = list(start)
            for k in self.rng.integers(robots, size=robots // 2 + 1).tolist():
                number = joint.class_of[changed[k]]
                first, end = np.searchsorted(joint.class_of, [number, number + 1])
                changed[k] = int(self.rng.integers(first, end))
            starts.append(changed)
        return [tuple(team) for team in ascended(joint, starts, self.is_thorough).tolist()]

    def highest(self, joint: JointStates) -> float:
        """Returns the largest height that local search finds."""
        return max((joint.reduced_profit(found) for found in self.ascended(joint)), default=-np.inf)
