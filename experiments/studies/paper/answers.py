"""The paper's claims, answered from measurements in sentences and tables.

A claim about a mean holds if its whole confidence interval is on the right side of the line,
does not hold if it is on the wrong side, and is left open otherwise.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Self

from cocap_opt.experiments.results.rows import Row
from cocap_opt.experiments.results.statistics import NONE, Mean
from cocap_opt.experiments.results.tables import Table
from cocap_opt.result import relative_gap
from cocap_opt.stop import Limit

SOURCE = "Rauniyar, Corah, Scherer 2024 (arXiv 2412.20695)"
HOLDS, FAILS, OPEN = "holds", "does not hold", "is left open by so many seeds"
_CLOSE = 1.0  # % below the bound without collisions that is called close to it
_PUBLISHED = {"sequential": 482.0, "cocap": 3981.0, "cocap-vs": 2.7}  # s, their corridor, 8 steps


@dataclass(frozen=True)
class SceneAnswers:
    """Answers about one scene, a sentence each.

    Attributes
    ----------
    rows : of the gap table, of all planners and seeds of the scene
    """

    scene: str
    rows: Sequence[Row]

    @classmethod
    def all_of(cls, rows: Sequence[Row]) -> list[Self]:
        """Makes the answers about each scene of some rows."""
        return [cls(scene, some) for (scene,), some in Row.grouped(rows, "scene").items()]

    def closeness(self) -> str:
        """Answers if CoCap comes close to unconstrained performance.

        CoCap loses at most its distance below the certified bound without collisions, and at
        least its distance below the best plan found without collisions.
        """
        own = self._of("cocap")
        planned = [row for row in own if row.valid and row.gap_free is not None]
        if not planned:
            words = "CoCap has no plan that obeys the rules; the claim cannot be tried."
            return f"{self.scene}: {words}"
        found = Mean.of(Row.percent(planned, "gap_free"))
        least = Mean.of([
            100 * relative_gap(row.reward, row.optimum_free)
            for row in planned
            if row.reward is not None and row.optimum_free is not None
        ])  # fmt: skip
        words = _verdict_below(found, _CLOSE)
        if words != HOLDS:
            words = FAILS if _verdict_below(least, _CLOSE) == FAILS else OPEN
        if len(planned) < len(own):
            words = f"{OPEN}, as it has no plan on {len(own) - len(planned)} of {len(own)}"
        return (
            f"{self.scene}: CoCap is {_text(found)} below the certified bound of planning without "
            f"collisions, at most {max(Row.percent(planned, 'gap_free')):.2f} %. That it comes "
            f"within {_CLOSE:g} % of unconstrained performance {words} (mean over {found.size} "
            "seeds)."
        )

    def against_sequential(self) -> str:
        """Answers if CoCap is better than sequential planning."""
        pairs = self._pairs("cocap", "sequential", lambda row: row.reward if row.valid else None)
        if not pairs:
            return f"{self.scene}: there is no seed on which both planners have a plan."
        found = Mean.of([100 * (a - b) / b for a, b in pairs])
        better, worse = sum(a > b for a, b in pairs), sum(a < b for a, b in pairs)
        return (
            f"{self.scene}: CoCap's reward is {_text(found)} above that of sequential planning on "
            f"the same seeds (better on {better}, worse on {worse} of {len(pairs)}). That it "
            f"outperforms sequential planning {_verdict_above(found, 0.0)}."
        )

    def sequential_failures(self) -> str:
        """Answers when sequential planning fails."""
        collides = {row.seed for row in self._of("greedy") if row.conflicts}
        own = self._of("sequential")
        without = sum(not row.valid for row in own)
        parts = []
        for words, chosen in (("with", True), ("without", False)):
            some = [row for row in own if row.valid and (row.seed in collides) == chosen]
            gaps = Row.percent(some, "gap")
            said = _text(Mean.of(gaps)) if gaps else NONE
            parts.append(f"{said} on the {len(gaps)} seeds {words} collisions in the greedy plan")
        return (
            f"{self.scene}: below the best certified bound, sequential planning is "
            f"{' and '.join(parts)}; it finds no plan on {without} of {len(own)} seeds."
        )

    def times(self, coverage: float) -> str:
        """Answers if view search is faster than value iteration.

        Value iteration needs the coverage of all states, which is computed before it; view
        search computes what it touches while it runs. So that time is added to the former's.

        Parameters
        ----------
        coverage : s, of all states of one seed of the scene, on one thread
        """
        pairs = self._pairs("cocap", "cocap-vs", lambda row: row.seconds)
        if not pairs:
            return f"{self.scene}: not both low levels were timed."
        ours = [median(times) for times in zip(*pairs, strict=True)]
        log_ratio = Mean.of([math.log((a + coverage) / b) for a, b in pairs if b > 0])
        ratio, low, high = (math.exp(log_ratio[k]) for k in range(3))
        theirs = _PUBLISHED["cocap"] / _PUBLISHED["cocap-vs"]
        reach = f" [{low:.2g}, {high:.2g}]" if log_ratio.size > 1 else ""
        return (
            f"{self.scene}: CoCap takes {ours[0]:.3f} s with value iteration, after "
            f"{coverage:.3f} s for the coverage of all states, and {ours[1]:.3f} s with view "
            f"search (medians). The former takes {ratio:.2g}{reach} times as long as the latter "
            f"(geometric mean); published are {theirs:,.0f} times. That view search is the faster "
            f"one {_verdict_above(log_ratio, 0.0)} here."
        )

    def comparison(self) -> Table:
        """Returns published seconds beside ours, and the gaps that only bounds can tell."""
        table = []
        for planner in _PUBLISHED:
            own = self._of(planner)
            planned = [row for row in own if row.valid]
            published = f"{_PUBLISHED[planner]:g}" if self.scene == "corridor" else NONE
            table.append(
                {
                    "scene": self.scene,
                    "planner": planner,
                    "published (s)": published,
                    "ours (s)": Mean.interval(Row.values(own, "seconds"), 3),
                    "seeds": f"{len(planned)} of {len(own)}",
                    "reward": Mean.interval(Row.values(planned, "reward"), 0),
                    "below the best bound (%)": Mean.interval(Row.percent(planned, "gap"), 3),
                    "below the free bound (%)": Mean.interval(Row.percent(planned, "gap_free"), 3),
                    "bound proved optimal": (
                        f"{sum(row.bound_is_proved for row in own)} of {len(own)}"
                    ),
                }
            )
        return table

    def scaling(self, limit: float) -> str:
        """Answers what a team of this size costs.

        Parameters
        ----------
        limit : s, that each planner had
        """
        parts = []
        for planner in ("sequential", "cocap"):
            own = self._of(planner)
            gaps = Row.percent([row for row in own if row.valid], "gap")
            stopped = sum(row.limit == Limit.TIME for row in own)
            words = f", stopped by the limit of {limit:g} s on {stopped}" if stopped else ""
            gap = f"{_text(Mean.of(gaps))} below the bound" if gaps else "without a plan"
            parts.append(f"{planner} is {gap} on {len(gaps)} of {len(own)} seeds{words}")
        return f"{self.scene}: {'; '.join(parts)}."

    def _of(self, planner: str) -> list[Row]:
        return [row for row in self.rows if row.planner == planner]

    def _pairs(
        self, first: str, second: str, figure: Callable[[Row], float | None]
    ) -> list[tuple[float, float]]:
        """Returns a figure of two planners, on the seeds on which both have it."""
        one, other = (
            {row.seed: number for row in self._of(name) if (number := figure(row)) is not None}
            for name in (first, second)
        )
        return [(number, other[seed]) for seed, number in one.items() if seed in other]


def _verdict_below(found: Mean, line: float) -> str:
    """Returns HOLDS, FAILS or OPEN for the claim that a mean is below a line."""
    if found.high < line:
        return HOLDS
    return FAILS if found.low > line else OPEN


def _verdict_above(found: Mean, line: float) -> str:
    """Returns HOLDS, FAILS or OPEN for the claim that a mean is above a line."""
    return _verdict_below(
        Mean(-found.value, -found.high, -found.low, found.spread, found.size), -line
    )


def _text(found: Mean) -> str:
    reach = f" [{found.low:.2f}, {found.high:.2f}]" if found.size > 1 else ""
    return f"{found.value:.2f} %{reach}"
