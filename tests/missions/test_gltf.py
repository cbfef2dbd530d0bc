import io
import re
from typing import Any

import numpy as np
import numpy.typing as npt
import pygltflib
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp
from strategies import examples

import cocap_opt as co
from cocap_opt.data import ProblemError
from cocap_opt.flight.flights import Flight
from cocap_opt.missions import FORMATS
from cocap_opt.missions import relief as relief_module
from cocap_opt.missions.gltf import ERROR, ERROR_OF_ANGLES
from cocap_opt.missions.relief import Relief
from cocap_opt.world import HeightMap

Array = npt.NDArray[Any]


def scene(step: float = 0.5) -> tuple[co.Problem, co.Plan]:
    """Two drones, far from the origin, that fly, climb and turn, and a person who turns about."""
    heights = np.zeros((6, 5))
    heights[2:4, 2] = 3.0
    poses = [[5e5 + 2, 4e6 + t, 0.5, np.pi * (t % 2)] for t in range(4)]
    robot = co.Robot(
        start=co.State(0, 0), motion=co.Motion(layers=(5.0, 8.0)),
        camera=co.Camera(width=400, height=300, focal=200.0, tilts=(0.2, 1.0)),
    )  # fmt: skip
    problem = co.Problem(
        name="yard", height_map=HeightMap(heights=heights, resolution=2.0, origin=(5e5, 4e6)),
        robots=[robot, robot.replace(start=co.State(5, 4))],
        actors=[co.Actor(poses=np.array(poses), shape=co.Prism())], horizon=3, step=step,
        meshes=(co.Mesh.box((5e5, 4e6, 10.0), (5e5 + 1, 4e6 + 1, 1e9)),),
        airspace=co.Airspace(no_fly=(co.Mesh.box((5e5, 4e6 + 7, 0.0), (5e5 + 1, 4e6 + 8, 1e9)),)),
    )  # fmt: skip
    one = [co.State(0, 0), co.State(1, 1, 0, 1, 1), co.State(1, 1, 1, 2, 0), co.State(1, 1, 1, 1)]
    other = [co.State(5, 4), co.State(5, 4, 0, 7), co.State(5, 4, 0, 7), co.State(4, 4)]
    return problem, co.Plan(paths=(tuple(one), tuple(other)))


def written(flight: Flight) -> bytes:
    """The .glb file of a flight."""
    return FORMATS[".glb"].writer()(flight, None).files[""]


class Played:
    """A file as a viewer of glTF plays it, read by pygltflib."""

    def __init__(self, content: bytes) -> None:
        self.file = pygltflib.GLTF2.load_from_bytes(content)
        self._binary = self.file.binary_blob()
        self.number = {node.name: k for k, node in enumerate(self.file.nodes)}

    def _values(self, accessor: int) -> Array:
        own = self.file.accessors[accessor]
        view = self.file.bufferViews[own.bufferView]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[own.type]
        part = self._binary[view.byteOffset : view.byteOffset + view.byteLength]
        rows = np.frombuffer(part, dtype="<f4").reshape(own.count, width).astype(float)
        np.testing.assert_allclose(rows.min(axis=0), own.min)
        np.testing.assert_allclose(rows.max(axis=0), own.max)
        return rows

    def track(self, name: str, path: str) -> tuple[Array, Array]:
        """Times and values of a node's animation."""
        (animation,) = self.file.animations
        (sampler,) = [
            animation.samplers[channel.sampler] for channel in animation.channels
            if (channel.target.node, channel.target.path) == (self.number[name], path)
        ]  # fmt: skip
        assert sampler.interpolation == "LINEAR"
        return self._values(sampler.input)[:, 0], self._values(sampler.output)

    def places(self, name: str, times: Array) -> Array:
        """Where a node is, in the coordinates of the map."""
        t, rows = self.track(name, "translation")
        at = np.column_stack([np.interp(times, t, column) for column in rows.T])
        return at @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]] + self.file.scenes[0].extras["origin"]

    def turns(self, name: str, times: Array) -> Rotation:
        """How a node is turned, by the shorter way between moments, as the specification says."""
        t, rows = self.track(name, "rotation")
        return Slerp(t, Rotation.from_quat(rows))(np.clip(times, t[0], t[-1]))


