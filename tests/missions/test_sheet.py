import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import same_color, to_rgb
from matplotlib.figure import Figure
from strategies import examples
from test_cli import Run
from test_gltf import scene

import cocap_opt as co
from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.flight.changes import TIGHT, people_and_delay, tolerated_delay
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.safety import Nearest
from cocap_opt.flight.touchdowns import Touchdowns
from cocap_opt.flight.urgent import attention
from cocap_opt.flight.ways import has_homes, parts_of_take
from cocap_opt.missions import FORMATS
from cocap_opt.missions.routes import seconds_to_step_0
from cocap_opt.missions.sheet import pages_of
from cocap_opt.missions.sheet.cards import battery_warnings, drone_cards, people_cards
from cocap_opt.missions.sheet.clock import TAKE, Clock, phases_of
from cocap_opt.missions.sheet.filmed import (
    filmed_by,
    quality_notes,
    quality_of,
    quality_table,
    who_films_whom,
)
from cocap_opt.missions.sheet.fonts import USUAL, families_of
from cocap_opt.missions.sheet.kinds import KINDS
from cocap_opt.missions.sheet.letters import BODY, in_order, wide, wrapped
from cocap_opt.missions.sheet.maps import LAND, draw, draw_legend, ground_of
from cocap_opt.missions.sheet.pages import HEIGHT, WIDTH, Card, Pages, Table
from cocap_opt.missions.sheet.words import (
    running_order,
    sections,
    to_check,
    unchecked,
)
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Limits
from cocap_opt.problem.labels import placed
from cocap_opt.problem.land_cover import LANDS, LandCover
from cocap_opt.problem.pictures import TopView, land_colour
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.hardware import AIRFRAMES, CAMERAS


def clock_of(flight: Flight) -> Clock:
    """The clock of a flight."""
    problem = flight.flown.problem
    parts = parts_of_take(problem, flight.plan) if has_homes(problem) else ()
    return Clock(flight.start, parts, flight.flown.step)


def text_of(flight: Flight, every: float | None = None) -> dict[str, list[str]]:
    """The lines of a sheet by their titles; cells of tables are parted by spaces."""
    clock = clock_of(flight)
    found = {}
    for title, blocks in sections(flight, clock, Touchdowns.of(flight), every):
        rows = [[block] if isinstance(block, str) else map(" ".join, [block.heads, *block.rows])
                for block in blocks]  # fmt: skip
        found[title] = [line for lines in rows for line in lines]
    return found


def framed(flight: Flight) -> list[str]:
    """The warnings in the frame of the first page."""
    parts = clock_of(flight).parts
    return [f"{note.text}." for note in attention(flight, Touchdowns.of(flight), parts)]


def left_open(flight: Flight) -> list[str]:
    """What is to be checked on the spot, without homes, and what the program did not check."""
    return [*to_check(flight, False), *unchecked(flight)]


def order_of(flight: Flight) -> list[str]:
    """What happens, in the running order."""
    return [what for *_, what in running_order(flight, clock_of(flight)).rows]


def cards_of(flight: Flight) -> list[dict[str, str]]:
    """The facts of the drones' cards."""
    cards = drone_cards(flight, clock_of(flight), quality_of(flight), Touchdowns.of(flight))
    return [dict([card.beside, *card.facts]) for card in cards]


def numbers(line: str) -> list[float]:
    """The numbers in a line."""
    return [float(word) for word in re.findall(r"-?\d+\.?\d*", line)]


def test_a_card_has_what_the_scene_knows_of_its_drone() -> None:
    """Camera, airframe, battery with reserve; what nobody knows is a blank to be filled in."""
    problem, plan = scene()
    kinds = (
        (CAMERAS["skydio-2"], AIRFRAMES["skydio-2"]),
        (co.Camera(width=640), Limits(endurance=1200.0)),
    )
    robots = tuple(
        robot.replace(camera=camera.replace(tilts=robot.camera.tilts), limits=limits)
        for robot, (camera, limits) in zip(problem.robots, kinds, strict=True)
    )
    flight = Flight.of(problem.replace(robots=robots), plan, False)
    known, unknown = cards_of(flight)
    assert (known["camera"], known["airframe"]) == ("skydio-2", "skydio-2")
    assert (unknown["camera"], unknown["airframe"], unknown["pilot"]) == ("", "", "")
    # 5 m up at 1 m/s, 10 s for all to wait, and 1.5 s, rounded up; the reserve is rounded down.
    assert known["battery"] == (
        "23:00 min (as stated); in the air 0:17 min plus landing; reserve 22:43 min (98 %)"
    )
    assert unknown["battery"].startswith("20:00 min (as stated); ")
    bare = robots[0].replace(limits=None)
    flight = Flight.of(problem.replace(robots=(bare, robots[1])), plan, False)
    assert cards_of(flight)[0]["battery"].startswith("________ min; in the air 0:17 min")


def test_a_plan_that_was_cut_short_says_so_first() -> None:
    """In the frame on the first page, and not once more among what was not checked."""
    problem, plan = scene()
    words = "cut short: 1 of 2 drones stays at its start"
    flight = Flight.of(problem, plan, False)._replace(cut_short=words)
    assert framed(flight)[0] == f"ATTENTION: {words}."
    assert words not in left_open(flight)


def _over(
    ground: LandCover | None,
    top: float = 0.0,
    homes: tuple[tuple[int, int] | None, tuple[int, int] | None] = (None, None),
) -> Flight:
    """The flight of two drones that hover, the second above a column on some land."""
    heights = np.zeros((9, 3))
    heights[7, 1] = top
    robots = [co.Robot(start=co.State(x, 1), motion=co.Motion(layers=(5.0,))) for x in (1, 7)]
    problem = co.Problem(
        name="yard", height_map=co.HeightMap(heights=heights), horizon=1, step=1.0, actors=(),
        robots=[robot.replace(home=home) for robot, home in zip(robots, homes, strict=True)],
        land_cover=() if ground is None else (ground,),
    )  # fmt: skip
    paths = tuple((robot.start, robot.start) for robot in problem.robots)
    return Flight.of(problem, co.Plan(paths=paths), False)  # type: ignore[arg-type]


