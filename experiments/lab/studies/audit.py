"""Audits of the built-in scenes: how many numbers are compared, and how wide enclosures are."""

import math
from typing import Annotated, NamedTuple

from cyclopts import Parameter

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.results import STORED, Results, load_csv, markdown
from cocap_opt.experiments.lab.studies.options import Out, Scenes, of_extra
from cocap_opt.experiments.lab.studies.runs import processor_seconds
from cocap_opt.formulations.independent import instance_of
from cocap_opt.formulations.independent.audit import NARROW
from cocap_opt.model import compiled
from cocap_opt.output.printing import Listing
from cocap_opt.planners.greedy import greedy
from cocap_opt.run.audited import audited
from cocap_opt.scenarios import SCENES, load_scene
from cocap_opt.text import counted

_TABLE = "audit.csv"
_SEED = 0


class AuditedScene(NamedTuple):
    """The audit of a scene's instance: a row of audit.csv."""

    scene: str
    places: int
    moves: int
    reached: int  # states at steps that count
    enclosed: int  # states among these whose coverage was enclosed
    numbers: int  # their numbers that are not 0 on both sides
    undecided: int  # numbers in enclosures that are too wide
    different: int  # facts and numbers that differ from the scene's
    wide_share: float  # width of the widest other enclosure, as a share of the number
    wide_pixels: float  # width of the widest other enclosure, px/m2
    seconds: float  # CPU time of the audit alone

    @classmethod
    def of(cls, name: str, views: int, whole: int) -> "AuditedScene":
        """Audits the instance of a scene, and the states of its greedy plan.

        Parameters
        ----------
        views : number of states with most pixels, and of random states, to check
        whole : scenes with at most this number of states are checked completely
        """
        problem = load_scene(name, _SEED)
        model = compiled(problem)
        text, plan = instance_of(model), greedy(problem).plan
        plans = [] if plan is None else [plan.paths]
        begin = processor_seconds()
        most = math.inf if model.reachable_views <= whole else views
        audit = audited(problem, text, plans, most, _SEED)
        seconds = processor_seconds() - begin
        assert audit.coverage is not None
        found = audit.coverage
        return cls(
            problem.name, audit.places, audit.moves, audit.reached, found.states, found.numbers,
            found.undecided, len(audit.differences) + len(found.differences), found.wide_share,
            found.wide_pixels, seconds,
        )  # fmt: skip


def audit(
    *,
    scene: Scenes = None,
    views: Annotated[
        int, Parameter(help="number of states with most pixels, and of random ones, to check")
    ] = 20_000,
    whole: Annotated[
        int, Parameter(help="check all states of scenes with up to this many reachable states")
    ] = 400_000,
    out: Out = None,
) -> None:
    """Measures, prints, and writes the table (audit.csv)."""
    results, rows = Results.into(out), list[AuditedScene]()
    with of_extra("audit"):
        for name in scene or SCENES:
            rows.append(AuditedScene.of(name, views, whole))
            results.save(_TABLE, rows)
            say(f"{name}: {counted(rows[-1].numbers, 'number')}, {rows[-1].seconds:.1f} s")
    Listing("audits of instances", [row._asdict() for row in rows]).print()


def _stored() -> list[AuditedScene]:
    return load_csv(STORED / _TABLE, AuditedScene, "audit")


def audits_in_markdown() -> str:
    """Returns the stored audits, with the small scenes in one row."""
    rows = _stored()
    small = [row for row in rows if row.scene.startswith("tiny-")]
    others = [row for row in rows if row not in small]
    return markdown([
        *([_shown(f"{len(small)} tiny ones", small)] if small else []),
        *(_shown(row.scene, [row]) for row in others),
    ])  # fmt: skip


def _shown(name: str, rows: list[AuditedScene]) -> dict[str, str]:
    """Returns a row of the page for some audits together."""
    reached, enclosed, numbers, undecided, different = (
        sum(getattr(row, field) for row in rows)
        for field in ("reached", "enclosed", "numbers", "undecided", "different")
    )
    return {
        "scene": name,
        "reachable states": f"{reached:,}",
        "enclosed": f"{enclosed:,}",
        "numbers": f"{numbers:,}",
        "different": f"{different:,}",
        "undecided": f"{undecided:,}",
        "widest": f"{max(row.wide_share for row in rows):.1g}",
        "widest, px/m2": f"{max(row.wide_pixels for row in rows):.1g}",
        "time": f"{sum(row.seconds for row in rows):.0f} s",
    }


def audits_in_words() -> str:
    """States how many numbers of the stored audits are in enclosures, and how wide these are."""
    rows = _stored()
    numbers, undecided, different = (
        sum(getattr(row, field) for row in rows) for field in ("numbers", "undecided", "different")
    )
    return (
        f"Of {numbers:,} numbers of {len(rows)} scenes, {different} are outside their "
        f"enclosures. The enclosures of {undecided:,} are wider than {NARROW:.0e} of the number, "
        "which leaves these numbers undecided; the widest other enclosure is "
        f"{max(row.wide_pixels for row in rows):.1g} px/m2 wide."
    )
