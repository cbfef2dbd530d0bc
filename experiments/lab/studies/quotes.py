"""Quotes of the stored results for pages: a name for each number, sentence and table.

Pages have marks, which readers do not see, and `docs/write.py` writes these quotes between them, so
no number is written by hand.
"""

from collections.abc import Callable, Iterable
from functools import cache, partial
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.experiments.lab.results import STORED
from cocap_opt.experiments.lab.studies.audit import audits_in_markdown, audits_in_words
from cocap_opt.experiments.lab.studies.browser.browser import browser_in_markdown, size_in_words
from cocap_opt.experiments.lab.studies.cameras import (
    cost_in_markdown,
    directions_in_words,
    proofs_in_markdown,
)
from cocap_opt.experiments.lab.studies.coverage.coverage import coverage_in_markdown
from cocap_opt.experiments.lab.studies.flight.flight import stored_flights
from cocap_opt.experiments.lab.studies.flight.tables import flights_in_markdown, sentences
from cocap_opt.experiments.lab.studies.gamma import chosen_in_words, gammas_in_markdown
from cocap_opt.experiments.lab.studies.growth.growth import growth_in_markdown
from cocap_opt.experiments.lab.studies.lazy import lazy_in_markdown
from cocap_opt.experiments.lab.studies.others.others import (
    findings_in_markdown,
    published_in_markdown,
    start_sets_in_markdown,
)
from cocap_opt.experiments.lab.studies.paper.answers import lines
from cocap_opt.experiments.lab.studies.paper.claims import claims_table
from cocap_opt.experiments.lab.studies.paper.conditions import PUBLISHED, read_trials
from cocap_opt.experiments.lab.studies.paper.measured import read_rows
from cocap_opt.experiments.lab.studies.paper.page import Page
from cocap_opt.experiments.lab.studies.paper.planner_table import (
    described_planners_in_markdown,
    measured_planners_in_markdown,
    numbers_in_markdown,
    short_planners_in_markdown,
)
from cocap_opt.experiments.lab.studies.paper.reproduction import SCENES
from cocap_opt.experiments.lab.studies.quality.quality import stored_accuracy, stored_agreement
from cocap_opt.experiments.lab.studies.releases import releases_in_markdown
from cocap_opt.experiments.lab.studies.separation.points import SeparationPoint
from cocap_opt.experiments.lab.studies.separation.tables import separation_in_markdown
from cocap_opt.experiments.lab.studies.solvers.table import solvers_in_markdown
from cocap_opt.experiments.lab.studies.speed import gain_in_words, speed_in_markdown
from cocap_opt.experiments.lab.studies.starts import starts_in_markdown
from cocap_opt.experiments.lab.studies.tripods.tripods import (
    tripods_in_markdown,
    tripods_in_words,
)
from cocap_opt.experiments.lab.studies.verified import verified_in_markdown
from cocap_opt.experiments.lab.studies.views import views_in_markdown
from cocap_opt.experiments.lab.studies.which import (
    proved_in_words,
    views_saved_in_words,
    which_bound_in_markdown,
    which_planner_in_markdown,
)
from cocap_opt.experiments.library.tables import library_in_markdown, library_in_words
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.files.documents import FileError
from cocap_opt.output.printing import markdown_table, print_texts
from cocap_opt.planners import RECOMMENDED
from cocap_opt.text import counted


@cache
def _paper() -> Page:
    rows, trials = STORED / "paper.csv", STORED / "paper-conditions.csv"
    return Page(read_rows(rows), read_trials(trials))


def _listed(said: Iterable[str]) -> str:
    return "".join(f"- {sentence}\n" for sentence in said)


def _claims() -> str:
    return markdown_table(claims_table(_paper().rows, _paper().trials))


def _side(title: str) -> str:
    """Returns the sentences for CoCap, against CoCap, or on claims left open."""
    return _listed(_paper().verdict()[title])


def _answers(question: str) -> str:
    return _listed(_paper().questions()[question])