def _land(kind: str) -> LandCover:
    """Land around the second drone."""
    outline = np.array([(6.0, 0.0), (9.0, 0.0), (9.0, 3.0), (6.0, 3.0)])
    return LandCover(kind=kind, outline=outline)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("land", "top", "words"),
    [
        (None, 0.0, ""),
        (_land("green"), 0.2, ""),
        (_land("green"), 1.5, "an obstacle 1.5 m above the ground"),
        (_land("building"), 3.0, "a roof 3.0 m above the ground"),
        (_land("building"), 0.0, "a building, by the land cover"),
        (_land("water"), 0.0, "water"),
        (_land("water"), 2.0, "an obstacle 2.0 m above the ground"),  # a bridge
    ],
)
def test_the_crew_is_warned_of_roofs_water_and_obstacles_below_a_drone(
    land: LandCover | None, top: float, words: str
) -> None:
    """In the frame, on the drone's card, and in the table of its legs; it is no event."""
    flight = _over(land, top)
    told = [f"ATTENTION: drone 1 {does} {words}; {what} it elsewhere"
            for does, what in (("takes off from", "start"), ("lands on", "land"))]  # fmt: skip
    assert framed(flight) == ([f"{each}." for each in told] if words else [])
    assert not any("ATTENTION" in what for what in order_of(flight))
    first, second = (card.get("ATTENTION", "") for card in cards_of(flight))
    assert (first, second) == ("", f"lands on {words}; land it elsewhere" if words else "")
    *_, row = text_of(flight)["Take-off and landing (a suggestion)"]
    assert row.endswith(words or ("ground" if land is None else land.kind))


def test_drones_on_bad_ground_are_told_in_one_sentence() -> None:
    """Those with homes use them alone, and what the scene does not tell is not checked."""
    (words,) = framed(_over(_land("water"), homes=((6, 2), (8, 2))))
    whole = "drones 0-1 take off from and land on water; start and land them elsewhere"
    assert words == f"ATTENTION: {whole}."
    assert any("no land cover" in words for words in left_open(_over(None)))
    assert not any("land cover" in words for words in left_open(_over(_land("green"))))
    slope = co.HeightMap(heights=np.linspace(0.0, 4.0, 27).reshape(9, 3))
    flight = _over(None)
    problem = flight.flown.problem.replace(height_map=slope)
    unknown = Flight.of(problem, flight.plan, False)
    assert framed(unknown) == []
    assert any("has no ground heights" in words for words in left_open(unknown))


def _apart(
    rules: co.CollisionRules, *ends: tuple[int, int], tops: tuple[float, ...] = ()
) -> Flight:
    """The flight of drones that begin far apart and end in cells x of some layers, 5 m apart."""
    motion = co.Motion(layers=(5.0, 10.0, 15.0), radius=16)
    heights = np.zeros((40, 3))
    for (x, _), top in zip(ends, tops, strict=False):
        heights[x, 1] = top
    starts = [co.State(9 + 8 * k, 0, layer) for k, (_, layer) in enumerate(ends)]
    problem = co.Problem(
        name="yard", height_map=co.HeightMap(heights=heights), horizon=1, step=9.0, actors=(),
        rules=rules, robots=[co.Robot(start=start, motion=motion) for start in starts],
    )  # fmt: skip
    paths = tuple((start, co.State(x, 1, z)) for start, (x, z) in zip(starts, ends, strict=True))
    return Flight.of(problem, co.Plan(paths=paths), False)


@pytest.mark.parametrize(
    ("ends", "told", "on_card"),
    [
        (((9, 0), (9, 1)), "drones 0 and 1 land on the same spot; land one of them elsewhere",
         "lands on the same spot as drone 0; land one of them elsewhere"),
        (((9, 0), (10, 1)),
         "drones 0 and 1 land 1.00 m from each other, less than 3 m; land one of them elsewhere",
         "lands 1.00 m from drone 0, less than 3 m; land one of them elsewhere"),
        (((9, 0), (12, 1)), "", ""),
        (((9, 0), (10, 1), (9, 2)),
         "drones 0-2 land less than 3 m from each other, 0 and 2 on the same spot; land some of "
         "them elsewhere",
         "lands less than 3 m from drones 0, 2; land some of them elsewhere"),
    ],
)  # fmt: skip
def test_the_crew_is_warned_of_drones_that_meet_as_they_land(
    ends: tuple[tuple[int, int], ...], told: str, on_card: str
) -> None:
    """Above each other, or closer than the separation below their last places, and who they are."""
    flight = _apart(co.CollisionRules(separation=3.0), *ends)
    assert framed(flight) == ([f"ATTENTION: {told}."] if told else [])
    assert not any("ATTENTION" in what for what in order_of(flight))
    assert cards_of(flight)[1].get("ATTENTION", "") == on_card


def test_ways_down_that_end_above_others_are_apart() -> None:
    """One ends on a roof that is higher than the other flies; a rule of heights is kept as well.

    Without a rule it is that of scenes that are to be flown, and homes are places to land, too.
    """
    roof, aside = ((9, 0), (10, 2)), co.CollisionRules(separation=3.0)
    assert Touchdowns.of(_apart(aside, *roof, tops=(0.0, 9.0))).near == ()
    (pair,) = Touchdowns.of(_apart(aside, *roof, tops=(0.0, 7.0))).near
    assert (pair.kind, pair.distance) == ("landing", pytest.approx(5**0.5))
    tall = co.CollisionRules(separation=3.0, vertical=4.5)
    assert len(Touchdowns.of(_apart(tall, *roof, tops=(0.0, 9.0))).near) == 1
    without = Touchdowns.of(_apart(co.CollisionRules(), (9, 0), (10, 1)))
    assert (without.separation, len(without.near)) == (2.0, 1)
    homes = Touchdowns.of(_over(None, homes=((7, 2), (8, 2))))
    words = "1.00 m from each other, less than 2 m; start and land one of them elsewhere"
    assert [*homes.warnings()] == [f"drones 0 and 1 take off and land {words}"]


@pytest.mark.parametrize("ahead", [0.5, 2.0])
def test_the_crew_is_warned_of_timing_that_its_clock_does_not_show(ahead: float) -> None:
    """Drones that follow each other over one place, the second so many seconds behind the first."""
    motion = co.Motion(layers=(5.0,), radius=1)
    rules = co.CollisionRules(separation=1.0)
    cells = 1 + round(2 * ahead)  # between them, at 2 m/s, of which the separation takes one
    starts = [co.State(x, 1) for x in (cells, 0)]
    problem = co.Problem(
        name="lane", height_map=co.HeightMap(heights=np.zeros((20, 3))), horizon=12, step=0.5,
        actors=(), rules=rules, robots=[co.Robot(start=start, motion=motion) for start in starts],
    )  # fmt: skip
    paths = tuple(tuple(co.State(start.x + t, 1) for t in range(13)) for start in starts)
    flight = Flight.of(problem, co.Plan(paths=paths), False)
    delay = tolerated_delay(flight)
    assert delay == pytest.approx(ahead, abs=0.02)
    words = f"drones keep the separation 1 m only if no drone is late by {delay:.2f} s or more"
    told = [words in line for line in framed(flight)]
    assert told == ([True] if ahead < TIGHT else [])
    assert not any(words in what for what in order_of(flight))


