"""The text of a flight sheet: what a crew must know of flights before it starts them."""

import math
from collections.abc import Iterator, Sequence
from datetime import UTC

import numpy as np

from cocap_opt.data import FieldError, FloatArray
from cocap_opt.flight.changes import (
    people_and_delay,
    tolerated_delay,
    tolerated_delay_of_people,
)
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.safety import Nearest
from cocap_opt.flight.ways import CRUISE, NOTE, RISE, Part, Way, has_homes, parts_of_take, pauses_of
from cocap_opt.footage.quality import Quality
from cocap_opt.footage.summary import whole_percent
from cocap_opt.missions import FORMATS
from cocap_opt.missions.autopilots import AUTOPILOTS
from cocap_opt.missions.routes import (
    routes,
    seconds_in_the_air,
    seconds_to_step_0,
)
from cocap_opt.missions.waypoints import lateness
from cocap_opt.missions.zones import Zone, zones
from cocap_opt.output.heights import over_datum
from cocap_opt.problem import Problem
from cocap_opt.scenarios.hardware import airframe_name, camera_name
from cocap_opt.text import printable, shortened

ROWS = 12  # of a drone's table, at most, where nobody asked for others
_MOST_ROWS = 10_000
_BLANK = "__________"
_NAME = 24  # characters of a person's name in a table
_LEGS = "take-off and landing legs, against anything"
_UNCHECKED = (
    "wind, and deviations of drones: distances hold for flights flown exactly",
    _LEGS,
    "batteries, radio links and satellite reception",
    "obstacles that are not on the map, people who are not in the scene, and deviations of people "
    "from their walks",
    "airspace and its rules, and permission of the owners of the ground",
)


_MOST_CORNERS = 8  # of a no-fly zone, that are listed

Section = tuple[str, list[str]]  # a part of the text: its title and its lines


def briefing(flight: Flight, every: float | None) -> list[Section]:
    """Returns the text of a flight's sheet, without what its map shows.

    Parameters
    ----------
    every : s between rows of the tables of places
    """
    return [
        ("Flight", list(_summary(flight))),
        ("Drones", list(_drones(flight))),
        ("Distances and limits", [*_distances(flight), "", *_limits(flight)]),
        ("Late drones and people", list(_delays(flight))),
        *_filmed(flight),
        *_take_off(flight),
        *_missions(flight),
        *_places(flight, every),
        *_walks(flight, every),
        ("Not checked", [f"- {words}" for words in _unchecked(flight)]),
    ]


def _take_off(flight: Flight) -> Iterator[Section]:
    """Yields how drones come to their first places and back to the ground."""
    problem = flight.flown.problem
    if problem.begins_in_the_air:
        yield ("Drones in the air", list(_already_up(problem)))
        yield ("Landing (a suggestion)", list(_legs(flight)))
        return
    if not has_homes(problem):
        yield ("Take-off and landing (a suggestion)", list(_legs(flight)))
        return
    parts = parts_of_take(problem, flight.plan)
    yield ("From home and back", list(_homeward(parts)))
    for part in parts:
        steps = f" of steps {part.words}" if len(parts) > 1 else ""
        lines = [
            line
            for drone in part.drones
            for words, way in (("out", drone.out), ("back", drone.back))
            for line in _points(drone.drone, words, way)
        ]
        yield (f"Ways{steps}", ["drone           x (m)        y (m)     z (m)", *lines])


def _already_up(problem: Problem) -> Iterator[str]:
    """Yields which drone is which in the mission, and how they begin its rest."""
    yield "The rest of a mission: all drones hover at their first places until all begin."
    for i, robot in enumerate(problem.robots):
        yield f"Drone {i} of this sheet is drone {robot.number} of the mission."
    yield "Batteries have what is left of them after the steps that were flown."


