"""Ablation: what each part adds to others, in pairs on the same seeds.

The parts are an order of the drones, rounds of best responses, CoCap's constraint tree, and large
neighbourhood search. What a part adds is J with it minus J without it, in % of the certified bound.
"""

from collections.abc import Sequence
from statistics import geometric_mean
from typing import NamedTuple, Self

from cocap_opt.experiments.lab.studies.paper.answers import (
    FAILS,
    HOLDS,
    OPEN,
    ClaimAnswer,
    turned,
)
from cocap_opt.experiments.lab.studies.paper.measured import POLISHED
from cocap_opt.experiments.lab.studies.paper.stopped import StoppedRuns
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.experiments.tables.statistics import NONE, Mean
from cocap_opt.experiments.tables.tables import Table

ALL = "all scenes alike"
_INSTEAD = "in place of "  # begins `beside` if the part replaces the other
_ALIKE = 0.1  # % of the bound; planners with a smaller difference count as equally good


class Contrast(NamedTuple):
    """A part, what it is added to, and the planners with it and without it."""

    part: str
    beside: str
    with_it: str
    without: str

    @property
    def words(self) -> str:
        """The change in words: a part is added to something, or replaces something."""
        if self.beside.startswith(_INSTEAD):
            return f"replacing {self.beside.removeprefix(_INSTEAD)} with {self.part}"
        return f"adding {self.part} to {self.beside}"


TREE_ALONE = Contrast("the tree", "in place of sequential planning", "cocap", "sequential")
ROUNDS = Contrast("rounds", "sequential planning", "sequential-rounds", "sequential")
ORDERS = Contrast("ten orders", "sequential planning", "best-of-orders", "sequential")
TREE_OR_ROUNDS = Contrast("the tree", "in place of rounds", "cocap", "sequential-rounds")
TREE = Contrast("the tree", "rounds", POLISHED, "sequential-rounds")
TREE_FROM_ROUNDS = Contrast(
    "the focal tree (its root in rounds)", "rounds", "cocap-focal", "sequential-rounds"
)
SEARCH = Contrast("neighbourhood search", "rounds", "cocap-lns", "sequential-rounds")
SEARCH_OR_TREE = Contrast(
    "neighbourhood search", "in place of the tree and rounds", "cocap-lns", POLISHED
)
_PLURAL = {ROUNDS.part, ORDERS.part}
CONTRASTS = (
    TREE_ALONE, ROUNDS, ORDERS, TREE_OR_ROUNDS, TREE, TREE_FROM_ROUNDS, SEARCH, SEARCH_OR_TREE,
)  # fmt: skip