def test_drones_without_a_rule_that_come_close_are_told_first() -> None:
    """Nearer than scenes that are flown ask for; else it is among what was not checked."""
    flight = _over(None)
    problem = flight.flown.problem
    beside = problem.replace(
        robots=[problem.robots[0], problem.robots[1].replace(start=co.State(2, 1))]
    )
    paths = tuple((robot.start, robot.start) for robot in beside.robots)
    near = Flight.of(beside, co.Plan(paths=paths), False)  # type: ignore[arg-type]
    for each, is_first in ((flight, False), (near, True)):
        urgent = [note.text for note in each.too_near()]
        others = [note.text for note in each.near_without_rule()]
        assert (len(urgent), len(others)) == ((1, 0) if is_first else (0, 1))
        assert framed(each)[:1] == [f"ATTENTION: {words}." for words in urgent]
        assert {*others} <= {*left_open(each)} and not {*urgent} & {*left_open(each)}


def test_the_rest_of_a_mission_is_no_thing_that_was_not_checked() -> None:
    """The crew reads in a section of its own which drones are in the air; `fly` tells it, too."""
    problem, plan = scene()
    robots = tuple(r.replace(number=3 * i + 1) for i, r in enumerate(problem.robots))
    flight = Flight.of(problem.replace(robots=robots), plan, False)
    hover, *numbers, _ = text_of(flight)["Drones in the air"]
    assert hover.startswith("The rest of a mission: all drones hover at their first places")
    assert numbers == [f"Drone {i} of this sheet is drone {3 * i + 1} of the mission."
                       for i in range(2)]  # fmt: skip
    assert not any("mission" in words for words in left_open(flight))
    assert any("in the mission drone 0 is 1, drone 1 is 4" in note.text for note in flight.notes())


def test_the_crew_checks_what_happens_if_a_link_is_lost() -> None:
    """Crews' own flight plans have it; the program cannot know it."""
    problem, plan = scene()
    assert any("link is lost" in item for item in to_check(Flight.of(problem, plan, False), False))


def test_the_crew_is_not_told_what_the_author_of_a_scene_can_change() -> None:
    """The sheet leaves such remedies out, and has its own words for heights."""
    problem, plan = scene()
    flight = Flight.of(problem.replace(earth=co.Earth(crs="EPSG:25830")), plan, False)
    notes = [*flight.notes(), *people_and_delay(flight, None)]
    remedies = [note.remedy for note in notes if note.remedy]
    told = "".join(map(str, notes))
    assert len(remedies) == 3 and all(f"; {words}" in told for words in remedies)
    texts = [text.get_text() for figure in pages_of(flight, None, [USUAL]).figures
             for text in figure.texts]  # fmt: skip
    printed = " ".join(" ".join(texts).split())
    assert not any(words in printed for words in (*remedies, "eight datum unknown"))
    assert "which is z = 0 of the map." in printed
    assert "how close a late drone comes to them was not checked." in printed


def test_the_crew_is_told_who_is_filmed_badly_and_by_whom() -> None:
    """A row per person who counts, with the worst moment in seconds; nothing where nobody does."""
    problem, plan = scene()
    first, *others = problem.actors
    people = (first.replace(name="A" + 60 * "x"), *others)
    problem = problem.replace(actors=people)
    flight = Flight.of(problem, plan, False)
    found = quality_of(flight)
    assert found is not None
    clock, names = clock_of(flight), ["Ax (0)"]
    (row,) = quality_table(found, names, clock).rows
    (person,) = co.quality(problem, plan).by_person
    ends = [clock.time(float(s)) for s in re.findall(r"[\d.]+(?= (?:to|s)\b)", person.worst)]
    assert row[0] == "Ax (0)" and ends and all(end in row[-1] for end in ends)
    pale = "Pale: the first step, which does not count."
    assert (pale in quality_notes(found)) == (found.first_step > 0)
    assert numbers(row[1])[0] == pytest.approx(100 * person.by_two, abs=0.5)
    ((_, drones),) = who_films_whom(found, names, phases_of(flight, ()), clock).rows
    shares = found.seen[:, :, 0].mean(axis=0)
    often = [int(number) for number in re.findall(r"\d+", drones.partition("(")[0])]
    assert often == np.flatnonzero(shares >= 0.5).tolist()
    for drone, card in enumerate(cards_of(flight)):
        counted = found.seen[found.counts[:, 0], drone, 0].mean()
        assert (card["films"] == "nobody") == (counted == 0)
    hidden = [actor.replace(importance=(0.0,) * len(actor.poses)) for actor in people]
    assert quality_of(Flight.of(problem.replace(actors=tuple(hidden)), plan, False)) is None


def test_no_fly_zones_are_told_from_houses_on_the_map() -> None:
    """They have a hatch of their own, which the legend names."""
    problem, plan = scene()
    assert problem.airspace.no_fly
    for airspace, count in ((problem.airspace, len(problem.airspace.no_fly)), (co.Airspace(), 0)):
        flight = Flight.of(problem.replace(airspace=airspace), plan, False)
        figure = Figure()
        ax, legend = figure.subplots(1, 2)
        (phase,) = phases_of(flight, ())
        draw(ax, flight, phase, ground_of(flight))
        assert sum(patch.get_hatch() == "xxx" for patch in ax.patches) == count
        draw_legend(legend, flight, False, ground_of(flight))
        box = legend.get_legend()
        assert box is not None
        words = [text.get_text() for text in box.get_texts()]
        assert any(line.startswith("no-fly zone") for line in words) == bool(count)
        assert "obstacle as high as drones fly" not in words  # houses are lower here
        assert {"lower obstacle", "walk"} <= set(words)


def grey(colour: str) -> float:
    """The tone of a colour in a grey print, of 255."""
    return float(np.dot(to_rgb(colour), (0.299, 0.587, 0.114)) * 255)


def test_grey_prints_tell_dangers_apart() -> None:
    """No two kinds look alike; obstacles are darker than any land, and have darker edges."""
    looks = [(kind.fill, kind.hatch) for kind in KINDS.values()]
    assert len(set(looks)) == len(looks)
    plain = sorted(grey(kind.fill) for kind in KINDS.values() if not kind.hatch)
    land = [grey(land_colour(kind, LAND)) for kind in LANDS]
    assert min(np.diff([*plain, min(land)])) >= 15
    assert max(land) < 255
    for kind in KINDS.values():
        assert grey(kind.edge) <= grey(kind.fill) - 90


