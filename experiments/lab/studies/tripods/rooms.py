"""Laboratory rooms with cameras on their walls, as problems in which a camera is a hovering drone.

The rooms' sizes, lenses, heights and zones are those of the example configurations of
lab-camera-optimizer 1.2.1 (F. Delaplace, MIT licence). One person stands at the points of a zone,
one point per step, so that people do not hide each other.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.problem import (
    Actor,
    Camera,
    CollisionRules,
    Motion,
    Objective,
    Prism,
    Problem,
    Robot,
    StartStates,
    State,
    Views,
)
from cocap_opt.world.workspace import HeightMap, Mesh

Box = tuple[float, float, float, float]  # m, x and y of the low corner, then of the high one
LANDSCAPE, PORTRAIT = "L", "P"
_CELL = 0.5  # m between mounting places along walls, and between points of zones
_HEADINGS = 72
_TILTS = tuple(math.radians(5.0 * k) for k in range(1, 18))
_FOCAL = 1000.0  # px
_BODY = 0.2  # m, half the width of a person; the default body radius of lab-camera-optimizer
_LEAST_SINE, _LEAST_WAY = 0.01, 0.1  # m; of its rule for tilts


class Mounted(NamedTuple):
    """A mounted camera.

    Attributes
    ----------
    x, y, height : m
    heading : degrees from +x, counter-clockwise
    orientation : "L", landscape, or "P", portrait
    """

    x: float
    y: float
    heading: float
    orientation: str
    height: float


class Zone(NamedTuple):
    """A rectangle in which people must be seen."""

    box: Box
    weight: float


class Room(NamedTuple):
    """A rectangular room with the floor at height 0, and the zones that cameras must see.

    Attributes
    ----------
    source : the configuration file from which its numbers come
    size : m along x and y
    ceiling : m
    lens : horizontal and vertical angle of view in degrees, of a camera in landscape
    heights : m at which cameras are mounted
    spacing : m, smallest distance between cameras, seen from above
    walk : m, y of the line at which cameras are tilted
    analysis : m, x of both ends of the part of the walk that is analysed
    zones : where people must be seen; a point in several zones has the largest weight
    target : number of cameras that should see a point, by the configuration
    bilateral, decay : weights in the score of lab-camera-optimizer, of views from both sides and of
        distance
    restarts : number of restarts of its search
    pillars : solid from floor to ceiling
    person : m, height
    whole : share of a person that a camera must see
    """

    name: str
    source: str
    size: tuple[float, float]
    ceiling: float
    lens: tuple[float, float]
    heights: tuple[float, ...]
    spacing: float
    walk: float
    analysis: tuple[float, float]
    zones: tuple[Zone, ...]
    target: int
    bilateral: float
    decay: float
    restarts: int
    pillars: tuple[Box, ...] = ()
    person: float = 1.9
    whole: float = 0.9

    @property
    def points(self) -> list[tuple[float, float, float]]:
        """The points of the zones, x, y (m) and weight, on a grid from each zone's corner."""
        found: dict[tuple[float, float], float] = {}
        for (x0, y0, x1, y1), weight in self.zones:
            for x in np.arange(x0, x1 + _CELL / 2, _CELL).tolist():
                for y in np.arange(y0, y1 + _CELL / 2, _CELL).tolist():
                    found[x, y] = max(weight, found.get((x, y), 0.0))
        return [(x, y, weight) for (x, y), weight in sorted(found.items())]

    def half_view(self, orientation: str) -> float:
        """Returns half of the horizontal angle of view (degrees)."""
        return self.lens[orientation == PORTRAIT] / 2

    def tilt(self, y: float, heading: float, height: float) -> float:
        """Returns the tilt (rad below the horizon) of a camera on a wall.

        By the rule of lab-camera-optimizer: it looks at the middle of a person who stands where its
        heading meets the line of the walk, or at the line's distance if it does not.
        """
        sine, aside = math.sin(math.radians(heading)), abs(y - self.walk)
        way = (self.walk - y) / sine if abs(sine) > _LEAST_SINE else 0.0
        return math.atan2(height - self.person / 2, max(way if way > 0 else aside, _LEAST_WAY))


