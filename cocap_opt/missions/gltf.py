"""Flights as an animated scene, glTF 2.0 (.glb), for Blender, viewers in browsers and others.

Everything moves linearly between moments that all drones have in common, spaced so closely that the
error is at most a millimetre. (glTF also supports cubic splines, which would need fewer moments,
but Blender's importer does not read their tangents: KhronosGroup/glTF-Blender-IO issue 419.) x is
the map's x, y is up, and z is the map's -y.
"""

import math
from collections.abc import Iterator

import numpy as np

from cocap_opt.data import FieldError, FloatArray, IntArray, ProblemError
from cocap_opt.flight.flights import MOST_ROWS, Flight
from cocap_opt.flight.notes import Kind, Note
from cocap_opt.flight.trajectory import Trajectory
from cocap_opt.missions.export import Export
from cocap_opt.missions.glb import LINE_STRIP, LINES, Glb
from cocap_opt.missions.relief import Relief
from cocap_opt.problem import Actor, Camera, pictures
from cocap_opt.world import HeightMap, Mesh

ERROR = 0.001  # m, error of linear motion between moments
ERROR_OF_ANGLES = math.radians(0.1)
_MOST_TURN = math.pi / 2  # rad between moments; the direction of half a turn would be ambiguous
_SKY = 4.0  # m above the highest flight, up to which zones are drawn
_MARGIN = 20.0  # m around flights and walks within which the map is drawn in the finest detail
_NEAR = 0.5  # m, beyond the drone itself
_FRUSTUM = 0.15  # length of a camera's frustum relative to the map, from 1 to 20 m
_DARK = "#222222"
_ZONE = "#8a4fbf"


def write(flight: Flight, every: float | None) -> Export:
    """Returns the terrain, drones with cameras, and people, moving on a common clock.

    Raises
    ------
    ProblemError
        If the time between moments is given, although it follows from the error, or if there are
        too many moments.
    """
    if every is not None:
        raise FieldError("every", "must be left out for .glb, whose moments follow from its error")
    scene = _Animation(flight.flown)
    scene.add_ground()
    scene.add_solids()
    scene.add_drones()
    scene.add_people()
    return Export({"": scene.content()}, tuple(scene.notes()))


