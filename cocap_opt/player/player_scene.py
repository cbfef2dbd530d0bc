"""Terrain, meshes, people and drones of a scene in the coordinates of the player.

Positions are in m from the corner of the map and from its lowest height, with as many digits as can
be seen. Map coordinates of 500 km would exceed the precision of graphics.
"""

import math
from collections.abc import Container, Iterable
from functools import cached_property
from typing import Any

import numpy as np

from cocap_opt.data import BoolArray, FloatArray
from cocap_opt.pictures.figures import VIEW_LENGTH, robot_colour
from cocap_opt.player.player_tasks import groups_of_people, told_group
from cocap_opt.problem import (
    Camera,
    Cone,
    Plan,
    Problem,
    Robot,
    State,
)
from cocap_opt.problem.land_cover import LANDS, in_cells
from cocap_opt.problem.pictures import LAND_COLOURS, STARTABLE, take_colour
from cocap_opt.problem.start_ground import StartGround
from cocap_opt.problem.takes import told_take
from cocap_opt.world.workspace import Mesh, Workspace

MOST_CELLS = 128  # along an edge of the map, as it is drawn
MOST_TRIANGLES = 10_000  # in all meshes; finer meshes are drawn as the cells that they fill
_DIGITS = 5  # significant digits, relative to the map's size
_GROUND, _LOW, _BLOCKS = 0, 1, 2  # kinds of cells; the last blocks the lowest flight height
_SLAB = 0.012  # height of the drawn edge of the map, relative to its size
_MARGIN = 4.0  # m, from all flights and walks to the edge of the picture
_MOST_TOLD = 2  # largest number of start areas that are named one by one
_SKY = 4.0  # m above the highest flight, up to which closed airspace is drawn

Data = dict[str, Any]