class Effect(NamedTuple):
    """The gain by a part on one scene, or on all scenes with equal weights."""

    scene: str
    contrast: Contrast
    differences: tuple[tuple[float, ...], ...]  # % of the bound, by scene and seed
    lost: int  # seeds on which one of the planners has no plan
    ratios: tuple[float, ...]  # seconds with the part / without it, if both were timed
    stopped: int  # pairs in which a limit stopped the planner with the part

    @classmethod
    def all_of(cls, rows: Sequence[GapRow], contrast: Contrast) -> list[Self]:
        """Returns the effect on each scene, and last the effect on all scenes."""
        effects = []
        for (scene,), of_scene in GapRow.grouped(rows, "scene").items():
            with_it, without = (
                {row.seed: row for row in of_scene if row.planner == name and row.valid}
                for name in (contrast.with_it, contrast.without)
            )
            seeds = {
                row.seed for row in of_scene if row.planner in (contrast.with_it, contrast.without)
            }
            pairs = [
                (with_it[s], without[s]) for s in sorted(with_it.keys() & without.keys(), key=str)
            ]
            differences = tuple(_difference(*pair) for pair in pairs)
            ratios = tuple(a.seconds / b.seconds for a, b in pairs if a.seconds and b.seconds)
            late = StoppedRuns.of(of_scene, contrast.with_it).seeds
            stopped = sum(row.seed in late for row, _ in pairs)
            lost = len(seeds) - len(pairs)
            effects.append(cls(scene, contrast, (differences,), lost, ratios, stopped))
        lost, stopped = (sum(getattr(e, name) for e in effects) for name in ("lost", "stopped"))
        ratios = sum((effect.ratios for effect in effects), ())
        everything = tuple(e.differences[0] for e in effects if e.differences[0])
        return [*effects, cls(ALL, contrast, everything, lost, ratios, stopped)]

    @classmethod
    def over_all(cls, rows: Sequence[GapRow], contrast: Contrast) -> Self:
        """Returns the effect on all scenes, with equal weights."""
        return cls.all_of(rows, contrast)[-1]

    @property
    def mean(self) -> Mean | None:
        """Mean over scenes of means over seeds; None without seeds on which both have a plan."""
        return Mean.of(*self.differences) if any(self.differences) else None

    @property
    def longer(self) -> str:
        """The time with the part divided by the time without it (geometric mean)."""
        if not self.ratios:
            return NONE
        ratio = geometric_mean(self.ratios)
        return f"{ratio:.1f}" if ratio < 9.95 else f"{ratio:,.0f}"

    @property
    def record(self) -> dict[str, str]:
        """Its row of a table."""
        values = [value for of_scene in self.differences for value in of_scene]
        return {
            "what is added": self.contrast.part,
            "to, or beside": self.contrast.beside,
            "scene": self.scene,
            "adds (% of the bound)": self.mean.text(3) if self.mean else NONE,
            "better": str(sum(value > 0 for value in values)),
            "equal": str(sum(value == 0 for value in values)),
            "worse": str(sum(value < 0 for value in values)),
            "no plan": str(self.lost),
            "stopped": str(self.stopped),
            "times as long": self.longer,
        }

    def answer(self) -> ClaimAnswer:
        """Answers whether the part adds anything, takes something away, or adds almost nothing."""
        found, contrast = self.mean, self.contrast
        change = _capital(contrast.words)
        if found is None:
            return ClaimAnswer(f"{change}: there is no seed on which both have a plan.", OPEN)
        verdict = ClaimAnswer.above(found, 0.0)
        claim = f"{contrast.part} {'raise' if contrast.part in _PLURAL else 'raises'} J"
        words = ClaimAnswer.judged(verdict, found.size, claim)
        if verdict == OPEN and max(-found.low, found.high) < _ALIKE:
            words = f"That is less than {_ALIKE:g} % either way: planning is as good without it."
            verdict = FAILS
        elif verdict == HOLDS and found.value < _ALIKE:
            words += f" But the gain is below {_ALIKE:g} % on average: planning is nearly as good "
            words += "without it."
        long = f" in {self.longer} times the time" if self.ratios else ""
        changes = f"loses {turned(found).text(3, ' %')}"
        if found.value >= 0:
            changes = f"gains {found.text(3, ' %')}"
        return ClaimAnswer(
            f"{change} {changes} of the bound{long} ({contrast.with_it} against "
            f"{contrast.without}, {self.scene}, {found.size} seeds{self._cut_short()}). {words}",
            verdict,
            found.text(2, " %"),
        )

    def _cut_short(self) -> str:
        return f"; a limit stopped the tree on {self.stopped} of them" if self.stopped else ""


def table(rows: Sequence[GapRow]) -> Table:
    """Returns a row per contrast and scene."""
    return [effect.record for contrast in CONTRASTS for effect in Effect.all_of(rows, contrast)]


def _difference(with_it: GapRow, without: GapRow) -> float:
    """Returns the J of a plan minus another's, in % of the bound; 0 if only rounding differs."""
    if with_it.reward is None or without.reward is None or not with_it.bound:
        return 0.0
    share = 100 * (with_it.reward - without.reward) / with_it.bound
    return 0.0 if abs(share) < 1e-6 else share


def _capital(words: str) -> str:
    return words[0].upper() + words[1:]