def test_the_map_has_edges_and_hatches_where_the_ground_changes() -> None:
    """The legend names each kind once, and the land if the map shows it."""
    flight = Flight.of(*scene(), False)
    rim = np.array([[5e5, 4e6], [5e5 + 12, 4e6], [5e5 + 12, 4e6 + 10]])
    kinds = np.random.default_rng(0).integers(0, 5, (6, 5))
    land = (LandCover(kind="water", outline=rim),)
    ground = ground_of(flight)._replace(kinds=kinds, land=land)
    figure = Figure()
    ax, legend = figure.subplots(1, 2)
    (phase,) = phases_of(flight, ())
    draw(ax, flight, phase, ground)
    framed = np.pad(kinds, 1)
    for number, lines in enumerate(ax.collections, 1):
        assert same_color(np.squeeze(lines.get_edgecolor()), KINDS[number].edge)
        ends = [path.vertices for path in lines.get_paths()]
        changes = sum(np.diff(framed == number, axis=axis).sum() for axis in (0, 1))
        assert len({tuple(np.ravel(line)) for line in ends}) == len(ends) == changes
        for a, b in ends:
            across = np.array([1.0, 0.0] if a[0] == b[0] else [0.0, 1.0])
            sides = [(((a + b) / 2 + way * across) - ground.corner) / 2 for way in (-1, 1)]
            beside = [framed[tuple(np.floor(side).astype(int) + 1)] for side in sides]
            assert beside.count(number) == 1
    assert {kind.hatch for kind in KINDS.values()} < {
        patch.get_hatch() or "" for patch in ax.patches
    }
    draw_legend(legend, flight, False, ground)
    box = legend.get_legend()
    assert box is not None
    words = [text.get_text() for text in box.get_texts()]
    assert {*(kind.words for kind in KINDS.values()), "ground, in pale colours"} < set(words)
    assert len(set(words)) == len(words)


@pytest.mark.parametrize(("at", "is_drawn"), [(5.0, True), (0.1, False), (9.9, False)])
def test_a_place_name_is_drawn_whole_or_not_at_all(at: float, is_drawn: bool) -> None:
    """The edge of the map cuts none, and none is far from its area."""
    rim = np.array([[5.0, 5.0], [5.2, 5.0], [5.2, 5.2], [5.0, 5.2]])
    pixels = []
    for name in ("courtyard", None):
        problem = scene()[0].replace(land_cover=(LandCover(kind="yard", outline=rim, name=name),))
        figure = Figure()
        ax, canvas = figure.add_subplot(), FigureCanvasAgg(figure)
        TopView.of(problem).draw_map(ax)
        x, y = problem.land_cover[0].label
        ax.set_xlim(x - at, x - at + 10)
        ax.set_ylim(y - 5, y + 5)
        canvas.draw()
        pixels.append(np.asarray(canvas.buffer_rgba()).copy())
    assert (pixels[0] != pixels[1]).any() == is_drawn


def test_names_stay_as_they_are() -> None:
    """A person's card has her name over it as the scene writes it, before her number."""
    problem, plan = scene()
    (actor,) = problem.actors
    names = (None, "Person 0"), ("Ada LOVELACE", "Ada LOVELACE (0)"), ("ada", "ada (0)")
    for name, title in names:
        flight = Flight.of(problem.replace(actors=(actor.replace(name=name),)), plan, False)
        (card,) = people_cards(flight, clock_of(flight))
        assert card.title == title


@pytest.mark.parametrize("smooth", [False, True])
def test_a_battery_has_to_last_for_the_way_up_and_the_wait(smooth: bool) -> None:
    """The sheet says how long drones are in the air, and whose battery is too small for that.

    A reserve is rounded down, so that no warning contradicts its own number.
    """
    problem, plan = scene()
    flight = Flight.of(problem, plan, smooth)
    heights = flight.columns(flight.flown.seconds)
    rise = heights["above_takeoff"][heights["t"] == 0].max()
    seconds = rise + (0 if smooth else 10) + flight.flown.seconds
    for endurance, words in (
        (seconds - 0.1, "THE BATTERY OF DRONE 1 DOES NOT LAST: it lasts "),
        (seconds / 0.815, "Drone 1 has a battery reserve of only 18 %"),
        (seconds / 0.803, "Drone 1 has a battery reserve of only 19 %: less than a fifth"),
        (seconds / 0.79, ""),
    ):
        limits = Limits(endurance=endurance)
        robots = (problem.robots[0], problem.robots[1].replace(limits=limits))
        other = Flight.of(problem.replace(robots=robots), plan, smooth)
        found = [*battery_warnings(other, clock_of(other))]
        assert [line.startswith(words) for line in found] == [True] * bool(words)


def test_missions_of_drones_with_homes_have_a_start_of_their_own() -> None:
    """They contain no flights from home, with which the running order begins."""
    problem, plan = scene()
    earth = co.Earth(crs="EPSG:25830", origin=(43.26, -2.93))
    homes = [robot.replace(home=(robot.start.x, robot.start.y)) for robot in problem.robots]
    for robots, said in ((problem.robots, 0), (tuple(homes), 1)):
        flight = Flight.of(problem.replace(earth=earth, robots=robots), plan, False)
        lines = text_of(flight)["Waypoint missions"]
        found = [line for line in lines if "the running order does not hold for them" in line]
        assert len(found) == said
        at = clock_of(flight).at(-seconds_to_step_0(flight))
        assert all(f"start all missions at once at {at}, in time" in line for line in found)


def test_the_crew_reads_which_file_is_for_which_autopilot() -> None:
    """And above what the ceiling is, and where no-fly zones are."""
    problem, plan = scene()
    earth = co.Earth(crs="EPSG:25830", origin=(43.26, -2.93), heights="sea", base=3.0)
    airspace = problem.airspace.replace(ceiling=50.0)
    flight = Flight.of(problem.replace(earth=earth, airspace=airspace), plan, False)
    sections = text_of(flight)
    lines = "\n".join(sections["Waypoint missions"])
    assert "*.px4.*.plan PX4 for PX4" in lines
    assert "*.ardupilot.*.waypoints\n*.ardupilot.*.plan ArduPilot for ArduPilot" in lines
    places = "\n".join(sections["Places and heights"])
    assert "Places: x and y (m) from latitude 43.26, longitude -2.93, along the axes of " in places
    limits = "\n".join(sections["Distances and limits"])
    assert "The ceiling is 50 m above " in limits
    assert re.search(r"No-fly zone 0, .*, with corners x \d+\.\d y \d+\.\d, ", limits)
    for other in (
        Flight.of(problem.replace(earth=earth), plan, True),
        Flight.of(problem.replace(earth=None), plan, False),
    ):
        assert "Waypoint missions" not in text_of(other)


def test_the_crew_reads_where_in_their_tracks_people_begin() -> None:
    """Step 0 need not be the first moment of a track."""
    problem, plan = scene()
    (actor,) = problem.actors
    for begin, count in ((None, 0), (15.5, 1)):
        own = problem.replace(actors=(actor.replace(begin=begin),))
        lines = text_of(Flight.of(own, plan, False))["Places and heights"]
        assert (
            sum("Step 0 is at 15.5 s of the tracks of person 0." in line for line in lines) == count
        )


