"""The commands of `cocap-opt library`: best plans and bounds of instances, each of them checked."""

import csv
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from cocap_opt.cli.options import FLAG, Json, Output
from cocap_opt.console.streams import say
from cocap_opt.console.usage import set_usages
from cocap_opt.experiments.library.entries import DATA
from cocap_opt.experiments.library.judge import TIME_LIMIT
from cocap_opt.experiments.library.records import Library, Standing
from cocap_opt.experiments.library.tables import (
    by_gap,
    full_rows,
    history_rows,
    in_words,
    short_rows,
)
from cocap_opt.files.documents import SceneFile, encode
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import check_output, make_folder, save_bytes, save_files
from cocap_opt.output.printing import Listing, print_texts
from cocap_opt.run.options import Option, UsageError
from cocap_opt.text import counted

app = App(
    name="library",
    help="Instances with their best plans and bounds, and how to submit better ones.",
    version_flags=[],
)

_Name = Annotated[str, Parameter(help="instance; `cocap-opt library status --all` lists them")]
_Folder = Annotated[
    Path | None,
    Parameter(name="--library", help="folder of a library (default: the one that is installed)"),
]
_From = Annotated[
    Path | None,
    Parameter(
        name="--from",
        help="folder with files from another project, for instances that need them; `library "
        "status NAME` prints where to get them",
    ),
]
_Verified = Annotated[
    Path | None,
    Parameter(
        name="--verified",
        help="program cocap-check-verified, which is proved correct in Coq, to judge certificates "
        "and proofs in place of cocap-check: it proves the bound that the file claims, and takes "
        "less time for long searches",
    ),
]


