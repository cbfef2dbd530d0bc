"""The report of a sweep: tables, figures and players in one HTML file that needs no network.

It needs only the files in the sweep's folder, so it can be made on any machine.
"""

import base64
import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path

from matplotlib.figure import Figure

from cocap_opt.experiments.report.charts import (
    conflicts_figure,
    gaps_figure,
    losses_figure,
    progress_figure,
)
from cocap_opt.experiments.report.explaining import (
    explained_plans,
    parts_table,
    worth_telling,
)
from cocap_opt.experiments.report.limitations import limitations
from cocap_opt.experiments.report.profiles import profiles_figure
from cocap_opt.experiments.sweeps.cells import FAILED
from cocap_opt.experiments.sweeps.results import RunFile
from cocap_opt.experiments.tables.comparison import profiles
from cocap_opt.experiments.tables.comparison_tables import comparison_tables, too_few_scenes
from cocap_opt.experiments.tables.layout import Paths
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.experiments.tables.tables import Tables
from cocap_opt.files.documents import FileError
from cocap_opt.output.files import PlanReader
from cocap_opt.output.trace import Trace
from cocap_opt.pictures.figures import picture
from cocap_opt.player.pages import page_text
from cocap_opt.player.player import Player
from cocap_opt.problem import CollisionRules, Plan, Problem
from cocap_opt.referee import check
from cocap_opt.run.explained import SHOWN, Explained, is_too_large
from cocap_opt.run.explained_words import costliest
from cocap_opt.scenarios import load_scene
from cocap_opt.text import counted, printable

_TOO_LARGE = (
    "The scene has too many states to explain its gaps on a page; run "
    "<code>cocap-opt verify SCENE PLAN CERTIFICATE --explain</code>."
)


def report_page(
    folder: Path, rows: Sequence[GapRow], run: RunFile, against: str, players: int
) -> str:
    """Returns the text of the HTML file.

    Parameters
    ----------
    folder : the sweep's folder, for scenes, plans, certificates and traces
    rows : rows of its results, at least one
    against : the planner that others are compared with
    players : largest number of scenes with a player of their plans

    Raises
    ------
    FileError
        If files in the folder are damaged or belong to another run; one line.
    """
    sections = {
        "Results": _results(rows, against),
        "Planners compared": _comparison(rows),
        "Search for the bounds": _searches(folder, rows),
        "Plans": _plans(folder, rows, players),
        "What failed": _failures(rows),
        "Limitations": _list(
            [*limitations(rows, run, _rules(folder, rows)), *_absent(folder, rows)]
        ),
        "How it was made": _settings(rows, run),
    }
    shown = {title: text for title, text in sections.items() if text}
    parts = {
        "style": page_text("report.css"),
        "title": "Planners and bounds compared",
        "about": _escaped(_about(rows)),
        "contents": "\n".join(
            f'<a href="#{_anchor(title)}">{title}</a>' for title in shown
        ),
        "sections": "\n".join(
            f'<section id="{_anchor(title)}">\n<h2>{title}</h2>\n{text}\n</section>'
            for title, text in shown.items()
        ),
    }  # fmt: skip
    return page_text("report.html", parts)


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def _about(rows: Sequence[GapRow]) -> str:
    """Returns the scenes with their numbers of seeds, and the planners, in one line."""
    planners = dict.fromkeys(row.planner or "" for row in rows)
    scenes = ", ".join(
        f"{scene} ({counted(len({row.seed for row in group}), 'seed')})"
        for (scene,), group in GapRow.grouped(rows, "scene").items()
    )
    return f"{scenes}; {', '.join(planners)}"


# -- results ------------------------------------------------------------------------------


def _results(rows: Sequence[GapRow], against: str) -> str:
    gaps = _image(
        gaps_figure(rows),
        "Gap of each plan to the best certified bound of its scene and seed: a stroke per seed, "
        "the mean, and its 95 % interval. Plans that break a rule have no gap.",
    )
    return gaps + Tables.of(rows, against).html(level=3)


def _comparison(rows: Sequence[GapRow]) -> str:
    """Returns profiles and paired tests; nothing if there is only one planner or one scene."""
    drawn = profiles(rows)
    if len({row.planner for row in rows}) < 2 or len({row.scene for row in rows}) < 2 or not drawn:
        return ""
    figure = _image(
        profiles_figure(drawn),
        "Share of scenes on which a planner is within a factor of the best planner, for J and for "
        "time. A plan that breaks a rule never counts.",
    )
    words = too_few_scenes(rows)
    note = f"<p>{_escaped(words)}.</p>\n" if words else ""
    return figure + note + comparison_tables(rows).html(level=3)


