"""The command `takes`: compares plans for each take with a plan for all, each in every take."""

import logging
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.cli.options import Json, Scene, Seed, Whole, load
from cocap_opt.console.progress import Watch
from cocap_opt.data import ProblemError
from cocap_opt.files.documents import PlanFile, SceneFile, encode
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import make_folder, save_files
from cocap_opt.output.printing import Listing, Record
from cocap_opt.output.told_bounds import told_bound
from cocap_opt.problem import Problem
from cocap_opt.run.drawn_takes import with_drawn_takes
from cocap_opt.run.options import Option, UsageError
from cocap_opt.run.takes import Hedging, PlanForTake, hedging
from cocap_opt.scenarios.spread import Spread
from cocap_opt.stop import Interrupt

_log = logging.getLogger(__name__)

_DRAWN = 3  # takes
_KINDS = "scene", "bound", "plan"  # kinds of files


def _takes(
    scene: Scene,
    /,
    *,
    seed: Seed = 0,
    seconds: Annotated[
        float, Parameter(name="--seconds", help="seconds for each plan, including coverage")
    ] = 20.0,
    delay: Annotated[float, Parameter(help="standard deviation of people's delays, s")] = 0.0,
    aside: Annotated[
        float, Parameter(help="standard deviation of people's sideways offsets, m")
    ] = 0.0,
    speed: Annotated[
        float, Parameter(help="standard deviation of people's speeds, relative, e.g. 0.1")
    ] = 0.0,
    count: Annotated[
        Whole | None,
        Parameter(help=f"number of takes, the first as in the scene (default: {_DRAWN})"),
    ] = None,
    draw_seed: Annotated[Whole | None, Parameter(help="seed of random takes (default: 0)")] = None,
    output: Annotated[
        Path | None,
        Parameter(
            name=["-o", "--output"],
            help="folder for plans, certificates and their scenes",
        ),
    ] = None,
    json: Json = False,
) -> int:
    """Show what a plan for one take loses in another, and what a plan for all of them costs.

    For each take, and for the average over all takes, it finds a plan and proves a bound on J.
    Then it shows J of each plan in each take. All plans keep away from the people of all takes.
    If the scene defines no takes, --delay, --aside and --speed draw them at random.

    Example: cocap-opt takes bottleneck --aside 0.5 --count 3 --seconds 10 -o takes
    """
    Option("--seconds").require_duration(seconds)
    problem = _in_takes(load(scene, seed), Spread(delay, aside, speed), count, draw_seed)
    make_folder(output)
    with Interrupt.caught() as interrupt, Watch.on_terminal(problem.name) as watch:
        found = hedging(problem, seconds, interrupt, show=watch.show)
    if interrupt.pressed:
        _log.warning("stopped by Ctrl-C: shows the plans and bounds found so far")
    files = {} if output is None else _saved(found, output)
    _say(found, seed, files, output, json)
    return 0


def _in_takes(problem: Problem, spread: Spread, count: int | None, seed: int | None) -> Problem:
    """Returns the scene with its takes, or with randomly drawn takes if it has none."""
    options = {
        "--delay": spread.delay or None, "--aside": spread.aside or None,
        "--speed": spread.speed or None, "--count": count, "--draw-seed": seed,
    }  # fmt: skip
    if problem.takes:
        for option, value in options.items():
            if value is not None:
                raise UsageError(f"{option}: must be left out, as the scene has takes")
        return problem
    if not any(spread):
        raise UsageError("SCENE: has no takes; --delay, --aside or --speed draw some")
    if not problem.actors:
        raise UsageError("SCENE: must have people, who can walk differently")
    draws = 0 if seed is None else Option("--draw-seed").require_whole(seed)
    try:
        return with_drawn_takes(problem, _DRAWN if count is None else count, spread, draws)
    except ProblemError as error:
        field = str(error).partition(":")[0]
        if f"--{field}" not in options:
            raise
        raise Option.refused(error) from error


def _saved(found: Hedging, folder: Path) -> dict[str, list[str]]:
    """Writes the plans and certificates, and their scenes; returns the names of the files."""
    contents = {}
    for k, row in enumerate((found.hedged, *found.plans)):
        name = f"take-{k - 1}" if k else "hedged"
        contents[f"{name}.scene.json"] = encode(SceneFile(problem=row.problem))
        if row.certificate is not None:
            contents[f"{name}.bound.json"] = encode(row.certificate)
        if row.plan is not None:
            contents[f"{name}.plan.json"] = encode(
                PlanFile.of(found.problem, row.plan, row.mean, f"for {row.made_for}")
            )
    save_files({folder / name: content for name, content in contents.items()})
    strays = {path.name for kind in _KINDS for path in folder.glob(f"take-*.{kind}.json")}
    if others := sorted(strays - contents.keys()):
        _log.warning("%s: files of another scene, not written now: %s", folder, ", ".join(others))
    return {"files": sorted(contents)}


def _say(
    found: Hedging, seed: int, files: dict[str, list[str]], output: Path | None, json: bool
) -> None:
    """Prints the table and the sentences on it."""
    notes = list(found.sentences())
    if json:
        answer: Record = {
            "scene": found.problem.name,
            "seed": seed,
            "takes": [{"name": t.name, "probability": t.probability} for t in found.problem.takes],
            "plans": [_record(row) for row in (*found.plans, found.hedged)],
            "foreknowledge": found.foreknowledge,
            "notes": notes,
            "output": output,
            **files,
        }
        print_result(answer, json)
        return
    *plans, bounds = found.rows
    rows = [
        *({key: _told(value) for key, value in row.items()} for row in plans),
        {key: _told_bound(value, [row[key] for row in plans]) for key, value in bounds.items()},
    ]
    Listing(f"{found.problem.name}: J of each plan in each take", rows, notes).print()


def _record(row: PlanForTake) -> Record:
    """Returns a plan for a take as plain data."""
    return {
        "plan_for": row.made_for, "rewards": list(row.rewards), "mean": row.mean,
        "bound": row.bound, "seconds": row.seconds,
    }  # fmt: skip


def _told(value: object) -> object:
    """Returns J in words."""
    return f"{value:,.2f}" if isinstance(value, float) else value


def _told_bound(value: object, rewards: Sequence[float]) -> object:
    """Returns a bound in words, relative to the J of plans."""
    if not isinstance(value, float):
        return value
    return told_bound(value, max(rewards, default=None)) if math.isfinite(value) else "not proved"


COMMANDS = {"takes": _takes}
