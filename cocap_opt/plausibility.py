"""Warnings about likely mistakes in valid problems: wrong units, people inside walls, narrow ways.

Nothing here changes a result. If nobody in a scene can be seen, J = 0 is proved; the warnings
explain why.
"""

import math
from collections.abc import Iterator

import numpy as np

from cocap_opt.graph.choke_points import MOST_CELLS, ChokePoint
from cocap_opt.graph.encounters import NEAR, Encounters
from cocap_opt.graph.motion import Window
from cocap_opt.problem import Actor, Cell, Motion, Prism, Robot, SceneData, Shape, State
from cocap_opt.text import pair
from cocap_opt.world.columns import Spans
from cocap_opt.world.workspace import HeightMap, Mesh, Workspace

_SUNK = 0.3  # m, largest plausible depth of feet below the ground
_FLOATING = 1.0  # m, largest plausible height of feet above the ground
_PROBE = 1e-3  # m, width of the column that is examined around a foot point
_HEIGHTS = 0.3, 4.0  # m, of people and riders
_FASTEST = 100.0  # m per step
_AHEAD = 2.0  # times as fast as drones; in published scenes people are up to 1.5 times as fast
_HOVERING = 100.0  # m, of a mesh above the highest cell; bridges and cranes are lower
_TALLEST = 830.0  # m, of buildings
_USUAL = 150.0  # m, median height of built-up cells; no city of towers exceeds it
_STEEPEST = 2.0  # median slope of land; only cliffs are steeper
_SMALLEST = 0.1  # m, smallest size of an obstacle that hides a person
_NOTHING = "has no triangle with an area, so it has no effect"
_WANTED = "cells near people at the last step"
_MOST_YAW = 4 * math.pi  # rad, two whole turns
_LEVEL = math.pi / 2  # deg; tilts that are in radians by mistake are at most that
_LONG = 0.5  # share of the steps that two people are inside one another
_FEW = 12  # cells, fewer than a drone needs to choose its view
_WIDEST = 60  # cells around a start in which pockets without a way out are searched for

_Pose = tuple[float, float, float, float]


def warnings(problem: SceneData) -> list[str]:
    """Returns all likely mistakes in a problem, in words, one line each."""
    return [
        *warnings_before_starts(problem), *_outrun(problem),
        *_shut_in(problem, _around_robots(problem)),
    ]  # fmt: skip


def warnings_before_starts(problem: SceneData) -> list[str]:
    """Returns the likely mistakes that can be found before the robots have starts, or exist."""
    found = [*_about_heights(problem.height_map)]
    found += [
        f"meshes[{k}] {_not_closed(mesh) if len(mesh.surface) else _NOTHING}"
        for k, mesh in enumerate(problem.meshes)
        if not (mesh.is_solid and len(mesh.surface))
    ]
    found += [
        f"meshes[{k}] is entirely below the ground: its top is at "
        f"{mesh.corners[..., 2].max():.4g} m; is another axis up in its file?"
        for k, mesh in enumerate(problem.meshes)
        if _below_ground(problem, mesh)
    ]
    found += [
        f"meshes[{k}] {warning}"
        for k, mesh in enumerate(problem.meshes)
        for warning in _about_mesh(problem, mesh)
    ]
    if not problem.actors:
        found.append("there are no people to film, so every view reward is 0")
    for j, actor in _distinct_people(problem):
        about = (*_about(problem, actor), *_misplaced(problem, actor))
        found += [f"{problem.person(j)} {warning}" for warning in about]
    return [*found, *_in_each_other(problem), *_about_cameras(problem), *_in_the_way(problem)]


def misplaced_people(problem: SceneData) -> Iterator[str]:
    """Yields the people who are off the map, inside an obstacle or in the air, and when."""
    for j, actor in _distinct_people(problem):
        yield from (f"{problem.person(j)} {words}" for words in _misplaced(problem, actor))


def narrow_way(problem: SceneData) -> str:
    """Returns the place where robots must queue because it has fewer cells than robots, in words.

    This is not a mistake, but may be the reason why a plan is bad or does not exist. The text is
    empty if there is no such place, if no rule holds between robots, or if too many cells are in
    reach to search them.
    """
    if problem.rules.none:
        return ""
    around = _around_robots(problem)
    if any(around[r.motion].outing(s)[0] > MOST_CELLS for r, s in _first_starts(problem)):
        return ""
    near = {
        Cell(x, y, problem.layers.index(motion.layers[layer]))
        for motion, encounters in around.items()
        for layer, x, y in encounters.graph.coordinates(encounters.near_at_the_end()).T.tolist()
    }
    choke = ChokePoint.of(problem, near)
    return choke.told(len(problem.robots), _WANTED) if choke else ""


