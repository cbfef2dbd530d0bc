"""Files of planned cameras, read as their formats are described, and by none of our own code."""

import io
import json
import math
import re
import tomllib
import zipfile
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

CENTRE = 0.5  # px from the corner of a pixel to its centre, where OpenCV begins to count


class Pose(NamedTuple):
    """A camera at a moment: the size of its image, K, R, t, and the place of its pixel 0, 0."""

    size: tuple[int, int]
    K: Array
    R: Array
    t: Array
    first: float = 0.0  # px from the image's corner

    @property
    def P(self) -> Array:  # noqa: N802
        """The projection matrix [3, 4]."""
        return self.K @ np.column_stack([self.R, self.t])

    @property
    def place(self) -> Array:
        """The place of the camera in the world [3]."""
        return -self.R.T @ self.t

    def pixels(self, points: Array) -> Array:
        """The places [n, 2] of points [n, 3] in the image, as the file's readers count pixels."""
        homogeneous = np.column_stack([points, np.ones(len(points))]) @ self.P.T
        return homogeneous[:, :2] / homogeneous[:, 2:]


class Cameras(NamedTuple):
    """The content of a file: times (s), poses by drone and moment, and facts on the world."""

    times: list[float]
    poses: list[list[Pose]]
    world: dict[str, Any]


def read(ending: str, content: bytes) -> Cameras:
    """What a file says."""
    return READERS[ending](content)


def from_vector(vector: Array) -> Array:
    """Rodrigues' formula: the rotation by the length of a vector about its direction."""
    angle = float(np.linalg.norm(vector))
    if not angle:  # of a camera that looks straight up, its image's lower side along y
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def from_quaternion(w: float, x: float, y: float, z: float) -> Array:
    """The rotation of a unit quaternion."""
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def _opencv(content: bytes) -> Cameras:
    document = json.loads(content)

    def matrix(node: dict[str, Any]) -> Array:
        assert (node["type_id"], node["dt"]) == ("opencv-matrix", "d")
        return np.array(node["data"], dtype=float).reshape(node["rows"], node["cols"])

    poses = []
    for camera in document["cameras"]:
        assert not matrix(camera["distortion_coefficients"]).any()
        size = camera["image_width"], camera["image_height"]
        rows = zip(matrix(camera["rvec"]), matrix(camera["tvec"]), strict=True)
        K = matrix(camera["camera_matrix"])
        poses.append([Pose(size, K, from_vector(r), t, CENTRE) for r, t in rows])
    assert [c["name"] for c in document["cameras"]] == [f"drone{i}" for i in range(len(poses))]
    return Cameras(matrix(document["t"]).ravel().tolist(), poses, document["world"])


def _pose2sim(content: bytes) -> Cameras:
    document = tomllib.loads(content.decode())
    world = document.pop("metadata")
    assert (world.pop("adjusted"), world.pop("error")) == (False, 0.0)
    found: dict[int, list[Pose]] = {}
    times: dict[int, float] = {}
    for number, (name, camera) in enumerate(document.items()):
        assert camera["name"] == name and camera["fisheye"] is False
        assert camera["distortions"] == [0.0] * 4
        drone, frame, last = map(int, re.findall(r"\d+", name))
        assert last == number  # by which Pose2Sim sorts folders
        rotation, translation = (np.array(camera[key]) for key in ("rotation", "translation"))
        width, height = camera["size"]
        K = np.array(camera["matrix"])
        pose = Pose((width, height), K, from_vector(rotation), translation, CENTRE)
        poses = found.setdefault(drone, [])
        assert frame == len(poses)
        assert times.setdefault(frame, camera["t"]) == camera["t"]
        poses.append(pose)
    assert list(found) == list(range(len(found)))
    return Cameras(list(times.values()), list(found.values()), world)


def _colmap(content: bytes) -> Cameras:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        files = {name: archive.read(name).decode().splitlines() for name in archive.namelist()}
    assert list(files) == ["cameras.txt", "images.txt", "points3D.txt", "times.csv"]
    assert all(line.startswith("#") for line in files["points3D.txt"])
    lenses = {}
    for line in files["cameras.txt"]:
        if not line.startswith("#"):
            number, model, width, height, *numbers = line.split()
            fx, fy, cx, cy = map(float, numbers)
            assert model == "PINHOLE"
            K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
            lenses[number] = (int(width), int(height)), K
    rows = [line for line in files["images.txt"] if not line.startswith("#")]
    assert not any(rows[1::2])  # no points
    poses: list[list[Pose]] = [[] for _ in lenses]
    names: list[str] = []
    for k, line in enumerate(rows[::2]):
        number, *words, lens, name = line.split()
        w, x, y, z, *t = map(float, words)
        assert int(number) == k + 1
        drone = int(lens) - 1
        folder, frame, _ = re.split(r"[/.]", name)
        assert int(folder.removeprefix("drone")) == drone
        assert int(frame) == len(poses[drone])
        names.append(name)
        poses[drone].append(Pose(*lenses[lens], from_quaternion(w, x, y, z), np.array(t)))
    assert names == sorted(set(names))  # as COLMAP numbers them
    head, *lines = files["times.csv"]
    assert head == "frame,t"
    times = [float(line.split(",")[1]) for line in lines]
    comments = [line for line in files["images.txt"] if line.startswith("# world: ")]
    world = tomllib.loads("\n".join(line.removeprefix("# world: ") for line in comments))
    return Cameras(times, poses, world)


READERS = {".opencv.json": _opencv, ".pose2sim.toml": _pose2sim, ".colmap.zip": _colmap}
