"""The command `front`: J against the number of drones that see each person, with proofs."""

import logging
import math
from functools import partial
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.cli.options import Json, Scene, Seed, Whole, load, say_why_no_plan
from cocap_opt.console.progress import Watch
from cocap_opt.data import ProblemError
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import make_folder
from cocap_opt.output.printing import Listing, Record
from cocap_opt.output.told_bounds import told_bound
from cocap_opt.run import front_files
from cocap_opt.run.front import Front
from cocap_opt.run.front_search import explored
from cocap_opt.run.judged import finite
from cocap_opt.run.options import Option, UsageError
from cocap_opt.stop import Interrupt

_log = logging.getLogger(__name__)


def _front(
    scene: Scene,
    /,
    *,
    seed: Seed = 0,
    cameras: Annotated[
        Whole | None,
        Parameter(help="drones to count per person at most (default: the scene's number, or 2)"),
    ] = None,
    at_least: Annotated[
        float | None,
        Parameter(
            help="share of a person that must be visible in a drone's image (default: the scene's "
            "share, or 0.3)"
        ),
    ] = None,
    directions: Annotated[
        Whole, Parameter(help="number of weights of views in J to try in this call, at most")
    ] = 6,
    seconds: Annotated[
        float,
        Parameter(
            name="--seconds",
            help="seconds for each weight, excluding coverage; twice as long each time a weight is "
            "retried",
        ),
    ] = 10.0,
    share: Annotated[
        float | None,
        Parameter(
            help="find the best plan with at least this share of all possible views (default: the "
            "scene's share, if it has one)"
        ),
    ] = None,
    output: Annotated[
        Path | None,
        Parameter(
            name=["-o", "--output"], help="folder for plans and proofs; later calls continue there"
        ),
    ] = None,
    json: Json = False,
) -> int:
    """Show the trade-off between J and how many drones see each person, with bounds.

    Views are counted at each step, up to --cameras for each person. Plans show what is possible,
    certificates what is not. Each further call with the same folder narrows the gap between plans
    and certificates.

    Example: cocap-opt front bottleneck -o front
    """
    Option("--directions").require_whole(directions)
    if not directions and output is None:
        raise UsageError("--directions: must be 1 or more without -o, the folder of earlier plans")
    Option("--seconds").require_duration(seconds)
    try:
        front = Front.of(load(scene, seed), cameras, at_least, share)
    except ProblemError as error:
        raise Option.refused(error) from error
    make_folder(output)
    name = f"{front.problem.name} seed {seed}"
    with Interrupt.caught() as interrupt, Watch.on_terminal(name) as watch:
        if output is None:
            front = explored(front, interrupt, seconds, directions, watch=watch)
        else:
            keep = partial(front_files.save, folder=output)
            front = front_files.read(front, output, interrupt, watch)
            front = explored(front, interrupt, seconds, directions, watch=watch, keep=keep)
            keep(front)
    if front.no_plan:
        say_why_no_plan(scene, seed, front.problem)
    _say(front, seed, output, json)
    return 0


def _say(front: Front, seed: int, output: Path | None, json: bool) -> None:
    """Prints a trade-off."""
    notes = list(front.sentences())
    if json:
        answer: Record = {
            "scene": front.problem.name,
            "seed": seed,
            "cameras": front.views.cameras,
            "at_least": front.views.at_least,
            "most_views": front.most_views,
            "views_bound": front.views_bound,
            "gap": front.gap if math.isfinite(front.gap) else None,
            "settled": front.settled,
            "front": [dict(row) for row in front.plan_rows()],
            "bounds": [dict(row) for row in front.bound_rows()],
            "notes": notes,
            "output": output,
        }
        print_result(answer, json)
        return
    most = front.views.cameras
    title = f"{front.problem.name}: J, and drones that see each person, up to {most}"
    if front.plans:
        Listing(title, _rows(front), notes).print()
    else:
        for note in notes:
            _log.warning("%s", note)


def _rows(front: Front) -> list[Record]:
    """Returns a row for each plan, for a terminal."""
    return [
        {
            "views": point.views,
            "of all (%)": 100 * front.share(point.views),
            f"seen by {front.views.cameras} (%)": finite(100 * front.seen(point)),
            "J": point.reward,
            "no plan has more than": _told(front.reward_bound(point.views), point.reward),
        }
        for point in front.plans
    ]


def _told(bound: float, reward: float) -> str:
    """Returns a bound in words, relative to J of the best known plan."""
    return told_bound(bound, reward) if bound < math.inf else "-"


COMMANDS = {"front": _front}