def _homeward(parts: Sequence[Part]) -> Iterator[str]:
    """Yields in which order drones fly, and for how long they are in the air."""
    if words := pauses_of(parts):
        yield f"ATTENTION: {words}."
    yield f"{NOTE[0].upper()}{NOTE[1:]}."
    yield (
        f"Straight up and down at home, at {RISE:g} m/s or faster; on the level at {CRUISE:g} m/s "
        "if limits are known and allow it, else as fast as in the take."
    )
    yield ""
    heads = "".join(f"{name:>9}" for name in ("out", "waits", "take", "waits", "back"))
    yield f"steps     drone{heads}{'in the air':>13}"
    for part in parts:
        for each in part.drones:
            known = each.endurance is not None
            of = f" s of {each.endurance:.0f} s" if known else f" s of {_BLANK}"
            yield (
                f"{part.words:<10}{each.drone:>5}{each.out.seconds:>9.1f}{each.out.waits:>9.1f}"
                f"{each.filming:>9.1f}{each.back.waits:>9.1f}{each.back.seconds:>9.1f}"
                f"{each.seconds:>11.1f}{of}"
            )
        for name, ways in (
            ("take off", [each.out for each in part.drones]),
            ("go home", [each.back for each in part.drones]),
        ):
            # Who waits longest at its place was there first, or leaves it last.
            order = sorted(ways, key=lambda way: way.waits, reverse=name == "take off")
            yield f"Drones {name} in this order: {', '.join(str(way.drone) for way in order)}."


def _points(drone: int, words: str, way: Way) -> Iterator[str]:
    """Yields the points at which a way turns."""
    for k, (x, y, z) in enumerate(way.points.tolist()):
        name = f"{drone:>5} {words:<6}" if k == 0 else " " * 12
        yield f"{name}{x:>9.1f} {y:>12.1f} {z:>9.1f}"


def _unchecked(flight: Flight) -> Iterator[str]:
    """Yields what nobody has checked; that a plan was cut short stands at the top of the sheet."""
    homes = has_homes(flight.flown.problem)
    yield from (
        "people on the ways from and to home" if homes and words == _LEGS else words
        for words in _UNCHECKED
    )
    yield from (words for words in flight.warnings() if words != flight.cut_short)


def _summary(flight: Flight) -> Iterator[str]:
    problem, flown = flight.flown.problem, flight.flown
    if flight.cut_short:
        yield f"ATTENTION: {flight.cut_short}."
    drones, people = len(problem.robots), len(problem.actors)
    yield (
        f"{drones} {'drones' if drones > 1 else 'drone'}, {people} "
        f"{'person' if people == 1 else 'people'}; {flown.seconds:g} s, in {problem.horizon} steps "
        f"of {flown.step:g} s; {'smooth' if flight.is_smooth else 'straight from step to step'}"
    )
    yield f"Step 0, t = 0, is at {_start(flight)}. All drones start their flights together."
    if people:
        yield f"People set out at t = 0. {_signal(flight)}"
    yield from _tracks(problem)
    if flight.is_smooth:
        yield "Waypoint missions fly straight: export their sheet without --smooth."
    if flight.geodesy is None:
        yield "Places: x and y of the map (m); its location on the Earth is unknown or left out."
    else:
        off = flight.geodesy.accuracy
        known = "accuracy unknown" if off is None else f"off by {off:g} m at most"
        name = flight.geodesy.name
        yield f"Places: x and y in {name}; latitudes and longitudes in WGS 84, {known}."
        yield f"{flight.geodesy_note(flight.geodesy)}."
    yield f"z: {_altitude(flight)}."


def _signal(flight: Flight) -> str:
    """Says when people get their signal."""
    if flight.is_smooth or flight.flown.problem.begins_in_the_air:
        return "Give them the signal then."
    return (
        f"Give them the signal then; with waypoint missions, {seconds_to_step_0(flight):.3g} s "
        "after starting the missions."
    )


def _start(flight: Flight) -> str:
    """Returns the time of step 0 by the clock that was asked for, and in UTC."""
    if flight.start is None:
        return _BLANK
    utc = f"{flight.start.astimezone(UTC):%Y-%m-%d %H:%M:%S} UTC"
    if not flight.start.utcoffset():
        return utc
    return f"{flight.start.isoformat(' ', 'seconds')}, which is {utc}"


def _tracks(problem: Problem) -> Iterator[str]:
    """Yields at which times of their tracks people are at step 0."""
    begins = dict[float, list[str]]()
    for j, actor in enumerate(problem.actors):
        if actor.begin is not None:
            begins.setdefault(actor.begin, []).append(problem.person(j))
    for begin, people in begins.items():
        everybody = 1 < len(people) == len(problem.actors)
        who = "all people" if everybody else ", ".join(people)
        yield f"Step 0 is at {begin:.6g} s of the tracks of {who}."