def test_a_margin_is_told_beside_what_the_scene_asks_for() -> None:
    """The crew reads which distance to people is kept, and which the scene says."""
    problem, plan = scene()
    flight = Flight.of(problem, plan, False)
    for asked, count in ((None, 0), (problem.airspace.replace(people_aside=9.0), 1)):
        lines = text_of(flight._replace(asked=asked))["Distances and limits"]
        assert sum("The scene requires 9 m from people" in line for line in lines) == count


@pytest.mark.parametrize("smooth", [False, True])
def test_least_distances_are_those_of_dense_samples(smooth: bool) -> None:
    """Between drones, and from drones to people seen from above, by the clock and where."""
    flight = Flight.of(*scene(), smooth)
    near = Nearest.of_drones(flight.flown)
    assert near is not None
    drones, people, airspace, *_ = text_of(flight)["Distances and limits"]
    t = np.linspace(0, 1.5, 3001)
    found = flight.flown.at(t)
    one, other = (found.place[found.drone == i] for i in range(2))
    apart = np.linalg.norm(other - one, axis=1)
    assert f", at {clock_of(flight).time(near.t)} near x" in drones
    least, first, second, _, _, *place = numbers(drones)
    assert (first, second) == (0, 1)
    assert least == pytest.approx(apart.min(), abs=0.006)
    assert np.interp(near.t, t, apart) == pytest.approx(least, abs=0.02)
    at = flight.flown.at(np.array([near.t])).place[0]
    assert place == pytest.approx(at.tolist(), abs=0.06)
    walk = flight.flown.problem.actors[0].poses[:, :2]
    feet = np.column_stack([np.interp(t / 0.5, range(4), column) for column in walk.T])
    aside = np.linalg.norm([drone[:, :2] - feet for drone in (one, other)], axis=2)
    least, drone, person, *_ = numbers(people)
    assert (drone, person) == (np.argmin(aside.min(axis=1)), 0)
    assert least == pytest.approx(aside.min(), abs=0.006)
    assert flight.record()["people_distance"] == pytest.approx(aside.min(), abs=1e-4)
    assert "1 no-fly zone" in airspace


def test_legs_end_on_a_deck_where_the_flight_is_above_it() -> None:
    """The surface below is the highest matter that is not over the drone."""
    heights, deck = np.zeros((4, 3)), co.Mesh.box((0.0, 0.0, 2.0), (4.0, 1.0, 3.0))
    motion = co.Motion(layers=(1.0, 6.0), clearance=0.5)
    starts = [co.State(1, 0, layer) for layer in (0, 1)]
    problem = co.Problem(
        name="deck", height_map=co.HeightMap(heights=heights), meshes=(deck,), horizon=1,
        robots=tuple(co.Robot(start=start, motion=motion) for start in starts), actors=(), step=1.0,
    )  # fmt: skip
    flight = Flight.of(problem, co.Plan(paths=tuple((start, start) for start in starts)), False)
    *_, under, _, over, _ = text_of(flight)["Take-off and landing (a suggestion)"]
    assert numbers(under)[3:6] == [0, 1, 1]
    assert numbers(over)[3:6] == [3, 6, 3]


@pytest.mark.parametrize("smooth", [False, True])
def test_the_crew_reads_when_and_where_people_walk(smooth: bool) -> None:
    """Each person has cues, the signal a time, and the distance to people its tolerance."""
    problem, plan = scene()
    problem = problem.replace(airspace=problem.airspace.replace(people_aside=1.0))
    flight = Flight.of(problem, plan, smooth)
    clock = clock_of(flight)
    (card,) = people_cards(flight, clock)
    assert card.table is not None
    walk = problem.actors[0].poses[:4, :2]
    places = [[float(cell) for cell in row[1:3]] for row in card.table.rows]
    assert card.table.heads[1:3] == ("x (m)\n-\xa0500\xa0km", "y (m)\n-\xa04,000\xa0km")
    np.testing.assert_allclose(places + np.array([500e3, 4000e3]), walk, atol=0.06)
    assert [row[0] for row in card.table.rows] == ["T+0:00", "T+0:00.5", "T+0:01", "T+0:01.5"]
    assert [row[3] for row in card.table.rows] == ["2.00 m/s"] * 3 + ["end"]  # 1 m in half a second
    rows = running_order(flight, clock).rows
    assert ("T+0:00", "all people", "SIGNAL: start walking (step 0 of the plan)") in rows
    # Both drones are 5 m above their take-offs, and have 10 s left there.
    assert (rows[0][0] == "T-0:15") == (not smooth)
    assert any(
        "drones keep 1 m from people" in line for line in text_of(flight)["Late drones and people"]
    )


def test_cues_of_people_are_on_the_earth_where_it_is_known() -> None:
    """People have a phone, which knows nothing of x and y."""
    problem, plan = scene()
    flight = Flight.of(problem.replace(earth=co.Earth(crs="EPSG:25830")), plan, False)
    (card,) = people_cards(flight, clock_of(flight))
    assert card.table is not None and flight.geodesy is not None
    assert card.table.heads[1:3] == ("latitude", "longitude")
    walk = problem.actors[0].poses[:4]
    found = np.array([[float(cell) for cell in row[1:3]] for row in card.table.rows])
    degrees = np.stack(flight.geodesy.degrees(walk[:, 0], walk[:, 1]), axis=1)
    np.testing.assert_allclose(found, degrees, rtol=0, atol=6e-7)


def test_a_table_parts_no_word_that_has_room() -> None:
    """Times and numbers are whole where another column can go on in the next line."""
    cells = "10:00:12.5", *(f"- 4,79{k} km of it" for k in range(6))
    pages = Pages([USUAL])
    pages.cards("Cards", [Card("Drone 0", [], Table(("time", *"abcdef"), [cells]))])
    told = {text.get_text() for text in pages.figures[0].texts}
    assert "10:00:12.5" in told
    assert {f"4,79{k}" for k in range(6)} <= {word for text in told for word in text.split()}


def test_a_cue_says_where_somebody_stops_and_not_a_mean_pace() -> None:
    """At 1.25 m/s in steps of 4 s: in the third she walks 1 s, and then stands."""
    path = (co.State(0, 8),) * 6
    x = np.array([0.5, 5.5, 10.5, 11.75, 11.75, 11.75])
    walk = np.column_stack([x, np.full(6, 0.5), np.zeros((6, 2))])
    problem = co.Problem(
        name="walk", height_map=co.HeightMap(heights=np.zeros((15, 9))), horizon=5, step=4.0,
        actors=(co.Actor(poses=walk),), robots=(co.Robot(start=path[0]),),
    )  # fmt: skip
    flight = Flight.of(problem, co.Plan(paths=(path,)), False)
    (card,) = people_cards(flight, clock_of(flight))
    assert card.table is not None
    told = ["1.25 m/s", "1.25 m/s", "1.25 m, stops", "stands", "stands", "end"]
    assert [row[3] for row in card.table.rows] == told


