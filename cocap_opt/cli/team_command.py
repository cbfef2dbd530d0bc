"""The command `team`: how many drones, with which camera, at which height."""

import sys
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.cli.options import FLAG, Json, Scene, Seed, Whole, Work, load
from cocap_opt.cli.workforce import HERE, Workforce
from cocap_opt.console.exit_codes import FAILED, INTERRUPTED
from cocap_opt.experiments.sweeps.teams import Asked, compare_teams, team_settings
from cocap_opt.experiments.tables.teams import records, sentences, teams_table
from cocap_opt.output.answer import print_result
from cocap_opt.output.printing import line_width
from cocap_opt.problem import Problem
from cocap_opt.run.options import Option, UsageError
from cocap_opt.scenarios.hardware import CAMERAS

_SHARE = 0.95


@Parameter(name="*")
@dataclass(frozen=True)
class _RequiredViews:
    """The options that define what a team must reach."""

    share: Annotated[
        float, Parameter(help="share of person-steps to be seen by --cameras drones or more")
    ] = _SHARE
    cameras: Annotated[
        Whole, Parameter(help="drones that must see each person; 2 can locate a point in space")
    ] = 2
    at_least: Annotated[
        float | None,
        Parameter(
            help="share of a person, by unhidden solid angle, that a drone must see (default: the "
            "scene's share, or 0.3)"
        ),
    ] = None


_USUAL = _RequiredViews()


def _team(
    scene: Scene,
    /,
    *,
    drones: Annotated[str, Parameter(help="numbers of drones, e.g. 1-8 or 2,4")] = "1-6",
    camera: Annotated[
        str | None,
        Parameter(help=f"cameras to compare, separated by commas: {', '.join(CAMERAS)} (default: "
                  "the scene's camera)"),
    ] = None,
    heights: Annotated[
        str | None,
        Parameter(help="heights to compare in metres, e.g. 6,9,12; each team stays at one height "
                  "(default: the scene's heights)"),
    ] = None,
    required: _RequiredViews = _USUAL,
    seed: Seed = 0,
    time_limit: Annotated[
        float,
        Parameter(
            name="--time-limit",
            help="seconds for each of the two problems of a team, excluding coverage",
        ),
    ] = 20.0,
    work_limit: Work = None,
    out: Annotated[
        Path | None,
        Parameter(
            name=["--out", "-o"],
            help="folder for teams.csv, scenes, plans and certificates",
        ),
    ] = None,
    workforce: Workforce = HERE,
    retry: Annotated[
        bool,
        FLAG(help="retry failed runs in the --out folder"),
    ] = False,
    json: Json = False,
) -> int:  # fmt: skip
    """Compare teams by number of drones, camera and height, with bounds on what any team can do.

    The drones are copies of the scene's drones, with the best starts: in the areas that the scene
    defines, or anywhere. Each team is planned twice, for J and for the number of drones that see
    each person, and bounds are computed for both as far as time allows. Results
    already in the --out folder are not recomputed. The exit code is 1 if a computation ended
    with an error, and 130 if Ctrl-C ended the command before all teams were complete.

    Example: cocap-opt team bottleneck --drones 1-4 --out teams
    """  # fmt: skip
    asked = _asked(drones, camera, heights, required)
    if retry and out is None:
        raise UsageError(
            "--retry: name the folder with --out; without --out, results are not stored"
        )
    seconds = Option("--time-limit").require_seconds(time_limit)
    work = None if work_limit is None else Option("--work-limit").require_whole(work_limit)
    settings = team_settings(seconds, work, out is not None or workforce.is_elsewhere)
    hired = workforce.hired(settings)
    problem = load(scene, seed)
    rows, is_complete = compare_teams(problem, seed, asked, settings, out, hired, retry)
    words = list(sentences(rows, required.share))
    if json:
        print_result({"rows": records(rows), "words": words, "output": out}, json)
    else:
        spare = ("apart", "mm", "gain")
        listing = teams_table(rows).fitted(spare, "--json")
        listing._replace(notes=[*listing.notes, *_of_starts(problem, out)]).print()
        for sentence in words:
            sys.stdout.write(f"{textwrap.fill(sentence, line_width())}\n")
    if any(row.failed for row in rows):
        return FAILED
    return 0 if is_complete else INTERRUPTED


def _of_starts(problem: Problem, out: Path | None) -> Iterator[str]:
    """Yields why J of teams is higher than that of the scene's plans, if its starts are fixed."""
    if not problem.has_free_starts:
        kept = "" if out is not None else "; use -o FOLDER to store plans and starts"
        yield f"teams start where it is best, not at the scene's starts{kept}"


def _asked(drones: str, camera: str | None, heights: str | None, required: _RequiredViews) -> Asked:
    """Returns the teams that the options request; UsageError names an option that is out of
    range.
    """
    Option("--share").require_part(required.share)
    return Asked.of(
        Option("--drones").numbers(drones),
        None if camera is None else camera.split(","),
        None if heights is None else Option("--heights").lengths(heights),
        required.cameras,
        required.at_least,
        lambda name: f"--{name.replace('_', '-')}",
    )


COMMANDS = {"team": _team}
