"""The command `limits`: the moves that drones' limits allow in a recipe, and their cost in J."""

import math
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.cli.options import USUAL, Budget, Json, Scene, Seed, load_planned
from cocap_opt.console.progress import Watch
from cocap_opt.console.streams import without_warnings
from cocap_opt.data import ProblemError
from cocap_opt.files.documents import FileError
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import PlanReader
from cocap_opt.output.printing import Listing, Record
from cocap_opt.output.told_bounds import is_attained, told_bound, told_gap
from cocap_opt.problem import Problem
from cocap_opt.problem.motion import MOST_MOVED
from cocap_opt.referee import check
from cocap_opt.run.kept_share import run_keeping
from cocap_opt.run.options import UsageError
from cocap_opt.scenarios.built_in import places
from cocap_opt.stop import Interrupt

_METHOD = "column-generation"
# Keys of rows, short enough for a terminal of 80 characters.
_HEADS = {
    "moves of recipe": "moves\nof recipe", "longest of recipe (m)": "longest (m)\nof recipe",
    "turn of recipe (deg)": "turn (deg)\nof recipe",
}  # fmt: skip


def _limits(
    scene: Scene,
    plan: Annotated[
        Path | None, Parameter(help="plan for the scene, whose J is compared with the bound")
    ] = None,
    /,
    *,
    seed: Seed = 0,
    budget: Budget = USUAL,
    json: Json = False,
) -> int:
    """Show which moves the limits of a recipe's drones allow, and how much J they can cost at most.

    In a recipe with limits, plans consist of moves that drones can fly smoothly in any order. If
    you pass a plan, the command also computes a certified bound on J without the limits, from
    starts in the same cells: the difference to the plan's J is the most that the limits can cost.

    Example: cocap-opt limits scene.toml plan.json
    """
    allowance = budget.allowance
    problem = load_planned(scene, seed)
    unlimited = _unlimited(Path(scene), seed)
    answer: Record = {"scene": problem.name, "seed": seed}
    rows, notes = _rows(problem, unlimited), []
    if plan is not None:
        wide = _with_moves_of(problem, unlimited)
        given = PlanReader(scene, problem).plan(plan).plan
        reward = check(problem, given).reward
        with Interrupt.caught() as interrupt, Watch.on_terminal(problem.name) as watch:
            judged = run_keeping(
                wide, _METHOD, allowance.begin(interrupt), watch=watch, start=None,
                report=watch.report(), gap=OPTIMALITY,
            )  # fmt: skip
        bound, limit = judged.result.bound, judged.result.limit
        lost = max(bound - reward, 0.0)
        answer |= {"reward": reward, "bound": bound, "lost": lost}
        if limit is not None:
            notes.append(f"the search for the bound was stopped by the {limit} limit")
        if reward > bound and not is_attained(bound, reward):
            notes.append(
                f"the limits cost nothing: this plan moves by parts of cells and has J "
                f"{reward:,.2f}; certified: no plan that moves by whole cells has a J above "
                f"{bound:,.2f}"
            )
        elif math.isfinite(bound):
            most = f"no plan has a J above {told_bound(bound, reward)}"
            gap = told_gap(lost / bound if bound else 0.0)
            this = f"is below the best by {gap}"
            if is_attained(bound, reward):
                this = "is optimal"
            notes.append(
                f"certified: with all moves of the recipe {most}; this plan, with J "
                f"{reward:,.2f}, {this}"
            )
        else:
            notes.append("no bound was found in time; try a longer --time-limit")
    if json:
        print_result({**answer, "drones": rows, "notes": notes}, json)
    else:
        shown = [{_HEADS.get(key, key): value for key, value in row.items()} for row in rows]
        Listing("moves in a step, and those of the recipe", shown, notes).print()
    return 0


def _unlimited(path: Path, seed: int) -> Problem:
    """Returns the scene of a recipe without limits of its drones."""
    from cocap_opt.scenarios.recipe import read, without_limits  # its readers take long to import

    if path.suffix.lower() != ".toml":
        hint = (
            f"; `cocap-opt recipe {path} -o FOLDER` copies its recipe"
            if str(path) in places.SCENES
            else ""
        )
        raise UsageError(f"SCENE: must be a recipe, a .toml file, not {path}{hint}")
    try:
        with without_warnings("cocap_opt.scenarios"):
            return read(path, seed, without_limits)
    except ProblemError as error:
        raise FileError(str(error)) from error


def _with_moves_of(problem: Problem, other: Problem) -> Problem:
    """Returns a problem whose drones make the moves of another, from its own starts and cells.

    Flight heights are also those of the other, if limits raise them over steep ground.
    """
    parts = round(other.height_map.resolution / problem.height_map.resolution)
    robots = []
    for i, (robot, free) in enumerate(zip(problem.robots, other.robots, strict=True)):
        if free.motion.radius * parts > MOST_MOVED:
            raise UsageError(
                f"PLAN: must be left out: cells are divided by {parts} for the limits, so drone "
                f"{i} of the recipe moves by {free.motion.radius * parts} of them in a step, and "
                f"no more than {MOST_MOVED} can be compared"
            )
        times = robot.motion.headings // free.motion.headings
        motion = free.motion.replace(
            radius=free.motion.radius * parts,
            spacing=free.motion.spacing * parts,
            headings=robot.motion.headings,
            turn=free.motion.turn * times,
        )
        robots.append(robot.replace(motion=motion, limits=None))
    airspace = problem.airspace.replace(people_stray=0.0)
    terrain = problem.height_map.replace(lift=None)
    return problem.replace(robots=tuple(robots), airspace=airspace, height_map=terrain)


def _rows(problem: Problem, unlimited: Problem) -> list[Record]:
    """Returns the moves of each drone beside those in the recipe."""
    rows: list[Record] = []
    for i in range(len(problem.robots)):
        row: Record = {"drone": i}
        for name, scene in (("", problem), (" of recipe", unlimited)):
            motion, terrain = scene.robots[i].motion, scene.height_map
            row |= {
                f"moves{name}": len(motion.moves_on(terrain)),
                f"longest{name} (m)": motion.longest_aside(terrain.resolution),
                f"turn{name} (deg)": 360 / motion.headings * min(motion.turn, motion.headings // 2),
            }
        rows.append(row)
    return rows


COMMANDS = {"limits": _limits}