class Cells(NamedTuple):
    """The places, headings and tilts of a room's cameras as states of drones.

    Attributes
    ----------
    headings : in a full turn
    tilts : rad
    """

    room: Room
    headings: int = _HEADINGS
    tilts: tuple[float, ...] = _TILTS

    def problem(self, seen_by: int, starts: Mapping[str, Sequence[tuple[State, ...]]]) -> Problem:
        """Returns the problem of so many cameras, whose J counts views of the zones' points.

        Parameters
        ----------
        seen_by : largest number of cameras that count for a point
        starts : by orientation, the states in which each of its cameras may be
        """
        room, points = self.room, self.room.points
        return Problem(
            name=room.name,
            height_map=self._map,
            robots=tuple(
                self._robot(orientation, states)
                for orientation, several in starts.items()
                for states in several
            ),
            actors=(
                Actor(
                    poses=np.array([[x, y, 0.0, 0.0] for x, y, _ in points]),
                    shape=Prism(sides=8, apothem=_BODY, height=room.person),
                    importance=tuple(weight for *_, weight in points),
                ),
            ),
            horizon=len(points) - 1,
            rules=CollisionRules(separation=room.spacing, vertical=2 * room.ceiling),
            objective=Objective(
                pixels=0.0, count_start=True, views=Views(cameras=seen_by, at_least=room.whole)
            ),
            meshes=tuple(
                Mesh.box((x0, y0, 0.0), (x1, y1, room.ceiling)) for x0, y0, x1, y1 in room.pillars
            ),
        )

    @property
    def _map(self) -> HeightMap:
        """A level map whose outermost cells have their middles on the walls."""
        x, y = (round(size / _CELL) + 1 for size in self.room.size)
        # Walls are not solid, as they hide nobody in a room without corners that stick out.
        return HeightMap(
            heights=np.zeros((x, y)), resolution=_CELL, origin=(-_CELL / 2, -_CELL / 2)
        )

    def _robot(self, orientation: str, states: tuple[State, ...]) -> Robot:
        sides = [round(2 * _FOCAL * math.tan(math.radians(angle / 2))) for angle in self.room.lens]
        width, height = sides if orientation == LANDSCAPE else reversed(sides)
        motion = Motion(
            radius=0, turn=0, climb=0, pitch_turn=0,
            headings=self.headings, layers=self.room.heights,
        )  # fmt: skip
        camera = Camera(width=width, height=height, focal=_FOCAL, tilts=self.tilts)
        start = states[0] if len(states) == 1 else StartStates(states=states)
        return Robot(start=start, motion=motion, camera=camera)

    def candidates(self, orientation: str) -> tuple[State, ...]:
        """Returns all states in which a camera may be mounted without looking past its walls."""
        half, turn, found = self.room.half_view(orientation), 360 / self.headings, set[State]()
        for x, y, normal, open_to in self._places():
            most = abs(open_to - half)  # in a corner wide views look past one wall
            for heading in range(self.headings):
                if abs((heading * turn - normal + 180) % 360 - 180) <= most + 1e-9:
                    found.update(
                        self.state(Mounted(x * _CELL, y * _CELL, heading * turn, "", height))
                        for height in self.room.heights
                    )
        return tuple(sorted(found))

    def _places(self) -> Iterator[tuple[int, int, float, float]]:
        """Yields the free cells along the walls, with the inward direction and half of the opening.

        Both angles are in degrees.
        """
        last_x, last_y = (round(size / _CELL) for size in self.room.size)
        for x in range(last_x + 1):
            for y in range(last_y + 1):
                inwards = ((x == 0) - (x == last_x), (y == 0) - (y == last_y))
                if inwards != (0, 0) and not self._in_pillar(x * _CELL, y * _CELL):
                    corner = all(inwards)
                    normal = math.degrees(math.atan2(inwards[1], inwards[0]))
                    yield x, y, normal, 45.0 if corner else 90.0

    def _in_pillar(self, x: float, y: float) -> bool:
        """Returns True if the cell around a place contains a pillar."""
        half = _CELL / 2
        return any(
            x0 <= x + half and x - half <= x1 and y0 <= y + half and y - half <= y1
            for x0, y0, x1, y1 in self.room.pillars
        )

    def state(self, camera: Mounted) -> State:
        """Returns the nearest state to a camera that is tilted by the rule."""
        turn, heights = 360 / self.headings, np.array(self.room.heights)
        heading = round(camera.heading / turn) % self.headings
        tilt = self.room.tilt(camera.y, camera.heading, camera.height)
        return State(
            round(camera.x / _CELL),
            round(camera.y / _CELL),
            int(np.abs(heights - camera.height).argmin()),
            heading,
            int(np.abs(np.array(self.tilts) - tilt).argmin()),
        )

    def camera(self, orientation: str, state: State) -> Mounted:
        """Returns the camera of a state, tilted by the rule."""
        return Mounted(
            state.x * _CELL, state.y * _CELL, state.heading * 360 / self.headings, orientation,
            self.room.heights[state.layer],
        )  # fmt: skip


