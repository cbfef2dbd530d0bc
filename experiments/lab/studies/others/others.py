"""Plans of other projects and ours on all scenes in a folder, with a bound for each.

It is a sweep over their scenes, with the plans that they published and with each of their start
sets; it has its own tables.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.console.exit_codes import INTERRUPTED
from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.results import STORED, Results, in_percent, markdown, stored_rows
from cocap_opt.experiments.lab.studies.options import Out, Workers, positive_seconds
from cocap_opt.experiments.lab.studies.others.cases import Case
from cocap_opt.experiments.lab.studies.others.findings import findings
from cocap_opt.experiments.lab.studies.others.published import Scene, not_there
from cocap_opt.experiments.lab.studies.others.tables import (
    BETWEEN,
    PLAN,
    WORD,
    Compared,
    OverSets,
    signed_percent,
)
from cocap_opt.experiments.sweeps.instances import Instance, Key, Settings
from cocap_opt.experiments.sweeps.sweep import Hired, sweep
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.output.files import save_bytes
from cocap_opt.output.printing import Listing, Record, print_texts
from cocap_opt.planners import RECOMMENDED
from cocap_opt.problem import Plan
from cocap_opt.run.engine import SOLVERS
from cocap_opt.run.options import Option, UsageError

_PLANNERS = (RECOMMENDED, "cocap-lns", "cocap")
_JUDGED = {PLAN: "the plan", BETWEEN: "between cells", WORD: "their word"}
_NOTES = """\
The same referee evaluates all plans, theirs and ours; bounds are certified. `gap`: distance to the
bound under the scene's collision rules, for plans that obey them. `gap_free`: distance to the bound
without such rules, which holds for any plan. `best known`: the largest J that any method found
here, including the search for the bound. `of`: what a reward is of: a plan, `their word` (as
their file states it, without a plan), or `no plan` (states that start elsewhere or lie between the
cells). `shared cells`: how often two drones of a plan are in one cell at one step, whether this is
forbidden or not. `colliding`: number of drones that take part in a conflict. `valid`: number of
plans without a conflict. `reward`: over start sets, the view reward per drone and step; elsewhere
J, the sum over all drones and steps. Columns that lack a value in some start set
are empty. Seconds are measured for our planners; those of their programs are unknown.
"""


def others(
    folder: Annotated[
        Path,
        Parameter(help="folder with scenes of Greedy Perspectives or Hughes et al. at any depth"),
    ],
    /,
    *,
    planner: Annotated[
        list[str] | None,
        Parameter(
            negative="",
            consume_multiple=True,
            help=f"planners of this project (default: {' '.join(_PLANNERS)})",
        ),
    ] = None,
    sets: Annotated[
        str | None,
        Parameter(help="start sets of Greedy Perspectives, e.g. 0-9 (default: all)"),
    ] = None,
    limit: Annotated[float, positive_seconds(help="seconds for each plan and each bound")] = 60.0,
    workers: Workers = None,
    out: Out = None,
) -> int:
    """Measures with a sweep what is not in `out` yet, and prints and writes the tables."""
    if unknown := [name for name in planner or [] if name not in SOLVERS]:
        raise UsageError(f"--planner: must be among {', '.join(SOLVERS)}, not {unknown[0]!r}")
    numbers = None if sets is None else Option("--sets").numbers(sets)
    scenes = Scene.all_in(folder)
    for sentence in not_there(folder, scenes):
        say(sentence)
    cases = Case.all_of(scenes, numbers, say)
    settings = Settings(time_limit=limit, bound_time_limit=limit)
    instances = [case.instance(planner or _PLANNERS, settings) for case in cases]

    def is_same(key: Key, digest: str) -> bool:
        return Case.is_same(cases, key, digest)

    rows = sweep(instances, out, Hired(workers, None, settings.cell_limit), is_same=is_same)
    whole = [
        (case, instance)
        for case, instance in zip(cases, instances, strict=True)
        if instance.is_finished
    ]
    _publish(whole, rows, limit, out)
    return 0 if len(whole) == len(instances) else INTERRUPTED


def start_sets_in_markdown() -> str:
    """Returns stored means over the start sets of Greedy Perspectives, as its paper has them."""
    return markdown([
        {
            "scene": row["scene"],
            "planner": row["planner"],
            "reward": f"{float(row['reward']):,.0f} ± {float(row['sd']):,.0f}",
            "drones that collide": f"{float(row['colliding']):.1f}",
            "gap, mean": in_percent(row["gap"]),
            "gap, largest": in_percent(row["largest gap"]),
            "gap without rules": in_percent(row["gap_free"]),
            "proved": f"{row['proved']} of {row['sets']}",
        }
        for row in stored_rows("greedy-perspectives.csv")
    ])  # fmt: skip


def published_in_markdown(name: str) -> str:
    """Returns plans that other projects published, with ours, and the source of their J.

    Parameters
    ----------
    name : of the stored file
    """
    return markdown([
        {
            "scene": row["scene"],
            "plan of": "them" if row["by"] == "them" else "us",
            "planner": row["planner"],
            "J": f"{float(row['reward']):,.1f}",
            "J of": _JUDGED[row["of"]],
            "below the bound": in_percent(row["gap"]),
            "conflicts": row["conflicts"] or "-",
            "above their best": signed_percent(float(row["above theirs (%)"])),
        }
        for row in stored_rows(name)
        if row["reward"] and row["above theirs (%)"]
    ])  # fmt: skip


def findings_in_markdown(name: str) -> str:
    """Returns the stored findings on the evaluation of other projects, in sentences.

    Parameters
    ----------
    name : of the stored file, others.md as the study writes it
    """
    text = (STORED / name).read_text(encoding="utf-8")
    return text.partition("## Their evaluation\n\n")[2].partition("\n\n")[0]


def _publish(
    whole: Sequence[tuple[Case, Instance]], rows: Sequence[GapRow], limit: float, out: Path | None
) -> None:
    """Prints the tables and findings, and writes them."""
    sets = {instance.key for case, instance in whole if case.is_start_set}
    counted = {case.problem.name: case.counted_steps for case, _ in whole}
    means = OverSets([row for row in rows if row.key in sets], counted)
    compared = [
        Compared(case, [row for row in rows if row.key == instance.key], _plans(instance))
        for case, instance in whole
        if not case.is_start_set
    ]
    sentences = list(_sentences(compared))
    listings = [comparison.listing() for comparison in compared]
    listings += [means.listing()] if means.rows else []
    for listing in listings:
        listing.print()
    if sentences:
        print_texts((), sentences)
    if out is not None:
        beside = [record for comparison in compared for record in comparison.records()]
        _write(out, beside, means.records(), sentences, limit)


def _plans(instance: Instance) -> dict[str, Plan]:
    found = {name: instance.plan(name) for name in instance.cells}
    return {name: plan for name, plan in found.items() if plan is not None}


def _sentences(compared: Sequence[Compared]) -> Iterator[str]:
    """Yields the findings, project by project."""
    for of_hughes in (False, True):
        of_project = [
            comparison for comparison in compared if comparison.case.scene.is_hughes == of_hughes
        ]
        if of_project:
            yield from findings(of_project, of_hughes)


def _write(
    out: Path,
    beside: Sequence[Record],
    means: Sequence[Record],
    sentences: Sequence[str],
    limit: float,
) -> None:
    """Writes others.csv, start_sets.csv and others.md; parts without content are omitted."""
    tables = {
        "others.csv": Listing("Their plans and ours", beside),
        "start_sets.csv": Listing("View reward per drone and step over start sets", means),
    }
    parts = []
    for name, listing in tables.items():
        if listing.rows:
            Results(out).save(name, listing.rows)
            parts.append(f"## {listing.title} (limit {limit:g} s)\n\n{listing.markdown}")
    told = "".join(f"- {Listing.cell(sentence)}\n" for sentence in sentences)
    parts += [f"## Their evaluation\n\n{told}"] if told else []
    save_bytes(out / "others.md", "\n".join([*parts, _NOTES]).encode())
