"""Bringing rasters to square cells."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from strategies import examples

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.scenarios.maps.raster import MOST_CELLS, SLIVER, Grid, How, Raster
from cocap_opt.world.workspace import HeightMap

HOW: tuple[How, ...] = ("highest", "level")
LENGTHS = st.integers(10, 4000).map(lambda mm: mm / 1000)  # m, not exact in binary


@st.composite
def rasters(draw: st.DrawFn, holes: bool = False, square: bool = False) -> Raster:
    """Rasters of up to 6 x 6 cells at large coordinates."""
    shape = draw(st.tuples(st.integers(1, 6), st.integers(1, 6)))
    heights = st.integers(-20, 90).map(float)
    cells = st.one_of(heights, st.just(math.nan)) if holes else heights
    count = math.prod(shape)
    values = np.array(draw(st.lists(cells, min_size=count, max_size=count))).reshape(shape)
    dx = draw(LENGTHS)
    origin = draw(st.sampled_from([(0.0, 0.0), (500600.988, 4794197.109)]))
    return Raster(values, (dx, dx if square else draw(LENGTHS)), origin)


def resolutions(raster: Raster) -> st.SearchStrategy[float]:
    """Edges that give few cells, multiples and fractions of the raster's among them."""
    return st.one_of(
        st.integers(1, 12).map(lambda k: k * raster.cell[0]),
        st.integers(1, 4).map(lambda k: raster.cell[0] / k),
        LENGTHS,
    ).filter(lambda edge: edge > max(raster.cell) / 20)


def exact(length: float, cell: float) -> Fraction:
    """The ratio of two lengths: both are millimetres, of which one may be cut in four."""
    return Fraction(length / cell).limit_denominator(16_000)


def overlaps(cells: int, ratio: Fraction) -> list[dict[int, Fraction]]:
    """For each target cell, the source cells that it overlaps, and by how much."""
    targets = math.ceil(cells / ratio)
    return [
        {
            k: length
            for k in range(cells)
            if (length := min((j + 1) * ratio, Fraction(k + 1)) - max(j * ratio, Fraction(k))) > 0
        }
        for j in range(targets)
    ]


def between(cells: int, ratio: Fraction) -> list[dict[int, Fraction]]:
    """For each target cell, the shares of the source cells between whose middles its middle is."""
    targets = []
    for j in range(math.ceil(cells / ratio)):
        middle = (j * ratio + min((j + 1) * ratio, Fraction(cells))) / 2
        at = min(max(middle - Fraction(1, 2), Fraction(0)), Fraction(cells - 1))
        low = math.floor(at)
        shares = {low: 1 - (at - low), low + 1: at - low}
        targets.append({k: share for k, share in shares.items() if share > SLIVER})
    return targets


def by_loops(raster: Raster, resolution: float, how: How) -> FloatArray:
    """The grid by its definition, in fractions."""
    ratios = [exact(resolution, cell) for cell in raster.cell]
    along = [
        between(n, ratio) if how == "level" and ratio < 1 else overlaps(n, ratio)
        for n, ratio in zip(raster.values.shape, ratios, strict=True)
    ]
    grid = np.empty([len(targets) for targets in along])
    for i, xs in enumerate(along[0]):
        for j, ys in enumerate(along[1]):
            pairs = [(raster.values[x, y], xs[x] * ys[y]) for x in xs for y in ys]
            if any(math.isnan(value) for value, _ in pairs):
                grid[i, j] = math.nan
            elif how == "highest":
                grid[i, j] = max(value for value, _ in pairs)
            else:
                area = sum(area for _, area in pairs)
                grid[i, j] = float(sum(Fraction(value) * area for value, area in pairs) / area)
    return grid


@examples(80)
@given(data=st.data(), raster=rasters(holes=True))
@pytest.mark.parametrize("how", [pytest.param("highest", marks=pytest.mark.slow), "level"])
def test_grid_follows_its_definition(how: How, data: st.DataObject, raster: Raster) -> None:
    """A cell takes the highest or the mean height of the cells that it overlaps, and their holes;
    the level between coarser ones is interpolated.
    """
    resolution = data.draw(resolutions(raster))
    grid = Grid.of(raster, resolution, how)
    assert grid.resolution == resolution
    assert_allclose(grid.values, by_loops(raster, resolution, how), atol=1e-9)


