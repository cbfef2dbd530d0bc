"""Real cameras by name, as pinhole cameras, and limits of real airframes by name.

The cameras' numbers come from their manufacturers, or from third parties' calibrations. Lens
distortion is ignored, and the principal point is at the centre of the image. A name that ends with
-4k is the camera in its film mode; the name without it is the camera in its photo mode, whose
images are higher.
"""

import math
from collections.abc import Sequence

from cocap_opt.data import ProblemError
from cocap_opt.problem import (
    AnyCamera,
    AnyStart,
    Camera,
    Limits,
    Problem,
    Robot,
    StartArea,
    StartStates,
    State,
)
from cocap_opt.text import meant

# Drones' cameras in their photo mode; their film modes are below.
_PHOTOS: dict[str, Camera] = {
    # Theta DroneModels (Apache-2.0): pixel pitch, with f = 8.8 mm, 4.7 mm, and 12.29 mm, 24 mm on
    # 35 mm film, for the Mavic 3
    "dji-mavic-3": Camera(width=5280, height=3956, focal=3624.7),
    "dji-mavic-pro": Camera(width=4000, height=3000, focal=2971.4),
    "dji-phantom-4-pro": Camera(width=5472, height=3648, focal=3752.2),
    # OpenSfM, camera_calibration.yaml: focal length over the width; sizes assumed
    "dji-fc300s": Camera(width=4000, height=3000, focal=2372.3),
    "skydio-2": Camera(width=4056, height=3040, focal=2389.2),
}


def _film(photo: Camera) -> Camera:
    """Returns the film mode of a camera, 3840 x 2160 px, given the camera in its photo mode.

    The image keeps its width and is cropped at the top and bottom, because no source for these
    drones states another crop. Electronic stabilisation and high frame rates, which crop more, are
    off.
    """
    return Camera(width=3840, height=2160, focal=round(photo.focal * 3840 / photo.width, 1))


_FILM = {f"{name}-4k": _film(photo) for name, photo in _PHOTOS.items()}

# Film of 16:9 first, then other shapes.
CAMERAS: dict[str, Camera] = {
    **_FILM,
    # YooJuno/ORB-SLAM3_Drone, README: calibrated; distortion k1 = .092, k2 = -.296 left out
    "dji-spark-1080p": Camera(width=1920, height=1080, focal=1850.1),
    # PX4-gazebo-models, gimbal/model.sdf (BSD-3): 2.0 rad; pitch joint -2.356..0.785 rad
    "px4-gimbal": Camera(width=1280, height=720, focal=410.9),
    # PX4-gazebo-models, OakD-Lite/model.sdf (BSD-3): 1.204 rad, and 1.274 rad of the depth camera
    "oak-d-lite-rgb": Camera(width=1920, height=1080, focal=1397.2),
    # microsoft/AirSim, docs/settings.md, CaptureSettings: 90 degrees
    "airsim": Camera(width=256, height=144, focal=128.0),
    "oak-d-lite-depth": Camera(width=640, height=480, focal=432.5),  # as oak-d-lite-rgb
    # PX4-gazebo-models, mono_cam/model.sdf (BSD-3): horizontal angle of view 1.74 rad
    "px4-mono": Camera(width=1280, height=960, focal=539.9),
    **_PHOTOS,
    # Suresh et al., "Greedy Perspectives", 2024: the camera of its scenes and of the built-in ones
    "greedy-perspectives": Camera(width=4000, height=3000, focal=2500.0),
}


def film_of(name: str) -> str | None:
    """Returns the name of the film mode of a camera in photo mode; None if there is none."""
    return f"{name}-4k" if name in _PHOTOS else None


def camera_name(camera: AnyCamera) -> str | None:
    """Returns the name of a camera, ignoring its tilts; None if it is not in the table."""
    known = (
        name for name, listed in CAMERAS.items() if listed.replace(tilts=camera.tilts) == camera
    )
    return next(known, None)


def camera_called(name: str, otherwise: str = "") -> Camera:
    """Returns the camera with a name in `CAMERAS`, or raises a ProblemError that lists the names.

    Parameters
    ----------
    otherwise : what the caller accepts in place of a name, added at the end of the message
    """
    if name not in CAMERAS:
        near = meant(name, CAMERAS)
        raise ProblemError(
            f"camera: must be one of {', '.join(CAMERAS)}, not {name!r}{near}{otherwise}"
        )
    return CAMERAS[name]


