"""Pictures of scenes, and the style of all figures, which notebooks take as a style sheet."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import colors, rcParams, style
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import cocap_opt as co
from cocap_opt.data import BoolArray
from cocap_opt.output.printing import markdown_table
from cocap_opt.pictures.style import LABEL, SERIES, TITLE, WIDTH
from cocap_opt.problem.apart_numbers import ApartNumbers
from cocap_opt.problem.land_cover import LandCover
from cocap_opt.problem.map_frame import MapFrame
from cocap_opt.problem.pictures import COVERED, DRONE_COLOURS, LOW, PERSON, WALL, TopView
from cocap_opt.problem.whole_names import WholeName
from cocap_opt.world.workspace import HeightMap

HOUSE = "cocap_opt.pictures.house"


def test_the_style_sheet_has_colours_and_sizes_of_all_figures() -> None:
    """Notebooks look like the pages around them."""
    with style.context(HOUSE):
        cycle = [colors.to_hex(look["color"]) for look in rcParams["axes.prop_cycle"]]
        assert cycle == list(SERIES)
        assert rcParams["figure.figsize"][0] == WIDTH
        assert (rcParams["axes.titlesize"], rcParams["axes.labelsize"]) == (TITLE, LABEL)
        assert rcParams["legend.fontsize"] == rcParams["ytick.labelsize"] == LABEL


def test_drones_have_their_colours_in_any_style() -> None:
    """No style sheet makes a drone look like a person."""
    problem = co.load("tiny-queue")
    plan = co.plan(problem).plan
    with style.context(HOUSE):
        drawn = {colors.to_hex(line.get_color()) for line in problem.plot(plan).get_lines()}
    assert {*DRONE_COLOURS[: len(problem.robots)], PERSON} <= drawn


places = st.lists(st.tuples(st.floats(-9, 29), st.floats(-9, 39)), max_size=6)


@given(places)
def test_a_frame_has_all_places_on_the_map(found: list[tuple[float, float]]) -> None:
    """It is a part of the map, with room for something, and whole where nothing happens.

    The mark of a place has room around it: beyond the map, too, if the place is at its edge.
    """
    frame = MapFrame.around(HeightMap(heights=np.zeros((20, 30))), found)
    mark = 0.03 * 31  # m, at most
    assert (frame.low >= -mark).all() and (frame.high <= np.array([20, 30]) + mark).all()
    assert min(frame.size) > 0
    room = 0.02 * max(frame.size)
    for place in np.array(found).reshape(-1, 2):
        if (place >= 0).all() and (place <= (20, 30)).all():
            assert (frame.low <= place - room).all() and (place + room <= frame.high).all()
    assert found or frame.size == (20, 30)


def test_numbers_of_people_stand_apart() -> None:
    """Three who walk together, beside a drone, have three numbers that can be read."""
    figure = Figure(dpi=100)
    canvas, ax = FigureCanvasAgg(figure), figure.add_subplot()
    ax.set_xlim(0, 60)
    ax.set_ylim(0, 60)
    people = np.array([[30.0, 30.0], [30.4, 29.7], [30.1, 30.2], [90.0, 5.0]])
    numbers = ApartNumbers(people, [PERSON] * 4, 9, np.array([[31.0, 30.0]]), 11)
    ax.add_artist(numbers)
    canvas.draw()
    boxes = [text.get_window_extent() for text in numbers.texts[:3]]
    for k, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:k])
        disc = ax.transData.transform([31.0, 30.0])
        assert np.hypot(*(np.clip(disc, box.p0, box.p1) - disc)) > 5
        middle = (box.p0 + box.p1) / 2
        assert np.hypot(*(middle - ax.transData.transform(people[k]))) < 60
    assert numbers.texts[3].get_position() == (0, 0)  # whoever is outside has none


def test_what_is_built_is_not_green() -> None:
    """Green is what grows: obstacles have less of it than of red or blue."""
    for colour in (LOW, WALL, COVERED):
        red, green, blue = colors.to_rgb(colour)
        assert green < max(red, blue)


def test_a_scene_is_drawn_where_something_happens() -> None:
    """The rest of the map is left out, no walk and no flight is."""
    problem = co.load("corridor", seed=2)
    axes = problem.plot()
    assert np.ptp(axes.get_xlim()) < problem.height_map.shape[0]
    low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
    for actor in problem.actors:
        walk = actor.poses[: problem.horizon + 1, :2]
        assert (low <= walk).all() and (walk <= high).all()


def test_scenes_beside_each_other_share_a_legend() -> None:
    """It is below all of them, and the names of axes are at the outer ones alone."""
    problem = co.load("tiny-queue")
    figure = Figure(layout="constrained")
    left, right = figure.subplots(1, 2)
    for ax in (left, right):
        problem.plot(ax=ax)
    assert len(figure.legends) == 1 and left.get_legend() is right.get_legend() is None
    assert (left.get_ylabel(), right.get_ylabel()) == ("y (m)", "")
    alone = Figure().add_subplot()
    assert problem.plot(ax=alone).get_legend() is not None


def test_a_legend_has_a_mark_for_each_drone() -> None:
    """As many as there are colours, each in its place."""
    for scene in ("bottleneck", "field-large"):
        problem = co.load(scene)
        colours = min(len(problem.robots), len(DRONE_COLOURS))
        assert colours > 3
        legend = problem.plot(ax=Figure().add_subplot()).get_legend()
        assert legend is not None
        found = {line for line in legend.findobj(Line2D) if isinstance(line, Line2D)}
        rings = [line for line in found if line.get_markerfacecolor() == "white"]
        places = sorted(np.ravel(line.get_xdata())[0] for line in rings)
        assert len(rings) == colours
        assert min(np.diff(places)) > rings[0].get_markersize() / 2


def named(name: str, x: float, y: float, side: float = 1.0) -> LandCover:
    """A square area with a name."""
    corners = np.array([x, y]) + side * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    return LandCover(kind="green", outline=corners, name=name)


def drawn_names(*areas: LandCover, disc: tuple[float, float] | None = None) -> BoolArray:
    """Draws names in axes of 10 x 10 m, and returns where ink is, [Y, X] from above."""
    figure = Figure(figsize=(3, 3))
    ax = figure.add_axes((0, 0, 1, 1), xlim=(0, 10), ylim=(0, 10))
    if disc is not None:
        ax.plot(*disc, "o", ms=10, alpha=0)
    ax.set_axis_off()
    for area in areas:
        ax.add_artist(WholeName(area, transform=ax.transData))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray((np.asarray(canvas.buffer_rgba())[..., :3] < 128).any(axis=-1))


@pytest.mark.parametrize(("at", "is_drawn"), [((5.0, 5.0), False), ((5.0, 9.0), True)])
def test_a_name_is_left_out_where_a_disc_would_hide_it(
    at: tuple[float, float], is_drawn: bool
) -> None:
    """Names on the ground are whole, or are not there."""
    assert drawn_names(named("lane", 5, 5), disc=at).any() == is_drawn


def test_a_name_at_an_edge_is_moved_inwards() -> None:
    """It is whole: as much ink as in the middle, and none in the last column of pixels."""
    middle, edge = (drawn_names(named("court", x, 5)) for x in (5, 9.4))
    assert not edge[:, -1].any() and edge[:, edge.shape[1] // 2 :].any()
    assert edge.sum() == pytest.approx(middle.sum(), rel=0.1)
    assert not drawn_names(named("a long name", 9.9, 5)).any()  # it would be beside its area


def test_a_name_is_in_the_part_of_its_area_that_is_shown() -> None:
    """An area whose middle is outside of the picture is named, too; one outside of it is not."""
    assert drawn_names(named("canal", 20, 5, side=30)).any()
    assert not drawn_names(named("canal", 20, 5)).any()


def test_names_do_not_overlap() -> None:
    """The first of two in one place is drawn."""
    assert (drawn_names(named("court", 5, 5), named("mound", 5.2, 5.1))
            == drawn_names(named("court", 5, 5))).all()  # fmt: skip


def test_pictures_say_what_they_show() -> None:
    """Those in notebooks have an alternative text."""
    image = TopView.of(co.load("tiny-trap")).image()
    assert 'alt="Map from above with starts of drones and the walks of 2 people"' in image


@pytest.mark.parametrize(
    ("cells", "right"),
    [
        (("1,234", "-"), True),
        (("0.36 (13 of 30)", "3.02\\*"), True),
        (("**5.3**", "495 s"), True),
        (("0.00..0.03 %", "1e-05"), True),
        (("0.04, 0.11", "1,792 ± 135"), True),
        (("100.0 %", "93.6 % &#42;"), True),
        (("4", "each take"), False),
        (("-", "-"), False),
        (("5 stages of a proof", "2"), False),
    ],
)
def test_numbers_end_where_their_column_ends(cells: tuple[str, str], right: bool) -> None:
    """A column of anything else begins where it begins."""
    line = markdown_table([{"a": cell} for cell in cells]).splitlines()[1]
    assert line.endswith(":|") is right
