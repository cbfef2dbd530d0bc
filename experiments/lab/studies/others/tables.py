"""The tables of the study of other projects: their plans and ours, and means over start sets.

View reward per drone and step is J divided by the number of drones and by the number of steps that
count; in scenes of Greedy Perspectives these are H steps, including the start. Their published mean
is over H + 1 rows, one of them a spurious 0, so it is H / (H + 1) of ours.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from statistics import stdev
from typing import NamedTuple

from cocap_opt.experiments.lab.studies.others.cases import Case
from cocap_opt.experiments.lab.studies.others.published import Published
from cocap_opt.experiments.tables.gap_table import PROVED
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.output.printing import Listing, Marked, Record
from cocap_opt.problem import Plan
from cocap_opt.referee import check
from cocap_opt.result import relative_gap

PLAN, BETWEEN, WORD = "plan", "no plan", "their word"  # sources of a reward
_MARKS = {
    PLAN: "",
    BETWEEN: "+",
    WORD: "*",
}
_NOTES = {
    BETWEEN: "+ starts elsewhere or flies between the cells: the bound does not hold for it",
    WORD: "* as their file says, without a plan; a gap if their evaluator proves to be ours",
}
_SAME = 1e-9  # relative difference up to which rewards of a step count as equal


@dataclass(frozen=True)
class Compared:
    """A case with published results, and the results of a sweep on it.

    Attributes
    ----------
    rows : of our planners, and of their plans that can be flown
    plans : the plans of these rows, by planner
    """

    case: Case
    rows: Sequence[GapRow]
    plans: Mapping[str, Plan]

    @cached_property
    def by_us(self) -> dict[str, Sequence[float]]:
        """Rewards step by step, by our evaluator, of their planners that can be judged."""
        found: dict[str, Sequence[float]] = {}
        for planner in self.case.published.values():
            if planner.plan is not None:
                verdict = check(self.case.problem, planner.plan)
                start = [verdict.reward_at_start] * (self.case.problem.first_step == 0)
                found[planner.name] = [*start, *verdict.reward_per_step]
            elif planner.evaluated is not None:
                found[planner.name] = planner.evaluated
        return found

    def off(self, planner: Published) -> list[int]:
        """Returns the steps, counted from 1, at which a reported reward differs from ours."""
        pairs = zip(self.by_us.get(planner.name, ()), planner.reported or (), strict=False)
        return [t for t, pair in enumerate(pairs, 1) if not math.isclose(*pair, rel_tol=_SAME)]

    def records(self) -> list[Record]:
        """Returns a record per planner, theirs first, with the same evaluator and bound for all."""
        theirs = [self._theirs(planner) for planner in self.case.published.values()]
        ours = [self._of_row(row) for row in self.rows if row.planner not in self.case.published]
        best = self.best_of_theirs()
        above = "above theirs (%)"
        return [
            record | {above: _above(record["reward"], best)}
            for record in (*theirs, *ours)
            if record is not None
        ]

    def best_of_theirs(self) -> float | None:
        """Returns the largest J of their plans that start where ours do and can be flown."""
        rewards = [r.reward for r in self.rows if r.planner in self.case.published and r.valid]
        return max((reward for reward in rewards if reward is not None), default=None)

    def reward(self, planner: str) -> float | None:
        """Returns J of a planner's plan, if it has one that obeys the rules."""
        found = (row.reward for row in self.rows if row.planner == planner and row.valid)
        return next(found, None)

    def listing(self) -> Listing:
        """Returns the table for a terminal."""
        records = self.records()
        shown = [
            {
                "planner": record["planner"],
                "reward": Marked(record["reward"], _MARKS[record["of"]]),
                "gap": record["gap"],
                "above theirs": signed_percent(record["above theirs (%)"]),
                "collide": record["shared cells"],
                "seconds": record["seconds"],
            }
            for record in records
        ]
        kinds = {record["of"] for record in records}
        notes = [words for kind, words in _NOTES.items() if kind in kinds]
        return Listing(self._title(), shown, notes)

    def _title(self) -> str:
        problem, row = self.case.problem, self.rows[0]
        drones = f"{len(problem.robots)} drones, {self.case.counted_steps} steps"
        if row.bound is None:
            return f"{problem.name}: {drones}, no bound"
        if row.bound_reason in PROVED:
            return f"{problem.name}: {drones}, optimum {row.bound:,.2f}"
        known = "" if row.optimum is None else f", best known {row.optimum:,.2f}"
        return f"{problem.name}: {drones}, bound {row.bound:,.2f}{known}"

    def _theirs(self, planner: Published) -> Record | None:
        """Returns the record of one of their planners; None if it has no result to judge."""
        told = {
            "by": "them",
            "reported": _sum(planner.reported),
            "own tilts": _sum(planner.own_tilts),
        }
        row = next((row for row in self.rows if row.planner == planner.name), None)
        if row is not None:
            return self._of_row(row) | told
        if planner.evaluated is not None:
            return self._record(planner.name, _sum(planner.evaluated), BETWEEN) | told
        if planner.reported is None:
            return None
        kind = WORD if self._starts_here(planner.reported) else BETWEEN
        return self._record(planner.name, _sum(planner.reported), kind) | told

    def _starts_here(self, reported: Sequence[float]) -> bool:
        """Returns True if rewards begin like those of one of their plans that can be flown."""
        known = [
            planner.reported for planner in self.case.published.values() if planner.plan is not None
        ]
        firsts = [rewards[0] for rewards in known if rewards is not None]
        return any(math.isclose(reported[0], first, rel_tol=_SAME) for first in firsts)

    @cached_property
    def _is_confirmed(self) -> bool:
        """True if their evaluator equals ours: all rewards that can be judged are as reported."""
        return not any(self.off(planner) for planner in self.case.published.values())

    def _of_row(self, row: GapRow) -> Record:
        planner = row.planner or ""
        return self._record(planner, row.reward, PLAN) | {
            "gap": row.gap,
            "conflicts": row.conflicts,
            "shared cells": self._shared(planner),
            "seconds": row.seconds,
        }

    def _shared(self, planner: str) -> int | None:
        """Counts how often two drones of a plan are in one cell, whether forbidden or not."""
        if planner not in self.plans:
            return None
        problem, paths = self.case.problem, self.plans[planner].paths
        cells = [[problem.cell(i, state) for state in path] for i, path in enumerate(paths)]
        steps = zip(*cells, strict=True)
        return sum(1 for step in steps for cell, other in combinations(step, 2) if cell == other)

    def _record(self, planner: str, reward: float | None, kind: str) -> Record:
        bound, gap = self.rows[0].bound, None
        if kind == WORD and reward is not None and bound is not None and self._is_confirmed:
            gap = relative_gap(reward, bound)
        return {
            "scene": self.case.problem.name,
            "by": "us",
            "planner": planner,
            "reward": reward,
            "of": kind,
            "reported": None,
            "own tilts": None,
            "best known": self.rows[0].optimum,
            "bound": bound,
            "proved": self.rows[0].bound_reason in PROVED,
            "gap": gap,
            "conflicts": None,
            "shared cells": None,
            "seconds": None,
        }


