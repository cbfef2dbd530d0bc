"""Runs of a planner that a limit stopped, separated from those that finished.

If CoCap is stopped, it returns the plan of sequential planning if that is better than its own
(`planners/constraint_tree`). So means over all runs are partly means over the other planner.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Self

from cocap_opt.experiments.lab.studies.paper.measured import POLISHED
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.experiments.tables.statistics import Mean
from cocap_opt.stop import NO_LIMIT

_SAME = 1e-8  # relative difference of equal rewards, which are stored with nine digits
_BEGINS_FROM = {POLISHED: "cocap"}  # compositions, and the planner whose plan they start from

Seed = int | None


class StoppedRuns(NamedTuple):
    """The runs of a planner on one scene that a limit stopped.

    Attributes
    ----------
    seeds : of these runs
    fallen_back : seeds among them on which its plan has the J of sequential planning
    """

    seeds: frozenset[Seed]
    fallen_back: frozenset[Seed]

    @classmethod
    def of(cls, rows: Sequence[GapRow], planner: str) -> Self:
        """Finds the stopped runs of a planner among the rows of a scene.

        A composition counts as stopped if the planner whose plan it starts from was stopped.
        """
        asked = {planner, _BEGINS_FROM.get(planner, planner)}
        seeds = frozenset(r.seed for r in rows if r.planner in asked and r.limit != NO_LIMIT)
        rewards, sequential = (
            {row.seed: row.reward for row in rows if row.planner == name and row.valid}
            for name in (planner, "sequential")
        )
        fallen_back = frozenset(s for s in seeds if _is_same(rewards.get(s), sequential.get(s)))
        return cls(seeds, fallen_back)

    @property
    def whose_plan(self) -> str:
        """States how many of the stopped runs have the plan of sequential planning."""
        if not self.fallen_back:
            return ""
        if self.fallen_back == self.seeds:
            return ", where its plan is that of sequential planning"
        return f", on {len(self.fallen_back)} of which its plan is that of sequential planning"

    def apart(self, values: Mapping[Seed, float]) -> str:
        """States the mean of values, in %, of runs that finished, and of runs that were stopped.

        Returns
        -------
        str
            A sentence with a space before it; empty if no run with a value was stopped.
        """
        ended, stopped = (
            [value for seed, value in values.items() if (seed in self.seeds) == late]
            for late in (False, True)
        )
        if not stopped:
            return ""
        found = f"{Mean.of(stopped).text(2, ' %')} on the {len(stopped)} on which a limit stopped"
        if not ended:
            return f" A limit stopped it on all of these seeds{self.whose_plan}."
        return (
            f" That is {Mean.of(ended).text(2, ' %')} on the {len(ended)} seeds on which it "
            f"ended, and {found} it{self.whose_plan}."
        )


def _is_same(reward: float | None, other: float | None) -> bool:
    return reward is not None and other is not None and abs(reward - other) <= _SAME * abs(other)
