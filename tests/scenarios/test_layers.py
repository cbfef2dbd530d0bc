"""Further maps on the map of a recipe: buildings, and trees with and without trunks."""

import itertools
from pathlib import Path

import numpy as np
import pytest
import rasterio
from hypothesis import given
from hypothesis import strategies as st
from rasterio.transform import Affine
from strategies import examples

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.problem import Plan, Problem, State
from cocap_opt.referee import check
from cocap_opt.scenarios.maps import layers
from cocap_opt.scenarios.maps.layers import highest_in_cells, merged
from cocap_opt.scenarios.maps.raster import Raster
from cocap_opt.scenarios.recipe import read
from cocap_opt.world.workspace import HeightMap

RECIPE = """
steps = 2
[map]
{map}
[[walk]]
points = [[9.5, 4.5]]
heading = 180
[[drones]]
starts = [{ x = 1.5, y = 4.5, height = 3 }]
motion = { layers = [3, 6, 12] }
"""


def grid(path: Path, heights: FloatArray, x: float = 0.0, y: float = 0.0, cell: float = 1.0) -> str:
    """Writes an ESRI grid of heights [X, Y], and returns its name; nan is no data."""
    rows = np.where(np.isnan(heights), -9999, heights).T[::-1]
    width, depth = heights.shape
    head = f"ncols {width}\nnrows {depth}\nxllcorner {x}\nyllcorner {y}\ncellsize {cell}\n"
    text = "\n".join(" ".join(f"{v:g}" for v in row) for row in rows)
    path.write_text(f"{head}NODATA_value -9999\n{text}\n")
    return path.name


def scene(folder: Path, *tables: str, base: str = "size = [12, 9]") -> Problem:
    """The scene of a recipe with these layers."""
    path = folder / "scene.toml"
    path.write_text(RECIPE.replace("{map}", base) + "".join(f"[[layer]]\n{t}\n" for t in tables))
    return read(path)


def solid(problem: Problem, x: int, y: int) -> list[tuple[float, float]]:
    """Altitudes between which a cell is solid, above the height map's column, which comes last."""
    column, *rest = problem.workspace.columns.at(x, y)
    return [*rest, (0.0, column[1])]


rasters = st.builds(
    lambda seed, shape, cell, origin: Raster(
        np.where(
            (draw := np.random.default_rng(seed)).random(shape) < 0.2,
            np.nan, draw.integers(0, 9, shape).astype(float),
        ),
        cell, origin,
    ),
    st.integers(0, 10**6), st.tuples(st.integers(1, 6), st.integers(1, 6)),
    st.tuples(st.sampled_from((0.3, 0.5, 1.0, 1.7, 3.0)), st.sampled_from((0.5, 1.0, 2.2))),
    st.tuples(st.sampled_from((-2.0, 0.0, 0.25, 3.5)), st.sampled_from((-1.5, 0.0, 2.75))),
)  # fmt: skip


@examples(150)
@given(rasters, st.sampled_from((0.5, 1.0, 1.5)))
def test_no_obstacle_is_lost_between_cells(raster: Raster, resolution: float) -> None:
    """Each cell of the map has the highest of all cells of the layer that it overlaps."""
    height_map = HeightMap(heights=np.zeros((5, 4)), resolution=resolution, origin=(0.0, 0.0))
    found = highest_in_cells(raster, height_map)
    for x, y in itertools.product(range(5), range(4)):
        low, high = np.array([x, y]) * resolution, np.array([x + 1, y + 1]) * resolution
        heights = []
        for i, j in itertools.product(*map(range, raster.values.shape)):
            first = np.array(raster.origin) + np.array([i, j]) * raster.cell
            overlap = np.minimum(high, first + raster.cell) - np.maximum(low, first)
            if (overlap > 1e-9).all() and not np.isnan(raster.values[i, j]):
                heights.append(raster.values[i, j])
        expected = max(heights, default=np.nan)
        np.testing.assert_equal(found[x, y], expected)


