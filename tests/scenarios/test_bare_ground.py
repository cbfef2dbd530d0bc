"""The ground of recipes whose flight heights are above the sea, which scenes keep for warnings."""

from pathlib import Path

import numpy as np
import pytest

import cocap_opt as co
from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.files.documents import SceneFile, problem_digest
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.touchdowns import Touchdowns
from cocap_opt.plausibility import buried
from cocap_opt.scenarios.recipe import read

HILL = np.add.outer(np.zeros(20), 100.0 + np.arange(12) / 5)  # rises by 1 : 5 along y
ROOF = (7, 4)  # its cell; it is 3 m high
RECIPE = """
steps = 2
flight = "above-sea"
{more}
[map]
file = "surface.asc"
heights = "absolute"
ground = "ground.asc"
[[walk]]
points = [[3, 6.5], [9, 6.5]]
[[drones]]
starts = [{{ x = 7.5, y = 4.5 }}, {{ x = 13.5, y = 8.5 }}]
motion = {{ layers = [125] }}
{limits}
"""


def write_grid(path: Path, values: FloatArray) -> None:
    """An ESRI grid of heights [X, Y] whose lower left corner is (0, 0), in cells of 1 m."""
    header = "ncols 20\nnrows 12\nxllcorner 0\nyllcorner 0\ncellsize 1\n"
    path.write_text(header + "\n".join(" ".join(map(repr, row)) for row in values.T[::-1].tolist()))


def scene(folder: Path, more: str = "", limits: str = "") -> co.Problem:
    """The scene of a recipe of two drones above a hill, the first above a roof on it."""
    surface = HILL.copy()
    surface[ROOF] += 3.0
    write_grid(folder / "ground.asc", HILL)
    write_grid(folder / "surface.asc", surface)
    path = folder / "scene.toml"
    path.write_text(RECIPE.format(more=more, limits=limits))
    return read(path)


def hovering(problem: co.Problem) -> Flight:
    """The flight of drones that stay at their starts."""
    paths = tuple((start,) * (problem.horizon + 1) for start in problem.first_starts)
    return Flight.of(problem, co.Plan(paths=paths), False)


def warned(problem: co.Problem) -> list[str]:
    """The warnings of the ground below drones that stay."""
    return [*Touchdowns.of(hovering(problem)).warnings()]


def test_roofs_are_known_where_flight_heights_are_above_the_sea(tmp_path: Path) -> None:
    """Only the drone above the roof is warned of, though the ground of the other is higher."""
    problem = scene(tmp_path)
    assert problem.height_map.datum is None and problem.height_map.knows_ground
    roof = "an obstacle 3.0 m above the ground"
    words = [f"drone 0 takes off from {roof}; start it elsewhere",
             f"drone 0 lands on {roof}; land it elsewhere"]  # fmt: skip
    assert warned(problem) == words
    above = hovering(problem).columns()["above_ground"]
    assert [*np.unique(above)] == pytest.approx([125.0 - 101.6, 125.0 - 100.8])
    divided = scene(tmp_path, limits="limits = { speed = 5, acceleration = 3 }")
    assert divided.height_map.resolution < 1.0
    assert warned(divided) == words


def test_a_scene_file_keeps_the_ground_which_is_in_no_digest(tmp_path: Path) -> None:
    """Files of before, which have no such field, are read, and plans of them fit."""
    problem = scene(tmp_path)
    SceneFile(problem=problem).save(tmp_path / "new.json")
    again = SceneFile.read(tmp_path / "new.json").problem
    np.testing.assert_array_equal(again.height_map.ground, HILL)
    assert warned(again) == warned(problem)
    text = (tmp_path / "new.json").read_text()
    rows = text.index(',\n   "bare": [')
    (tmp_path / "old.json").write_text(text[:rows] + text[text.index("\n  }", rows) :])
    old = SceneFile.read(tmp_path / "old.json").problem
    assert old.height_map.bare is None and not old.height_map.knows_ground
    assert warned(old) == []
    assert problem_digest(old) == problem_digest(again) == problem_digest(problem)
    with pytest.raises(ProblemError, match="bare: must have 20 x 12 cells"):
        problem.height_map.replace(bare=np.zeros((3, 3)))


def test_people_who_are_drawn_aside_stand_on_a_slope(tmp_path: Path) -> None:
    """Feet follow the ground, also where flight heights do not."""
    problem = scene(tmp_path, more="spread = { takes = 4, aside = 2.0, speed = 0.3 }")
    assert len(problem.actors) == 4
    for actor in problem.actors:
        at = problem.height_map.cells_below(actor.poses)
        np.testing.assert_allclose(actor.poses[:, 2], HILL[at])
        assert not buried(problem.workspace, actor, problem.horizon)


@pytest.mark.parametrize("cell", [0.5, 3.0, 8.0])
def test_ground_in_cells_of_another_size_keeps_its_slope(tmp_path: Path, cell: float) -> None:
    """Smaller cells are averaged, and larger ones interpolated with those around the map."""

    def write(name: str, low: float, size: float, heights: FloatArray) -> None:
        head = f"ncols {len(heights)}\nnrows {len(heights.T)}\nxllcorner {low}\nyllcorner {low}\n"
        rows = "\n".join(" ".join(map(repr, row)) for row in heights.T[::-1].tolist())
        (tmp_path / name).write_text(f"{head}cellsize {size}\n{rows}")

    count = int(48 / cell)
    middles = -16 + cell * (np.arange(count) + 0.5)
    write("ground.asc", -16, cell, np.add.outer(100 + 0.2 * middles, 0.1 * middles))
    write("map.asc", 0, 1.0, np.zeros((16, 12)))
    path = tmp_path / "scene.toml"
    path.write_text(
        'steps = 2\nmap = { file = "map.asc", ground = "ground.asc" }\n'
        "[[walk]]\npoints = [[2.5, 3.5], [13.5, 9.5]]\n"
        "[[drones]]\nstarts = [{ x = 8.5, y = 2.5 }]\n"
    )
    problem = read(path)
    for x, y, z, _ in problem.actors[0].poses.tolist():
        inside = np.floor([x, y]) + 0.5
        assert z == pytest.approx(100 + 0.2 * inside[0] + 0.1 * inside[1], abs=1e-9)


def test_holes_in_the_ground_are_named(tmp_path: Path) -> None:
    """`fill` is for the map, so the ground's must be filled in its file."""
    ground = HILL.copy()
    ground[5, 3] = np.nan
    scene(tmp_path)
    write_grid(tmp_path / "ground.asc", ground)
    with pytest.raises(ProblemError, match=r"map.ground: must .* 1 of 240 .* gdal_fillnodata"):
        read(tmp_path / "scene.toml")