def _about_heights(height_map: HeightMap) -> Iterator[str]:
    """Yields a warning if heights are implausible for buildings, or slopes for land."""
    ground = height_map.ground
    above = (height_map.heights - ground)[height_map.stands_out]
    highest, usual = (float(f(above)) if len(above) else 0.0 for f in (np.max, np.median))
    steps = [np.abs(np.diff(ground, axis=axis)).ravel() for axis in (0, 1)]
    slope = float(np.median(np.concatenate([*steps, [0.0]]))) / height_map.resolution
    what = (
        f"has obstacles up to {highest:.4g} m high" if highest > _TALLEST
        else f"has obstacles with a median height of {usual:.4g} m" if usual > _USUAL
        else f"rises by {slope:.3g} m per metre or more at half of its cells" if slope > _STEEPEST
        else ""
    )  # fmt: skip
    if what:
        yield (
            f"the map {what}: are its heights in centimetres? If so, set `unit` in the recipe's "
            "[map]"
        )


def _about_cameras(problem: SceneData) -> Iterator[str]:
    """Yields a warning for each camera that looks up, or whose tilts may be in radians."""
    seen = set()
    for k, robot in enumerate(problem.robots):
        if max(robot.camera.tilts) < 0 and robot.camera.tilts not in seen:
            yield (
                f"drones[{k}] look up at all their tilts, which are degrees below the horizon: "
                "should they be positive?"
            )
        most = math.degrees(max(abs(tilt) for tilt in robot.camera.tilts))
        if 0 < most < _LEVEL and robot.camera.tilts not in seen:
            yield f"drones[{k}] look down by at most {most:.3g} deg: are their tilts in degrees?"
        seen.add(robot.camera.tilts)


def _about_mesh(problem: SceneData, mesh: Mesh) -> Iterator[str]:
    """Yields the warnings about the size of a mesh and its height above the map."""
    if not len(mesh.surface):
        return
    corners = mesh.corners.reshape(-1, 3)  # vertices that no triangle uses do not count
    low, high = float(corners[:, 2].min()), float(corners[:, 2].max())
    above = low - float(problem.height_map.heights.max())
    if above > _HOVERING:
        yield f"is {above:.4g} m above the top of the map: is its altitude right?"
    if high - low > _TALLEST:
        yield f"is {high - low:.4g} m high: is its unit or height right?"
    largest = float(np.ptp(corners, axis=0).max())
    if largest < _SMALLEST:
        yield f"is no more than {largest:.2g} m in size: is its unit right?"