def _searches(folder: Path, rows: Sequence[GapRow]) -> str:
    """Returns figures of the gap over time in the search for the bounds, one per scene."""
    parts = []
    for (scene,), group in GapRow.grouped(rows, "scene").items():
        traces = {}
        for row in {row.seed: row for row in group}.values():
            if (trace := _trace(folder, row)) is not None:
                traces[f"seed {row.seed}"] = trace
        if traces:
            words = (
                f"{scene}: gap between the best plan and the best bound during the search for the "
                "bound. Ring: proved optimal."
            )
            parts.append(_image(progress_figure(traces), words))
    return "".join(parts)


def _trace(folder: Path, row: GapRow) -> Trace | None:
    """Returns the trace of the bound under the rules; without a search for it, the other trace."""
    paths = (folder / Paths(row).trace(free) for free in (False, True))
    traces = [Trace.load(path) for path in paths if path.is_file()]
    searched = [trace for trace in traces if len(trace.snapshots) > 1]
    return next(iter(searched or traces), None)


# -- plans --------------------------------------------------------------------------------


def _plans(folder: Path, rows: Sequence[GapRow], most: int) -> str:
    """Returns players of the first scenes, each for the scene's most instructive seed."""
    scenes = [
        group
        for (_,), group in GapRow.grouped(rows, "scene").items()
        if (folder / Paths(group[0]).scene).is_file()
    ]
    return "\n".join(_scene_plans(folder, group) for group in scenes[:most])


def _scene_plans(folder: Path, rows: Sequence[GapRow]) -> str:
    seed, group = _telling_seed(rows)
    problem = load_scene(str(folder / Paths(group[0]).scene), 0)
    shown = _telling_pair(group)
    if not shown:
        return ""
    plans = {row.planner or "": _plan(folder, row, problem) for row in shown}
    explained = explained_plans(folder, shown, problem, plans)
    terms = [explained[name].explanation if name in explained else None for name in plans]
    cut_short = [row.cut_short for row in shown]
    player = escape(Player(problem, list(plans.items()), terms, cut_short=cut_short).page())
    title = problem.name if seed is None else f"{problem.name}, seed {seed}"
    charts = _image(conflicts_figure(problem, plans), f"{title}: which drones collide, and when.")
    name = _escaped(title)
    gaps = worth_telling(explained)
    known = {name: gap for name, gap in gaps.items() if gap.explanation.terms}
    left_out = f"<p>{_TOO_LARGE}</p>" if gaps and is_too_large(problem) else ""
    return (
        f"<h3>{name}</h3>\n<p>{_escaped(_story(shown))}</p>\n"
        f'<iframe class="player" loading="lazy" title="plans of {name}" srcdoc="{player}">'
        f"</iframe>\n{charts}{_gaps_explained(title, known)}{left_out}"
    )


def _gaps_explained(title: str, explained: Mapping[str, Explained]) -> str:
    """Returns a figure and a table of the parts of plans' gaps, in % of the bound."""
    if not explained:
        return ""
    losses = {
        planner: 100 * told.explanation.share(1.0) * told.explanation.losses()
        for planner, told in explained.items()
    }
    words = (
        f"{title}: what each drone loses by its move after a step, compared with the bound's best "
        "path from there."
    )
    lost = any(loss.max() >= 100 * SHOWN for loss in losses.values())
    drawn = _image(losses_figure(losses), words) if lost else ""
    table = {"Parts of the gaps (% of the bound)": parts_table(explained)}
    costly = {planner: costliest(told) for planner, told in explained.items()}
    most = [f"{planner}: {words}." for planner, words in costly.items() if words]
    about = (
        "A gap has four causes: drones leave the bound's best paths, the bound overestimates the "
        "reward of faces, the plan does not use rules that have a price, and other leaves of a "
        "proof have larger bounds. The largest single terms:"
    )
    listed = f"<p>{about}</p>{_list(most)}" if most else ""
    return drawn + Tables(table).html(level=4) + listed


def _telling_seed(rows: Sequence[GapRow]) -> tuple[int | None, list[GapRow]]:
    """Returns the most instructive seed of a scene, with its rows.

    Seeds with at least two plans come first, then those whose plans have the most conflicts, then
    those whose rewards differ most.
    """

    def told(group: Sequence[GapRow]) -> tuple[bool, int, float]:
        rewards = [row.reward for row in group if row.valid and row.reward is not None]
        apart = max(rewards) - min(rewards) if rewards else -1.0
        plans = sum(row.reward is not None for row in group)
        return plans > 1, max((row.conflicts or 0) for row in group), apart

    seeds = {seed: group for (seed,), group in GapRow.grouped(rows, "seed").items()}
    return max(seeds.items(), key=lambda item: told(item[1]))


def _telling_pair(rows: Sequence[GapRow]) -> list[GapRow]:
    """Returns up to two plans of a seed: most conflicts (or else worst) first, then the best."""
    good = sorted((row for row in rows if row.valid), key=lambda row: row.reward or 0.0)
    colliding = [row for row in rows if row.conflicts]
    if colliding:
        return [max(colliding, key=lambda row: row.conflicts or 0), *good[-1:]]
    return [good[0], good[-1]] if len(good) > 1 else good


