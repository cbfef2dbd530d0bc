"""Recipes whose drones end above ground on which they can land."""

import json
from pathlib import Path

import numpy as np
import pytest

import cocap_opt as co
from cocap_opt.data import ProblemError
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.touchdowns import LANDING, Touchdowns
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import GoalArea, Problem
from cocap_opt.referee import check
from cocap_opt.scenarios.recipe import read
from cocap_opt.stop import never

ROOFS = range(4, 6)  # cells x, between the drone and the person
LAND = 'land = "ground"'
RECIPE = """
steps = 2
step = 2.0
[map]
file = "houses.asc"
{more}
[[walk]]
points = [[15, 7], [15.1, 7]]
speed = 0.01
[[drones]]
starts = [{{ x = 7, y = 7, height = 5 }}]
motion = {{ layers = [5] }}
{land}
"""


def write_houses(folder: Path, roof: float) -> None:
    """A map of 9 x 7 cells of 2 m with a row of roofs across it, and its rim."""
    heights = np.zeros((9, 7))
    heights[ROOFS] = roof
    header = "ncols 9\nnrows 7\nxllcorner 0\nyllcorner 0\ncellsize 2\n"
    rows = "\n".join(" ".join(map(str, row)) for row in heights.T[::-1].tolist())
    (folder / "houses.asc").write_text(header + rows)


def scene(folder: Path, land: str = LAND, more: str = "", roof: float = 1.0) -> Problem:
    """The scene of a recipe of a drone, houses, and a person behind them."""
    write_houses(folder, roof)
    path = folder / "scene.toml"
    path.write_text(RECIPE.format(land=land, more=more))
    return read(path)


def test_plans_end_where_drones_can_land(tmp_path: Path) -> None:
    """The optimum is another, no planner ends on the roof, and the certificate holds."""
    free, problem = scene(tmp_path, land=""), scene(tmp_path)
    best, landing = co.solve(free, time_limit=60), co.solve(problem, time_limit=60)
    assert best.plan is not None and landing.plan is not None
    assert best.plan.paths[0][-1].x in ROOFS
    assert landing.plan.paths[0][1].x in ROOFS and landing.plan.paths[0][-1].x not in ROOFS
    assert landing.value < 0.99 * best.value
    assert landing.bound == pytest.approx(landing.value)
    verified = co.verify(problem, landing.plan, landing.certificate, second_opinion=True)
    assert verified.gap == pytest.approx(0.0, abs=1e-6)
    assert check(problem, best.plan).violations == (
        "paths[0]: must end in one of its goals, not in cell "
        f"({best.plan.paths[0][-1].x}, {best.plan.paths[0][-1].y})",
    )
    for name, planner in PLANNERS.items():
        result = planner(problem, never)
        assert result.plan is not None and not check(problem, result.plan).violations, name
        assert result.value <= landing.value * (1 + 1e-9), name


def test_nothing_but_ground_is_landed_on(tmp_path: Path) -> None:
    """Roofs, water, buildings by the land cover, what hangs above, and no-fly zones are left out.

    The sheet warns of all of these but the last two if drones end there.
    """
    squares = [("water", 0), ("building", 2), ("green", 14)]  # m, their west
    features = [
        {"type": "Feature", "properties": {"kind": kind}, "geometry": {
            "type": "Polygon",
            "coordinates": [[[x, 0], [x + 2, 0], [x + 2, 2], [x, 2], [x, 0]]],
        }}
        for kind, x in squares
    ]  # fmt: skip
    (tmp_path / "land.geojson").write_text(
        json.dumps({"type": "FeatureCollection", "features": features})
    )
    (tmp_path / "walls.wkt").write_text("POLYGON ((14 4, 16 4, 16 6, 14 6, 14 4))")
    more = (
        '[[land_cover]]\nfile = "land.geojson"\nunit = "m"\n'
        '[[walls]]\nfile = "walls.wkt"\nunit = "m"\npolygons = "obstacles"\nbase = 9\nheight = 1\n'
        "[[no_fly]]\npolygon = [[14, 8], [16, 8], [16, 10], [14, 10]]\nbottom = 20\n"
    )
    problem = scene(tmp_path, more=more)
    goal = problem.robots[0].goal
    assert isinstance(goal, GoalArea)
    closed = {(x, y) for x in ROOFS for y in range(7)} | {(0, 0), (1, 0), (7, 2), (7, 4)}
    assert {*goal.cells} == {(x, y) for x in range(9) for y in range(7)} - closed
    free = problem.replace(robots=(problem.robots[0].replace(goal=None),))
    for x, y in closed | {*goal.cells}:
        start = co.State(x, y)
        there = free.replace(robots=(free.robots[0].replace(start=start),))
        flight = Flight.of(there, co.Plan(paths=((start,) * 3,)), False)
        warned = [*Touchdowns.of(flight).warnings({LANDING})]
        assert bool(warned) == ((x, y) in closed - {(7, 2), (7, 4)}), (x, y)


@pytest.mark.parametrize(
    ("land", "more", "words"),
    [
        (LAND, "lowest = 3\n[[no_fly]]\npolygon = [[0, 0], [18, 0], [18, 14], [0, 14]]\nbottom = 9",
         r"drones\[0\].land: must be left out here: none of .* is above free ground"),
        (LAND, "[airspace]\nceiling = 2",
         r"drones\[0\].motion.layers: must be .*: the ceiling is at 2 m"),
        (LAND, "[[no_fly]]\npolygon = [[0, 0], [18, 0], [18, 14], [0, 14]]",
         r"drones\[0\].motion.layers: must be .*: no-fly zones cover all cells that are open"),
        (f"{LAND}\nhomes = [[3, 3]]", "", r"drones\[0\].land: must be left out beside homes"),
        ('land = "roof"', "", r"""land: must be "ground", not 'roof'"""),
    ],
)  # fmt: skip
def test_a_recipe_without_ground_is_refused_in_a_line(
    tmp_path: Path, land: str, more: str, words: str
) -> None:
    """It names the field, and what to do."""
    with pytest.raises(ProblemError, match=words) as error:
        scene(tmp_path, land=land, more=more)
    assert "\n" not in str(error.value)


def test_a_map_that_does_not_tell_the_ground_is_refused(tmp_path: Path) -> None:
    """Low roofs look like a slope, unless the recipe has the ground."""
    with pytest.raises(ProblemError, match=r"land: .* if the height of the ground is unknown"):
        scene(tmp_path, roof=0.2)
