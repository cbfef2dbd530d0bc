"""The paper's claims by scene: yes, no or open, each with its mean and interval."""

from collections.abc import Callable, Mapping, Sequence

from cocap_opt.experiments.lab.studies.paper import ablation
from cocap_opt.experiments.lab.studies.paper.answers import (
    FAILS,
    HOLDS,
    OPEN,
    ClaimAnswer,
    SceneAnswers,
)
from cocap_opt.experiments.lab.studies.paper.conditions import (
    PUBLISHED,
    Trial,
    answer_for_the_best,
)
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.experiments.tables.statistics import NONE
from cocap_opt.experiments.tables.tables import Table

_WORDS = {HOLDS: "yes", FAILS: "no", OPEN: "open"}
_TITLE, _ALL = "CoCap", "all scenes"
_AS_PUBLISHED = f"gains {PUBLISHED:g} % over it, as published"
# Each claim, the number that decides it, and the function that answers it.
_CLAIMS: tuple[tuple[str, str, Callable[[SceneAnswers], ClaimAnswer]], ...] = (
    ("outperforms sequential planning", "J above it", SceneAnswers.against_sequential),
    (_AS_PUBLISHED, "J above it", lambda scene: scene.gains_much(PUBLISHED)),
    (
        "comes within 1 % of planning without collisions", "J below its bound",
        SceneAnswers.closeness,
    ),
    ("is faster with view search", "time with all views / with view search", SceneAnswers.times),
    (
        "loses less than 1 % by view search", "J below that with all views",
        SceneAnswers.kept_by_view_search,
    ),
    ("ends in time", "runs that the limit stopped", SceneAnswers.stopped),
)  # fmt: skip


def claims_table(rows: Sequence[GapRow], trials: Sequence[Trial]) -> Table:
    """Returns a row for each claim of CoCap, with an answer for each scene."""
    scenes = SceneAnswers.all_of(rows)
    table = [
        _row(claim, measured, {scene.scene: answer(scene) for scene in scenes})
        for claim, measured, answer in _CLAIMS
    ]
    elsewhere = _cell(answer_for_the_best(trials))
    table = [
        row | {_ALL: f"{elsewhere} elsewhere" if row[_TITLE] == _AS_PUBLISHED else NONE}
        for row in table
    ]
    *of_scenes, of_all = ablation.Effect.all_of(rows, ablation.TREE)
    effects = {effect.scene: effect.answer() for effect in of_scenes}
    last = _row("adds to rounds by its tree", "J above rounds", effects)
    return [*table, last | {_ALL: _cell(of_all.answer())}]


def _row(claim: str, measured: str, answers: Mapping[str, ClaimAnswer]) -> dict[str, str]:
    cells = {scene: _cell(answer) for scene, answer in answers.items()}
    return {_TITLE: claim, "measured": measured, **cells}


def _cell(answer: ClaimAnswer) -> str:
    """Returns the verdict and the decisive number, without a line break before its sign."""
    figure = answer.figure.replace(" %", "\u00a0%")
    return f"**{_WORDS[answer.verdict]}** {figure}"
