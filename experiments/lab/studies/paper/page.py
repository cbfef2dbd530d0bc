"""The page of the paper's study: verdict, answers and tables, all made from numbers."""

from collections.abc import Collection, Sequence
from typing import NamedTuple

from cocap_opt.experiments.lab.studies.paper import ablation, conditions
from cocap_opt.experiments.lab.studies.paper.answers import (
    FAILS,
    HOLDS,
    OPEN,
    SOURCE,
    ClaimAnswer,
    SceneAnswers,
)
from cocap_opt.experiments.lab.studies.paper.conditions import Trial
from cocap_opt.experiments.lab.studies.paper.giving_way import Encounter
from cocap_opt.experiments.lab.studies.paper.stopped import StoppedRuns
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.experiments.tables.statistics import NONE
from cocap_opt.experiments.tables.tables import CAMERAS, Table, Tables

_SIDES = {HOLDS: "For CoCap", FAILS: "Against it", OPEN: "Inconclusive"}
_FIGURES = {
    "curves.png": "Reward per step",
    "ablation.png": "What each part adds",
    "conditions.png": "Where CoCap gains",
}
_OF_THE_TREE = (ablation.TREE_OR_ROUNDS, ablation.TREE, ablation.TREE_FROM_ROUNDS)


class Page(NamedTuple):
    """Everything that the page describes.

    Attributes
    ----------
    rows : of the scenes, including compositions of the ablation
    team_rows : of the scaling experiment
    trials : of the search for scenes where CoCap gains most
    giving : the table of drones that give way
    example : the encounter that is drawn
    missing : number of scenes and seeds that are not computed yet
    figures : names of the figures beside the page
    """

    rows: Sequence[GapRow]
    trials: Sequence[Trial]
    team_rows: Sequence[GapRow] = ()
    giving: Table | None = None
    example: Encounter | None = None
    missing: int = 0
    figures: Collection[str] = ()

    def summary(self) -> list[str]:
        """Returns the answers in brief."""
        scenes = SceneAnswers.all_of(self.rows)
        better = [scene.against_sequential().verdict for scene in scenes].count(HOLDS)
        near = [scene.closeness().verdict for scene in scenes].count(HOLDS)
        tree, rounds, orders, beside, search = (
            self._added(contrast)
            for contrast in (
                ablation.TREE_ALONE, ablation.ROUNDS, ablation.ORDERS, ablation.TREE,
                ablation.SEARCH,
            )
        )  # fmt: skip
        return [
            f"CoCap outperforms sequential planning on {better} of {len(scenes)} scenes, and comes "
            f"within 1 % of planning without collisions on {near}.",
            f"Over all scenes it gains {tree} of the bound over sequential planning; rounds of "
            f"best responses gain {rounds}, the best of ten orders {orders}.",
            f"Its tree adds {beside} to rounds, neighbourhood search {search}.",
            *self._stopped_runs(),
        ]

    def _stopped_runs(self) -> list[str]:
        """States how many of CoCap's runs a limit stopped, if any."""
        runs = sum(row.planner == "cocap" for row in self.rows)
        found = [
            StoppedRuns.of(of_scene, "cocap")
            for of_scene in GapRow.grouped(self.rows, "scene").values()
        ]
        late, fallen = (sum(len(stopped[k]) for stopped in found) for k in (0, 1))
        if not late:
            return []
        return [
            f"A limit stopped its tree in {late} of {runs} runs; in "
            f"{'all' if fallen == late else fallen} of these its plan is that of sequential "
            "planning. The means above count these runs; the sentences on each scene list them "
            "separately."
        ]

    def _added(self, contrast: ablation.Contrast) -> str:
        found = ablation.Effect.over_all(self.rows, contrast).mean
        return found.text(2, " %") if found else NONE

    def verdict(self) -> dict[str, list[str]]:
        """Returns the sentences for CoCap, against CoCap, and on claims that are left open."""
        sides: dict[str, list[str]] = {title: [] for title in _SIDES.values()}
        for answer in self._claims():
            sides[_SIDES[answer.verdict]].append(answer.words)
        return sides

    def _claims(self) -> list[ClaimAnswer]:
        scenes = SceneAnswers.all_of(self.rows)
        return [
            *(scene.against_sequential() for scene in scenes),
            *(scene.closeness() for scene in scenes),
            *(scene.stopped() for scene in scenes),
            *(ablation.Effect.over_all(self.rows, contrast).answer() for contrast in _OF_THE_TREE),
            *(scene.kept_by_view_search() for scene in scenes),
            *(scene.times() for scene in scenes),
        ]

    def questions(self) -> dict[str, list[str]]:
        """Returns the answers to further questions, in sentences."""
        scenes = SceneAnswers.all_of(self.rows)
        effects = [ablation.Effect.over_all(self.rows, contrast) for contrast in ablation.CONTRASTS]
        return {
            "What do collisions cost at all?": [scene.price() for scene in scenes],
            "When does sequential planning fail?": [s.sequential_failures() for s in scenes],
            "What do others gain over sequential planning?": [
                scene.against_sequential(name, name).words
                for scene in scenes
                for name in ("sequential-rounds", "cocap-lns")
            ],
            "What does each part add?": [effect.answer().words for effect in effects],
            "How many views does view search need?": [scene.views() for scene in scenes],
            "How many cameras see people?": [scene.cameras() for scene in scenes],
            f"When does CoCap gain {conditions.PUBLISHED:g} %?": (
                conditions.sentences(self.trials) if self.trials else ["There was no search."]
            ),
        }

    def text(self) -> str:
        """Returns the page in Markdown."""
        parts = ["# The CoCap paper, reproduced and answered\n"]
        if self.missing:
            words = f"{self.missing} of the scenes and seeds are not computed yet."
            parts.append(f"**Unfinished: {words}**\n")
        parts.append(_listed("In short", self.summary()))
        parts += [_listed(title, said) for title, said in self.verdict().items()]
        parts += [_listed(question, said) for question, said in self.questions().items()]
        return "\n".join([*parts, *self._measured(), *self._others()])

    def _measured(self) -> list[str]:
        """Returns the tables of the scenes."""
        scenes = SceneAnswers.all_of(self.rows)
        comparison = [row for answers in scenes for row in answers.comparison()]
        tables = {
            "Planners": comparison,
            "Price of collision avoidance": [scene.price_row() for scene in scenes],
            CAMERAS: Tables.of(self.rows).get(CAMERAS, []),
            "What each part adds": ablation.table(self.rows),
            "Where CoCap gains, by parameter": conditions.by_level(self.trials),
        }
        return [
            *(f"![{words}]({name})\n" for name, words in _FIGURES.items() if name in self.figures),
            Tables({title: table for title, table in tables.items() if table}).markdown(),
            f"Published seconds: {SOURCE}, for its corridor of 8 steps on the authors' machine; "
            "its rewards are for scenes that were not published. Intervals: 95 %, bootstrap over "
            "seeds. Seconds: time of the search, as CPU time if it is below ten seconds, excluding "
            "coverage except for planners that evaluate views one by one. cocap-polished: CoCap's "
            "plan after rounds; cocap-vs-dive: cocap-vs with gamma 1.\n",
        ]

    def _others(self) -> list[str]:
        """Returns the table of drones that give way, and the scaling experiment."""
        parts = []
        if self.giving:
            parts += [Tables({"Who gives way": self.giving}).markdown(), _story(self.example)]
        if self.team_rows:
            limit = max(GapRow.values(self.team_rows, "time_limit"), default=0.0)
            said = [answers.scaling(limit) for answers in SceneAnswers.all_of(self.team_rows)]
            parts.append("## Scaling\n\n![Time and reward against team size](scaling.png)\n")
            parts.append("".join(f"- {words}\n" for words in said))
            parts.append(Tables({"Team sizes": Tables.of(self.team_rows)["Planners"]}).markdown())
        return parts


def _listed(title: str, sentences: Sequence[str]) -> str:
    words = "".join(f"- {words}\n" for words in sentences) or "- Nothing.\n"
    return f"## {title}\n\n{words}"


def _story(example: Encounter | None) -> str:
    """Returns sentences on the encounter in which a drone gives up most."""
    if example is None:
        return "No earlier drone gave up any of its own reward in these scenes.\n"
    i, k = example.robots
    return (
        f"Seed {example.seed}: drones {i} and {k} would collide at step {example.step}. With CoCap "
        f"drone {i}, which is planned first, gives way and has "
        f"{100 * example.given_up[0]:.2f} % less of its own reward, drone {k} "
        f"{100 * example.given_up[1]:.2f} % less; J of the team is {example.team:,.1f}.\n\n"
        "![The encounter in three plans](giving-way.png)\n"
    )
