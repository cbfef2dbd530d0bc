"""The report of a sweep: tables, figures and players in one HTML file that needs no network.

It reads a sweep's folder only, so that it can be made on another machine.
"""

import base64
import math
import shlex
from collections.abc import Sequence
from html import escape
from pathlib import Path

from matplotlib.figure import Figure

from cocap_opt.check import check
from cocap_opt.experiments.report.charts import conflicts_figure, gaps_figure, progress_figure
from cocap_opt.experiments.report.figures import picture
from cocap_opt.experiments.report.limitations import limitations
from cocap_opt.experiments.report.pages import filled, part
from cocap_opt.experiments.report.player import player_page
from cocap_opt.experiments.results.documents import html
from cocap_opt.experiments.results.files import read_plan
from cocap_opt.experiments.results.layout import plan_path, scene_path, trace_path
from cocap_opt.experiments.results.printing import counted
from cocap_opt.experiments.results.rows import Row, obeys
from cocap_opt.experiments.results.tables import all_tables, grouped, is_optimal
from cocap_opt.experiments.results.trace import Trace, load_trace
from cocap_opt.experiments.sweeps.about import RunFile
from cocap_opt.experiments.sweeps.cells import FAILED
from cocap_opt.files.documents import FileError
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Problem
from cocap_opt.scenarios import load_scene


def report_page(folder: Path, rows: Sequence[Row], run: RunFile, against: str, players: int) -> str:
    """The text of the HTML file.

    Parameters
    ----------
    folder : of a sweep, for what is beside its results
    rows : its results, at least one
    against : the planner that others are compared with
    players : of so many scenes at most plans are shown

    Raises
    ------
    FileError
        If files in the folder are damaged or of another run.
    """
    sections = {
        "Results": _results(rows, run, against),
        "Search for the bounds": _searches(folder, rows),
        "Plans": _plans(folder, rows, players),
        "What failed": _failures(rows),
        "Limitations": _list([*limitations(rows, run), *_absent(folder, rows)]),
        "How it was made": _settings(run),
    }
    shown = {title: text for title, text in sections.items() if text}
    parts = {
        "style": part("report.css"),
        "about": escape(_about(rows)),
        "contents": "\n".join(
            f'<a href="#{_anchor(title)}">{title}</a>' for title in shown
        ),
        "sections": "\n".join(
            f'<section id="{_anchor(title)}">\n<h2>{title}</h2>\n{text}\n</section>'
            for title, text in shown.items()
        ),
    }  # fmt: skip
    return filled("report.html", parts)


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def _about(rows: Sequence[Row]) -> str:
    """How much of what, in a line."""
    planners = dict.fromkeys(row["planner"] for row in rows)
    scenes = ", ".join(
        f"{scene} ({counted(len({row['seed'] for row in some}), 'seed')})"
        for (scene,), some in grouped(rows, "scene").items()
    )
    return f"{scenes}; {', '.join(planners)}"


# -- results ------------------------------------------------------------------------------


def _results(rows: Sequence[Row], run: RunFile, against: str) -> str:
    gaps = _image(
        gaps_figure(rows),
        "Gap of each plan to the best certified bound of its scene and seed: a point per seed, "
        "their mean and its 95 % interval. Plans that break a rule have no gap.",
    )
    return gaps + html(all_tables(rows, run.settings.limit, against), level=3)


def _searches(folder: Path, rows: Sequence[Row]) -> str:
    """How the bounds were found over time, a figure per scene."""
    parts = []
    for (scene,), some in grouped(rows, "scene").items():
        traces = {}
        for row in {row["seed"]: row for row in some}.values():
            if (trace := _trace(folder, row)) is not None:
                traces[f"seed {row['seed']}"] = trace
        if traces:
            words = (
                f"{scene}: gap between the best plan and the best bound while the search for the "
                "bound runs. A ring: proved optimal."
            )
            parts.append(_image(progress_figure(traces), words))
    return "".join(parts)


def _trace(folder: Path, row: Row) -> Trace | None:
    """Of the bound under the rules; where the one without rules has settled both, of that."""
    paths = (folder / trace_path(row, free) for free in (False, True))
    traces = [load_trace(path) for path in paths if path.is_file()]
    searched = [trace for trace in traces if len(trace.snapshots) > 1]
    return next(iter(searched or traces), None)


# -- plans --------------------------------------------------------------------------------


def _plans(folder: Path, rows: Sequence[Row], most: int) -> str:
    """Of some scenes, the plans of the seed that shows most, with a player."""
    scenes = [
        some
        for (_,), some in grouped(rows, "scene").items()
        if (folder / scene_path(some[0])).is_file()
    ]
    return "\n".join(_scene_plans(folder, some) for some in scenes[:most])


def _scene_plans(folder: Path, rows: Sequence[Row]) -> str:
    seed, some = telling_seed(rows)
    problem = load_scene(str(folder / scene_path(some[0])), 0)
    shown = telling_pair(some)
    if not shown:
        return ""
    plans = {row["planner"]: _plan(folder, row, problem) for row in shown}
    player = escape(player_page(problem, list(plans.items())))
    name = escape(problem.name if seed is None else f"{problem.name}, seed {seed}")
    charts = _image(conflicts_figure(problem, plans), f"{name}: who collides with whom, and when.")
    return (
        f"<h3>{name}</h3>\n<p>{escape(_story(shown))}</p>\n"
        f'<iframe class="player" loading="lazy" title="plans of {name}" srcdoc="{player}">'
        f"</iframe>\n{charts}"
    )