def exactly(room: Room, cameras: Sequence[Mounted]) -> tuple[Cells, dict[str, list[State]]]:
    """Returns cells with headings in steps of a degree and the exact tilts of some cameras, and the
    cameras' states.

    Places are rounded to the room's mounting places, as in all cells.
    """
    tilts = sorted({room.tilt(c.y, c.heading, c.height) for c in cameras})
    cells = Cells(room, 360, tuple(tilts))
    return cells, {
        side: [cells.state(camera) for camera in cameras if camera.orientation == side]
        for side in (LANDSCAPE, PORTRAIT)
    }


_WIDE, _NARROW, _LONG = (110.0, 70.0), (80.0, 58.0), (54.4, 37.8)

ROOMS = {
    room.name: room
    for room in (
        Room(
            "demo", "demo.yaml", (8.0, 5.0), 3.0, _WIDE, (2.0, 2.2), 1.2, 2.5, (2.0, 6.0),
            (Zone((1.0, 2.0, 7.0, 3.0), 0.5), Zone((2.0, 2.0, 6.0, 3.0), 1.0)),
            3, 0.8, 0.03, 8,
        ),
        Room(
            "simple", "example_simple.yaml", (10.0, 6.0), 3.0, _WIDE, (2.0,), 1.5, 3.0, (3.0, 7.0),
            (Zone((1.0, 2.5, 9.0, 3.5), 0.5), Zone((3.0, 2.5, 7.0, 3.5), 1.0)),
            3, 0.9, 0.01, 10,
        ),
        Room(
            "narrow", "example_simple.yaml, with the lens and the height of its tripods",
            (10.0, 6.0), 3.0, _NARROW, (1.5,), 1.5, 3.0, (3.0, 7.0),
            (Zone((1.0, 2.5, 9.0, 3.5), 0.5), Zone((3.0, 2.5, 7.0, 3.5), 1.0)),
            3, 0.9, 0.01, 10,
        ),
        Room(
            "long", "example_simple.yaml, with a lens of 35 mm on a full frame at 1.5 m",
            (10.0, 6.0), 3.0, _LONG, (1.5,), 1.5, 3.0, (3.0, 7.0),
            (Zone((1.0, 2.5, 9.0, 3.5), 0.5), Zone((3.0, 2.5, 7.0, 3.5), 1.0)),
            3, 0.9, 0.01, 10,
        ),
        Room(
            "turns", "T_zone_direction_change.yaml, its first placement", (12.0, 7.0), 3.0, _WIDE,
            (2.0, 2.2), 1.2, 3.5, (6.0, 6.0),
            (
                Zone((1.0, 2.5, 7.0, 3.5), 1.0), Zone((8.0, 1.0, 10.0, 2.5), 1.8),
                Zone((8.0, 3.5, 10.0, 5.0), 1.8), Zone((7.0, 2.5, 10.0, 3.5), 2.5),
            ),
            5, 0.9, 0.005, 15, ((5.8, 0.0, 6.1, 0.3),),
        ),
    )
}  # fmt: skip
