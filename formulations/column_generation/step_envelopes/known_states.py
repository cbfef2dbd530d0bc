"""The joint states and paths known to step envelopes, from which local search starts."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from cocap_opt.data import IntArray
from cocap_opt.formulations.certificates.staged import JointStates
from cocap_opt.formulations.certificates.staged.search import plain_nodes
from cocap_opt.formulations.column_generation.parameters import BundleParameters
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.step_envelopes.local_optima import (
    KERNEL as LOCAL_SEARCH,
)
from cocap_opt.formulations.column_generation.step_envelopes.local_optima import (
    heights_of,
    local_optima,
    that_count,
)
from cocap_opt.model import Path
from cocap_opt.stop import Stop

_JointKey = tuple[tuple[int, int], ...]  # class and state number of each robot, sorted


@dataclass
class Known:
    """The joint states and paths found so far.

    Attributes
    ----------
    rng : random generator of local searches
    parameters : numbers of local searches
    paths : class numbers and paths
    is_thorough : True once a search has been long: from then on local search is compiled, which
        takes some seconds the first time on a machine, and starts from more joint states
    """

    rng: np.random.Generator
    parameters: BundleParameters
    paths: dict[tuple[int, Path], None] = field(default_factory=dict)
    is_thorough: bool = False
    _joint: dict[int, dict[_JointKey, None]] = field(default_factory=dict)

    def add_plan(self, plan: Incumbent, steps: Iterable[int]) -> None:
        """Stores the paths and the joint states of a plan."""
        numbers = [column.along.class_number for column in plan.columns]
        for number, path in zip(numbers, plan.paths, strict=True):
            self.add_path(number, path)
        for t in steps:
            at = ((number, path[t]) for number, path in zip(numbers, plan.paths, strict=True))
            self._joint.setdefault(t, {})[tuple(sorted(at))] = None

    def add_path(self, number: int, path: Path) -> bool:
        """Stores a path of a class; returns True if it is new."""
        is_new = (number, path) not in self.paths
        self.paths[number, path] = None
        return is_new

    def add(self, joint: JointStates, positions: Sequence[int]) -> bool:
        """Stores a joint state, if given; returns True if it is new."""
        if not positions:
            return False
        at = list(positions)
        key = tuple(sorted(_named(joint.class_of[at], joint.states[at])))
        states = self._joint.setdefault(joint.t, {})
        is_new = key not in states
        states[key] = None
        return is_new

    def note(self, nodes: int, joint: JointStates, stop: Stop) -> None:
        """Records how many nodes a search took; does not raise LimitReached."""
        if nodes > plain_nodes(joint):
            self.is_thorough |= LOCAL_SEARCH.takes_over_in_time(stop)

    def at(self, joint: JointStates) -> list[list[int]]:
        """Returns the positions of the known joint states that still count."""
        at = {place: k for k, place in enumerate(_named(joint.class_of, joint.states))}
        keys = self._joint.get(joint.t, {})
        found = [[at[place] for place in key] for key in keys if all(place in at for place in key)]
        if not found:
            return []
        teams = np.array(found, dtype=np.int64)
        counts = that_count(joint, teams).tolist()
        return [team for team, does_count in zip(found, counts, strict=True) if does_count]

    def ascended(self, joint: JointStates) -> list[tuple[int, ...]]:
        """Returns high joint states that count; in most of them, no robot can raise the height
        alone.
        """
        robots, known = sum(joint.sizes), self.at(joint)
        self.rng.shuffle(known)
        starts: list[Sequence[int]] = [*known[: self.parameters.known_starts]]
        if self.is_thorough and known:
            highest = np.argsort(-heights_of(joint, np.array(known)), kind="stable")
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
        compiled = self.parameters if self.is_thorough else None
        return [tuple(team) for team in local_optima(joint, starts, compiled).tolist()]

    def highest(self, joint: JointStates) -> float:
        """Returns the largest height that local search finds."""
        return max((joint.reduced_profit(found) for found in self.ascended(joint)), default=-np.inf)


def _named(classes: IntArray, states: IntArray) -> Iterator[tuple[int, int]]:
    """Returns the class and number of each of some states [n]."""
    return zip(classes.tolist(), states.tolist(), strict=True)