@examples(80)
@given(data=st.data(), raster=rasters())
def test_highest_loses_no_obstacle(data: st.DataObject, raster: Raster) -> None:
    """The whole grid's highest is the raster's, and of coarser cells it is no lower than the
    mean.
    """
    resolution = data.draw(resolutions(raster))
    highest, level = (Grid.of(raster, resolution, how).values for how in HOW)
    assert highest.max() == raster.values.max()
    if resolution >= max(raster.cell):
        assert (highest >= level - 1e-9).all()


@examples(60)
@given(
    data=st.data(),
    slope=st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
    cells=st.tuples(LENGTHS, LENGTHS),
)
def test_a_slope_stays_a_slope(
    data: st.DataObject, slope: tuple[float, float], cells: tuple[float, float]
) -> None:
    """Away from the edges, the level is that of a plane in the cells' middles; means of finer
    cells, which are steps, are off by half a step at most.
    """

    def middles(raster: Raster) -> tuple[FloatArray, FloatArray]:
        axes = zip(raster.origin, raster.cell, raster.values.shape, strict=True)
        x, y = (low + size * (np.arange(count) + 0.5) for low, size, count in axes)
        return x[:, None], y[None, :]

    def plane(raster: Raster) -> FloatArray:
        x, y = middles(raster)
        return 3.0 + slope[0] * x + slope[1] * y

    terrain = Raster(np.zeros((7, 9)), cells, (2.0, -5.0))
    terrain = terrain._replace(values=plane(terrain))
    corner = tuple(data.draw(st.floats(-2, 2)) + low for low in terrain.origin)
    other = Raster(np.zeros((6, 5)), (data.draw(LENGTHS), data.draw(LENGTHS)), corner)
    found = terrain.level_in(other)
    inside, step = True, 1e-6
    for axis, at in enumerate(middles(other)):
        size, count = terrain.cell[axis], terrain.values.shape[axis]
        reach = max(size, other.cell[axis]) / 2
        step += abs(slope[axis]) * size / 2 if other.cell[axis] >= size else 0.0
        low, high = terrain.origin[axis], terrain.origin[axis] + size * count
        inside = inside & (low + reach <= at) & (at <= high - reach)
    assert_allclose(found[inside], plane(other)[inside], atol=step)


def test_the_level_off_a_raster_and_beside_its_holes_is_not_known() -> None:
    """Cells that it does not overlap, and those between a hole and another cell, have none."""
    terrain = Raster(np.array([[10.0], [20.0], [math.nan], [40.0]]), (10.0, 10.0), (0.0, 0.0))
    fine = Raster(np.zeros((9, 1)), (5.0, 10.0), (0.0, 0.0))
    nan = math.nan
    assert_array_equal(terrain.level_in(fine)[:, 0], [10, 12.5, 17.5, nan, nan, nan, nan, 40, nan])
    coarse = Raster(np.zeros((3, 1)), (20.0, 10.0), (0.0, 0.0))
    assert_array_equal(terrain.level_in(coarse)[:, 0], [15, nan, nan])


@examples(40)
@given(raster=rasters(holes=True, square=True), own=st.booleans())
@pytest.mark.parametrize("how", HOW)
def test_own_resolution_changes_nothing(how: How, raster: Raster, own: bool) -> None:
    """Square cells stay as they are, whether their edge is given or not."""
    grid = Grid.of(raster, raster.cell[0] if own else None, how)
    assert_array_equal(grid.values, raster.values)
    assert (grid.origin, grid.resolution) == (raster.origin, raster.cell[0])


@examples(20)
@given(raster=rasters(holes=True), times=st.integers(1, 6))
@pytest.mark.parametrize("how", HOW)
def test_mirror_images(how: How, raster: Raster, times: int) -> None:
    """If the sizes divide, the mirrored raster gives the mirrored grid."""
    assume(len(raster.values) % times == 0)
    resolution = times * raster.cell[0]
    mirrored = Grid.of(raster._replace(values=raster.values[::-1]), resolution, how)
    assert_allclose(mirrored.values, Grid.of(raster, resolution, how).values[::-1], atol=1e-9)


@examples(40)
@given(data=st.data(), raster=rasters(holes=True))
@pytest.mark.parametrize("how", HOW)
def test_a_shift_only_shifts(how: How, data: st.DataObject, raster: Raster) -> None:
    """The origin is the raster's, and has no influence on the heights."""
    resolution = data.draw(resolutions(raster))
    there = Grid.of(raster._replace(origin=(7e5, -3.25)), resolution, how)
    assert there.origin == (7e5, -3.25)
    assert_array_equal(there.values, Grid.of(raster, resolution, how).values)