@app.command(name="status")
def _status(
    name: Annotated[str, Parameter(help="instance (default: all)", show_default=False)] = "",
    /,
    *,
    every: Annotated[bool, FLAG(name="--all", help="also list solved instances")] = False,
    as_csv: Annotated[bool, FLAG(name="--csv", help="print everything as CSV")] = False,
    library: _Folder = None,
    json: Json = False,
) -> int:
    """Print the number of solved instances and the gaps of the others, or the records of one.

    Example: cocap-opt library status bottleneck-0
    """
    if as_csv and json:
        raise UsageError("--csv: must not be combined with --json")
    if every and name:
        raise UsageError("--all: lists all instances; leave out NAME")
    known = Library(library or DATA)
    found = [known.standing(name)] if name else known.standings()
    rows = full_rows(found)
    if as_csv:
        writer = csv.DictWriter(sys.stdout, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    elif name:
        records = history_rows(known.records(name))
        if json:
            print_result({**rows[0], "records": records}, json)
        else:
            drones, people, steps = (rows[0].pop(key) for key in ("drones", "people", "steps"))
            counts = {"drone": drones, "person": people, "step": steps}
            size = ", ".join(counted(number, noun) for noun, number in counts.items())
            made = found[0].entry.recipe
            print_result({**rows[0], "size": size, "made of": made}, json)
            Listing("records", records).print()
    elif json:
        print_result({"version": known.version, "instances": rows}, json)
    else:
        print_texts([], [f"Library, version {known.version}: {in_words(found)}."])
        if every:
            Listing("", short_rows(found)).print()
        else:
            _print_open(found)
    return 0


def _print_open(standings: Sequence[Standing]) -> None:
    """Prints the instances that are not solved, if there are any."""
    rows = short_rows(by_gap(found for found in standings if found.is_open))
    note = "--all lists the solved ones, too."
    if rows:
        listing = Listing("not solved, the largest gap first", rows, [note])
        listing.fitted(("state", "drones", "bound"), "--csv").print()
    else:
        print_texts([], [note])


@app.command(name="get")
def _get(
    name: _Name,
    /,
    *,
    output: Annotated[
        Path | None,
        Parameter(name=["-o", "--output"], help="folder to write to (default: NAME)"),
    ] = None,
    unchecked: Annotated[
        bool,
        FLAG(
            name="--unchecked",
            help="do not recheck plan and certificate, which may take minutes",
        ),
    ] = False,
    verified: _Verified = None,
    sources: _From = None,
    library: _Folder = None,
    json: Json = False,
) -> int:
    """Recheck the best plan and certificate of an instance, and write them with its other files.

    Example: cocap-opt library get bottleneck-0 -o bottleneck-0
    """
    known = Library(library or DATA)
    standing = known.standing(name)
    output = output or Path(standing.entry.name)
    make_folder(output)
    instance = known.instance(standing.entry, sources)
    contents = {output / f"{name}.instance": instance.read_bytes()}
    for record in filter(None, (standing.plan, standing.bound)):
        kind = "plan" if record.kind == "plan" else "certificate"
        if not unchecked:
            say(f"{name}: checking the {kind} again (--unchecked skips this)")
            known.recheck(record, sources, verified=_absolute(verified))
        contents[output / f"{name}.{kind}.json"] = known.content(record)
    problem = known.problem(standing.entry, sources)
    contents[output / f"{name}.scene.json"] = encode(SceneFile.of(problem))
    save_files(contents)
    answer = {"instance": name, "files": list(contents)}
    print_result({**_told(standing), **answer}, json)
    return 0


@app.command(name="submit")
def _submit(
    file: Annotated[Path, Parameter(help="plan, certificate or proof of an instance")],
    /,
    *,
    who: Annotated[
        str, Parameter(help="your name, for the record; required", show_default=False)
    ] = "",
    program: Annotated[
        str,
        Parameter(
            help="program that found it, with its version (default: the method in the file)",
            show_default=False,
        ),
    ] = "",
    seconds: Annotated[
        float | None, Parameter(help="seconds that it took (default: those in the plan file)")
    ] = None,
    time_limit: Annotated[
        float, Parameter(help="seconds for the checker; inf: no limit")
    ] = TIME_LIMIT,
    verified: _Verified = None,
    sources: _From = None,
    library: _Folder = None,
    json: Json = False,
) -> int:
    """Submit a plan or a certificate: accepted if the checker accepts it and it is better.

    The record keeps the number that the checker proves. The claim of a file need not be that.

    Example: cocap-opt library submit plan.json --who Ada
    """
    if seconds is not None and not 0 <= seconds < float("inf"):
        raise UsageError(f"--seconds: must be >= 0, not {seconds}")
    if not who.strip():
        raise UsageError("--who: must name who found it: records are kept for good")
    limit = Option("--time-limit").require_limit(time_limit)
    known = Library(library or DATA)
    record = known.submit(file, who, program, seconds, sources, limit, _absolute(verified))
    standing = known.standing(record.name)
    answer = {"instance": record.name, "accepted": f"{record.kind} {record.value:.6f}"}
    print_result({**answer, **_told(standing)}, json)
    return 0


def _absolute(program: Path | None) -> Path | None:
    """Returns the whole path of a program, which is not looked for where the shell looks."""
    return program and program.absolute()


@app.command(name="page")
def _page(
    name: _Name,
    /,
    *,
    output: Output = None,
    sources: _From = None,
    library: _Folder = None,
    json: Json = False,
) -> int:
    """Make a page of an instance: records, curve of J and bound, player, how to cite.

    Example: cocap-opt library page bottleneck-0 -o bottleneck-0.html
    """
    from cocap_opt.experiments.library.page import page  # matplotlib is slow to import

    check_output(output)
    path = Option("-o").file(output, (".html",)).path
    known = Library(library or DATA)
    standing = known.standing(name)
    save_bytes(path, page(known, standing, known.problem(standing.entry, sources)))
    print_result({"instance": name, "file": path}, json)
    return 0


def _told(standing: Standing) -> dict[str, object]:
    (row,) = full_rows([standing])
    return {key: row[key] for key in ("state", "reward", "bound", "gap")}


set_usages(app, "cocap-opt library")
