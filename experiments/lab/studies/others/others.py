"""Plans of other projects and ours on all scenes in a folder, with a bound beside each number.

A sweep whose instances are their scenes, with the plans that they have published and with each of
their start sets, and with tables of its own.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.studies.others.cases import Case
from cocap_opt.experiments.lab.studies.others.findings import findings
from cocap_opt.experiments.lab.studies.others.published import Scene, not_there
from cocap_opt.experiments.lab.studies.others.tables import Compared, OverSets
from cocap_opt.experiments.sweeps.instances import Instance, Key, Settings
from cocap_opt.experiments.sweeps.sweep import Hired, sweep
from cocap_opt.experiments.tables.rows import Row
from cocap_opt.output.files import save_bytes, save_csv
from cocap_opt.output.printing import Listing, Record, print_texts
from cocap_opt.problem import Plan

PLANNERS = ("cocap-lns", "cocap")
_NOTES = """\
Every plan, theirs or ours, is evaluated by the same referee; bounds are certified. `gap` is to the
bound under the scene's collision rules, of plans that obey them. `gap_free` is to the bound without
such rules, which holds for any plan. `best known` is the largest J that any method found here, that
of the search for the bound included. `of` says what a reward is of: a plan, their word without one,
or no plan that starts where the others do and flies from cell to cell. `shared cells` counts how
often two drones of a plan are in one cell at one step, be that forbidden or not; `colliding` is the
number of drones that take part in a conflict; `valid` is the number of plans without one. `reward`
over start sets is view reward per drone and step, elsewhere J, the sum over all drones and steps.
Columns without a value in every start set are left empty. Seconds are the planner's own; those of
their programs are not known.
"""


def others(
    folder: Path,
    planners: Sequence[str],
    sets: Sequence[int] | None,
    limit: float,
    workers: int | None = None,
    out: Path | None = None,
) -> bool:
    """Measures what is not in `out` yet by a sweep, and prints and writes the tables.

    Parameters
    ----------
    folder : that holds scenes as they are published, somewhere below it
    planners : of ours; PLANNERS if there is none
    sets : start sets; None for all
    limit : s, of each plan and each bound
    workers : processes; None for this one

    Returns
    -------
    bool
        True if all is measured, False after Ctrl-C.

    Raises
    ------
    FileError
        If no scene can be read.
    """
    scenes = Scene.all_in(folder)
    for sentence in not_there(folder, scenes):
        say(sentence)
    cases = Case.all_of(scenes, sets, say)
    settings = Settings(time_limit=limit, bound_time_limit=limit)
    instances = [case.instance(planners or PLANNERS, settings) for case in cases]

    def is_same(key: Key, digest: str) -> bool:
        return Case.is_same(cases, key, digest)

    rows = sweep(instances, out, Hired(workers, None, settings.cell_limit), is_same=is_same)
    whole = [
        (case, instance)
        for case, instance in zip(cases, instances, strict=True)
        if instance.is_whole and not instance.is_cut
    ]
    _publish(whole, rows, limit, out)
    return len(whole) == len(instances)


def _publish(
    whole: Sequence[tuple[Case, Instance]], rows: Sequence[Row], limit: float, out: Path | None
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
    listings = [one.listing() for one in compared]
    listings += [means.listing()] if means.rows else []
    for listing in listings:
        listing.print()
    if sentences:
        print_texts((), sentences)
    if out is not None:
        _write(out, [record for one in compared for record in one.records()], means.records(),
               sentences, limit)  # fmt: skip


def _plans(instance: Instance) -> dict[str, Plan]:
    found = {name: instance.plan(name) for name in instance.cells}
    return {name: plan for name, plan in found.items() if plan is not None}


def _sentences(compared: Sequence[Compared]) -> Iterator[str]:
    """Yields the findings, project by project."""
    for of_hughes in (False, True):
        some = [one for one in compared if one.case.scene.is_hughes == of_hughes]
        if some:
            yield from findings(some, of_hughes)


def _write(
    out: Path,
    beside: Sequence[Record],
    means: Sequence[Record],
    sentences: Sequence[str],
    limit: float,
) -> None:
    """Writes others.csv, start_sets.csv and others.md, as far as there is something to say."""
    tables = {
        "others.csv": Listing("Their plans and ours", beside),
        "start_sets.csv": Listing("View reward per drone and step over start sets", means),
    }
    parts = []
    for name, listing in tables.items():
        if listing.rows:
            save_csv(out / name, listing.rows)
            parts.append(f"## {listing.title} (limit {limit:g} s)\n\n{listing.markdown}")
    told = "".join(f"- {Listing.cell(sentence)}\n" for sentence in sentences)
    parts += [f"## Their evaluation\n\n{told}"] if told else []
    save_bytes(out / "others.md", "\n".join([*parts, _NOTES]).encode())
