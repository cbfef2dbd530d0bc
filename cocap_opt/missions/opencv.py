"""Planned cameras for OpenCV (.opencv.json), readable by `cv2.FileStorage` and any JSON reader.

`cameras` contains, for each drone, the fields of OpenCV's own calibration files (`image_width`,
`camera_matrix`, `distortion_coefficients`, ..), and one row per moment in `rvec` and `tvec`, in the
form that `cv2.projectPoints` takes; `t` contains the moments (s). Matrices have the form that
FileStorage writes.

Source: `samples/cpp/calibration.cpp` and `modules/core/src/persistence_json.cpp` in
https://github.com/opencv/opencv
"""

import json
from typing import Any

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.flight.flights import Flight
from cocap_opt.missions.export import Export
from cocap_opt.missions.planned_cameras import PlannedCamera, PlannedCameras


def write(flight: Flight, every: float | None) -> Export:
    """Returns the cameras of a flight, with all poses of each in one matrix."""
    planned = PlannedCameras.of(flight, every)
    document = {
        "world": planned.world.facts,
        "t": _matrix(planned.times[:, None]),
        "cameras": [_camera(camera) for camera in planned.cameras],
    }
    # FileStorage does not support \u escapes.
    text = json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1)
    return Export({"": text.encode() + b"\n"}, planned.notes)


def _camera(camera: PlannedCamera) -> dict[str, Any]:
    return {
        "name": camera.name,
        "image_width": camera.lens.width,
        "image_height": camera.lens.height,
        "camera_matrix": _matrix(camera.matrix),
        "distortion_coefficients": _matrix(np.zeros((5, 1))),
        "rvec": _matrix(camera.vectors),
        "tvec": _matrix(camera.translations),
    }


def _matrix(values: FloatArray) -> dict[str, Any]:
    rows, columns = values.shape
    return {
        "type_id": "opencv-matrix", "rows": rows, "cols": columns, "dt": "d",
        "data": values.ravel().tolist(),
    }  # fmt: skip
