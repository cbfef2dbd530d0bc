"""The drawings of the pages, made from stored results or from plans that are computed here.

`docs/write.py` writes them into `docs/pictures`. The gallery shows a plan of each of its scenes
from above; on the built site, a player replaces the picture.
"""

import re
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

from cocap_opt.experiments.lab.results import STORED
from cocap_opt.experiments.lab.studies.browser.files import EXAMPLE, certified
from cocap_opt.experiments.lab.studies.flight.figure import flight_figure
from cocap_opt.experiments.lab.studies.flight.flight import stored_flights
from cocap_opt.experiments.lab.studies.growth.figure import growth_figure
from cocap_opt.experiments.lab.studies.growth.points import GrowthPoint, Sample
from cocap_opt.experiments.lab.studies.paper.conditions import read_trials
from cocap_opt.experiments.lab.studies.paper.figures import (
    StepReward,
    ablation_figure,
    conditions_figure,
    curves_figure,
    curves_of,
    encounter_figure,
)
from cocap_opt.experiments.lab.studies.paper.giving_way import Encounter
from cocap_opt.experiments.lab.studies.paper.measured import read_rows
from cocap_opt.experiments.lab.studies.paper.reproduction import effects_of
from cocap_opt.experiments.lab.studies.quality.figure import quality_figure
from cocap_opt.experiments.lab.studies.quality.quality import stored_plans, stored_steps
from cocap_opt.experiments.lab.studies.separation.figure import separation_figure
from cocap_opt.experiments.lab.studies.separation.points import SeparationPoint
from cocap_opt.experiments.report.charts import gaps_figure
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.output.files import make_folder
from cocap_opt.pictures.figures import picture, plan_picture
from cocap_opt.pictures.rendering import drone_view
from cocap_opt.planners import RECOMMENDED
from cocap_opt.player.player import Player
from cocap_opt.player.player_proof import CHECK_PAGE, Proof
from cocap_opt.problem import Plan, Problem
from cocap_opt.run.engine import run
from cocap_opt.run.explained import gaps_of
from cocap_opt.scenarios import SCENES, load_scene
from cocap_opt.scenarios.built_in import places

_SVG, _PNG = ".svg", ".png"
_GAPS_OF = ("greedy", "sequential", "sequential-rounds", "cocap", "cocap-vs", RECOMMENDED)
_GAPS_IN = ("bottleneck", "passage")
GALLERY = ("delft", "delft-walkers", "corridor", "bottleneck", "passage", "bridge", "field")
# Recipes in the folder of a built-in place that are not scenes of their own: the place, and what
# the gallery says of the recipe.
RECIPES = {
    "delft-walkers": (
        "delft",
        "Recorded people in the lane of delft: one goes up, three come down, and five drones film "
        "them for six seconds. They are volunteers of an experiment of Forschungszentrum Jülich, "
        "in a corridor 4 m wide; their tracks are turned and moved into the lane, neither scaled "
        "nor changed in time. So short a time lets drones within their autopilot's limits get 3.5 "
        "m far, so the planner also chooses where they start.",
    )
}
_GIVING_WAY = ("greedy", "sequential", "cocap")


def _gaps() -> bytes:
    rows = [row for row in _paper() if row.scene in _GAPS_IN and row.planner in _GAPS_OF]
    return picture(gaps_figure(rows), _SVG)


def _rewards() -> bytes:
    rewards = StepReward.read(STORED / "curves.csv")
    return picture(curves_figure(curves_of(rewards)), _SVG)


def _ablation() -> bytes:
    return picture(ablation_figure(effects_of(_paper())), _SVG)


def _conditions() -> bytes:
    return picture(conditions_figure(read_trials(STORED / "paper-conditions.csv")), _SVG)


def _separation() -> bytes:
    return picture(separation_figure(SeparationPoint.read(STORED / "separation.csv")), _SVG)


def _flight() -> bytes:
    return picture(flight_figure(stored_flights()), _SVG)


def _quality() -> bytes:
    return picture(quality_figure(stored_steps(), stored_plans()), _PNG)


def _growth() -> bytes:
    samples = Sample.read(STORED / "growth.csv")
    return picture(growth_figure(GrowthPoint.all_of(samples), samples[0].limit), _SVG)


