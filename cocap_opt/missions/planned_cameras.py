"""Planned cameras: pinhole cameras and their poses along a flight, in the form that triangulation
needs.

Camera axes are those of OpenCV: x to the right of the image, y down, z forward. A point X of the
world is at R X + t in camera coordinates, and at K (R X + t) in the image, up to scale. The world
has the map's axes x, y and z (m, z up), with x and y relative to the map's corner: other programs
would lose millimetres with coordinates of a reference system, which are millions of metres.

Lenses have no distortion, and images are level: gimbals have no roll.
"""

import json
from collections.abc import Iterator
from typing import NamedTuple, Self

import numpy as np
from scipy.spatial.transform import Rotation

from cocap_opt.data import FieldError, FloatArray
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.notes import Kind, Note
from cocap_opt.flight.trajectory import Samples
from cocap_opt.problem import Camera
from cocap_opt.text import printable
from cocap_opt.vision.projection import Projection

_DOWN = np.array([[1.0], [-1.0], [1.0]])  # converts right, up, forward to right, down, forward
_WHOLE = 1e-9  # share of the flight by which its end may miss the last moment of a grid


class PlannedCamera(NamedTuple):
    """A drone's camera and its poses at n moments.

    Attributes
    ----------
    name : name of the camera, e.g. drone0
    lens : image size and focal length, in px of the video mode for which the scene was planned
    rotations : [n, 3, 3] from the world to the camera
    translations : [n, 3] position of the world's origin in camera coordinates, m
    """

    name: str
    lens: Camera
    rotations: FloatArray
    translations: FloatArray

    @classmethod
    def of(cls, number: int, lens: Camera, samples: Samples, origin: FloatArray) -> Self:
        """Returns the poses of a drone's camera in a world with this origin, given in map
        coordinates (m).
        """
        rows = samples.drone == number
        axes = Projection.axes_towards(samples.yaw[rows], -samples.pitch[rows])
        rotations = axes * _DOWN + 0.0  # turns -0 into 0
        ways = origin - samples.place[rows]
        return cls(
            f"drone{number}", lens, rotations, (rotations * ways[:, None, :]).sum(axis=-1) + 0.0
        )

    @property
    def vectors(self) -> FloatArray:
        """The rotations as Rodrigues vectors [n, 3] (rad), of at most half a turn."""
        return np.asarray(Rotation.from_matrix(self.rotations).as_rotvec()) + 0.0

    @property
    def quaternions(self) -> FloatArray:
        """The rotations as unit quaternions [n, 4] (w, x, y, z), w >= 0."""
        turns = Rotation.from_matrix(self.rotations)
        return np.asarray(turns.as_quat(canonical=True, scalar_first=True)) + 0.0

    @property
    def middle_of_corners(self) -> tuple[float, float]:
        """The principal point (px) if the corner of the first pixel is (0, 0), as in COLMAP."""
        return self.lens.width / 2, self.lens.height / 2

    @property
    def middle_of_centres(self) -> tuple[float, float]:
        """The principal point (px) if the centre of the first pixel is (0, 0), as in OpenCV."""
        return (self.lens.width - 1) / 2, (self.lens.height - 1) / 2

    @property
    def matrix(self) -> FloatArray:
        """K [3, 3] in px, if the centre of the first pixel is (0, 0), as in OpenCV."""
        (u, v), focal = self.middle_of_centres, self.lens.focal
        return np.array([[focal, 0.0, u], [0.0, focal, v], [0.0, 0.0, 1.0]])


