"""The command `front`: J against the number of drones that see each person, with proofs."""

import logging
import math
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.cli.options import Json, Scene, Seed, Whole, load
from cocap_opt.console.progress import Watch
from cocap_opt.data import ProblemError
from cocap_opt.output.printing import Listing, Record, print_result
from cocap_opt.problem import Views
from cocap_opt.run import front_files
from cocap_opt.run.front import Front
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
        Parameter(help="drones from which on more add nothing; if not given, the scene's, or 2"),
    ] = None,
    at_least: Annotated[
        float | None,
        Parameter(
            help="share of a person that must be visible in a drone's image; if not given, the "
            "scene's, or 0.3"
        ),
    ] = None,
    directions: Annotated[
        Whole, Parameter(help="weights that are tried in this call, at most")
    ] = 6,
    seconds: Annotated[
        float,
        Parameter(
            name="--seconds",
            help="for each of them, coverage not included; each time that one is tried again it "
            "has twice as many",
        ),
    ] = 10.0,
    share: Annotated[
        float | None,
        Parameter(
            help="find the best plan with at least this share of all possible views; if not given, "
            "the scene's, if it has one"
        ),
    ] = None,
    output: Annotated[
        Path | None,
        Parameter(name=["-o", "--output"], help="folder for plans and proofs; it is gone on with"),
    ] = None,
    json: Json = False,
) -> int:
    """Enclose the trade-off between J and the drones that see each person.

    Views are counted step by step and person by person, each up to --cameras. Plans show what can
    be had, certificates what cannot. Each call with the same folder finds a little more, until
    nothing is left between the two.

    Example: cocap-opt front bottleneck -o front
    """
    Option("--directions").require_whole(directions)
    if not Option("--seconds").require_seconds(seconds) > 0:
        raise UsageError("--seconds: must be more than 0")
    if share is not None and not 0 <= share <= 1:
        raise UsageError(f"--share: must be 0..1, not {share:g}")
    problem = load(scene, seed)
    stated = problem.objective.views or Views()
    share = stated.share if share is None else share
    try:
        front = Front.of(
            problem,
            stated.cameras if cameras is None else cameras,
            stated.at_least if at_least is None else at_least,
        )
    except ProblemError as error:
        raise UsageError(f"--{str(error).replace('_', '-')}") from error
    name = f"{front.problem.name} seed {seed}"
    with Interrupt.caught() as interrupt, Watch.on_terminal(name) as watch:
        if output is not None:
            front = front_files.read(front, output)
        wanted = None if share is None else share * front.most_views
        front = front.explored(interrupt, seconds, directions, watch=watch, wanted=wanted)
        if output is not None:
            front_files.save(front, output)
    _say(front, share, seed, output, json)
    return 0


def _say(front: Front, share: float | None, seed: int, output: Path | None, json: bool) -> None:
    """Prints a trade-off."""
    notes, asked = _notes(front), _asked(front, share)
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
            "front": [dict(row) for row in _rows(front)],
            "notes": [*notes, *asked],
            "output": output,
        }
        print_result(answer, json)
        return
    title = f"{front.problem.name}: J against people seen by {front.views.cameras} drones or fewer"
    if front.plans:
        Listing(title, _rows(front), [*notes, *asked]).print()
    else:
        for note in notes:
            _log.warning("%s", note)


def _rows(front: Front) -> list[Record]:
    """Returns a row for each plan."""
    return [
        {
            "views": point.views,
            "of all (%)": 100 * front.share(point.views),
            "J": point.reward,
            "no plan has more than": front.reward_bound(point.views),
        }
        for point in front.plans
    ]


def _notes(front: Front) -> list[str]:
    """Returns sentences on the whole."""
    if not front.plans:
        none = "there is no plan that obeys the rules: that is proved"
        return [none if front.settled else "no plan that obeys the rules was found"]
    most = 100 * front.share(front.views_bound)
    said = [
        f"views: drones that see a person, at most {front.views.cameras} counted, over all people "
        f"and steps; {front.most_views:g} if all were seen so",
        f"no plan of these drones has more than {most:.1f} % of them",
    ]
    if front.settled:
        words = "no weights of J and views have a better plan"
        if len(front.plans) == 1:
            words = "one plan is the best of both"
        said.append(f"the trade-off is settled: {words}")
    elif math.isfinite(front.gap):
        said.append(f"between plans and proofs there is at most {100 * front.gap:.2f} %")
    return said


def _asked(front: Front, share: float | None) -> list[str]:
    """Returns the sentence on the share that was asked for."""
    if share is None:
        return []
    views = share * front.most_views
    found, bound = front.best_with(views), front.reward_bound(views)
    if bound == -math.inf:
        return [f"no plan of these drones keeps {100 * share:g} %: that is proved"]
    words = "none was found" if found is None else f"the best one found has J = {found.reward:,.2f}"
    return [f"with {100 * share:g} % of views {words}; none has more than {bound:,.2f}"]


COMMANDS = {"front": _front}