@pytest.mark.parametrize("smooth", [False, True])
def test_drones_cameras_and_people_are_played_where_they_are(smooth: bool) -> None:
    """At any moment, by one clock: a millimetre and a tenth of a degree, as the file says."""
    problem, plan = scene()
    flight = Flight.of(problem, plan, smooth)
    played = Played(written(flight))
    times = np.linspace(0, 1.5, 301)
    found = flight.flown.at(times)
    for i in range(2):
        own = found.drone == i
        off = np.linalg.norm(played.places(f"drone {i}", times) - found.place[own], axis=1)
        assert off.max() < 1.1 * ERROR
        body = played.turns(f"drone {i}", times)
        # The drone looks along x of its node, the camera along -z.
        yaw, pitch = found.yaw[own], found.pitch[own]
        level = np.column_stack([np.cos(yaw), np.zeros(301), -np.sin(yaw)])
        assert angles(body.apply([1, 0, 0]), level).max() < 1.1 * ERROR_OF_ANGLES
        eye = body * played.turns(f"camera {i}", times)
        look = np.cos(pitch)[:, None] * level + np.sin(pitch)[:, None] * [0, 1, 0]
        assert angles(eye.apply([0, 0, -1]), look).max() < 2.2 * ERROR_OF_ANGLES
        np.testing.assert_allclose(eye.apply([1, 0, 0])[:, 1], 0, atol=1e-6)  # it does not roll
        # The files' nodes stand at first where they are at first.
        node = played.file.nodes[played.number[f"drone {i}"]]
        assert node.translation == pytest.approx(played.track(f"drone {i}", "translation")[1][0])
    walked = played.places("person 0", times)
    np.testing.assert_allclose(walked[:, 1] - 4e6, times / 0.5, atol=1e-5)
    facing = played.turns("person 0", np.array([0, 0.25, 0.5, 1.0])).apply([1, 0, 0])
    expected = [[1, 0, 0], [0, 0, facing[1, 2]], [-1, 0, 0], [1, 0, 0]]
    np.testing.assert_allclose(facing, expected, atol=1e-6)
    clocks = {t[-1] for node in played.number if node[:-2] in ("drone", "camera", "person")
              for t in [played.track(node, "rotation")[0]]}  # fmt: skip
    assert clocks == {1.5}


def test_flights_of_a_scene_have_one_origin() -> None:
    """The middle of the map at its lowest ground: files of two flights lie on each other."""
    problem, plan = scene()
    hovering = co.Plan(paths=tuple((path[0],) * len(path) for path in plan.paths))
    flights = Flight.of(problem, plan, False), Flight.of(problem, plan, True)
    for flight in (*flights, Flight.of(problem, hovering, False)):
        extras = Played(written(flight)).file.scenes[0].extras
        assert extras["origin"] == [5e5 + 6, 4e6 + 5, 0]


def angles(one: Array, other: Array) -> Array:
    """Angles (rad) between directions."""
    cross = np.linalg.norm(np.cross(one, other), axis=1)
    return np.asarray(np.arctan2(cross, (one * other).sum(axis=1)))


def test_the_scene_is_there_with_y_up() -> None:
    """Trimesh loads it: ground, buildings, bodies and solids are where the map has them."""
    problem, plan = scene()
    content = written(Flight.of(problem, plan, False))
    loaded = trimesh.load(io.BytesIO(content), file_type="glb")
    played = Played(content)
    assert set(played.number) >= {
        "terrain", "buildings", "mesh 0", "no-fly zone 0", "person 0", "frustum 0",
        *(f"{part} {i}" for part in ("drone", "camera", "track") for i in range(2)),
    }  # fmt: skip
    origin = np.array(played.file.scenes[0].extras["origin"])

    def bounds(name: str) -> Array:
        mesh = loaded.geometry[name].copy()
        matrix, _ = loaded.graph[name]
        low, high = mesh.apply_transform(matrix).bounds
        return np.array([low[[0, 2, 1]], high[[0, 2, 1]]]) * [1, -1, 1] + origin - [5e5, 4e6, 0]

    np.testing.assert_allclose(bounds("terrain"), [[0, 10, 0], [12, 0, 0]], atol=1e-3)
    np.testing.assert_allclose(bounds("buildings"), [[4, 6, 0], [8, 4, 3]], atol=1e-3)
    np.testing.assert_allclose(bounds("person 0")[:, 2], [0.5, 2.3], atol=1e-3)
    assert bounds("mesh 0")[1, 2] < 30  # though it is 1e9 m high
    lens = played.file.cameras[0].perspective
    assert lens.yfov == pytest.approx(2 * np.arctan(150 / 200))
    assert lens.aspectRatio == pytest.approx(4 / 3)


