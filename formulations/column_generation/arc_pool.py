"""The arcs of a restricted master, and for how many solves each has been idle."""

from collections.abc import Collection, Iterable

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.column_generation.columns import Arc, ClassState
from cocap_opt.model import Model

LEAST_USE = 1e-7  # flow on an arc that counts as use


class ArcPool:
    """The arcs of a master, numbered, and the number of solves for which each has been idle."""

    def __init__(self) -> None:
        self._numbers: dict[Arc, int] = {}
        self._idle = np.zeros(0, dtype=np.int64)

    @property
    def arcs(self) -> Collection[Arc]:
        """The arcs in the order of their numbers."""
        return self._numbers.keys()

    def add(self, arcs: Iterable[Arc]) -> int:
        """Adds arcs, and returns how many of them are new."""
        before = len(self._numbers)
        for arc in arcs:
            self._numbers.setdefault(arc, len(self._numbers))
        new = len(self._numbers) - before
        self._idle = np.append(self._idle, np.zeros(new, dtype=np.int64))
        return new

    def note_flow(self, flow: FloatArray) -> None:
        """Counts one more solve in which the arcs had this flow [n]."""
        self._idle = np.where(flow > LEAST_USE, 0, self._idle + 1)

    def has_fresh(self, arcs: Iterable[Arc], most_idle: int) -> bool:
        """Returns True if each of the arcs was used in one of the last `most_idle` solves."""
        return all(self._idle[self._numbers[arc]] <= most_idle for arc in arcs)

    def has_all(self, arcs: Iterable[Arc]) -> bool:
        """Returns True if all these arcs are in the pool."""
        return all(arc in self._numbers for arc in arcs)

    @staticmethod
    def states_on_paths(
        arcs: Iterable[Arc], starts: Collection[ClassState], horizon: int
    ) -> list[set[ClassState]]:
        """Returns the states [T+1] of each step on a path of arcs from a start to step T."""
        by_step: list[list[Arc]] = [[] for _ in range(horizon)]
        for arc in arcs:
            by_step[arc.t].append(arc)
        reached = [set(starts)]
        for some in by_step:
            reached.append({arc.enters for arc in some if arc.leaves in reached[-1]})
        leading = [reached[-1]]
        for t in range(horizon - 1, -1, -1):
            tails = {arc.leaves for arc in by_step[t] if arc.enters in leading[-1]}
            leading.append(tails & reached[t])
        return leading[::-1]

    def drop_idle(self, model: Model, most_idle: int) -> bool:
        """Drops arcs idle for more than `most_idle` solves, and those that lead nowhere then.

        Returns
        -------
        False if nothing was idle for so long.
        """
        if (self._idle <= most_idle).all():
            return False
        idle = dict(zip(self._numbers, self._idle.tolist(), strict=True))
        fresh = [arc for arc, n in idle.items() if n <= most_idle]
        starts = {
            (number, start)
            for number, robot_class in enumerate(model.classes)
            for start in robot_class.starts
        }
        on = self.states_on_paths(fresh, starts, model.problem.horizon)
        arcs = [arc for arc in fresh if arc.leaves in on[arc.t] and arc.enters in on[arc.t + 1]]
        self._numbers = {arc: n for n, arc in enumerate(arcs)}
        self._idle = np.array([idle[arc] for arc in arcs], dtype=np.int64)
        return True