def test_tables_have_the_places_of_the_flight() -> None:
    """Rows are the trajectory's, to the digits that are printed; a step is at most one row."""
    flight = Flight.of(*scene(), True)
    sections = text_of(flight, 0.75)
    for i in range(2):
        rows = [numbers(line) for line in sections[f"Places of drone {i}"][1:]]
        found = flight.flown.at(np.array([0, 0.75, 1.5]))
        own = found.drone == i
        np.testing.assert_allclose([row[0] for row in rows], [0, 0.75, 1.5])
        np.testing.assert_allclose([row[1:4] for row in rows], found.place[own], atol=0.006)
        yaw = np.degrees(found.yaw[own]) % 360
        np.testing.assert_allclose([row[-2] for row in rows], yaw, atol=0.06)
    assert "Places of person 0" in sections
    assert "Places of drone 0" not in text_of(flight)  # nobody asked for them
    legs = [numbers(line) for line in sections["Take-off and landing (a suggestion)"][3:]]
    assert [leg[-3:] for leg in legs[:2]] == [[0, 5, 5], [0, 8, 8]]
    with pytest.raises(ProblemError, match="every: must make at most 10000 rows on paper"):
        text_of(flight, 1e-4)


def test_cues_are_by_the_clock() -> None:
    """With its offset and in UTC at the top; from step 0 if nobody knows when that is."""
    start = datetime(2026, 5, 1, 10, tzinfo=timezone(timedelta(hours=2)))
    clock = Clock(start, (), 0.5)
    assert clock.step_0 == "10:00:00 (08:00:00 UTC)"
    assert clock.date == "Friday 2026-05-01"
    assert [clock.at(t) for t in (-0.5, 0.0, 3661.04)] == ["09:59:59.5", "10:00:00", "11:01:01"]
    unknown = Clock(None, (), 0.5)
    assert (unknown.step_0, unknown.date) == ("", "")
    assert [unknown.at(t) for t in (-61.5, 0.0, 75)] == ["T-1:01.5", "T+0:00", "T+1:15"]


@examples(50)
@given(st.integers(1, 200))
def test_phases_are_the_whole_take(steps: int) -> None:
    """Each begins where the one before ends; there are few."""
    problem, plan = scene()
    flight = Flight.of(problem, plan, False)
    longer = replace(flight.flown, problem=_lasting(problem, steps))
    phases = phases_of(flight._replace(flown=longer), ())
    assert [phases[0].first, *(phase.last for phase in phases)] == [
        *(phase.first for phase in phases), steps
    ]  # fmt: skip
    assert all(phase.kind == TAKE and phase.first < phase.last for phase in phases)
    assert len(phases) <= 4


def _lasting(problem: co.Problem, steps: int) -> co.Problem:
    """A scene without people that has so many steps."""
    return problem.replace(actors=(), horizon=steps)


@examples(50)
@given(st.lists(st.tuples(st.floats(0, 150), st.floats(0, 100)), min_size=1, max_size=18))
def test_labels_never_hide_each_other(points: list[tuple[float, float]]) -> None:
    """Nor do they leave the map, or lie on its scale bar, even if all drones start in one place."""
    sizes = np.full((len(points), 2), 4.0)
    taken = np.array([[[20.0, 5.0], [40.0, 10.0]]])
    middles = placed(np.array(points), sizes, (150.0, 100.0), np.zeros((0, 2)), taken)
    assert (middles >= 2 - 1e-9).all() and (middles <= np.array([148.0, 98.0]) + 1e-9).all()
    boxes = np.concatenate([taken, np.stack([middles, sizes], axis=1)])
    for k, (middle, size) in enumerate(boxes):
        apart = np.abs(boxes[:k, 0] - middle) - (boxes[:k, 1] + size) / 2
        assert (apart.max(axis=1, initial=1.0) > -1e-9).all()


@examples(100)
@given(
    st.text(st.characters(max_codepoint=0x24F, exclude_categories=("C", "Z")), max_size=40),
    st.floats(8, 60),
)
def test_lines_have_all_letters_and_fit(words: str, width: float) -> None:
    """Words that are wider than a line are parted."""
    lines = wrapped(words, width, BODY, (USUAL,))
    assert "".join(lines) == words
    assert all(len(line) <= 1 or wide(line, BODY, (USUAL,)) <= width + 0.02 for line in lines)


def test_numbers_stay_behind_names_from_right_to_left() -> None:
    """Names are drawn apart from what is beside them, and a line is as wide as its parts."""
    name = "\u05d2'\u05d5\u05df \u05d1\u05e8"
    line = f"films Ada (0) 9 %, {name} (3) 14 %"
    assert in_order(line) == ["films Ada (0) 9 %, ", name, " (3) 14 %"]
    pages = Pages([USUAL])
    pages.sentence(line)
    pages.table(Table(("person",), [(f"{name} (3)",)], frozenset({0})))
    found = [text for text in pages.figures[0].texts if text.get_text() in in_order(line)]
    assert [text.get_text() for text in found[:3]] == in_order(line)
    places = [text.get_position()[0] for text in found]
    assert places[0] < places[1] < places[2] and len(found) == 4
    assert "".join(wrapped(line, 30, BODY, (USUAL,))).count(name) <= 1
    require_apart(pages)


def extents(figure: Figure) -> FloatArray:
    """The boxes [n, 4] (mm) of all texts of a page, without those in pictures."""
    FigureCanvasAgg(figure)
    scale = 25.4 / figure.dpi
    boxes = [text.get_window_extent() for text in figure.texts if text.get_text().strip()]
    return np.array([[box.x0, box.y0, box.x1, box.y1] for box in boxes]) * scale


def require_apart(pages: Pages) -> None:
    """Nothing is cut at the edge of a page, and no text lies on another."""
    for figure in pages.figures:
        found = extents(figure)
        assert (found[:, :2] > 5.0).all()
        assert (found[:, 2:] < np.array([WIDTH, HEIGHT]) - 5.0).all()
        low, high = found[:, None], found[None]
        across = np.minimum(low[..., 2:], high[..., 2:]) - np.maximum(low[..., :2], high[..., :2])
        np.fill_diagonal(across[..., 0], -1.0)
        # Lines may touch where letters reach below the line.
        worst = np.minimum(across[..., 0], across[..., 1]).max()
        assert worst < 0.7, worst


@pytest.mark.slow
def test_texts_do_not_overlap_nor_leave_the_page() -> None:
    """With a name that is longer than a line, and tables that need several pages."""
    problem, plan = scene()
    named = problem.actors[0].replace(name="Wolfeschlegelsteinhausenbergerdorff " * 4)
    problem = problem.replace(actors=(named,), name=80 * "x")
    pages = pages_of(Flight.of(problem, plan, False), 0.01, [USUAL])
    assert len(pages.figures) > 5
    require_apart(pages)


