"""Flights in RotorPy, a third-party simulator of multirotors, imported only here.

The vehicle is RotorPy's AscTec Hummingbird, a research quadrotor of half a kilogram, with drag of
frame and rotors. Its controller is RotorPy's geometric one (Lee, Leok, McClamroch 2010), which
knows its state exactly, but neither the wind nor the drag. Its input is the position, velocity,
acceleration, yaw and yaw rate of the flight. The gimbal holds the camera's pitch.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.experiments.lab.studies.flight.wind import Wind
from cocap_opt.files.documents import FileError
from cocap_opt.flight.bernstein import values
from cocap_opt.flight.trajectory import YAW, Samples, Trajectory

TICK = 0.01  # s, longest time between outputs of the controller, as in RotorPy's environments


class Reference(NamedTuple):
    """The flights as input of a controller, at times [n].

    Attributes
    ----------
    times : s
    states, rates, bends : [R, n, 5] x, y, z (m), yaw and pitch (rad); their first and second
        derivatives with respect to time (s)
    """

    times: FloatArray
    states: FloatArray
    rates: FloatArray
    bends: FloatArray

    @classmethod
    def of(cls, flown: Trajectory, parts: int) -> "Reference":
        """Returns the flights at each tick; a step has a multiple of `parts` ticks."""
        robots, pieces = flown.pieces.shape[:2]
        count = parts * math.ceil(flown.step / parts / TICK - 1e-9)
        ticks = np.arange(flown.problem.horizon * count + 1)
        which = np.minimum(ticks * flown.parts // count, pieces - 1)
        shares: FloatArray = ticks * flown.parts / count - which
        found = [
            np.stack([values(part[i, which], shares) for i in range(robots)])
            for part in (flown.pieces, flown.velocities, flown.accelerations)
        ]
        found[0][..., :3] += [*flown.problem.height_map.origin, 0.0]
        times = np.asarray(ticks * (flown.step / count), dtype=np.float64)
        return cls(times, *found)


class Simulated(NamedTuple):
    """Simulated flights.

    Attributes
    ----------
    places : [R, n, 3] m
    yaws : [R, n] rad, without jumps
    """

    reference: Reference
    places: FloatArray
    yaws: FloatArray

    def views(self, moments: FloatArray) -> Samples:
        """Returns the cameras' places and directions at moments [m] (s), which must be ticks."""
        at = np.rint(moments / self.reference.times[1]).astype(np.int64)
        robots = len(self.places)
        return Samples(
            np.repeat(np.arange(robots), len(at)),
            np.tile(moments, robots),
            self.places[:, at].reshape(-1, 3),
            self.yaws[:, at].ravel(),
            self.reference.states[:, at, 4].ravel(),
        )


def simulate(flown: Trajectory, parts: int, wind: Wind) -> Simulated:
    """Flies flights in RotorPy; drones do not see each other.

    Parameters
    ----------
    parts : number of moments of a step that must be ticks

    Raises
    ------
    FileError
        If RotorPy is not installed.
    ProblemError
        If a drone gets out of control.
    """
    reference = Reference.of(flown, parts)
    height_map = flown.problem.height_map
    places, yaws = [], []
    for i, states in enumerate(reference.states):
        x, y, z = states[0, :3]
        height = z - height_map.ground[height_map.cell_of(x, y)]
        air = wind.on(i, height, reference.times)
        track = _fly(states, reference.rates[i], reference.bends[i], reference.times, air)
        if not np.isfinite(track).all():
            raise ProblemError(f"drone {i} loses control in {wind.speed:g} m/s of wind")
        places.append(track[:, :3])
        yaws.append(np.unwrap(track[:, 3]))
    return Simulated(reference, np.array(places), np.array(yaws))


def span() -> float:
    """Returns the largest width (m) of the vehicle, between the tips of two rotors."""
    parameters = _rotorpy()[0]
    arms = [float(np.hypot(*place[:2])) for place in parameters["rotor_pos"].values()]
    return 2 * (max(arms) + float(parameters["rotor_radius"]))


def _fly(
    states: FloatArray, rates: FloatArray, bends: FloatArray, times: FloatArray, air: FloatArray
) -> FloatArray:
    """Returns x, y, z (m) and yaw (rad) [n, 4] of a drone that starts at rest, as planned."""
    parameters, multirotor, controller = _rotorpy()
    vehicle, pilot = multirotor(parameters), controller(parameters)
    yaw, tick = states[0, YAW], times[1]
    hover = math.sqrt(vehicle.mass * vehicle.g / vehicle.num_rotors / vehicle.k_eta)
    state: dict[str, Any] = {
        "x": states[0, :3].copy(), "v": np.zeros(3), "w": np.zeros(3), "wind": air[0],
        "q": np.array([0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)]),
        "rotor_speeds": np.full(vehicle.num_rotors, hover),
    }  # fmt: skip
    track = np.empty((len(times), 4))
    for k, time in enumerate(times.tolist()):
        x, y, z, w = state["q"]
        track[k] = *state["x"], math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        wanted = {
            "x": states[k, :3], "x_dot": rates[k, :3], "x_ddot": bends[k, :3],
            "yaw": states[k, YAW], "yaw_dot": rates[k, YAW],
        }  # fmt: skip
        state["wind"] = air[k]
        state = vehicle.step(state, pilot.update(time, state, wanted), tick)
    return track


def _rotorpy() -> tuple[dict[str, Any], Any, Any]:
    """Returns RotorPy's parameters of the vehicle, its vehicle class and its controller class."""
    try:
        from rotorpy.controllers.quadrotor_control import SE3Control
        from rotorpy.vehicles.hummingbird_params import quad_params
        from rotorpy.vehicles.multirotor import Multirotor
    except ModuleNotFoundError as error:
        raise FileError(
            f"{str(error.name).split('.')[0]} is not installed: pip install 'cocap-opt[flight]'"
        ) from error
    return quad_params, Multirotor, SE3Control
