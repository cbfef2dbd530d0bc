"""Planned cameras for COLMAP (.colmap.zip): a model with poses and without points, as text.

The zip contains `cameras.txt`, `images.txt` and an empty `points3D.txt`, and also `times.csv`,
which COLMAP ignores, with the time of each frame. Frame 123 of drone 1 is the image
`drone1/000123.jpg` of camera 2. Newer versions of COLMAP require the numbers of cameras and images
to be those of the feature database, which numbers images by name, so names sort in the order of the
numbers, even with more than ten drones.

Source: "Output Format" and "Reconstruct sparse/dense model from known camera poses",
https://colmap.github.io/format.html, https://colmap.github.io/faq.html
"""

from collections.abc import Iterator

from cocap_opt.flight.flights import Flight
from cocap_opt.flight.notes import Note
from cocap_opt.missions.archive import zipped
from cocap_opt.missions.export import Export
from cocap_opt.missions.planned_cameras import PlannedCameras

_NOTE = Note(
    "unzip it for `colmap point_triangulator --input_path`; name the images as in images.txt, "
    "and use the numbers of images.txt and cameras.txt in the database"
)


def write(flight: Flight, every: float | None) -> Export:
    """Returns a model of the cameras of a flight: an image for each drone and moment."""
    planned = PlannedCameras.of(flight, every)
    times = (f"{k},{t!r}" for k, t in enumerate(planned.times.tolist()))
    comments = [f"# world: {line}" for line in planned.world.lines]
    files = {
        "cameras.txt": ["# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]", *_cameras(planned)],
        "images.txt": [
            *comments, "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME",
            "# POINTS2D[] as (X, Y, POINT3D_ID)", *_images(planned),
        ],
        "points3D.txt": ["# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[]"],
        "times.csv": ["frame,t", *times],
    }  # fmt: skip
    contents = {name: "\n".join(lines) + "\n" for name, lines in files.items()}
    return Export({"": zipped(contents)}, (*planned.notes, _NOTE))


def _cameras(planned: PlannedCameras) -> Iterator[str]:
    """Yields a line per drone."""
    for i, camera in enumerate(planned.cameras):
        lens, (u, v) = camera.lens, camera.middle_of_corners
        yield f"{i + 1} PINHOLE {lens.width} {lens.height} {lens.focal!r} {lens.focal!r} {u} {v}"


def _images(planned: PlannedCameras) -> Iterator[str]:
    """Yields two lines per drone and moment: a pose, and no points."""
    digits = len(str(len(planned.cameras) - 1))
    for i, camera in enumerate(planned.cameras):
        rows = zip(camera.quaternions.tolist(), camera.translations.tolist(), strict=True)
        for k, (turn, translation) in enumerate(rows):
            numbers = " ".join(map(repr, [*turn, *translation]))
            number = i * len(planned.times) + k + 1
            yield f"{number} {numbers} {i + 1} drone{i:0{digits}d}/{k:06d}.jpg"
            yield ""