class PlayerScene:
    """A scene in the player's coordinates, as JSON values."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        heights = problem.height_map.heights
        self._corner = np.array([*problem.height_map.origin, float(heights.min())])
        self._size = np.array(problem.height_map.shape) * problem.height_map.resolution
        self._decimals = _DIGITS - 1 - math.floor(math.log10(self._size.max()))

    def rounded(self, values: FloatArray) -> Any:
        """Returns lengths (m) or angles with as many decimals as can be seen, as nested lists."""
        return _short((np.asarray(values).round(max(self._decimals, 3)) + 0.0).tolist())

    def local(self, points: FloatArray) -> FloatArray:
        """Returns world points [.., 3] in the player's coordinates."""
        result: FloatArray = points - self._corner
        return result

    def path(self, robot: Robot, path: tuple[State, ...]) -> FloatArray:
        """Returns the poses [T+1, 5] of a robot: x, y, z (m), heading and tilt (rad)."""
        height_map, motion = self.problem.height_map, robot.motion
        rows = [
            (*height_map.centre(s.x, s.y), height_map.altitude(s.x, s.y, motion.layers[s.layer]),
             math.tau * s.heading / motion.headings, robot.camera.tilts[s.pitch])
            for s in path
        ]  # fmt: skip
        poses = np.array(rows)
        poses[:, :3] = self.local(poses[:, :3])
        return poses

    @cached_property
    def _block(self) -> int:
        """Number of the map's cells along the edge of a drawn cell."""
        return math.ceil(max(self.problem.height_map.shape) / MOST_CELLS)

    def _coarse(self, values: FloatArray, take: np.ufunc) -> FloatArray:
        """Returns values [.., X, Y] of the drawn cells."""
        for axis in (-2, -1):
            starts = np.arange(0, values.shape[axis], self._block)
            values = take.reduceat(values, starts, axis=axis)
        return values

    def terrain(self) -> Data:
        """Returns the columns of the height map; on a large map, the highest of each block."""
        height_map = self.problem.height_map
        parts = (np.minimum(height_map.heights, self._ceiling), height_map.ground, self._kinds)
        heights, ground, kinds = (self._coarse(part, np.maximum) for part in parts)
        return {
            "cell": height_map.resolution * self._block,
            "cells": list(heights.shape),
            "size": self._size.tolist(),
            "slab": self.rounded(_SLAB * self._size.max()),
            "heights": self.rounded(heights.ravel() - self._corner[2]),
            "grounds": self.rounded(np.minimum(ground, heights).ravel() - self._corner[2]),
            "kinds": "".join(str(int(kind)) for kind in kinds.ravel()),
            "land": self._land(),
        }

    def _land(self) -> Data | None:
        """Returns the land cover at the centres of the drawn cells, and its names.

        `cells` has a digit for each cell, the number of its colour, or `-` if its land cover is
        unknown. The result is None if all land cover is unknown.
        """
        areas, height_map = self.problem.land_cover, self.problem.height_map
        if not areas:
            return None
        middles = (
            np.minimum(np.arange(0, count, self._block) + self._block // 2, count - 1)
            for count in height_map.shape
        )
        found = in_cells(areas, height_map)[np.ix_(*middles)]
        return {
            "colours": [LAND_COLOURS[land] for land in LANDS],
            "cells": "".join("-" if kind < 0 else str(kind) for kind in found.ravel().tolist()),
            "names": [
                {"name": area.name, "at": self._on_ground(*area.label)}
                for area in areas
                if area.name is not None
            ],
        }

    def _on_ground(self, x: float, y: float) -> list[float]:
        """Returns a point (m) of the map, on the ground there, in the player's coordinates."""
        ground = float(self.problem.height_map.ground[self.problem.height_map.cell_of(x, y)])
        point: list[float] = self.rounded(self.local(np.array([x, y, ground])))
        return point

    @property
    def _ceiling(self) -> float:
        """Altitude up to which columns are drawn, as columns may be extremely high."""
        tops = [self.problem.height_map.altitudes(self.problem.layers).max()]
        tops += [actor.poses[:, 2].max() for actor in self.problem.actors]
        return float(max(tops) + self._size.max())

    @property
    def _kinds(self) -> FloatArray:
        """Kind of every cell [X, Y] of the height map."""
        height_map = self.problem.height_map
        blocked = _blocked_cells(self.problem, Workspace(height_map))  # meshes are drawn themselves
        kinds = np.where(height_map.stands_out, np.where(blocked, _BLOCKS, _LOW), _GROUND)
        return kinds.astype(np.float64)

    def meshes(self) -> Data:
        """Returns meshes as triangles, or as boxes: cells x, y and the altitudes that are solid."""
        return self._solids(self.problem.meshes)

    def airspace(self) -> Data | None:
        """Returns the closed airspace up to the height that is drawn; None if there is none.

        `zones` are like meshes. `lid` has the ceiling's height in each drawn cell, and is empty if
        the ceiling is too high to be drawn. `aside` and `above` are the distances (m) to people,
        None if there is no such rule.
        """
        airspace = self.problem.airspace
        if not str(airspace):
            return None
        zones = [
            zone.replace(vertices=np.clip(zone.vertices, [-np.inf, -np.inf, self._corner[2]],
                                          [np.inf, np.inf, self._sky]))
            for zone in airspace.no_fly
        ]  # fmt: skip
        return {
            "words": str(airspace),
            "zones": self._solids(tuple(zones)),
            "lid": self._lid(airspace.ceiling),
            "aside": airspace.people_aside or None,
            "above": airspace.people_above,
            "sky": self.rounded(self._sky - self._corner[2]),
        }

    def _lid(self, ceiling: float | None) -> list[float]:
        if ceiling is None:
            return []
        tops = self._coarse(self.problem.height_map.ceilings(ceiling), np.minimum)
        shown: list[float] = self.rounded(tops.ravel() - self._corner[2])
        return shown if tops.min() <= self._sky else []

    @property
    def _sky(self) -> float:
        """Altitude up to which closed airspace is drawn, as it may be unlimited."""
        return float(self.problem.height_map.altitudes(self.problem.layers).max()) + _SKY

    def _solids(self, meshes: tuple[Mesh, ...]) -> Data:
        if sum(len(mesh.triangles) for mesh in meshes) > MOST_TRIANGLES:
            return {"meshes": [], "boxes": self._boxes(meshes)}
        shown = [
            {
                "vertices": self.rounded(self.local(mesh.vertices).ravel()),
                "triangles": mesh.triangles.ravel().tolist(),
            }
            for mesh in meshes
        ]
        return {"meshes": shown, "boxes": []}

    def _boxes(self, meshes: tuple[Mesh, ...]) -> list[list[float]]:
        columns = Workspace(self.problem.height_map, meshes).columns
        low = self._coarse(columns.low[1:], np.minimum) - self._corner[2]
        high = self._coarse(columns.high[1:], np.maximum) - self._corner[2]
        filled = np.argwhere(low <= high)
        return [
            [int(x), int(y), self.rounded(low[k, x, y]), self.rounded(high[k, x, y])]
            for k, x, y in filled
        ]

    def starts(self) -> Data:
        """Returns the drawn cells above which drones may choose their start, and words for them.

        `cells` has a digit for each cell, 1 if one of these drones may start there.
        """
        areas, number = StartGround.all_of(self.problem), len(self.problem.open_starts)
        is_open = np.any([area.cells for area in areas], axis=0).astype(np.float64)
        words = "; ".join(area.words for area in areas)
        return {
            "words": words if len(areas) <= _MOST_TOLD else f"{number} drones may start here",
            "colour": STARTABLE,
            "cells": "".join(f"{kind:.0f}" for kind in self._coarse(is_open, np.maximum).ravel()),
        }

    def scope(self, plans: Iterable[Plan], absent: Container[int] = ()) -> Data:
        """Returns corners of a box around flights and walks, and the length (m) of view cones.

        Parameters
        ----------
        absent : numbers of drones that are not shown; the box contains their possible starts
        """
        steps, robots = self.problem.horizon + 1, self.problem.robots
        parts = [self.local(actor.poses[:steps, :3]) for actor in self.problem.actors]
        for plan in plans:
            for i, (robot, path) in enumerate(zip(robots, plan.paths, strict=True)):
                if i in absent:
                    parts.append(
                        self.local(self.problem.above(robot.motion, self.problem.starts[i].cells))
                    )
                else:
                    parts.append(self.path(robot, path)[:, :3])
        points = np.concatenate(parts)
        least, most = points.min(axis=0), points.max(axis=0)
        margin, edge = np.array([_MARGIN, _MARGIN, 0.0]), np.array([*self._size, np.inf])
        # The map's edge ends the picture, except for people beyond it who are not too far away.
        floor = np.where(least < 0, -edge - margin, np.array([0.0, 0.0, -np.inf]))
        edge = np.where(most > edge, 2 * edge + margin, edge)
        low, high = np.clip(least - margin, floor, edge), np.clip(most + margin, floor, edge)
        size = min(float(self._size.min()), float((high - low)[:2].max()))
        return {"scope": [self.rounded(low), self.rounded(high)], "reach": VIEW_LENGTH * size}

    def person(self, j: int) -> Data:
        """Returns faces around the foot point, their names, and poses [T+1, 4], of a person."""
        actor = self.problem.actors[j]
        poses = actor.poses[: self.problem.horizon + 1].copy()
        poses[:, :3] = self.local(poses[:, :3])
        faces = actor.shape.faces()
        return {
            "faces": [self.rounded(face) for face in faces],
            "called": self.problem.person(j),
            "name": actor.name,
            "inTake": None if actor.take is None else told_take(actor.take),
            "take": take_colour(int(self.problem.take_of[j])) if self.problem.takes else None,
            "names": actor.shape.face_names,
            "height": self.rounded(np.array(actor.shape.height)),
            "poses": self.rounded(poses),
            "swerve": self.rounded(np.array(actor.swerve)),
        }

    @cached_property
    def groups(self) -> list[list[int]]:
        """The people in groups, few enough that each group has its own colour."""
        return groups_of_people(self.problem)

    def tasks(self) -> list[Data]:
        """Returns a colour and words for each group of people that drones may film most."""
        return [
            {"people": people, "colour": _colour(k), "words": told_group(self.problem, people)}
            for k, people in enumerate(self.groups)
        ]

    def drone(self, number: int) -> Data:
        """Returns a drone's colour, its camera in words, and half its angles of view (rad).

        `rise`, the vertical angle, is None for a cone, which looks level.
        """
        robot = self.problem.robots[number]
        camera = robot.camera
        rise = math.atan(camera.height / 2 / camera.focal) if isinstance(camera, Camera) else None
        return {
            "colour": _colour(number),
            "camera": _told_camera(camera),
            "half": camera.half_angle,
            "rise": rise,
        }


def _colour(number: int) -> str:
    """Returns the colour of a drone, or of a group of people, as CSS has it."""
    red, green, blue, _ = (round(255 * share) for share in robot_colour(number))
    return f"#{red:02x}{green:02x}{blue:02x}"


def _told_camera(camera: Camera | Cone) -> str:
    """Returns a camera in words, without a comma."""
    name = "cone" if isinstance(camera, Cone) else "camera"
    return f"{name} of {math.degrees(2 * camera.half_angle):.0f}°"


def _short(values: Any) -> Any:
    """Returns nested lists of numbers in which whole numbers are integers."""
    if isinstance(values, list):
        return [_short(value) for value in values]
    return int(values) if values.is_integer() else values


def _blocked_cells(problem: Problem, workspace: Workspace) -> BoolArray:
    """Returns the cells [X, Y] of a workspace in which no robot may be at the lowest layer."""
    lowest = problem.layers[:1]
    low = (robot.motion for robot in problem.robots if robot.motion.layers[:1] == lowest)
    free = [motion.replace(layers=lowest).free_places(workspace)[0] for motion in set(low)]
    blocked: BoolArray = ~np.any(free, axis=0)
    return blocked