class OverSets(NamedTuple):
    """Means over start sets of the rows of a sweep.

    Attributes
    ----------
    counted : steps that count, by scene
    """

    rows: Sequence[GapRow]
    counted: Mapping[str, int]

    def records(self) -> list[Record]:
        """Returns means and spreads, per scene and planner."""
        return list(self._records())

    def listing(self) -> Listing:
        """Returns the table for a terminal."""
        shown = [
            {
                **{key: record[key] for key in ("scene", "planner", "reward")},
                "collide": record["colliding"],
                **{key: record[key] for key in ("gap", "largest gap")},
                "proved": f"{record['proved']}/{record['sets']}",
                "seconds": record["seconds"],
            }
            for record in self._records()
        ]
        return Listing("means over start sets: view reward per drone and step", shown)

    def _records(self) -> Iterator[Record]:
        for (scene, planner), rows in GapRow.grouped(self.rows, "scene", "planner").items():
            yield {"scene": scene, "planner": planner} | self._means(rows)

    def _means(self, rows: Sequence[GapRow]) -> Record:
        rewards = [self._each(row, row.reward) for row in rows]
        gaps = [row.gap for row in rows]
        return {
            "sets": len(rows),
            "reward": _mean(rewards),
            "sd": _of_all(lambda values: stdev(values) if len(values) > 1 else None, rewards),
            "colliding": _mean([row.colliding for row in rows]),
            "valid": sum(row.valid for row in rows),
            "bound": _mean([self._each(row, row.bound) for row in rows]),
            "proved": sum(row.bound_reason in PROVED for row in rows),
            "gap": _mean(gaps),
            "largest gap": _of_all(max, gaps),
            "bound_free": _mean([self._each(row, row.bound_free) for row in rows]),
            "gap_free": _mean([_gap_free(row) for row in rows]),
            "seconds": _mean([row.seconds for row in rows]),
        }

    def _each(self, row: GapRow, value: float | None) -> float | None:
        """Returns a sum over drones and steps as a mean per drone and step."""
        return None if value is None else value / (row.robots * self.counted[row.scene])


def _gap_free(row: GapRow) -> float | None:
    """Returns the gap to the bound without rules, which holds for plans that break them, too."""
    if row.reward is None or row.bound_free is None:
        return None
    return relative_gap(row.reward, row.bound_free)


def _above(value: float | None, other: float | None) -> float | None:
    return 100 * (value / other - 1) if value is not None and other else None


def signed_percent(value: float | None) -> str:
    """Returns a difference in % with its sign; about zero has no sign, and None is "-"."""
    if value is None:
        return "-"
    return f"{value:+.2f} %" if round(value, 2) else "0.00 %"


def _sum(values: Sequence[float] | None) -> float | None:
    return None if values is None else math.fsum(values)


def _mean(values: Sequence[float | None]) -> float | None:
    return _of_all(lambda all_: math.fsum(all_) / len(all_), values)


def _of_all(
    statistic: Callable[[list[float]], float | None], values: Sequence[float | None]
) -> float | None:
    """Returns a statistic, or None if a value is missing, as other start sets would mislead."""
    known = [value for value in values if value is not None]
    return statistic(known) if known and len(known) == len(values) else None