def telling_seed(rows: Sequence[Row]) -> tuple[int | None, list[Row]]:
    """The seed of a scene on which most conflicts have to be avoided, with its rows.

    Among those with as many conflicts, that on which the plans' rewards differ most. A seed with
    two plans comes before all with one.
    """

    def told(some: Sequence[Row]) -> tuple[bool, int, float]:
        rewards = [row["reward"] for row in some if obeys(row)]
        apart = max(rewards) - min(rewards) if rewards else -1.0
        plans = sum(_has_plan(row) for row in some)
        return plans > 1, max((row["conflicts"] or 0) for row in some), apart

    seeds = {row["seed"]: [r for r in rows if r["seed"] == row["seed"]] for row in rows}
    return max(seeds.items(), key=lambda item: told(item[1]))


def telling_pair(rows: Sequence[Row]) -> list[Row]:
    """One or two plans of a seed: that with most conflicts, or the worst; and the best."""
    good = sorted((row for row in rows if obeys(row)), key=lambda row: float(row["reward"]))
    colliding = [row for row in rows if _has_plan(row) and not obeys(row)]
    if colliding:
        return [max(colliding, key=lambda row: int(row["conflicts"])), *good[-1:]]
    return [good[0], good[-1]] if len(good) > 1 else good


def _has_plan(row: Row) -> bool:
    return row["reward"] is not None


def _plan(folder: Path, row: Row, problem: Problem) -> Plan:
    """The plan of a row; its reward must be the row's."""
    path = folder / plan_path(row)
    _, plan = read_plan(path, str(folder / scene_path(row)), problem)
    reward = check(problem, plan).reward
    if not math.isclose(reward, row["reward"], rel_tol=1e-9, abs_tol=1e-9):
        words = f"has J = {reward:,.2f}, results.csv says {row['reward']:,.2f}"
        raise FileError(f"{path}: is of another run: it {words}")
    return plan


def _story(rows: Sequence[Row]) -> str:
    """What is to be seen, in a sentence or two."""
    parts = []
    for row in rows:
        if not obeys(row):
            parts.append(f"{row['planner']} has {counted(row['conflicts'], 'conflict')}")
        elif row["gap"] is None:
            parts.append(f"{row['planner']} obeys the rules")
        else:
            gap = "is proved optimal" if is_optimal(row) else _below(row)
            parts.append(f"{row['planner']} obeys the rules and {gap}")
    return f"{'; '.join(parts)}."


def _below(row: Row) -> str:
    return f"is {100 * row['gap']:.3f} % below the best certified bound"


# -- the rest -----------------------------------------------------------------------------


def _failures(rows: Sequence[Row]) -> str:
    """What was to be computed and could not be."""
    failed = [
        {"scene": row["scene"], "seed": str(row["seed"]), "what": what, "reason": reason,
         "message": message}
        for row in rows
        for what, reason, message in (
            (row["planner"], row["reason"], row["message"]),
            ("bound", row["bound_reason"], "so this seed has no bound of its own"),
        )
        if reason in FAILED
    ]  # fmt: skip
    once = list({tuple(row.items()): row for row in failed}.values())
    return html({"Cells": once}, level=3) if once else ""


def _absent(folder: Path, rows: Sequence[Row]) -> list[str]:
    """What ought to be in the folder and is not."""
    first = {(row["scene"], row["seed"]): row for row in rows}.values()
    named = {row[key] for row in first for key in ("certificate", "certificate_free") if row[key]}
    certificates = sum(not (folder / name).is_file() for name in named)
    scenes = sum(not (folder / scene_path(row)).is_file() for row in first)
    sentences = []
    if certificates:
        sentences.append(f"{certificates} of {len(named)} certificates are not in the folder.")
    if scenes:
        sentences.append(f"{scenes} of {len(first)} scene files are not in the folder.")
    return sentences


def _settings(run: RunFile) -> str:
    facts = [
        ("limit of each plan", f"{run.settings.limit:g} s"),
        ("limit of each bound", f"{run.settings.bound_limit:g} s"),
        ("digest of the code", run.code[:16]),
    ]
    for one in run.runs:
        own = {
            "command": shlex.join(one.command),
            "begun (UTC)": one.began,
            "computed by": one.workers,
            **one.machine,
            "packages": ", ".join(f"{name} {number}" for name, number in one.packages.items()),
        }
        facts += [(key, text) for key, text in own.items() if (key, text) not in facts]
    lines = (f"<dt>{escape(key)}</dt><dd>{escape(text)}</dd>" for key, text in facts)
    return f"<dl>{''.join(lines)}</dl>"


def _list(sentences: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(words)}</li>' for words in sentences)}</ul>"


def _image(figure: Figure, words: str) -> str:
    """A figure with its caption."""
    content = base64.b64encode(picture(figure, ".svg")).decode()
    return (
        f'<figure><img alt="{escape(words, quote=True)}" '
        f'src="data:image/svg+xml;base64,{content}"><figcaption>{escape(words)}</figcaption>'
        "</figure>\n"
    )
