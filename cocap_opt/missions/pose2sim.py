"""Planned cameras for Pose2Sim (.pose2sim.toml), to be used as its `calibration/Calib.toml`.

In Pose2Sim, a camera has one pose for all frames, and each frame is triangulated from the cameras
that have a pose file for it. So each drone has a separate camera for each moment, whose folder of
pose files contains only that frame, and the whole flight is triangulated at once. Folders are
sorted by the last number in their names, so each name ends with the camera's number, in the order
of the file.

Source: `retrieve_calib_params`, `sort_stringlist_by_last_number` (`common.py`) and
`triangulate_all` (`triangulation.py`) of Pose2Sim 0.10.49, https://github.com/perfanalytics/pose2sim
"""

from collections.abc import Iterator

from cocap_opt.data import FloatArray
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.notes import Note
from cocap_opt.missions.export import Export
from cocap_opt.missions.planned_cameras import PlannedCamera, PlannedCameras


def write(flight: Flight, every: float | None) -> Export:
    """Returns a calibration with a camera for each drone and moment."""
    planned = PlannedCameras.of(flight, every)
    lines = ["[metadata]", "adjusted = false", "error = 0.0", *planned.world.lines, *_all(planned)]
    return Export(
        {"": ("\n".join(lines) + "\n").encode()},
        (*planned.notes, _note(planned)),
    )


def _all(planned: PlannedCameras) -> Iterator[str]:
    """Yields the lines of all cameras, drone by drone."""
    times = planned.times.tolist()
    for i, camera in enumerate(planned.cameras):
        poses = zip(times, camera.vectors, camera.translations, strict=True)
        for k, (t, vector, translation) in enumerate(poses):
            yield from _camera(camera, _name(planned, i, k), vector, translation)
            yield f"t = {t!r}"


def _name(planned: PlannedCameras, drone: int, frame: int) -> str:
    number = drone * len(planned.times) + frame
    return f"{planned.cameras[drone].name}_frame{frame:06d}_camera{number}"


def _camera(
    camera: PlannedCamera, name: str, vector: FloatArray, translation: FloatArray
) -> Iterator[str]:
    """Yields the lines for a camera that Pose2Sim reads."""
    lens = camera.lens
    yield f"\n[{name}]"
    yield f'name = "{name}"'
    yield f"size = [{float(lens.width)}, {float(lens.height)}]"
    yield f"matrix = {camera.matrix.tolist()}"
    yield "distortions = [0.0, 0.0, 0.0, 0.0]"
    yield f"rotation = {vector.tolist()}"
    yield f"translation = {translation.tolist()}"
    yield "fisheye = false"


def _note(planned: PlannedCameras) -> Note:
    return Note(
        "Pose2Sim does not support moving cameras: each drone has a camera for each frame, and "
        f"pose/{_name(planned, 0, 0)}_json must contain only the pose file of that frame; set "
        f"frame_range = [0, {len(planned.times)}] in Config.toml"
    )