class _Animation:
    """A glTF document of flights."""

    def __init__(self, flown: Trajectory) -> None:
        self._flown, self._problem = flown, flown.problem
        self._glb = Glb()
        self._channels: list[tuple[int, str, int, int]] = []
        moments = _moments(flown)
        self._samples = flown.at(moments)
        self._times = self._clock(moments)
        self.origin = _origin(self._problem.height_map)
        self._size = min(self._problem.height_map.shape) * self._problem.height_map.resolution
        self._relief = Relief.of(self._problem.height_map, self._heights(), self._part())

    def content(self) -> bytes:
        self._glb.animation("flight", self._channels)
        words = "metres; x and -z are the map's x and y from the origin, y is up"
        return self._glb.content(
            self._problem.name, {"origin": self.origin.tolist(), "axes": words}
        )

    def notes(self) -> Iterator[Note]:
        """Yields the accuracy of the motion, and how the map is simplified, if it is."""
        rounding = float(np.abs(self._samples.place - self.origin).max()) * 2.0**-24
        x, y, z = self.origin.tolist()
        yield Note(
            f"motion is linear between moments, and off by {1000 * (ERROR + rounding):.2g} mm and "
            f"{math.degrees(ERROR_OF_ANGLES):g} degrees at most; y is up, z is -y of the map, and "
            f"the origin is at x = {x:.12g}, y = {y:.12g}, z = {z:.12g}",
            Kind.READING,
        )
        fine, coarse = self._relief.fine, self._relief.coarse
        if coarse > 1:
            yield Note(
                f"the map is drawn with {coarse} x {coarse} cells as one, and where drones fly "
                f"and people walk with {fine} x {fine}, as high as the highest of them, to "
                "keep the file small",
                Kind.READING,
            )

    def _clock(self, moments: FloatArray) -> int:
        """Adds the times of an animation."""
        if not (np.diff(moments.astype(np.float32)) > 0).all():
            raise ProblemError(
                f"steps of {self._flown.step:g} s are too short for the clock of a .glb file, "
                f"which has 32 bits, in a flight of {self._flown.seconds:g} s"
            )
        return self._glb.accessor(moments)

    def _local(self, points: FloatArray) -> FloatArray:
        """Returns points [.., 3] of the map in glTF coordinates."""
        return _upright(points - self.origin)

    def add_ground(self) -> None:
        """Adds the map: its ground, and the cells above it."""
        height_map = self._problem.height_map
        corner = np.array([*height_map.origin, 0.0])
        parts = (("terrain", self._relief.ground, pictures.COVERED),
                 ("buildings", self._relief.obstacles, pictures.WALL))  # fmt: skip
        for name, quads, colour in parts:
            if len(quads):
                corners = 4 * np.arange(len(quads), dtype=np.int64)[:, None]
                indices = np.add(corners, [0, 1, 2, 0, 2, 3]).reshape(-1, 3)
                self._add_still(name, quads.reshape(-1, 3) + corner, indices, colour)

    def _part(self) -> tuple[IntArray, IntArray]:
        """Returns the first cells of the part of the map that flights and walks cover, and its
        end.
        """
        steps = self._problem.horizon + 1
        walks = [actor.poses[:steps, :2] for actor in self._problem.actors]
        points = np.concatenate([self._samples.place[:, :2], *walks])
        ends = np.array([points.min(axis=0) - _MARGIN, points.max(axis=0) + _MARGIN])
        first, last = np.column_stack(self._problem.height_map.cells_below(ends))
        return first, last + 1

    def _heights(self) -> tuple[float, float]:
        """Returns the altitudes (m) between which solids are drawn; their own may be arbitrary."""
        z = [self._samples.place[:, 2], *(actor.poses[:, 2] for actor in self._problem.actors)]
        every = np.concatenate(z)
        return float(every.min()) - self._size, float(every.max()) + self._size

    def add_solids(self) -> None:
        """Adds meshes, and transparent no-fly zones."""
        low, high = self._heights()
        sky = float(self._samples.place[:, 2].max()) + _SKY
        for k, mesh in enumerate(self._problem.meshes):
            self._add_mesh(f"mesh {k}", mesh, (low, high), pictures.WALL, 1.0)
        for k, zone in enumerate(self._problem.airspace.no_fly):
            self._add_mesh(f"no-fly zone {k}", zone, (low, sky), _ZONE, 0.25)

    def _add_mesh(
        self, name: str, mesh: Mesh, heights: tuple[float, float], colour: str, opacity: float
    ) -> None:
        points = mesh.vertices.copy()
        points[:, 2] = points[:, 2].clip(*heights)
        self._add_still(name, points, mesh.triangles, colour, opacity)

    def _add_still(
        self, name: str, points: FloatArray, triangles: IntArray, colour: str, opacity: float = 1.0
    ) -> None:
        material = self._glb.material(name, colour, opacity)
        primitive = self._glb.primitive(self._local(points), material, triangles)
        self._glb.node(name, mesh=self._glb.mesh(name, primitive))

    def add_drones(self) -> None:
        """Adds drones with their cameras, and the lines of their flights."""
        dark = self._glb.material("camera", _DARK)
        for i, robot in enumerate(self._problem.robots):
            name, rows = f"drone {i}", self._samples.drone == i
            colour = pictures.DRONE_COLOURS[i % len(pictures.DRONE_COLOURS)]
            paint = self._glb.material(name, colour)
            track = self._local(self._samples.place[rows])
            line = self._glb.primitive(track, paint, mode=LINE_STRIP)
            self._glb.node(f"track {i}", mesh=self._glb.mesh(f"track {i}", line))
            body = self._glb.mesh(name, self._solid(_BODY, paint), self._solid(_NOSE, dark))
            node = self._glb.node(name, mesh=body)
            self._move(node, self._times, track, _about_up(self._samples.yaw[rows]))
            if isinstance(robot.camera, Camera):
                self._add_camera(i, node, robot.camera, self._samples.pitch[rows], paint)

    def _solid(self, boxes: Mesh, material: int) -> dict[str, object]:
        points = boxes.vertices[boxes.triangles].reshape(-1, 3)  # each face has its own corners
        return self._glb.primitive(_upright(points), material)

    def _add_camera(
        self, number: int, drone: int, camera: Camera, pitch: FloatArray, paint: int
    ) -> None:
        """Adds a camera, which looks along -z of its node, and the outline of its frustum."""
        name = f"camera {number}"
        rise = 2 * math.atan(camera.height / 2 / camera.focal)
        lens = self._glb.camera(name, rise, camera.width / camera.height, _NEAR)
        node = self._glb.node(name, drone, camera=lens)
        self._move(node, self._times, None, _gimbal(pitch))
        far = min(max(_FRUSTUM * self._size, 1.0), 20.0)
        x, y = (far * size / 2 / camera.focal for size in (camera.width, camera.height))
        points = np.array([[0, 0, 0], [-x, -y, -far], [x, -y, -far], [x, y, -far], [-x, y, -far]])
        edges = np.array([[0, 1], [0, 2], [0, 3], [0, 4], [1, 2], [2, 3], [3, 4], [4, 1]])
        outline = self._glb.primitive(points, paint, edges, LINES)
        name = f"frustum {number}"
        self._glb.node(name, node, mesh=self._glb.mesh(name, outline))

    def add_people(self) -> None:
        """Adds people, who walk and turn straight from step to step."""
        steps = self._problem.horizon + 1
        if not self._problem.actors:
            return
        material = self._glb.material("person", pictures.PERSON)
        walks = [actor.poses[:steps].copy() for actor in self._problem.actors]
        for walk in walks:
            walk[:, 3] = np.unwrap(walk[:, 3])  # yaw changes by at most half a turn between steps
        turns = np.abs([np.diff(walk[:, 3]) for walk in walks])
        parts = np.maximum(np.ceil(turns.max(axis=0) / _MOST_TURN), 1).astype(np.int64)
        numbers = _subdivided(parts)
        clock = self._clock(numbers * self._flown.step)
        for j, (actor, walk) in enumerate(zip(self._problem.actors, walks, strict=True)):
            name = self._problem.person(j)
            body = self._glb.primitive(_upright(_triangles(actor)), material)
            node = self._glb.node(name, mesh=self._glb.mesh(name, body))
            at = [np.interp(numbers, np.arange(steps), column) for column in walk.T]
            self._move(node, clock, self._local(np.column_stack(at[:3])), _about_up(at[3]))

    def _move(self, node: int, clock: int, places: FloatArray | None, turns: FloatArray) -> None:
        """Animates a node; before the animation it is at its first position."""
        rows = {"rotation": turns} if places is None else {"translation": places, "rotation": turns}
        for path, values in rows.items():
            self._glb.place(node, path, values[0])
            self._channels.append((node, path, clock, self._glb.accessor(values)))


