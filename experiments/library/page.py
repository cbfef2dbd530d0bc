"""A page of an instance in one HTML file: records, curve of J and bound, player, how to cite."""

import base64
import math
from collections.abc import Sequence
from datetime import date
from html import escape

from matplotlib.figure import Figure

from cocap_opt.experiments.library.judge import BOUND, PLAN
from cocap_opt.experiments.library.records import Library, Record, Standing
from cocap_opt.experiments.library.tables import history_rows
from cocap_opt.files.documents import PlanFile, decode_document
from cocap_opt.pictures.figures import picture
from cocap_opt.pictures.style import BLUE, RED, SMALL, add_legend, new_figure, set_frame
from cocap_opt.player.player import Player
from cocap_opt.problem import Problem

_HEAD = """<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>{title}</title>
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: auto; padding: 1rem }}
table {{ border-collapse: collapse }} td, th {{ padding: .2rem .8rem .2rem 0; text-align: left }}
td.n {{ text-align: right }} code {{ overflow-wrap: anywhere }}
iframe {{ width: 100%; height: 44rem; border: 1px solid #ccc }} img {{ max-width: 100% }}
</style></head><body>
"""


def page(library: Library, standing: Standing, problem: Problem) -> bytes:
    """Returns the page of an instance, which needs no network and no other file."""
    name, records = standing.entry.name, library.records(standing.entry.name)
    parts = [
        _HEAD.format(title=escape(name)), f"<h1>{escape(name)}</h1>", _facts(standing),
        "<h2>Records</h2>", _table(records),
    ]  # fmt: skip
    if records:
        drawn = base64.b64encode(picture(curve(records), ".svg")).decode()
        alt = "Best J and best bound by date; they meet where the instance is solved."
        parts.append(f'<img alt="{alt}" src="data:image/svg+xml;base64,{drawn}">')
    if standing.plan is not None:
        file = decode_document(library.content(standing.plan), standing.plan.file, PlanFile)
        player = Player(problem, [(name, file.plan)], planners=[file.planner]).page()
        parts += [
            "<h2>Best plan</h2>",
            f'<iframe title="player" srcdoc="{escape(player)}"></iframe>',
        ]
    parts += ["<h2>How to cite</h2>", f"<p>{escape(citation(library, standing))}</p>"]
    return "\n".join([*parts, "</body></html>\n"]).encode()


def citation(library: Library, standing: Standing) -> str:
    """Returns the words that cite an instance: version of the library, digest of the scene."""
    digest = "-" if standing.digest is None else standing.digest.digest[:16]
    words = f"The cocap-opt library, version {library.version}, instance {standing.entry.name}"
    told = [
        f"{noun} by {record.who} ({record.program}, {record.date})"
        for noun, record in (("plan", standing.plan), ("bound", standing.bound))
        if record is not None
    ]
    source = standing.entry.family.source
    made = f" The scene is of {source}: cite that, too." if source else ""
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
            if record.kind == kind and record.value >= 0  # a bound below 0: there is no plan
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
    facts = {"for": standing.entry.split, "state": standing.state, "made of": standing.entry.recipe}
    if math.isfinite(standing.gap):
        facts["gap"] = "0" if standing.state == "solved" else f"{100 * standing.gap:.4f} %"
    if size is not None:
        facts |= {
            "size": f"{size.drones} drones, {size.people} people, {size.steps} steps",
            "scene digest": size.digest,
            "SHA-256 of the instance": size.sha256,
        }
    if family.source:
        facts |= {"files": family.source, "licence": family.licence}
    rows = "".join(
        f"<tr><th>{escape(k)}</th><td><code>{escape(v)}</code></td></tr>" for k, v in facts.items()
    )
    return f"<table>{rows}</table>"


def _table(records: Sequence[Record]) -> str:
    rows = history_rows(records)
    if not rows:
        return "<p>There are none yet.</p>"
    head = "".join(f"<th>{escape(key)}</th>" for key in rows[0])
    lines = ["".join(_cell(value) for value in row.values()) for row in rows]
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return f"<table><tr>{head}</tr>{body}</table>"


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f'<td class="n">{value:,.6f}</td>'
    return f"<td>{escape('-' if value is None else str(value))}</td>"
