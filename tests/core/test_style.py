"""Pictures of scenes, and the style of all figures, which notebooks take as a style sheet."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import colors, rcParams, style
from matplotlib.figure import Figure

import cocap_opt as co
from cocap_opt.output.printing import markdown_table
from cocap_opt.pictures.style import LABEL, SERIES, TITLE, WIDTH
from cocap_opt.problem.map_frame import MapFrame
from cocap_opt.problem.pictures import DRONE_COLOURS, PERSON, TopView
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
    """It is a part of the map, with room for something, and whole where nothing happens."""
    frame = MapFrame.around(HeightMap(heights=np.zeros((20, 30))), found)
    assert (frame.low >= 0).all() and (frame.high <= (20, 30)).all()
    assert min(frame.size) > 0
    for place in np.array(found).reshape(-1, 2):
        if (place >= 0).all() and (place <= (20, 30)).all():
            assert (frame.low <= place).all() and (place <= frame.high).all()
    assert found or frame.size == (20, 30)


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
