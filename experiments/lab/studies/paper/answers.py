"""The paper's claims, answered from measurements in sentences and tables.

A claim about a mean holds if its whole confidence interval is on the right side of the threshold,
does not hold if it is on the wrong side, and is left open otherwise. Intervals are bootstrap
intervals over seeds, since gaps are never negative and mostly small.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, median
from typing import NamedTuple, Self

from cocap_opt.experiments.lab.studies.paper.measured import DIVE
from cocap_opt.experiments.lab.studies.paper.stopped import Seed, StoppedRuns
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.experiments.tables.statistics import NONE, Mean
from cocap_opt.experiments.tables.tables import Table
from cocap_opt.planners import RECOMMENDED
from cocap_opt.result import relative_gap
from cocap_opt.run.engine import is_lazy
from cocap_opt.stop import Limit

SOURCE = "Rauniyar, Corah, Scherer 2024 (arXiv 2412.20695)"
HOLDS, FAILS, OPEN = "Claim confirmed", "Claim refuted", "Inconclusive"
_CLOSE = 1.0  # % below the bound without collisions; within this distance, a plan counts as close
_PUBLISHED = {"sequential": 482.0, "cocap": 3981.0, "cocap-vs": 2.7}  # s, their corridor, 8 steps


def lines() -> str:
    """States the thresholds by which claims are judged."""
    return (
        f"the paper does not define close; here it means within {_CLOSE:g} %, of planning "
        "without collisions and of value iteration alike"
    )


class ClaimAnswer(NamedTuple):
    """An answer in words, and its verdict on the claim."""

    words: str
    verdict: str  # HOLDS, FAILS or OPEN
    figure: str = NONE  # the decisive mean, with its interval

    @staticmethod
    def below(found: Mean, line: float) -> str:
        """Returns HOLDS, FAILS or OPEN for the claim that a mean is below a line."""
        if found.high < line:
            return HOLDS
        return FAILS if found.low > line else OPEN

    @staticmethod
    def above(found: Mean, line: float) -> str:
        """Returns HOLDS, FAILS or OPEN for the claim that a mean is above a line."""
        return ClaimAnswer.below(turned(found), -line)

    @staticmethod
    def judged(verdict: str, seeds: int, claim: str, why: str = "") -> str:
        """Returns the verdict on a claim as a sentence; an open one has the number of seeds."""
        known = f"{verdict} with {seeds} seeds" if verdict == OPEN and not why else verdict
        return f"{known}{why}: {claim}."


def turned(found: Mean) -> Mean:
    """Returns the mean and the interval of the negated values."""
    return Mean(-found.value, -found.high, -found.low, found.spread, found.size)


@dataclass(frozen=True)
class SceneAnswers:
    """Answers about one scene, a sentence or two each.

    Attributes
    ----------
    rows : of all planners and seeds of the scene
    """

    scene: str
    rows: Sequence[GapRow]

    @classmethod
    def all_of(cls, rows: Sequence[GapRow]) -> list[Self]:
        """Makes the answers about each scene of some rows."""
        return [
            cls(scene, of_scene) for (scene,), of_scene in GapRow.grouped(rows, "scene").items()
        ]

    def closeness(self) -> ClaimAnswer:
        """Answers whether CoCap comes close to unconstrained performance.

        CoCap loses at most its distance below the certified bound without collisions, and at
        least its distance below the best plan found without collisions.
        """
        of_cocap = self._of("cocap")
        planned = [row for row in of_cocap if row.valid and row.gap_free is not None]
        if not planned:
            words = "CoCap has no plan that obeys the rules; the claim cannot be tested."
            return ClaimAnswer(f"{self.scene}: {words}", OPEN)
        found = Mean.of(GapRow.percent(planned, "gap_free"))
        least = Mean.of([
            100 * relative_gap(row.reward, row.optimum_free)
            for row in planned
            if row.reward is not None and row.optimum_free is not None
        ])  # fmt: skip
        verdict = ClaimAnswer.below(found, _CLOSE)
        if verdict != HOLDS:
            verdict = FAILS if ClaimAnswer.below(least, _CLOSE) == FAILS else OPEN
        why = ""
        if len(planned) < len(of_cocap):
            why = f", as it has no plan on {len(of_cocap) - len(planned)} of {len(of_cocap)} seeds"
            verdict = OPEN
        claim = (
            f"it comes within {_CLOSE:g} % of unconstrained performance (mean over {found.size} "
            "seeds)"
        )
        apart = self._stopped().apart({r.seed: 100 * r.gap_free for r in planned if r.gap_free})
        return ClaimAnswer(
            f"{self.scene}: CoCap is {_text(found)} below the certified bound of planning without "
            f"collisions, at most {max(GapRow.percent(planned, 'gap_free')):.2f} %.{apart} "
            f"{ClaimAnswer.judged(verdict, found.size, claim, why)}",
            verdict,
            _text(found),
        )

    def price(self) -> str:
        """States what collision avoidance costs the best plan, certified from both sides."""
        least, most = self._prices()
        if not least:
            return f"{self.scene}: no price of collisions is certified."
        low, high = f"{fmean(least):.2f} %", f"{fmean(most):.2f} %"
        return (
            f"{self.scene}: avoiding collisions costs the best plan "
            f"{low if low == high else f'between {low} and {high}'} on average over {len(least)} "
            f"seeds, certified, and {max(most):.2f} % at most on any."
        )

    def price_row(self) -> dict[str, str]:
        """Returns the row of the price of collision avoidance, in % of the bound without rules."""
        least, most = self._prices()
        return {
            "scene": self.scene,
            "at least (%)": Mean.in_words(least, 3),
            "at most (%)": Mean.in_words(most, 3),
            "largest (%)": Mean.rounded(max(most, default=None), 3),
            "seeds": str(len(least)),
        }

    def _prices(self) -> tuple[list[float], list[float]]:
        """Returns the least and the largest price of each seed, in %."""
        first = {row.seed: row for row in self.rows}.values()
        ends = [end for row in first if (end := row.price) is not None]
        return [100 * low for low, _ in ends], [100 * high for _, high in ends]

    def against_sequential(self, planner: str = "cocap", name: str = "CoCap") -> ClaimAnswer:
        """Answers whether CoCap, or another planner, is better than sequential planning."""
        pairs = self._pairs(planner, "sequential", lambda row: row.reward if row.valid else None)
        if not pairs:
            words = f"{self.scene}: there is no seed on which both planners have a plan."
            return ClaimAnswer(words, OPEN)
        gains = {seed: 100 * (a - b) / b for seed, (a, b) in pairs.items()}
        found = Mean.of(list(gains.values()))
        better, worse = (sum(sign * gain > 0 for gain in gains.values()) for sign in (1, -1))
        verdict = ClaimAnswer.above(found, 0.0)
        return ClaimAnswer(
            f"{self.scene}: {name}'s reward is {_text(found)} above that of sequential planning on "
            f"the same seeds, at most {max(gains.values()):.2f} % (better on {better}, worse on "
            f"{worse} of {len(pairs)}).{self._stopped(planner).apart(gains)} "
            f"{ClaimAnswer.judged(verdict, found.size, 'it outperforms sequential planning')}",
            verdict,
            _text(found),
        )

    def gains_much(self, least: float) -> ClaimAnswer:
        """Answers whether CoCap gains so many per cent over sequential planning on average."""
        pairs = self._pairs("cocap", "sequential", lambda row: row.reward if row.valid else None)
        if not pairs:
            return ClaimAnswer(f"{self.scene}: there is no seed on which both have a plan.", OPEN)
        found = Mean.of([100 * (a - b) / b for a, b in pairs.values()])
        verdict = ClaimAnswer.above(found, least)
        claim = f"it gains {least:g} % or more"
        words = f"{self.scene}: {_text(found)}. {ClaimAnswer.judged(verdict, found.size, claim)}"
        return ClaimAnswer(words, verdict, _text(found))

    def sequential_failures(self) -> str:
        """Answers when sequential planning fails."""
        collides = {row.seed for row in self._of("greedy") if row.conflicts}
        sequential = self._of("sequential")
        without = sum(not row.valid for row in sequential)
        parts = []
        for words, chosen in (("with", True), ("without", False)):
            where = [row for row in sequential if row.valid and (row.seed in collides) == chosen]
            gaps = GapRow.percent(where, "gap")
            said = _text(Mean.of(gaps)) if gaps else NONE
            parts.append(f"{said} on the {len(gaps)} seeds {words} collisions in the greedy plan")
        return (
            f"{self.scene}: below the best certified bound, sequential planning is "
            f"{' and '.join(parts)}; it finds no plan on {without} of {len(sequential)} seeds."
        )

    def times(self) -> ClaimAnswer:
        """Answers whether view search is faster than value iteration.

        Value iteration needs the coverage of all states, which is computed in advance; view search
        computes coverage while it runs. So the time of coverage is added to value iteration's.
        """
        pairs = self._pairs("cocap", "cocap-vs", _whole_seconds)
        if not pairs:
            return ClaimAnswer(f"{self.scene}: the times of both low levels are needed.", OPEN)
        ours = [median(times) for times in zip(*pairs.values(), strict=True)]
        log_ratio = Mean.of([math.log(a / b) for a, b in pairs.values() if b > 0])
        ratio, low, high = (math.exp(log_ratio[k]) for k in range(3))
        theirs = _PUBLISHED["cocap"] / _PUBLISHED["cocap-vs"]
        reach = "" if math.isnan(low) else f" ({_two_digits(low)} to {_two_digits(high)})"
        verdict = ClaimAnswer.above(log_ratio, 0.0)
        return ClaimAnswer(
            f"{self.scene}: CoCap takes {ours[0]:.3f} s with value iteration, the coverage of all "
            f"states included, and {ours[1]:.3f} s with view search (medians). The former takes "
            f"{_two_digits(ratio)}{reach} times as long as the latter (geometric mean); the paper "
            f"reports a factor of {theirs:,.0f}.{self._cut_short()} "
            f"{ClaimAnswer.judged(verdict, log_ratio.size, 'view search is the faster one')}",
            verdict,
            f"{_two_digits(ratio)}{reach}",
        )

    def _cut_short(self) -> str:
        """States how many times of each low level a limit cut short; empty if none."""
        tables, views = (len(self._stopped(name).seeds) for name in ("cocap", "cocap-vs"))
        if not tables + views:
            return ""
        return (
            f" A limit stopped the former on {tables} seeds and the latter on {views}; these runs "
            "count with the time until then."
        )

    def views(self) -> str:
        """States how many views view search evaluates, with and without discount, and its J."""
        theirs = _PUBLISHED["cocap"] / _PUBLISHED["cocap-vs"]
        parts, factors = [], []
        for planner, words in (
            ("cocap-vs", "view search evaluates"),
            (DIVE, "with gamma 1, where it dives, it evaluates"),
        ):
            views = self._pairs(planner, "cocap", lambda row: row.views)
            rewards = self._pairs(planner, "cocap", lambda r: r.reward if r.valid else None)
            shares, kept = ([100 * a / b for a, b in p.values()] for p in (views, rewards))
            if shares and kept:
                factors.append(fmean(100 / share for share in shares))
                parts.append(
                    f"{words} {fmean(shares):.1f} % of the views that drones can have (from "
                    f"{min(shares):.1f} to {max(shares):.1f} %), {factors[-1]:.0f} times fewer "
                    f"than value iteration, for {fmean(kept):.1f} % of its reward"
                )
        if not parts:
            return f"{self.scene}: views were not counted."
        explained = ", or ".join(f"{factor:.0f}" for factor in factors)
        return (
            f"{self.scene}: {'; '.join(parts)}. If computing views took all of the time, view "
            f"search would be {explained} times as fast; the paper reports a factor of "
            f"{theirs:,.0f}."
        )

    def kept_by_view_search(self) -> ClaimAnswer:
        """Answers whether view search plans nearly as well as value iteration."""
        pairs = self._pairs("cocap-vs", "cocap", lambda row: row.reward if row.valid else None)
        if not pairs:
            return ClaimAnswer(f"{self.scene}: plans of both low levels are needed.", OPEN)
        costs = {seed: 100 * (b - a) / b for seed, (a, b) in pairs.items()}
        found = Mean.of(list(costs.values()))
        verdict = ClaimAnswer.below(found, _CLOSE)
        claim = f"view search costs less than {_CLOSE:g} %"
        return ClaimAnswer(
            f"{self.scene}: with view search CoCap's reward is {_text(found)} below that with "
            f"value iteration.{self._where_both_end(costs)} "
            f"{ClaimAnswer.judged(verdict, found.size, claim)}",
            verdict,
            _text(found),
        )

    def _where_both_end(self, costs: Mapping[Seed, float]) -> str:
        """States the price of view search on seeds on which no limit stopped either method."""
        stopped = self._stopped("cocap").seeds | self._stopped("cocap-vs").seeds
        ended = [cost for seed, cost in costs.items() if seed not in stopped]
        if len(ended) == len(costs):
            return ""
        known = f"that is {_text(Mean.of(ended))}" if ended else "there is no result"
        return f" On the {len(ended)} seeds on which no limit stopped either of them, {known}."

    def stopped(self) -> ClaimAnswer:
        """Answers whether CoCap's tree ends in time."""
        of_cocap, stopped = self._of("cocap"), self._stopped()
        limit = max(GapRow.values(of_cocap, "time_limit"), default=0.0)
        verdict = FAILS if stopped.seeds else HOLDS
        return ClaimAnswer(
            f"{self.scene}: the limit of {limit:g} s stops CoCap on {len(stopped.seeds) or 'none'} "
            f"of {len(of_cocap)} seeds{stopped.whose_plan}. "
            f"{ClaimAnswer.judged(verdict, len(of_cocap), 'its tree ends in time')}",
            verdict,
            f"stopped on {len(stopped.seeds)} of {len(of_cocap)}",
        )

    def comparison(self) -> Table:
        """Returns published seconds and ours, and gaps, which only bounds make possible."""
        table = []
        for (planner,), of_planner in GapRow.grouped(self.rows, "planner").items():
            planned = [row for row in of_planner if row.valid]
            published = _PUBLISHED.get(planner) if self.scene == "corridor" else None
            stopped = self._stopped(planner).seeds
            ended = [row for row in planned if row.seed not in stopped]
            table.append(
                {
                    "scene": self.scene,
                    "planner": planner,
                    "plans": f"{len(planned)} of {len(of_planner)}",
                    "J": _mean(GapRow.values(of_planner, "reward"), 0),
                    "below the bound (%)": Mean.in_words(GapRow.percent(planned, "gap"), 3),
                    "at most (%)": Mean.rounded(
                        max(GapRow.percent(planned, "gap"), default=None), 3
                    ),
                    "below the free bound (%)": Mean.in_words(
                        GapRow.percent(planned, "gap_free"), 3
                    ),
                    "seconds, median": _median(GapRow.values(of_planner, "seconds"), 3),
                    "stopped": str(len(stopped)),
                    "below the bound, if not stopped (%)": (
                        Mean.in_words(GapRow.percent(ended, "gap"), 3) if stopped else NONE
                    ),
                    "views, median": _median(GapRow.values(of_planner, "views"), 0),
                    "published (s)": NONE if published is None else f"{published:g}",
                }
            )
        return table

    def cameras(self) -> str:
        """States the share of person-steps at which two drones or more see the person."""
        parts = []
        for planner in ("sequential", "cocap", RECOMMENDED):
            shares = GapRow.percent([r for r in self._of(planner) if r.valid], "seen_by_two")
            if shares:
                parts.append(f"{Mean.of(shares).text(1, ' %')} with {planner}")
        if not parts:
            return f"{self.scene}: there is no result."
        share = "the share of person-steps at which two drones or more see the person"
        return f"{self.scene}: {share} is {', '.join(parts)}."

    def scaling(self, limit: float) -> str:
        """Answers what a team of this size costs.

        Parameters
        ----------
        limit : time limit (s) of each planner
        """
        parts = []
        for planner in ("sequential", "cocap", "cocap-lns"):
            of_planner = self._of(planner)
            gaps = GapRow.percent([row for row in of_planner if row.valid], "gap")
            stopped = sum(row.limit == Limit.TIME for row in of_planner)
            words = f", stopped by the limit of {limit:g} s on {stopped}" if stopped else ""
            gap = f"{_text(Mean.of(gaps))} below the bound" if gaps else "without a plan"
            parts.append(f"{planner} is {gap} on {len(gaps)} of {len(of_planner)} seeds{words}")
        return f"{self.scene}: {'; '.join(parts)}."

    def _of(self, planner: str) -> list[GapRow]:
        return [row for row in self.rows if row.planner == planner]

    def _stopped(self, planner: str = "cocap") -> StoppedRuns:
        return StoppedRuns.of(self.rows, planner)

    def _pairs(
        self, first: str, second: str, figure: Callable[[GapRow], float | None]
    ) -> dict[Seed, tuple[float, float]]:
        """Returns a figure of two planners, by the seeds on which both have it."""
        figures, other = (
            {row.seed: number for row in self._of(name) if (number := figure(row)) is not None}
            for name in (first, second)
        )
        return {seed: (number, other[seed]) for seed, number in figures.items() if seed in other}


def _whole_seconds(row: GapRow) -> float | None:
    """Returns the time of a search, including the coverage that it needs."""
    if row.seconds is None:
        return None
    return row.seconds + (0.0 if is_lazy(row.planner or "") else row.coverage_seconds or 0.0)


def _text(found: Mean) -> str:
    return found.text(2, " %")


def _two_digits(ratio: float) -> str:
    """Returns a ratio with two digits, a last zero included."""
    return f"{ratio:#.2g}".rstrip(".")


def _mean(values: Sequence[float], digits: int) -> str:
    return Mean.rounded(fmean(values) if values else None, digits)


def _median(values: Sequence[float], digits: int) -> str:
    return Mean.rounded(median(values) if values else None, digits)