@pytest.mark.parametrize(("people", "least", "most"), [(1, 90.0, 120.0), (40, 160.0, 200.0)])
def test_maps_of_a_crowd_are_taller(people: int, least: float, most: float) -> None:
    """Small maps have no room for the numbers of so many people."""
    problem, plan = scene()
    problem = problem.replace(actors=people * problem.actors)
    pages = pages_of(Flight.of(problem, plan, False), None, [USUAL])
    inset = 9.0  # mm below a map, for its axis
    heights = [
        ax.get_position(original=True).height * HEIGHT + inset
        for figure in pages.figures for ax in figure.axes if ax.get_xlabel().startswith("x")
    ]  # fmt: skip
    assert len(heights) == 1 and least <= heights[0] <= most + 1e-6


@pytest.mark.long
def test_sixty_people_fit_on_the_pages() -> None:
    """Strips go on in another picture, and nothing leaves the paper."""
    problem, plan = scene()
    (actor,) = problem.actors
    names = ["Ada", *(f"person {k} of a large crowd" for k in range(1, 60))]
    people = tuple(actor.replace(name=name) for name in names)
    flight = Flight.of(problem.replace(actors=people), plan, False)
    pages = pages_of(flight, None, [USUAL])
    require_apart(pages)
    strips = []
    for figure in pages.figures:
        for ax in figure.axes:
            box = ax.get_position(original=True)
            assert box.y0 * HEIGHT > 14.0 and box.y1 * HEIGHT < HEIGHT - 13.9
            labels = [tick.get_text() for tick in ax.get_yticklabels()]
            strips += [label for label in labels if label.startswith(("P", "Ada"))]
    assert strips == ["Ada", *(f"P{k}" for k in range(1, 60))]


def test_a_card_lists_the_first_twenty_people() -> None:
    """It says how many more there are; long names lose their middle there."""
    problem, plan = scene()
    (actor,) = problem.actors
    for count, listed, end in ((1, 1, " %"), (20, 20, " %"), (21, 20, " and 1 more")):
        people = tuple(actor.replace(name=f"{k}{'x' * 90}") for k in range(count))
        crowd = problem.replace(actors=people)
        found = quality_of(Flight.of(crowd, plan, False))
        assert found is not None
        words = filmed_by(replace(found, seen=np.ones_like(found.seen)), 0, crowd)
        assert re.findall(r"\((\d+)\) ", words) == [str(k) for k in range(listed)]
        assert words.endswith(end) and words.count("100 %") == listed
        assert max(map(len, words.split(", "))) <= 60
        assert filmed_by(replace(found, seen=np.zeros_like(found.seen)), 0, crowd) == "nobody"


@pytest.mark.slow
@pytest.mark.parametrize("is_box", [False, True])
def test_text_longer_than_a_page_goes_on_in_the_next(is_box: bool) -> None:
    """No word of it is lost; text that a page holds is not parted."""
    words = [f"{k:03}-{'W' * 32}" for k in range(100)]  # each fills a line
    for count, on_pages in ((69, [1, 69]), (100, None)):
        pages = Pages([USUAL])
        pages.sentence("before")
        if is_box:
            pages.box(words[:count])
        else:
            pages.sentence(" ".join(words[:count]))
        require_apart(pages)
        found = [[text.get_text() for text in figure.texts] for figure in pages.figures]
        assert [line for page in found for line in page] == ["before", *words[:count]]
        assert on_pages is None or [len(page) for page in found] == on_pages


@pytest.mark.slow
def test_a_card_is_on_one_page() -> None:
    """However full the page before it is; a table that a page holds is not parted either."""
    rows = [(str(k), "y") for k in range(9)]
    for before in range(0, 60, 7):
        pages = Pages([USUAL])
        for k in range(before):
            pages.sentence(f"line {k}")
        pages.cards("cards", [Card("card", [("who", "z")], Table(("top", "end"), rows))])
        pages.section("title", [Table(("head", "foot"), rows)])
        for first, last in (("card", "8"), ("title", "8"), ("cards", "card")):
            on = [
                k for k, figure in enumerate(pages.figures)
                if {first, last} <= {text.get_text() for text in figure.texts}
            ]  # fmt: skip
            assert on, (before, first)
        require_apart(pages)


@pytest.mark.long
def test_the_pages_of_delft_are_full() -> None:
    """Cards fill two columns, and what is short has no page of its own: four pages, not five."""
    problem = load_scene("delft", 0)
    plan = PLANNERS["sequential"](problem).plan
    assert plan is not None
    flight = Flight.of(problem, plan, False)
    pages = pages_of(flight, None, [USUAL])
    require_apart(pages)
    assert len(pages.figures) == 4
    last = [text.get_text() for text in pages.figures[-1].texts]
    assert "Places and heights" in last and "Not checked by the program" in last


@pytest.mark.parametrize(("earth", "top", "heads", "first"), [
    (None, 0.0, ["m above take-off"], ["5.0"]),
    (None, 2.0, ["z of map (m)", "m above take-off"], ["5.0", "5.0"]),
    (co.Earth(crs="EPSG:25830", heights="sea", base=12.0), 0.0,
     ["m above sea", "m above take-off"], ["17.0", "5.0"]),
    (co.Earth(crs="EPSG:25830", heights="ellipsoid"), 2.0,
     ["m above ellipsoid", "m above take-off"], ["5.0", "5.0"]),
])  # fmt: skip
def test_heights_say_what_they_are_above(
    earth: co.Earth | None, top: float, heads: list[str], first: list[str]
) -> None:
    """No column is called z alone; one column is enough where the map's z is above take-off."""
    flight = _over(None, top)
    flown = replace(flight.flown, problem=flight.flown.problem.replace(earth=earth))
    flight = flight._replace(flown=flown)
    card, _ = drone_cards(flight, clock_of(flight), None, Touchdowns.of(flight))
    assert card.table is not None
    words = [head.replace("\n", " ") for head in card.table.heads]
    assert words[3:-2] == heads and list(card.table.rows[0][3:-2]) == first
    facts = dict(card.facts)
    assert facts["first place"].endswith("; 5.0 m above take-off")
    told = text_of(flight)
    assert sum(line.startswith("Heights") for line in told["Places and heights"]) == 1
    assert not any(re.search(r"\bz [(\d]", line) for lines in told.values() for line in lines) or (
        earth is None
    )