def _settings() -> str:
    """States the number of seeds, and the limits of plans and bounds."""
    rows = _paper().rows
    plans, bounds = (max(GapRow.values(rows, name)) for name in ("time_limit", "bound_time_limit"))
    return (
        f"{counted(len({row.seed for row in rows}), 'seed')} of each scene, with limits of "
        f"{plans:g} s for plans and {bounds:g} s for bounds"
    )


def _gap(scene: str, planner: str) -> str:
    """Returns the mean gap of a planner in a scene, in %."""
    of_planner = [row for row in _paper().rows if (row.scene, row.planner) == (scene, planner)]
    gaps = GapRow.percent([row for row in of_planner if row.valid], "gap")
    return f"{sum(gaps) / len(gaps):.2f} %"


QUOTES: dict[str, Callable[[], str]] = {
    "planners_described": described_planners_in_markdown,
    "planners_measured": measured_planners_in_markdown,
    "planners_in_short": short_planners_in_markdown,
    "numbers_in_short": numbers_in_markdown,
    "separation": lambda: separation_in_markdown(SeparationPoint.read(STORED / "separation.csv")),
    "flights": lambda: flights_in_markdown(stored_flights()),
    "flights_in_sentences": lambda: _listed(sentences(stored_flights())),
    "gammas": gammas_in_markdown,
    "gamma_chosen": chosen_in_words,
    "lazy": lazy_in_markdown,
    "library": library_in_markdown,
    "library_in_words": library_in_words,
    "greedy_perspectives": start_sets_in_markdown,
    "greedy_perspectives_plans": partial(published_in_markdown, "greedy-perspectives-plans.csv"),
    "hughes_plans": partial(published_in_markdown, "hughes-plans.csv"),
    "hughes_findings": partial(findings_in_markdown, "hughes.md"),
    "audits": audits_in_markdown,
    "audits_in_words": audits_in_words,
    "coverage": coverage_in_markdown,
    "growth": growth_in_markdown,
    "starts": starts_in_markdown,
    "tripods": tripods_in_markdown,
    "tripods_in_words": tripods_in_words,
    "verified": verified_in_markdown,
    "which_planner": which_planner_in_markdown,
    "which_bound": which_bound_in_markdown,
    "proved": proved_in_words,
    "views_saved": views_saved_in_words,
    "views": views_in_markdown,
    "solver_figures": solvers_in_markdown,
    "releases": releases_in_markdown,
    "speed": speed_in_markdown,
    "compiled_gain": gain_in_words,
    "browser_speed": browser_in_markdown,
    "python_size": size_in_words,
    "cameras_cost": cost_in_markdown,
    "cameras_proofs": proofs_in_markdown,
    "cameras_directions": directions_in_words,
    "quality_accuracy": stored_accuracy,
    "quality_objective": stored_agreement,
    "paper_claims": _claims,
    "paper_in_short": lambda: _listed(_paper().summary()),
    "paper_verdict": lambda: _paper().summary()[0],
    "paper_settings": _settings,
    "paper_lines": lines,
    "paper_for": partial(_side, "For CoCap"),
    "paper_against": partial(_side, "Against it"),
    "paper_left_open": partial(_side, "Inconclusive"),
    "paper_prices": partial(_answers, "What do collisions cost at all?"),
    "paper_cameras": partial(_answers, "How many cameras see people?"),
    "paper_parts": partial(_answers, "What does each part add?"),
    "paper_conditions": partial(_answers, f"When does CoCap gain {PUBLISHED:g} %?"),
    **{
        f"gap_{planner}_{scene}".replace("-", "_"): partial(_gap, scene, planner)
        for planner in ("sequential", "cocap", RECOMMENDED)
        for scene in SCENES
    },
}


def quote(
    name: Annotated[str | None, Parameter(help="name of a quote; default: list all names")] = None,
    /,
) -> None:
    """Prints the Markdown of a name, or all names."""
    if name is not None and name not in QUOTES:
        raise FileError(f"quote: must be one of {', '.join(QUOTES)}, not {name!r}")
    print_texts(["\n".join(QUOTES) if name is None else QUOTES[name]().strip()], [])