def test_what_a_clock_or_a_file_cannot_hold_is_refused() -> None:
    """Moments that 32 bits do not tell apart, too many of them, and moments of one's own."""
    flight = Flight.of(*scene(), False)
    pieces = np.zeros((1, 4000, 5, 6))
    for far, words in ((1e4, "too short for the clock"), (1e12, "at most 5000000 moments")):
        pieces[0, -1, 0, -1] = far
        quick = flight._replace(flown=flight.flown.with_pieces(pieces.copy()))
        with pytest.raises(ProblemError, match=words):
            written(quick)
    with pytest.raises(ProblemError, match="every: must be left out"):
        FORMATS[".glb"].writer()(flight, 0.5)


def test_full_turns_of_people_are_none() -> None:
    """A yaw that is written with a turn more is the same yaw: nobody spins between the steps."""
    problem, plan = scene()
    (actor,) = problem.actors
    turned = actor.poses + 0.1 * np.pi * np.array([[0, 0, 0, k] for k in range(4)])
    more = turned + 2 * np.pi * np.array([[0, 0, 0, k % 2] for k in range(4)])
    one, other = (
        written(Flight.of(problem.replace(actors=(actor.replace(poses=poses),)), plan, False))
        for poses in (turned, more)
    )
    assert len(one) == len(other)


def test_a_map_that_is_thinned_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """The notes say how large its cells are, here and there; else they do not speak of it."""
    flight = Flight.of(*scene(), False)
    assert len(FORMATS[".glb"].writer()(flight, None).notes) == 1
    monkeypatch.setattr(relief_module, "MOST_RECTANGLES", 8)
    _, note = FORMATS[".glb"].writer()(flight, None).notes
    assert re.search("64 x 64 cells as one, .* with 4 x 4, as high as the highest", note.text)


@examples(30)
@given(
    st.lists(st.lists(st.sampled_from([0.0, 0.0, 2.0, 5.0]), min_size=4, max_size=4), min_size=1,
             max_size=5),
)  # fmt: skip
def test_few_rectangles_make_the_same_surface(rows: list[list[float]]) -> None:
    """Each cell has its top, each step between cells its wall, and the map's edge, too."""
    heights = np.array(rows)
    height_map = HeightMap(heights=heights, resolution=2.0, origin=(7.0, 8.0))
    none = np.array([0, 0]), np.array([0, 0])
    relief = Relief.of(height_map, (-10.0, 10.0), none)
    quads = np.concatenate([relief.ground, relief.obstacles])
    low, high = quads.min(axis=1), quads.max(axis=1)
    flat = low[:, 2] == high[:, 2]
    assert flat.sum() <= heights.size
    for (i, j), height in np.ndenumerate(heights):
        at = np.array([2 * i + 1, 2 * j + 1])
        over = flat & (low[:, :2] < at).all(axis=1) & (at < high[:, :2]).all(axis=1)
        (top,) = np.flatnonzero(over)
        assert low[top, 2] == height
        stands = top >= len(relief.ground)
        assert stands == height_map.stands_out[i, j]
    walls = np.prod(np.where(high > low, high - low, 1.0)[~flat], axis=1).sum()
    framed = np.pad(heights, 1, constant_values=heights.min())
    steps = sum(np.abs(np.diff(framed, axis=axis)).sum() for axis in (0, 1))
    assert walls == pytest.approx(2.0 * steps)


def test_a_map_of_many_heights_is_thinned_but_where_it_matters(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Blocks of cells are as high as their highest, single cells remain around the flights."""
    monkeypatch.setattr(relief_module, "MOST_RECTANGLES", 600)
    heights = np.random.default_rng(0).random((40, 41))
    relief = Relief.of(
        HeightMap(heights=heights), (0.0, 1.0), (np.array([10, 12]), np.array([13, 14]))
    )
    assert (relief.fine, relief.coarse) == (1, 4)
    quads = np.concatenate([relief.ground, relief.obstacles])
    tops = quads[(quads[:, :, 2] == quads[:, :1, 2]).all(axis=1)]
    corners = {(*row[0, :2], *row[2, :2]): row[0, 2] for row in tops}
    assert corners[11, 13, 12, 14] == heights[11, 13]
    assert corners[0, 0, 4, 4] == heights[:4, :4].max()
    area = sum((x1 - x0) * (y1 - y0) for x0, y0, x1, y1 in corners)
    assert area == 40 * 41