@examples(100)
@given(st.integers(0, 10**6))
def test_boxes_are_the_cells(seed: int) -> None:
    """Each cell is in one box with its heights, or in none if nothing is there."""
    draw = np.random.default_rng(seed)
    there = draw.random((6, 5)) < 0.7
    low, high = draw.integers(-1, 2, (6, 5)), draw.integers(3, 5, (6, 5))
    count = np.zeros((6, 5), dtype=int)
    boxes = merged(there, low, high)
    for x0, y0, x1, y1, bottom, top in boxes:
        count[x0:x1, y0:y1] += 1
        assert (low[x0:x1, y0:y1] == bottom).all() and (high[x0:x1, y0:y1] == top).all()
    np.testing.assert_array_equal(count, there)
    alike = merged(np.ones((6, 5), dtype=bool), np.zeros((6, 5), int), np.ones((6, 5), int))
    assert alike == [(0, 0, 6, 5, 0, 1)]


def test_layers_add_up_to_the_highest(tmp_path: Path) -> None:
    """Buildings and trees down to the ground on bare terrain, above it or absolute."""
    ground = np.add.outer(np.linspace(10, 12, 12), np.zeros(9))
    houses, trees = np.zeros((12, 9)), np.zeros((12, 9))
    houses[4:6, 2:4], trees[5:8, 3:6] = 8.0, 5.0
    base = f'file = "{grid(tmp_path / "ground.asc", ground)}"\nheights = "absolute"\n'
    both = (
        f'file = "{grid(tmp_path / "houses.asc", houses)}"',
        f'file = "{grid(tmp_path / "trees.asc", ground + trees)}"\nheights = "absolute"',
    )
    problem = scene(tmp_path, *both, base=base + 'ground = "surface"')
    expected = ground + np.maximum(houses, trees)
    np.testing.assert_allclose(problem.height_map.heights, expected, atol=1e-4)
    np.testing.assert_allclose(problem.height_map.ground, ground, atol=1e-4)
    assert not problem.meshes
    other = scene(tmp_path, *both[::-1], base=base + 'ground = "surface"')
    np.testing.assert_array_equal(other.height_map.heights, problem.height_map.heights)


@pytest.mark.parametrize("value", [1000.5, 2640.0, 8888.0])
def test_nothing_on_earth_is_so_tall(tmp_path: Path, value: float) -> None:
    """Neither on a map nor in a layer, nor above a ground: it is a code, or above the sea."""
    trees = np.zeros((12, 9))
    trees[4, 3] = value
    file = f'file = "{grid(tmp_path / "trees.asc", trees)}"'
    ground = f'heights = "absolute"\nground = "{grid(tmp_path / "g.asc", np.zeros((12, 9)))}"'
    words = f"heights: must be at most 1000 m above the ground, but the highest is {value:g} m"
    for base, files in ((file, ()), (f"{file}\n{ground}", ()), ("size = [12, 9]", (file,))):
        with pytest.raises(ProblemError, match=words):
            scene(tmp_path, *files, base=base)


def test_crowns_leave_room_below(tmp_path: Path) -> None:
    """A drone flies below and above, not within; bushes are solid; without trunks all is."""
    trees = np.zeros((12, 9))
    trees[4:7, 3:6], trees[8, 1] = 9.2, 2.5
    name = grid(tmp_path / "trees.asc", trees)
    problem = scene(tmp_path, f'file = "{name}"\ntrunks = 4.2')
    assert solid(problem, 5, 4) == [(4.0, 10.0), (0.0, 0.0)]  # rounded outwards
    assert solid(problem, 8, 1) == [(0.0, 2.5)]
    free = problem.robots[0].motion.free_places(problem.workspace)
    assert free[:, 5, 4].tolist() == [True, False, True]
    filled = scene(tmp_path, f'file = "{name}"')
    assert solid(filled, 5, 4) == [(0.0, 9.2)]
    free = filled.robots[0].motion.free_places(filled.workspace)
    assert free[:, 5, 4].tolist() == [False, False, True]


