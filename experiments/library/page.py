"""The page of an instance, one HTML file: records, J and bound over time, player, citation."""

import base64
import math
from collections.abc import Sequence
from datetime import date
from html import escape

from matplotlib.figure import Figure

from cocap_opt.experiments.library.judge import BOUND, PLAN
from cocap_opt.experiments.library.records import Library, Record, Standing
from cocap_opt.experiments.report.explaining import explanation
from cocap_opt.experiments.tables.tables import html_table
from cocap_opt.files.documents import PlanFile, decode_document
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.formulations.explanation import Explanation
from cocap_opt.output.told_bounds import told_bound
from cocap_opt.pictures.figures import picture
from cocap_opt.pictures.style import BLUE, RED, SMALL, add_legend, new_figure, set_frame
from cocap_opt.player.pages import page_text
from cocap_opt.player.player import Player
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.text import counted, rounded_up

_STATES = {
    "solved": "solved: no plan is better than the best one here",
    "open": "open: there may be a better plan or a lower bound",
    "none": "no plan or no bound yet",
}
_USES = {"train": "training: tune planners on it", "test": "tests: report results on it"}


def page(library: Library, standing: Standing, problem: Problem) -> bytes:
    """Returns the page of an instance; it needs no network and no other file."""
    name, records = standing.entry.name, library.records(standing.entry.name)
    sections = {
        "Instance": _facts(standing),
        "Records": _records(records),
        "Best plan": _best_plan(library, standing, problem),
        "How to cite": f"<p>{escape(citation(library, standing))}</p>",
    }
    shown = {title: text for title, text in sections.items() if text}
    parts = {
        "style": page_text("report.css"),
        "title": f"Instance {escape(name)} of the cocap-opt library",
        "about": escape(_about(standing)),
        "contents": "\n".join(f'<a href="#{_anchor(title)}">{title}</a>' for title in shown),
        "sections": "\n".join(
            f'<section id="{_anchor(title)}">\n<h2>{title}</h2>\n{text}\n</section>'
            for title, text in shown.items()
        ),
    }
    return page_text("report.html", parts).encode()


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def _about(standing: Standing) -> str:
    """Returns the size of an instance, and whether it is solved."""
    size, of = standing.digest, ""
    if size is not None:
        people = f"{size.people} {'person' if size.people == 1 else 'people'}"
        steps = counted(size.steps, "step")
        of = f"{counted(size.drones, 'drone')}, {people}, {steps}; "
    if standing.has_no_plan:
        return f"{of}solved: no plan exists"
    return of + _STATES[standing.state]


def _best_plan(library: Library, standing: Standing, problem: Problem) -> str:
    """Returns the player of the best plan; an empty string if there is no plan."""
    if standing.plan is None:
        return ""
    file, name = (
        decode_document(library.content(standing.plan), standing.plan.file, PlanFile),
        standing.entry.name,
    )
    gap = _gap(library, standing, problem, file.plan)
    player = Player(problem, [(name, file.plan)], [gap], [file.planner]).page()
    return (
        f'<iframe class="player" title="best plan of {escape(name)}" srcdoc="{escape(player)}">'
        "</iframe>"
    )


def _gap(library: Library, standing: Standing, problem: Problem, plan: Plan) -> Explanation | None:
    """Explains the gap of the best plan to the best bound; None if there is no bound."""
    if standing.bound is None:
        return None
    content, name = library.content(standing.bound), standing.bound.file
    file = decode_document(content, name, CertificateFile, ProofFile)
    assert isinstance(file, CertificateFile | ProofFile)
    return explanation(problem, plan, check(problem, plan).reward, file)


def citation(library: Library, standing: Standing) -> str:
    """Returns a citation of an instance, with the library's version and the scene's digest."""
    digest = "-" if standing.digest is None else standing.digest.digest[:16]
    words = f"The cocap-opt library, version {library.version}, instance {standing.entry.name}"
    told = [
        f"{noun} by {record.who} ({record.program}, {record.date})"
        for noun, record in (("plan", standing.plan), ("bound", standing.bound))
        if record is not None
    ]
    source = standing.entry.family.source
    made = f" The scene is from {source}: cite that, too." if source else ""
    return f"{words}, scene digest {digest}; {'; '.join(told)}.{made}"


def curve(records: Sequence[Record]) -> Figure:
    """Draws best J and best bound against the date of each record."""
    figure = new_figure(7.5, 3.2)
    ax = set_frame(figure.add_subplot())
    days = [date.fromisoformat(record.date).toordinal() for record in records]
    for kind, colour, label in ((BOUND, RED, "bound"), (PLAN, BLUE, "J")):
        of_kind = [
            (day, record.value)
            for day, record in zip(days, records, strict=True)
            if record.kind == kind and record.value >= 0  # a bound below 0 means: no plan exists
        ]
        if of_kind:
            when, values = zip(*of_kind, strict=True)
            ax.step([*when, max(days)], [*values, values[-1]], where="post", color=colour)
            ax.plot(when, values, "o", ms=5, color=colour, label=label)
    ends = sorted({min(days), max(days)})
    ax.set_xlim(ends[0] - 1, ends[-1] + 1)
    ax.set_xticks(ends, [date.fromordinal(day).isoformat() for day in ends], fontsize=SMALL)
    ax.set_ylabel("J and bound")
    ax.yaxis.set_major_formatter("{x:,.6g}")
    add_legend(figure, ax)
    return figure


def _facts(standing: Standing) -> str:
    size, family = standing.digest, standing.entry.family
    facts = {"made of": standing.entry.recipe, "meant for": _USES[standing.entry.split]}
    if math.isfinite(standing.gap) and not standing.has_no_plan:
        part = rounded_up(100 * standing.gap, 4)
        facts["gap of the best plan to the best bound"] = (
            "none" if standing.state == "solved" else f"{part} % of the bound"
        )
    if size is not None:
        facts |= {
            "digest of the scene": size.digest, "SHA-256 of the file of the instance": size.sha256,
        }  # fmt: skip
    if family.source:
        facts |= {"files": family.source, "licence": family.licence}
    lines = (f"<dt>{escape(key)}</dt><dd>{escape(words)}</dd>" for key, words in facts.items())
    return f"<dl>{''.join(lines)}</dl>"


def _records(records: Sequence[Record]) -> str:
    """Returns the table of records, and a figure if they have more than one date."""
    best = max((record.value for record in records if record.kind == PLAN), default=None)
    rows = [
        {
            "date": record.date,
            "found": record.kind,
            "J or bound of J": _value(record, best),
            "by": record.who,
            "program": record.program,
            "search (s)": "-" if math.isnan(record.seconds) else f"{record.seconds:,.2f}",
        }
        for record in records
    ]
    if not rows:
        return "<p>There are none yet.</p>"
    words = (
        "The value of a plan is its J (higher is better); the value of a bound is a J that no plan "
        "exceeds (lower is better)."
    )
    found = f"<p>{words}</p>\n{html_table('records', rows)}"
    if len({record.date for record in records}) < 2:
        return found
    drawn = base64.b64encode(picture(curve(records), ".svg")).decode()
    alt = "Best J and best bound by date; they meet where the instance is solved."
    return (
        f'{found}<figure><img alt="{alt}" src="data:image/svg+xml;base64,{drawn}">'
        f"<figcaption>{alt}</figcaption></figure>"
    )


def _value(record: Record, best: float | None) -> str:
    if record.kind == PLAN:
        return f"{record.value:,.2f}"
    return "no plan" if record.value < 0 else told_bound(record.value, best)