def _drones(flight: Flight) -> Iterator[str]:
    """Yields the camera, the airframe and the battery of each drone, or a blank for the crew."""
    problem = flight.flown.problem
    yield f"drone  {'camera':<22}{'airframe':<22}battery"
    for i, robot in enumerate(problem.robots):
        lasts = robot.limits.endurance if robot.limits else None
        battery = _BLANK if lasts is None else f"{lasts / 60:.1f}"
        airframe = airframe_name(robot.limits) or _BLANK
        yield (f"{i:>5}  {camera_name(robot.camera) or _BLANK:<22}{airframe:<22}{battery} min")
    yield "Battery times are the maker's, in calm air; expect less in wind and cold."
    yield from _in_the_air(flight)


def _in_the_air(flight: Flight) -> Iterator[str]:
    """Yields how long drones are in the air, and whose battery does not last for it."""
    if flight.flown.problem.begins_in_the_air:
        yield f"In the air: {flight.flown.seconds:g} s for the rest, plus the way down."
        return
    if has_homes(flight.flown.problem):
        yield "In the air: from home and back, see the table below."
        return
    seconds = seconds_in_the_air(flight)
    before = seconds - flight.flown.seconds
    waits = "" if flight.is_smooth else ", where waypoint missions wait for each other"
    yield (
        f"In the air: {seconds:.4g} s ({seconds / 60:.1f} min) from take-off to the last step, "
        f"{before:.3g} s of them up to the first place at {RISE:g} m/s or faster{waits}; plus the "
        "way down."
    )
    for i, robot in enumerate(flight.flown.problem.robots):
        if robot.limits is not None and robot.limits.outlasted_by(seconds):
            yield (
                f"THE BATTERY OF DRONE {i} DOES NOT LAST: {robot.limits.endurance:.4g} s are less "
                f"than {seconds:.4g} s."
            )


def _altitude(flight: Flight) -> str:
    earth = flight.flown.problem.earth
    if earth is None or earth.heights is None:
        return "map height (m), datum unknown"
    above = "the sea" if earth.heights == "sea" else "the ellipsoid"
    if not earth.base:
        return f"height above {above} (m)"
    return f"map height (m); z + {earth.base:g} m is the height above {above}"


def _distances(flight: Flight) -> Iterator[str]:
    """Yields how near drones come to each other and to people, and the rules for it."""
    problem = flight.flown.problem
    near = Nearest.of_drones(flight.flown)
    rules = str(problem.rules)
    if near is None:
        yield "Between drones: there is only one."
    else:
        x, y, z = near.place.tolist()
        yield (
            f"Between drones: {near.distance:.2f} m at least, of {near.first} and {near.second} "
            f"at {near.t:.2f} s near x {x:.1f}, y {y:.1f}, z {z:.1f} (rules: {rules})."
        )
    close = Nearest.of_people(flight.flown)
    if close is not None:
        x, y, z = close.place.tolist()
        yield (
            f"To people, seen from above: {close.distance:.2f} m at least, of drone {close.first} "
            f"and {problem.person(close.second)} at {close.t:.2f} s "
            f"near x {x:.1f}, y {y:.1f}, z {z:.1f}."
        )
    yield f"Airspace: {str(problem.airspace) or 'no zones, no ceiling, no distance to people'}."
    if problem.airspace.ceiling is not None:
        yield f"The ceiling is {problem.airspace.ceiling:g} m {over_datum(problem)}."
    if flight.geodesy is not None:
        for zone in zones(flight, flight.geodesy):
            yield f"N{zone.name[1:]}{_corners(zone)}."
    if flight.asked is not None:
        yield f"The scene asks for {flight.asked.told_people}; --margin allows less in this flight."


def _corners(zone: Zone) -> str:
    """Returns where a zone is, by its corners if they are few; KML and GeoJSON have all others."""
    corners = list(zone.outline.exterior.coords)[:-1]
    if len(corners) > _MOST_CORNERS:
        west, south, east, north = zone.outline.bounds
        return f", between x {west:.1f} and {east:.1f}, y {south:.1f} and {north:.1f}"
    return f", with corners {', '.join(f'x {x:.1f} y {y:.1f}' for x, y in corners)}"