def _origin(height_map: HeightMap) -> FloatArray:
    """Returns the middle of the map [3] at its lowest ground, in whole metres.

    It is the same for all flights of a scene, so their files can be overlaid.
    """
    middle = height_map.origin + height_map.resolution / 2 * np.array(height_map.shape)
    return np.floor([*middle, height_map.ground.min()])


def _moments(flown: Trajectory) -> FloatArray:
    """Returns times [n] (s) between which the error of linear motion is within the limit.

    A polynomial deviates from its chord by at most an eighth of its largest second derivative times
    the squared duration, and no derivative is larger than its coefficients.
    """
    span = flown.piece_seconds
    curves, rates = flown.accelerations * span**2, flown.velocities * span
    place = np.sqrt((curves[:, :, :3] ** 2).sum(axis=2)).max(axis=(0, 2)) / (8 * ERROR)
    angle = np.abs(curves[:, :, 3:]).max(axis=(0, 2, 3)) / (8 * ERROR_OF_ANGLES)
    turn = np.abs(rates[:, :, 3:]).max(axis=(0, 2, 3)) / _MOST_TURN
    counts = np.ceil(np.maximum.reduce([np.sqrt(place), np.sqrt(angle), turn]) - 1e-9)
    rows = np.maximum(counts, 1).sum() * len(flown.pieces)
    if rows > MOST_ROWS:
        raise ProblemError(f"the flights must have at most {MOST_ROWS} moments, not {rows:.3g}")
    return _subdivided(np.maximum(counts, 1).astype(np.int64)) * span


def _subdivided(parts: IntArray) -> FloatArray:
    """Returns the numbers 0..N [n], with the interval n divided into parts[n] equal parts."""
    step = np.repeat(np.arange(len(parts)), parts)
    first = np.repeat(np.cumsum(parts) - parts, parts)
    inner = step + (np.arange(len(step)) - first) / parts[step]
    return np.append(inner, len(parts))


def _upright(points: FloatArray) -> FloatArray:
    """Returns points [.., 3] with z up as points with y up."""
    result: FloatArray = points[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    return result


def _about_up(angle: FloatArray) -> FloatArray:
    """Returns quaternions [n, 4] (x, y, z, w) of turns [n] (rad) about the vertical axis."""
    zero = np.zeros(len(angle))
    return np.column_stack([zero, np.sin(angle / 2), zero, np.cos(angle / 2)])


def _gimbal(pitch: FloatArray) -> FloatArray:
    """Returns quaternions [n, 4] that turn -z, where cameras look, to a pitch [n] (rad) along x."""
    half, c, s = math.sqrt(0.5), np.cos(pitch / 2), np.sin(pitch / 2)
    return half * np.column_stack([s, -c, s, c])


def _triangles(actor: Actor) -> FloatArray:
    """Returns the corners [3 n, 3] of the triangles of a person's faces."""
    fans = [face[[0, k, k + 1]] for face in actor.shape.faces() for k in range(1, len(face) - 1)]
    return np.concatenate(fans)


# A drone, 0.6 m wide, that faces along x.
_BODY = Mesh.joined([
    Mesh.box((-0.18, -0.12, -0.05), (0.18, 0.12, 0.05)),
    *(Mesh.box((x - 0.11, y - 0.11, 0.05), (x + 0.11, y + 0.11, 0.07))
      for x in (-0.2, 0.2) for y in (-0.2, 0.2)),
])  # fmt: skip
_NOSE = Mesh.box((0.18, -0.05, -0.08), (0.28, 0.05, 0.02))