def _plan(folder: Path, row: GapRow, problem: Problem) -> Plan:
    """Returns the plan of a row, after checking that it has the row's reward."""
    path = folder / Paths(row).plan
    plan = PlanReader(str(folder / Paths(row).scene), problem).plan(path).plan
    reward = check(problem, plan).reward
    claimed = math.nan if row.reward is None else row.reward
    if not math.isclose(reward, claimed, rel_tol=1e-9, abs_tol=1e-9):
        words = f"J is {reward:,.2f}, but {claimed:,.2f} in results.csv"
        raise FileError(f"{path}: belongs to another run: {words}")
    return plan


def _story(rows: Sequence[GapRow]) -> str:
    """Returns a sentence about the plans that are shown."""
    parts = []
    for row in rows:
        if not row.valid:
            parts.append(f"{row.planner} has {counted(row.conflicts or 0, 'conflict')}")
        elif row.gap is None:
            parts.append(f"{row.planner} obeys the rules")
        else:
            below = f"is {100 * row.gap:.3f} % below the best certified bound"
            gap = "is proved optimal" if row.is_optimal else below
            parts.append(f"{row.planner} obeys the rules and {gap}")
    return f"{'; '.join(parts)}."


# -- the rest -----------------------------------------------------------------------------


def _failures(rows: Sequence[GapRow]) -> str:
    """Returns a table of the plans and bounds that could not be computed."""
    failed = [
        {"scene": row.scene, "seed": str(row.seed), "of": cell, "reason": reason,
         "message": message}
        for row in rows
        for cell, reason, message in (
            (row.planner or "", row.reason, row.message),
            ("bound", row.bound_reason, "this scene and seed have no bound"),
        )
        if reason in FAILED
    ]  # fmt: skip
    once = list({tuple(row.items()): row for row in failed}.values())
    return Tables({"Plans and bounds that were not computed": once}).html(level=3) if once else ""


def _absent(folder: Path, rows: Sequence[GapRow]) -> list[str]:
    """Returns sentences about files that are missing from the folder."""
    first = {row.key: row for row in rows}.values()
    named = {name for row in first for name in (row.certificate, row.certificate_free) if name}
    certificates = sum(not (folder / name).is_file() for name in named)
    scenes = sum(not (folder / Paths(row).scene).is_file() for row in first)
    sentences = []
    if certificates:
        sentences.append(f"{certificates} of {len(named)} certificates are not in the folder.")
    if scenes:
        sentences.append(f"{scenes} of {len(first)} scene files are not in the folder.")
    return sentences


def _rules(folder: Path, rows: Sequence[GapRow]) -> dict[str, CollisionRules]:
    """Returns the collision rules of each scene whose file is in the folder."""
    files = {row.scene: folder / Paths(row).scene for row in rows}
    return {
        scene: load_scene(str(path), 0).rules for scene, path in files.items() if path.is_file()
    }


def _settings(rows: Sequence[GapRow], run: RunFile) -> str:
    facts = [
        ("limit of each plan", _limits((row.time_limit, row.work_limit) for row in rows)),
        (
            "limit of each bound",
            _limits((row.bound_time_limit, row.bound_work_limit) for row in rows),
        ),
        ("digest of the code", run.code[:16]),
    ]
    for command_run in run.runs:
        told = {
            "command": shlex.join(command_run.command),
            "started (UTC)": command_run.began,
            "computed by": command_run.workers,
            **command_run.machine,
            "packages": ", ".join(
                f"{name} {number}" for name, number in command_run.packages.items()
            ),
        }
        facts += [(key, text) for key, text in told.items() if (key, text) not in facts]
    lines = (f"<dt>{_escaped(key)}</dt><dd>{_escaped(text)}</dd>" for key, text in facts)
    return f"<dl>{''.join(lines)}</dl>"


def _limits(limits: Iterable[tuple[float | None, int | None]]) -> str:
    """Returns the distinct limits of time and of work, in words."""
    words = []
    for seconds, work in dict.fromkeys(limits):
        time = "unknown" if seconds is None else f"{seconds:g} s"
        words.append(time if work is None else f"{time} and {work} units of work")
    return ", ".join(words)


def _list(sentences: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{_escaped(words)}</li>' for words in sentences)}</ul>"


def _escaped(text: str) -> str:
    """Returns text that is safe on the page; some of it may come from files."""
    return escape(printable(text, "\n"))


def _image(figure: Figure, words: str) -> str:
    """Returns a figure with its caption."""
    content = base64.b64encode(picture(figure, ".svg")).decode()
    return (
        f'<figure><img alt="{_escaped(words)}" '
        f'src="data:image/svg+xml;base64,{content}"><figcaption>{_escaped(words)}</figcaption>'
        "</figure>\n"
    )