def _delays(flight: Flight) -> Iterator[str]:
    """Yields how late drones or people may be before a distance is lost."""
    rules, delay = flight.flown.problem.rules, tolerated_delay(flight)
    if delay is not None and math.isinf(delay):
        yield f"Between drones: {rules} is kept however late any of them is."
    elif delay is not None:
        yield f"Between drones: {rules} is kept while none is {delay:.2f} s or more behind another."
    to_people = people_and_delay(flight, tolerated_delay_of_people(flight))
    yield from (f"{words[0].upper()}{words[1:]}." for words in to_people)


def _filmed(flight: Flight) -> Iterator[Section]:
    """Yields how well each person is filmed at the steps, where anybody counts."""
    found = Quality.of(flight.flown.problem, flight.plan)
    if not found.by_person:
        return
    had = found.assumptions
    lines = [
        f"Cameras: {found.summary.line}.",
        f"Drones that are {had.drone_pixels:g} px wide or more in the picture of another: "
        f"{found.summary.in_pictures}, counted at each step.",
        "",
        f"{'person':<{_NAME}}{'by two':>10}{'by three':>10}{'half within':>14}  worst moment",
        *(
            f"{shortened(printable(person.person), _NAME - 1):<{_NAME}}"
            f"{whole_percent(person.by_two):>10}{whole_percent(person.by_three):>10}"
            f"{_millimetres(person.median):>14}  {person.worst or 'none'}"
            for person in found.by_person
        ),
        f"By two, by three: steps at which so many cameras or more see {100 * had.at_least:g} % of "
        "the person, or more.",
        "Half within: the error of a point in space at half of the steps, with "
        f"{had.pixel_error:g} px of error in a picture.",
    ]
    yield ("How people are filmed", lines)


def _millimetres(error: float) -> str:
    """Returns an error as the table has it; one that is infinite or unknown is a stroke."""
    return f"{error:,.0f} mm" if math.isfinite(error) else "-"


def _limits(flight: Flight) -> Iterator[str]:
    """Yields the tightest moment of each drone."""
    yield f"drone  {'tightest':<14}{'at (s)':>8}{'value':>10}{'':9}{'limit':<14}of the limit"
    for row in flight.rows():
        limit = "not known" if row["limit"] is None else f"{row['limit']:.2f} {row['unit']}"
        yield (
            f"{row['drone']:>5}  {row['tightest']:<14}{row['at (s)']:>8.2f}{row['value']:>10.2f} "
            f"{row['unit']:<8}{limit:<14}{row['of the limit'] or '-'}"
        )


def _legs(flight: Flight) -> Iterator[str]:
    """Yields the legs straight up to the first places and straight down from the last."""
    problem, flown = flight.flown.problem, flight.flown
    if not problem.begins_in_the_air:
        yield f"Straight up from the surface below the first place. {_order(flight)}"
    yield "Straight down at the last place, one drone after the other."
    yield ""
    head = "drone              x (m)        y (m)   surface z    place z     leg (m)"
    yield head + _head_of_degrees(flight)
    ends = flown.at(np.array([0.0, flown.seconds]))
    for k in range(int(problem.begins_in_the_air), len(ends.t), 1 + problem.begins_in_the_air):
        words = "take-off" if k % 2 == 0 else "landing"
        x, y, z = ends.place[k].tolist()
        i, j = (int(cell[0]) for cell in problem.height_map.cells_below(ends.place[k : k + 1]))
        tops = [high for _, high in problem.workspace.columns.at(i, j) if high <= z]
        surface = max(tops, default=math.nan)
        yield (
            f"{ends.drone[k]:>5} {words:<8}{x:>10.1f} {y:>12.1f} {surface:>11.2f} {z:>10.2f} "
            f"{z - surface:>11.2f}{_degrees(flight, x, y)}"
        )


def _missions(flight: Flight) -> Iterator[Section]:
    """Yields what the crew must know of each autopilot's missions of this flight."""
    if flight.is_smooth or flight.geodesy is None or flight.flown.problem.begins_in_the_air:
        return
    lines = ["A mission flies on the autopilot that its file names, and on no other:"]
    found = routes(flight, flight.geodesy)
    for autopilot in AUTOPILOTS.values():
        known = {ending: kind.autopilots for ending, kind in FORMATS.items()}
        endings = [ending for ending, pilots in known.items() if autopilot.name in pilots]
        endings.sort(key=lambda ending: known[ending].index(autopilot.name))  # usual ones first
        names = " or ".join(f"*.{autopilot.name}.*{ending}" for ending in endings)
        lines.append(f"- {names}: {autopilot.note}.")
        lines += (f"  {words}." for words in lateness(autopilot, found))
    yield ("Missions of waypoints", lines)