def _giving_way() -> bytes:
    """Draws the encounter, among ten seeds, in which a drone gives up most for its team."""
    found: list[Encounter] = []
    for seed in range(10):
        problem = load_scene("bottleneck", seed)
        found += Encounter.all_of(problem, seed, _plan(problem, "greedy"), _plan(problem, "cocap"))
    most = Encounter.most_generous(found)
    assert most is not None, "no drone gives way"
    problem = load_scene("bottleneck", most.seed)
    plans = {name: _plan(problem, name) for name in _GIVING_WAY}
    return picture(encounter_figure(problem, most, plans), _SVG)


def _top_view(scene: str, *steps: int) -> bytes:
    return plan_picture(*_recommended(scene), _SVG, steps)


def _view() -> bytes:
    return drone_view(*_recommended("bottleneck"), robot=0, t=5, width=500)


@cache
def _recommended(scene: str) -> tuple[Problem, Plan]:
    """Returns a scene of the gallery, with seed 0, and its plan by the recommended planner."""
    path = places.FOLDER / RECIPES[scene][0] / f"{scene}.toml" if scene in RECIPES else scene
    problem = load_scene(str(path), 0)
    return problem, _plan(problem, RECOMMENDED)


@cache
def _paper() -> list[GapRow]:
    return read_rows(STORED / "paper.csv")


def _plan(problem: Problem, planner: str) -> Plan:
    plan: Plan | None = run(problem, planner).result.plan
    assert plan is not None, f"{problem.name}: {planner} has no plan"
    return plan


DRAWINGS: dict[str, Callable[[], bytes]] = {
    "gaps.svg": _gaps,
    "rewards.svg": _rewards,
    "ablation.svg": _ablation,
    "conditions.svg": _conditions,
    "giving-way.svg": _giving_way,
    "separation.svg": _separation,
    "flight.svg": _flight,
    "growth.svg": _growth,
    "quality.png": _quality,  # a bitmap, as it has thousands of points
    "view.png": _view,
    "bottleneck.svg": lambda: _top_view("bottleneck", 0, 5, 11),
    **{f"gallery-{scene}.svg": partial(_top_view, scene) for scene in GALLERY},
}


def gallery_in_markdown() -> str:
    """Returns a part for each scene, with a picture of its plan and the commands for its player."""
    return "\n\n".join(map(_scene_part, GALLERY))


def _scene_part(name: str) -> str:
    if name in RECIPES:
        place, about = RECIPES[name]
        copy, scene = f"cocap-opt recipe {place} -o shoot\n", f"shoot/{name}.toml"
    else:
        copy, scene, about = "", name, " ".join((SCENES[name].__doc__ or "").split())
    return (
        f"## {name}\n\n{about}\n\n"
        f"![The recommended planner's plan of {name} from above](pictures/gallery-{name}.svg)\n\n"
        f"```sh\n{copy}cocap-opt plan {scene} -o {name}.json\n"
        f"cocap-opt show {scene} {name}.json -o {name}.html\n```"
    )


def with_players(page: str) -> str:
    """Returns the HTML of the gallery's page with players in addition to its pictures.

    The style sheet shows the pictures on phones, and the players elsewhere.
    """
    return re.sub(
        r'<img ([^>]*src="[^"]*/gallery-([\w-]+)\.svg"[^>]*>)',
        r'<img class="small" \1<iframe class="player" src="players/\2.html" title="\2" '
        r'loading="lazy"></iframe>'
        r'<a href="players/\2.html">The player of \2 on a page of its own</a>',
        page,
    )


def write_players(folder: Path) -> None:
    """Plans each scene of the gallery, and writes its player into a folder.

    The corridor's player has the certificate that is the example of the page that checks files.
    """
    make_folder(folder)
    for name in GALLERY:
        if name == EXAMPLE:
            player = _proved_player()
        else:
            problem, plan = _recommended(name)
            player = Player(problem, [(RECOMMENDED, plan)])
        player.save(folder / f"{name}.html")


def _proved_player() -> Player:
    """Returns the player of the example, with its certificate."""
    found, name = certified(EXAMPLE), f"{EXAMPLE}.json"
    verify = f"cocap-opt verify {EXAMPLE} {name}"
    check = (
        f"cocap-opt export {EXAMPLE} -o {EXAMPLE}.instance",
        f"cocap-check {EXAMPLE}.instance {name}",
    )
    proof = Proof(name, found.content, [verify], [check], f"../{CHECK_PAGE}.html")
    gaps = gaps_of(found.problem, [found.plan], found.certificate)
    return Player(found.problem, [(RECOMMENDED, found.plan)], gaps, [RECOMMENDED], proof=proof)