def with_cameras(
    problem: Problem, name: str | None = None, tilts: tuple[float, ...] | None = None
) -> Problem:
    """Returns the problem with other cameras, other tilts of the cameras, or both.

    Parameters
    ----------
    problem : the problem, whose robots all have cameras that take images
    name : one of `CAMERAS`, for all robots; None: each robot keeps its own
    tilts : degrees below the horizon, for all robots; several tilts make a gimbal, which begins at
        the tilt nearest to the robot's old one. None: each robot keeps its own

    Raises
    ------
    ProblemError
        If there is no camera of that name, tilts are out of range or not in order, or a robot has
        a sensor that takes no images.
    """
    given = None if name is None else camera_called(name)
    require_tilts(tilts or ())
    robots = []
    for i, robot in enumerate(problem.robots):
        if not isinstance(robot.camera, Camera):
            raise ProblemError(
                f"robots[{i}].camera: must be a pinhole camera; others cannot be replaced"
            )
        if given is not None:
            robot = robot.replace(camera=given.replace(tilts=robot.camera.tilts))
        robots.append(robot if tilts is None else _tilted(robot, tilts))
    return problem.replace(robots=tuple(robots))


def require_tilts(degrees: Sequence[float]) -> None:
    """Raises ProblemError if tilts of a gimbal (degrees) are out of range or not in order."""
    for angle in degrees:
        if not abs(angle) <= 90:  # true for nan, too
            raise ProblemError(f"tilts: must be within +-90 degrees, not {angle:g}")
    if [*degrees] not in (sorted(set(degrees)), sorted(set(degrees), reverse=True)):
        words = "must increase or decrease, as pitch_turn counts them in order"
        raise ProblemError(f"tilts: {words}, not {', '.join(f'{angle:g}' for angle in degrees)}")


def _tilted(robot: Robot, degrees: tuple[float, ...]) -> Robot:
    """Returns a robot with other tilts; it begins with the tilt nearest to its old one."""
    tilts = tuple(math.radians(angle) for angle in degrees)

    def nearest(pitch: int) -> int:
        old = robot.camera.tilts[pitch]
        return min(range(len(tilts)), key=lambda k: abs(tilts[k] - old), default=0)

    start: AnyStart
    if isinstance(robot.start, StartArea):
        old = robot.start.pitches
        pitches = None if old is None else tuple(dict.fromkeys(map(nearest, old)))
        start = robot.start.replace(pitches=pitches)
    else:
        states = (robot.start,) if isinstance(robot.start, State) else robot.start.states
        new = dict.fromkeys(state._replace(pitch=nearest(state.pitch)) for state in states)
        start = StartStates(states=tuple(new))
    return robot.replace(start=start, camera=robot.camera.replace(tilts=tilts))


# -- limits of airframes by name, each with its source
#
# Values that a source does not give are None, and are not checked. Most manufacturers' figures are
# for the fastest mode, without wind. The airframes of two cameras are missing, the Spark's and
# AirSim's, as there is no source; set the recipe's `limits` for them.

AIRFRAMES: dict[str, Limits] = {
    # PX4-Autopilot (BSD-3), src/modules/mc_pos_control, 2025: defaults of MPC_XY_VEL_MAX,
    # MPC_Z_VEL_MAX_UP, MPC_Z_VEL_MAX_DN, MPC_ACC_HOR, MPC_YAWRAUTO_MAX
    "px4": Limits(
        speed=12.0, climb=3.0, descent=1.5, acceleration=3.0, yaw_rate=math.radians(60.0)
    ),
    # Manufacturers' figures, from the wiki of the Zephyr simulator: Little-Arms-Studios/
    # zephyr-wiki, getting-started/drones/: mavic-pro.md, phantom-3.md, phantom-4.md, skydio-2.md
    "dji-mavic-pro": Limits(speed=18.0, climb=5.0, descent=3.0, endurance=27 * 60.0),
    "dji-phantom-3": Limits(
        speed=16.0, climb=5.0, descent=3.0, yaw_rate=math.radians(150.0),
        gimbal_rate=math.radians(90.0), endurance=25 * 60.0,
    ),
    "dji-phantom-4": Limits(
        speed=20.0, climb=6.0, descent=3.0, yaw_rate=math.radians(150.0),
        gimbal_rate=math.radians(90.0), endurance=28 * 60.0,
    ),
    "skydio-2": Limits(speed=16.1, endurance=23 * 60.0),
    # The manufacturer's figures for mode P (with the sensors on), and for turns those for mode S,
    # published by a laboratory of Embrapa for the aircraft that it flies:
    # project.cnpgc.embrapa.br/fenotipagem/docs/hardware
    "dji-phantom-4-pro": Limits(
        speed=13.9, climb=5.0, descent=3.0, yaw_rate=math.radians(250.0),
        gimbal_rate=math.radians(90.0), endurance=30 * 60.0,
    ),
}  # fmt: skip


def airframe_name(limits: Limits | None) -> str | None:
    """Returns the name of an airframe whose known limits are these; None if there is none.

    If no airframe also has the same endurance, endurance is ignored: the drone may have another
    battery.
    """
    fields = Limits.__struct_fields__
    for compared in (fields, [field for field in fields if field != "endurance"]):
        for name, airframe in AIRFRAMES.items():
            known = ((field, getattr(airframe, field)) for field in compared)
            if all(value in (None, getattr(limits, field, None)) for field, value in known):
                return name
    return None
