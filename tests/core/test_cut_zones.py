"""No-fly zones that a picture's edge cuts are marked there, and no others."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from strategies import examples

import cocap_opt as co
from cocap_opt.problem.cut_zones import Cut, cuts
from cocap_opt.problem.pictures import TopView

LOW, HIGH = np.array([0.0, 0.0]), np.array([16.0, 8.0])


def zone(west: float, south: float, east: float, north: float) -> co.Mesh:
    """A box that is closed at all heights that are flown."""
    return co.Mesh.box((west, south, -1e9), (east, north, 1e9))


def marks(*boxes: tuple[float, float, float, float]) -> list[Cut]:
    """The arrows of zones."""
    return cuts([zone(*box).corners for box in boxes], LOW, HIGH)


@pytest.mark.parametrize(
    ("box", "found"),
    [
        ((2, 2, 5, 5), ""),
        ((2, 0, 5, 5), ""),  # it ends at the edge
        ((-3, 2, 0, 5), ""),
        ((12, 2, 20, 4), ">>"),
        ((2, 7, 3, 9), "^"),
        ((2, 7.9, 2.1, 9), "^"),  # less than two arrows are apart
        ((-1, -1, 3, 2), "<<vvv"),
        ((-1, -1, 17, 9), 8 * "<" + 8 * ">" + 16 * "v" + 16 * "^"),
    ],
)
def test_arrows_are_where_a_zone_goes_on(box: tuple[float, ...], found: str) -> None:
    """One per sixteenth of the longer side, along each edge."""
    west, south, east, north = box
    assert "".join(cut.mark for cut in marks((west, south, east, north))) == found


@examples(100)
@given(st.lists(st.tuples(*[st.floats(-4, 20)] * 4), max_size=4))
def test_arrows_point_out_of_the_picture_into_a_zone(
    sides: list[tuple[float, float, float, float]],
) -> None:
    """Both sides of the edge are closed at an arrow, and no closed part of an edge lacks one."""
    boxes = [(min(a, c), min(b, d), max(a, c), max(b, d)) for a, b, c, d in sides]
    boxes = [box for box in boxes if box[2] - box[0] > 0.01 and box[3] - box[1] > 0.01]
    whole = shapely.union_all([shapely.box(*box) for box in boxes])
    found = marks(*boxes)
    for cut in found:
        assert shapely.distance(whole, shapely.Point(cut.x, cut.y)) < 1e-6
    ring = shapely.box(*LOW, *HIGH).exterior
    inside = shapely.intersection(ring, shapely.buffer(whole, -1e-3))
    for part in shapely.get_parts(inside):
        if part.length > 0.01:
            assert (
                min(part.distance(shapely.Point(cut.x, cut.y)) for cut in found)
                < 0.01 + part.length
            )


def test_maps_and_their_legends_have_the_arrows() -> None:
    """Of zones at the height that is drawn; also where the map itself ends."""
    robot = co.Robot(start=co.State(2, 2))
    for closed, is_cut in (
        ((zone(8, 8, 9, 30),), True), ((zone(5, 5, 6, 6),), False), ((), False),
        ((co.Mesh.box((8, 8, 50), (9, 30, 60)),), False),
    ):  # fmt: skip
        problem = co.Problem(
            name="yard", height_map=co.HeightMap(heights=np.zeros((12, 12))), horizon=1,
            robots=(robot,), actors=(), airspace=co.Airspace(no_fly=closed),
        )  # fmt: skip
        view = TopView.of(problem)
        assert view.is_cut == is_cut
        ax = view.draw()
        legend = ax.get_legend()
        assert legend is not None
        assert ("no-fly zone continues" in [t.get_text() for t in legend.get_texts()]) == is_cut
        assert any(line.get_marker() == "^" for line in ax.lines) == is_cut