def test_crowns_hide_people_as_they_block_drones(tmp_path: Path) -> None:
    """The person behind the trees is seen from below the crowns, and not past solid ones."""
    trees = np.zeros((12, 9))
    trees[4:7, 2:7] = 9.0
    name = grid(tmp_path / "trees.asc", trees)
    hovers = Plan(paths=((State(1, 4, 0, 0),) * 3,))
    rewards = [
        check(scene(tmp_path, *tables), hovers).reward
        for tables in ((), (f'file = "{name}"\ntrunks = 4',), (f'file = "{name}"',))
    ]
    assert rewards[0] == pytest.approx(rewards[1]) and rewards[0] > 0
    assert rewards[2] == 0


def test_what_a_layer_does_not_know_is_left_as_it_is(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Holes and what lies beside it add nothing, which a line says; low things are no obstacle."""
    part = np.full((6, 9), 3.0)
    part[0, 0], part[1, 1] = np.nan, 0.4
    name = grid(tmp_path / "part.asc", part, x=6.0)
    problem = scene(tmp_path, f'file = "{name}"\nlowest = 0.5')
    heights = problem.height_map.heights
    assert (heights[:6] == 0).all() and heights[6, 0] == 0 and heights[7, 1] == 0
    assert (heights[8:] == 3).all()
    assert "part.asc: has no data on 51 % of the map, and adds nothing there" in caplog.text


def write_tif(path: Path, crs: str, x: float = 0.0) -> str:
    """A GeoTIFF of 12 x 9 cells."""
    with rasterio.open(
        path, "w", driver="GTiff", width=12, height=9, count=1, dtype="float32", crs=crs,
        transform=Affine(1, 0, x, 0, -1, 9),
    ) as file:  # fmt: skip
        file.write(np.zeros((9, 12), dtype=np.float32), 1)
    return path.name


def test_layers_that_do_not_fit_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One line with the table, the file and what would do."""
    base = f'file = "{write_tif(tmp_path / "map.tif", "EPSG:25830")}"'
    other = write_tif(tmp_path / "other.tif", "EPSG:32633")
    far = write_tif(tmp_path / "far.tif", "EPSG:25830", x=900.0)
    trees = grid(tmp_path / "trees.asc", np.add.outer(np.arange(12.0), np.arange(9.0)) % 5 * 3 + 5)
    monkeypatch.setattr(layers, "MOST_BOXES", 9)
    for table, words in (
        (
            f'file = "{other}"',
            r"layer\[0\]: other.tif: must be in the reference system of the",
        ),
        (
            f'file = "{far}"',
            r"layer\[0\]: .*far.tif: must overlap the map, x 0..12 and y 0..9 m",
        ),
        ('file = "no.tif"', r"layer\[0\]: .*no.tif: no such file"),
        (
            f'file = "{trees}"\ntrunks = 4',
            r"layer\[0\]: trees.asc: trunks: must leave at most 9",
        ),
        (f'file = "{trees}"\ntrunks = 0', r"layer\[0\].trunks: must be a number >= "),
        (
            f'file = "{trees}"\ntrunk = 4',
            r"layer\[0\]: .*unknown field `trunk`; did you mean",
        ),
    ):
        with pytest.raises(ProblemError, match=words) as error:
            scene(tmp_path, table, base=base)
        assert "\n" not in str(error.value)


def test_a_layer_gives_a_flat_map_its_place(tmp_path: Path) -> None:
    """The reference system of a map without a file is that of the layer."""
    name = write_tif(tmp_path / "trees.tif", "EPSG:25830")
    earth = scene(tmp_path, f'file = "{name}"').earth
    assert earth is not None and earth.crs == "EPSG:25830"