def test_the_sheet_has_no_marks_of_other_papers() -> None:
    """No hyphens or backticks of Markdown; a box is beside what somebody checks, and nothing else.

    What the program did not check is a list of its own.
    """
    flight = Flight.of(*scene(), False)
    lines = [line for lines in text_of(flight).values() for line in lines]
    assert not any(line.startswith("- ") or "`" in line for line in lines)
    checks, others = {*to_check(flight, False)}, {*unchecked(flight)}
    assert checks and others and not checks & others
    assert not any("not checked" in words for words in checks)
    pages = pages_of(flight, None, [USUAL])
    texts = [text.get_text() for figure in pages.figures for text in figure.texts]
    assert texts.count("\N{BALLOT BOX}") == len(checks)
    assert texts.count("\N{BULLET}") == len(others)


@pytest.mark.slow
def test_no_half_page_is_empty_with_many_drones() -> None:
    """Maps that do not fit on the first page leave it to others; long tables go on in the next."""
    problem = load_scene("field-large", 0)
    few = problem.replace(
        robots=problem.robots[:18], actors=problem.actors[:6], step=2.0, horizon=9
    )
    few = few.replace(actors=[actor.replace(poses=actor.poses[:10]) for actor in few.actors])
    plan = co.Plan(paths=tuple((robot.start,) * 10 for robot in few.robots))
    pages = pages_of(Flight.of(few, plan, False), None, [USUAL])
    require_apart(pages)
    for figure in pages.figures[:-1]:
        boxes = [ax.get_position(original=True).y0 for ax in figure.axes]
        lowest = min([*boxes, *(box[1] / HEIGHT for box in extents(figure)[:-1])])
        assert lowest < 0.4
    cards = [
        text.get_text() for figure in pages.figures for text in figure.texts
        if re.fullmatch(r"Drone \d+", text.get_text())
    ]  # fmt: skip
    assert cards == [f"Drone {k}" for k in range(18)]


@pytest.mark.parametrize("count", [1, 2, 5, 300])
def test_a_checklist_has_two_columns_that_end_alike(count: int) -> None:
    """No page break parts it or leaves its heading behind; one that no page holds goes on."""
    pages = Pages([USUAL])
    for k in range(70):
        pages.sentence(f"line {k}")
    words = [f"item {k}" for k in range(count)]
    pages.checklist("title", words, "-")
    require_apart(pages)
    found = [{text.get_text() for text in figure.texts} for figure in pages.figures]
    assert set(words) <= set().union(*found)
    assert all({"title", words[0]} <= page for page in found if "title" in page)
    if count < 300:
        assert {"title", *words} <= found[-1]
        tops = [t.get_position()[1] for t in pages.figures[-1].texts if "item" in t.get_text()]
        assert len(set(tops)) == -(-count // 2)


def test_letters_of_other_scripts_have_fonts_or_are_told() -> None:
    """Latin, Greek and Cyrillic need no other font; a private letter has none anywhere."""
    assert families_of(["Ñandú Ωmega Жук"]) == ([USUAL], "")
    families, missing = families_of(["a\uf8ff\U000f0000"])
    assert families[0] == USUAL and "\U000f0000" not in missing  # it cannot be printed, so escaped


@pytest.mark.long
def test_the_sheet_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A4 pages, the same each time; north is the true one; it says when the flight starts."""
    problem, plan = scene()
    problem = problem.replace(
        name="yard \u98db", earth=co.Earth(crs="EPSG:2154", origin=(48.85, -3.5)),
        height_map=problem.height_map.replace(origin=(0.0, 0.0)), actors=(), meshes=(),
        airspace=co.Airspace(),
    )  # fmt: skip
    files = tmp_path / "scene.json", tmp_path / "plan.json"
    co.save(files[0], problem)
    co.save(files[1], plan, problem)
    words = "--start", "2026-05-01T10:00:00+02:00", "-o", tmp_path / "sheet.pdf"
    run = Run(capsys, "fly", *files, *words)
    assert run.code == 0, run.err
    page = (tmp_path / "sheet.pdf").read_bytes()
    flight = Flight.of(problem, plan, False)
    start = datetime(2026, 5, 1, 10, tzinfo=timezone(timedelta(hours=2)))
    for base, told in (
        (0.0, "Heights: above the sea; "),
        (-7.5, "(z = 0 of the map is 7.5 m below the sea)"),
    ):
        above = problem.replace(earth=co.Earth(crs="EPSG:2154", heights="sea", base=base))
        other = flight._replace(flown=replace(flight.flown, problem=above))
        assert any(told in line for line in text_of(other)["Places and heights"])
    assert FORMATS[".pdf"].writer()(flight._replace(start=start), None).files[""] == page
    (box,) = set(re.findall(rb"/MediaBox \[([\d. ]+)\]", page))
    assert [float(side) for side in box.split()] == pytest.approx([0, 0, 595.28, 841.89], abs=0.01)
    ax = Figure().add_subplot()
    (phase,) = phases_of(flight, ())
    draw(ax, flight, phase, ground_of(flight))
    (arrow,) = [text for text in ax.texts if text.get_text() == "N"]
    x, y = arrow.get_position()
    # The grid's north is west of the true one here, so that the arrow leans to the right.
    convergence = pyproj.Proj("EPSG:2154").get_factors(-3.5, 48.85).meridian_convergence
    assert np.degrees(np.arctan2(x, y)) == pytest.approx(-convergence, abs=0.01)
    assert convergence < -4


@pytest.mark.slow
def test_the_command_names_the_file_after_the_plan(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The answer is the file; what cannot be is one line that names the option."""
    problem, plan = scene()
    files = tmp_path / "scene.json", tmp_path / "plan.json"
    co.save(files[0], problem)
    co.save(files[1], plan, problem)
    run = Run(capsys, "sheet", *files, "--json")
    assert run.code == 0, run.err
    assert run.json["file"] == str(tmp_path / "plan.pdf") and run.json["pages"] > 1
    assert (tmp_path / "plan.pdf").read_bytes().startswith(b"%PDF")
    for words, told in (
        (("-o", tmp_path / "sheet.txt"), "-o: name a file that ends in .pdf"),
        (("--every", "0"), "--every: must be more than 0 seconds"),
        (("--start", "2026-05-01T10:00:00"), "--start: must be a date and a time with its offset"),
    ):
        run = Run(capsys, "sheet", *files, *words)
        assert run.code == 2 and re.search(told, run.err), run.err
    co.save(files[0], unknown := problem.replace(step=None))
    co.save(files[1], plan, unknown)
    run = Run(capsys, "sheet", *files)
    assert run.code == 2 and "--step" in run.err


def test_a_flight_that_leaves_the_calendar_is_refused() -> None:
    """It is the start that must be another."""
    late = datetime(9999, 12, 31, 23, 59, 59, tzinfo=UTC)
    with pytest.raises(ProblemError, match="start: must be such that the flight lies in the years"):
        Clock(late, (), 4.0).at(10.0)