@pytest.mark.parametrize(("cell", "times"), [(2.502, 2), (0.1, 3), (0.7, 10), (1 / 3, 3), (0.3, 7)])
@pytest.mark.parametrize("error", [-1e-9, 0.0, 1e-9])
def test_a_multiple_overlaps_no_sliver(cell: float, times: int, error: float) -> None:
    """Rounding of an edge that is a multiple of the cell never lets in the next cell."""
    steps = np.arange(120.0 * times)
    raster = Raster(steps[:, None] + steps[None, :2], (cell, cell), (500600.988, 4794197.109))
    grid = Grid.of(raster, times * cell * (1 + error / 2), "highest")
    assert grid.values.shape == (120, math.ceil(2 / times))
    assert_array_equal(np.diff(grid.values[:, 0]), np.full(119, float(times)))


def test_nearly_square_cells_are_kept() -> None:
    """A raster reprojected to cells of 2.5021 x 2.5024 m is not smeared over other cells."""
    values = np.arange(120.0 * 100).reshape(120, 100)
    grid = Grid.of(Raster(values, (2.5021, 2.5024), (0.0, 0.0)))
    assert_array_equal(grid.values, values)
    assert grid.resolution == pytest.approx(2.50225, abs=1e-12)


def test_cells_that_are_not_square_take_the_smaller_edge() -> None:
    """Without a resolution no detail of the finer axis is lost."""
    grid = Grid.of(Raster(np.array([[1.0, 2.0], [3.0, 4.0]]), (2.0, 1.0), (0.0, 0.0)))
    assert grid.resolution == 1.0
    assert_array_equal(grid.values, [[1, 2], [1, 2], [3, 4], [3, 4]])


@pytest.mark.parametrize("resolution", [0.0, -1.0, math.nan, math.inf, 1e-5])
def test_resolution_must_be_a_length(resolution: float) -> None:
    """A number that is no length of a cell is refused in one line."""
    raster = Raster(np.zeros((2, 2)), (1.0, 1.0), (0.0, 0.0))
    with pytest.raises(ProblemError, match=r"^resolution: must be within .* not .*$"):
        Grid.of(raster, resolution)


@pytest.mark.parametrize("shape", [(10_000, 5_000), (1_500, 1_000), (2_000_000, 1), (1, 1_000_001)])
def test_too_large_a_grid_names_a_resolution_that_does(shape: tuple[int, int]) -> None:
    """The coarser edge that the message names gives a grid that is accepted."""
    raster = Raster(np.broadcast_to(3.0, shape), (0.5, 0.5), (0.0, 0.0))
    with pytest.raises(ProblemError, match=r"^grid: .*window.* resolution of \S+ m$") as caught:
        Grid.of(raster)
    enough = float(str(caught.value).split()[-2])
    assert 0.95 * MOST_CELLS**0.5 < math.prod(Grid.of(raster, enough).values.shape) <= MOST_CELLS


def test_a_million_cells_are_allowed() -> None:
    """The limit itself is no reason to refuse, whatever the edge rounds to."""
    raster = Raster(np.zeros((3_000, 3_000)), (0.1, 0.1), (0.0, 0.0))
    assert Grid.of(raster, 0.3).values.shape == (1_000, 1_000)


def test_holes_are_named_or_filled() -> None:
    """Holes are refused with their number and a place that lies in one, unless given a height."""
    values = np.array([[1.0, 2.0, 3.0], [4.0, math.nan, math.nan]])
    grid = Grid(values, (500.0, 800.0), 2.0)
    with pytest.raises(ProblemError, match=r"^height_map: .* 2 of 6 .*\(503.000, 803.000\) m"):
        grid.filled(None, "height_map")
    with pytest.raises(ProblemError, match="fill: must be finite"):
        grid.filled(math.nan, "height_map")
    assert_array_equal(grid.filled(9.0, "height_map"), [[1, 2, 3], [4, 9, 9]])
    assert_array_equal(grid.values, values)
    cell = HeightMap(grid.filled(9.0, ""), grid.resolution, grid.origin).cell_of(503.0, 803.0)
    assert math.isnan(values[cell])


def test_grids_without_holes_need_no_fill() -> None:
    """Nothing is asked for that is not needed."""
    assert_array_equal(Grid(np.ones((2, 2)), (0.0, 0.0), 1.0).filled(None, ""), np.ones((2, 2)))