class World(NamedTuple):
    """The coordinates of the cameras' world.

    Attributes
    ----------
    origin : [3] m, in coordinates of the map
    crs : name of the reference system, None if the scene's position on the Earth is unknown
    place : latitude and longitude of the origin (degrees, WGS 84), and the direction of its x
        (degrees clockwise from true north)
    base : name of the vertical datum, and the height of z = 0 above it (m); None if unspecified
    """

    origin: FloatArray
    crs: str | None
    place: tuple[float, float, float] | None
    base: tuple[str, float] | None

    @classmethod
    def of(cls, flight: Flight) -> Self:
        """Returns the world of a flight, whose origin is the map's corner."""
        problem, geodesy = flight.flown.problem, flight.geodesy
        x, y = problem.height_map.origin
        crs, place, earth = None, None, problem.earth
        if geodesy is not None:
            at = np.array([x]), np.array([y])
            latitude, longitude = geodesy.degrees(*at)
            direction = geodesy.compass(*at, np.zeros(1))
            crs = printable(geodesy.name)
            place = float(latitude[0]), float(longitude[0]), float(direction[0])
        base = None
        if earth is not None and earth.heights is not None:
            base = f"above_{earth.heights}", earth.base
        return cls(np.array([x, y, 0.0]), crs, place, base)

    @property
    def facts(self) -> dict[str, str | float | list[float]]:
        """Numbers and names, by their keys in files."""
        found: dict[str, str | float | list[float]] = {"origin": self.origin.tolist()}
        if self.crs is not None:
            found["crs"] = self.crs
        if self.place is not None:
            found |= dict(zip(("latitude", "longitude", "x_axis"), self.place, strict=True))
        if self.base is not None:
            found |= dict([self.base])
        return found

    @property
    def lines(self) -> list[str]:
        """The facts as lines of TOML, for files and for comments."""
        return [f"{k} = {json.dumps(v, ensure_ascii=False)}" for k, v in self.facts.items()]

    def notes(self) -> Iterator[Note]:
        """Yields sentences on the world."""
        x, y, _ = self.origin.tolist()
        yield Note(
            "a point X of the world is at R X + t in the camera, whose x is to the right, y down "
            f"and z forward; the world is x, y and z of the map (m, z up), from x = {x:.12g}, "
            f"y = {y:.12g} on",
            Kind.READING,
        )
        if self.place is not None:
            latitude, longitude, direction = self.place
            yield Note(
                f"the world's origin is at latitude {latitude:.7f}, longitude {longitude:.7f}; "
                f"its x goes to {direction:.2f} degrees",
                Kind.READING,
            )


class PlannedCameras(NamedTuple):
    """The cameras of a team along a flight.

    Attributes
    ----------
    times : [n] moments of the poses of all cameras, s since step 0
    cameras : of all drones, in their order
    world : the coordinate system of their poses
    notes : sentences for the user
    """

    times: FloatArray
    cameras: tuple[PlannedCamera, ...]
    world: World
    notes: tuple[Note, ...]

    @classmethod
    def of(cls, flight: Flight, every: float | None) -> Self:
        """Returns the cameras of a flight.

        Parameters
        ----------
        every : time between moments, s; None: one per step, or ten per step for smooth flights

        Raises
        ------
        FieldError
            If a drone's sensor makes no images.
        """
        lenses = [_lens(i, r.camera) for i, r in enumerate(flight.flown.problem.robots)]
        world, samples = World.of(flight), flight.samples(every)
        cameras = [
            PlannedCamera.of(i, lens, samples, world.origin) for i, lens in enumerate(lenses)
        ]
        times = samples.t[samples.drone == 0]
        moments = _moments(times, flight.is_smooth)
        notes = *world.notes(), moments, *flight.between_rows(every), _PLANNED
        return cls(times, tuple(cameras), world, notes)


_PLANNED = Note(
    "lenses have no distortion and poses are as planned: undistort the footage, and if a "
    "drone's log has another pose, use that of the log"
)


def _lens(number: int, camera: object) -> Camera:
    """Returns a drone's camera, if it makes images."""
    if not isinstance(camera, Camera):
        words = "must be a pinhole camera, as a cone has no intrinsics"
        raise FieldError(f"robots[{number}].camera", words)
    return camera


def _moments(times: FloatArray, is_smooth: bool) -> Note:
    """Returns a note on the moments of the poses."""
    apart, end, most = float(times[1] - times[0]), float(times[-1]), len(times) - 1
    last = ""
    if abs(end - apart * most) > _WHOLE * end:
        last = f", and the last, frame {most}, at the flight's end, {end:.9g} s"
    way = "smoothly along the flight's polynomials" if is_smooth else "evenly"
    return Note(
        f"frame k is at k times {apart:.9g} s after step 0{last}; there are {most + 1}; between "
        f"steps x, y, z, yaw and pitch change {way}",
        Kind.READING,
    )