def _order(flight: Flight) -> str:
    """Says when drones rise, and when the flight begins."""
    if flight.is_smooth:
        return "The flight begins when all drones are at their first places."
    return (
        "Start missions of waypoints all at once: each drone waits at its first place until "
        f"{seconds_to_step_0(flight):.3g} s."
    )


def _angles(flight: Flight) -> str:
    yaw = "yaw is 0 along x, counter-clockwise"
    if flight.geodesy is not None:
        yaw = "compass is clockwise from true north"
    return f"Degrees: {yaw}; pitch is the camera's, 0 is level, below is negative."


def _head_of_degrees(flight: Flight) -> str:
    return "" if flight.geodesy is None else "     latitude    longitude"


def _degrees(flight: Flight, x: float, y: float) -> str:
    if flight.geodesy is None:
        return ""
    latitude, longitude = flight.geodesy.degrees(np.array([x]), np.array([y]))
    return f" {latitude[0]:>12.7f} {longitude[0]:>12.7f}"


def _columns(flight: Flight, every: float | None) -> dict[str, FloatArray]:
    """Returns the flights at the times of the tables."""
    steps = flight.flown.problem.horizon
    usual = math.ceil(steps / (ROWS - 1)) * flight.flown.step
    rows = 0.0 if every is None else flight.flown.seconds / every * len(flight.flown.pieces)
    if rows > _MOST_ROWS:
        raise FieldError("every", f"must make at most {_MOST_ROWS} rows on paper, not {rows:.3g}")
    return flight.columns(usual if every is None else every)


def _places(flight: Flight, every: float | None) -> Iterator[Section]:
    """Yields a table of times and places for each drone."""
    columns = _columns(flight, every)
    over = "above_ground" if "above_ground" in columns else "above_takeoff"
    yaw = columns["yaw"] % 360
    if flight.geodesy is not None:
        yaw = flight.geodesy.compass(columns["x"], columns["y"], np.radians(yaw))
    head = (
        f"{'t (s)':>8}{'x (m)':>12}{'y (m)':>13}{'z (m)':>9}{over.replace('_', ' '):>15}"
        f"{'yaw' if flight.geodesy is None else 'compass':>9}{'pitch':>7}{_head_of_degrees(flight)}"
    )
    for drone in range(len(flight.flown.pieces)):
        lines = [head]
        for k in np.flatnonzero(columns["drone"] == drone).tolist():
            x, y = float(columns["x"][k]), float(columns["y"][k])
            lines.append(
                f"{columns['t'][k]:>8.2f}{x:>12.2f}{y:>13.2f}{columns['z'][k]:>9.2f}"
                f"{columns[over][k]:>15.2f}{yaw[k] % 360:>9.1f}{columns['pitch'][k]:>7.1f}"
                f"{_degrees(flight, x, y)}"
            )
        yield (f"Drone {drone}", [_angles(flight), *lines] if drone == 0 else lines)


def _walks(flight: Flight, every: float | None) -> Iterator[Section]:
    """Yields a table of times and places for each person."""
    problem, columns = flight.flown.problem, _columns(flight, every)
    times = columns["t"][columns["drone"] == 0]
    steps = np.arange(problem.horizon + 1) * flight.flown.step
    head = f"{'t (s)':>8}{'x (m)':>12}{'y (m)':>13}{_head_of_degrees(flight)}"
    for j, actor in enumerate(problem.actors):
        walk = [np.interp(times, steps, axis) for axis in actor.poses[: len(steps), :2].T]
        lines = [
            f"{t:>8.2f}{x:>12.2f}{y:>13.2f}{_degrees(flight, x, y)}"
            for t, x, y in zip(times.tolist(), *(axis.tolist() for axis in walk), strict=True)
        ]
        person = problem.person(j)
        yield (f"{person[0].upper()}{person[1:]}", [head, *lines])