def _not_closed(mesh: Mesh) -> str:
    """Explains the effect of a mesh that is not closed; it may only lack a floor."""
    edges = np.sort(mesh.surface[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    distinct, counts = np.unique(edges, axis=0, return_counts=True)
    ends = mesh.vertices[distinct[counts == 1].ravel(), 2]
    lowest, highest = (float(end(mesh.corners[..., 2])) for end in (np.min, np.max))
    if len(ends) and float(ends.max()) - lowest <= _SUNK < highest - lowest:
        return "has no floor: only its surface is solid, and drones may fly inside"
    return "is not closed, so only its surface is solid"


def _outrun(problem: SceneData) -> Iterator[str]:
    """Yields a warning if the fastest person is much faster than all drones."""
    resolution, horizon = problem.height_map.resolution, problem.horizon
    people = [
        (float(np.hypot(*np.diff(actor.poses[: horizon + 1, :2], axis=0).T).mean()), j)
        for j, actor in _distinct_people(problem)
    ]
    longest = max((robot.motion.longest_aside(resolution) for robot in problem.robots), default=0.0)
    pace, j = max(people, default=(0.0, 0))
    if 0 < _AHEAD * longest < pace:
        yield (
            f"{problem.person(j)} moves {pace:.3g} m per step on average, and no drone more than "
            f"{longest:.3g} m, so drones fall behind: longer moves need a larger `radius` or, with "
            "an airframe, longer steps"
        )


def _shut_in(problem: SceneData, around: dict[Motion, Encounters]) -> Iterator[str]:
    """Yields a warning for each robot whose only start lets it reach few cells, or no person."""
    for i, (robot, start) in enumerate(_first_starts(problem)):
        if i in problem.open_starts:
            continue
        size, closed, meets = around[robot.motion].outing(start)
        if not closed:
            continue
        free = robot.motion.free_places(problem.workspace)
        if size <= _FEW:
            yield f"drone {i} can reach only {size} cell{'s' if size > 1 else ''}"
        elif not meets and size < np.count_nonzero(free):
            yield (
                f"drone {i} is shut in a pocket of {size} cells, from which it cannot "
                f"come within {NEAR:g} m of anybody in sight"
            )


def _first_starts(problem: SceneData) -> list[tuple[Robot, State]]:
    """Returns each robot with its start, or with the first of several possible starts."""
    return list(zip(problem.robots, problem.first_starts, strict=True))


def _around_robots(problem: SceneData) -> dict[Motion, Encounters]:
    """Returns, for the robots of each motion, the places near people around their starts."""
    found = {}
    for motion in dict.fromkeys(robot.motion for robot in problem.robots):
        starts = [(s.x, s.y) for robot, s in _first_starts(problem) if robot.motion == motion]
        # One step more than the horizon, to see if there is a way on from the last step's places.
        reach = min((problem.horizon + 1) * motion.radius, _WIDEST)
        window = Window.around(starts, reach, problem.workspace)
        found[motion] = Encounters(
            problem.workspace, motion, problem.distinct_people, problem.horizon, NEAR, window
        )
    return found


def _below_ground(problem: SceneData, mesh: Mesh) -> bool:
    """Returns True if all of a mesh's parts within the map's edges are below the ground."""
    tops = Workspace(problem.height_map, (mesh,)).columns.high[1:].max(axis=0, initial=-math.inf)
    above = tops > -math.inf
    return bool(above.any() and (tops <= problem.height_map.heights)[above].all())


def _in_each_other(problem: SceneData) -> Iterator[str]:
    """Yields a warning for each pair of people of a take who share a place for much of the time."""
    people = [*_distinct_people(problem)]
    feet = np.array([actor.poses[: problem.horizon + 1, :2] for _, actor in people])
    for k, (j, actor) in enumerate(people):
        apart = np.hypot(*(feet[k + 1 :] - feet[k]).transpose(2, 0, 1))
        for (i, other), distances in zip(people[k + 1 :], apart, strict=True):
            together = distances < max(_inner(actor.shape), _inner(other.shape))
            if actor.take == other.take and together.mean() >= _LONG:
                yield (
                    f"{problem.person(j)} and {problem.person(i)} are inside one another at "
                    f"{np.count_nonzero(together)} of {len(together)} steps, and hide one another: "
                    "are both the same person?"
                )


def _inner(shape: Shape) -> float:
    """Returns the radius (m) of the largest circle inside a shape, seen from above."""
    if isinstance(shape, Prism):
        return shape.apothem
    return min(shape.length, shape.width) / 2


def _in_the_way(problem: SceneData) -> Iterator[str]:
    """Yields a warning for each robot that can fly into a person, which no rule forbids."""
    if problem.airspace.people_aside:
        return
    for i, robot in enumerate(problem.robots):
        for j, actor in _distinct_people(problem):
            height = _height_within(problem, robot, actor)
            if height is not None:
                yield (
                    f"drone {i} can fly into {problem.person(j)}, {height:.3g} m above the feet; "
                    "no rule keeps them apart"
                )
                break


def _height_within(problem: SceneData, robot: Robot, actor: Actor) -> float | None:
    """Returns the height above an actor's feet (m) at which a robot can fly into it, or None."""
    for x, y, z, _ in actor.poses[: problem.horizon + 1].tolist():
        cell = problem.height_map.cell_of(x, y)
        if problem.height_map.inside(*cell):
            for layer in robot.motion.layers:
                above: float = problem.height_map.altitude(*cell, layer) - z
                if 0 <= above < actor.shape.height:
                    return above
    return None


def _about(problem: SceneData, actor: Actor) -> Iterator[str]:
    """Yields the warnings about the units of an actor's height, yaw and pace."""
    poses = actor.poses[: problem.horizon + 1]
    if not _HEIGHTS[0] <= actor.shape.height <= _HEIGHTS[1]:
        yield f"is {actor.shape.height:.3g} m high: is the unit right?"
    turned = float(np.abs(poses[:, 3]).max())
    if turned > _MOST_YAW:
        yield f"has a yaw of {turned:.3g} rad: is it in degrees?"
    fastest = float(np.hypot(*np.diff(poses[:, :2], axis=0).T).max(initial=0.0))
    if fastest > _FASTEST:
        yield f"moves by {fastest:.3g} m in one step: is the unit right?"


def _misplaced(problem: SceneData, actor: Actor) -> Iterator[str]:
    """Yields the warnings about the places of an actor."""
    poses = actor.poses[: problem.horizon + 1]
    steps: list[_Pose] = [(x, y, z, yaw) for x, y, z, yaw in poses.tolist()]
    off = [t for t, (x, y, _, _) in enumerate(steps) if not _on_map(problem.height_map, x, y)]
    if off:
        x, y, _, _ = steps[off[0]]
        is_far = max(abs(end) for end in np.ravel(problem.height_map.ends)) > 1000
        degrees = "; are these degrees?" if is_far and abs(x) <= 180 and abs(y) <= 180 else ""
        yield _at(off, steps, "is off the map", f"at {pair(x, y)} m{degrees}")
    if words := buried(problem.workspace, actor, problem.horizon):
        yield words
    high = {t: up for t, pose in enumerate(steps) if (up := _floats(problem, actor, pose))}
    if high:
        words = f"their feet are {next(iter(high.values())):.3g} m above the nearest surface below"
        yield _at(list(high), steps, "floats", words)


def buried(workspace: Workspace, actor: Actor, horizon: int) -> str:
    """Describes when an actor is inside an obstacle, and how deep; empty if it never is."""
    depths = depths_below(workspace, actor, horizon)
    if not depths:
        return ""
    words = f"their feet are {next(iter(depths.values())):.3g} m below the top of the obstacle"
    return _at(list(depths), _poses(actor, horizon), "is inside an obstacle", words)


def depths_below(workspace: Workspace, actor: Actor, horizon: int) -> dict[int, float]:
    """Returns the depths (m) of an actor's feet below the top of obstacles, by step."""
    steps = enumerate(_poses(actor, horizon))
    return {t: depth for t, pose in steps if (depth := _sunk(workspace, actor, pose))}


def _poses(actor: Actor, horizon: int) -> list[_Pose]:
    return [(x, y, z, yaw) for x, y, z, yaw in actor.poses[: horizon + 1].tolist()]


def _distinct_people(problem: SceneData) -> Iterator[tuple[int, Actor]]:
    """Yields people with their numbers; a person who walks alike in several takes occurs once."""
    distinct = set(map(id, problem.distinct_people))
    yield from ((j, actor) for j, actor in enumerate(problem.actors) if id(actor) in distinct)


def _at(when: list[int], steps: list[_Pose], what: str, words: str) -> str:
    return f"{what} at {len(when)} of {len(steps)} steps; at step {when[0]} {words}"


def _on_map(height_map: HeightMap, x: float, y: float) -> bool:
    return height_map.inside(*height_map.cell_of(x, y))


def _sunk(workspace: Workspace, actor: Actor, pose: _Pose) -> float:
    """Returns the depth (m) of an actor's feet below the top of an obstacle; 0 outside of any."""
    x, y, z, _ = pose
    if not _on_map(workspace.height_map, x, y):
        return 0.0
    middle = z + actor.shape.height / 2
    spans = workspace.columns.at(*workspace.height_map.cell_of(x, y))
    if any(_holds(span, z, middle) for span in spans[1:]):
        # A part of a mesh is in the cell, perhaps not at the place of the actor.
        spans = [spans[0], *_mesh_spans(workspace.meshes, x, y)]
    return max((top - z for low, top in spans if _holds((low, top), z, middle)), default=0.0)


def _holds(span: tuple[float, float], foot: float, middle: float) -> bool:
    return span[0] < middle and span[1] > foot + _SUNK


def _mesh_spans(meshes: tuple[Mesh, ...], x: float, y: float) -> list[tuple[float, float]]:
    """Returns the altitudes at which meshes are solid at a point."""
    found: list[tuple[float, float]] = []
    for mesh in meshes:
        vertices = (mesh.vertices - np.array([x, y, 0.0])) / np.array([_PROBE, _PROBE, 1.0])
        middle = np.array([0.5, 0.5, 0.0])
        spans = Spans.of_mesh(vertices + middle, mesh.surface, (1, 1), mesh.is_solid)
        found += zip(spans.low.tolist(), spans.high.tolist(), strict=True)
    return found


def _floats(problem: SceneData, actor: Actor, pose: _Pose) -> float:
    """Returns the height (m) of an actor's feet above the nearest surface below; 0 if plausible."""
    x, y, z, _ = pose
    if not _on_map(problem.height_map, x, y):
        return 0.0
    spans = problem.workspace.columns.at(*problem.height_map.cell_of(x, y))
    below = max((top for low, top in spans if low < z + actor.shape.height), default=math.inf)
    return z - below if z - below > _FLOATING else 0.0
