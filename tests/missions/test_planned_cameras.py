import io
import math
import zipfile
from pathlib import Path
from typing import Any

import camera_files
import numpy as np
import numpy.typing as npt
import pytest
from camera_files import CENTRE, READERS, Pose
from hypothesis import given
from hypothesis import strategies as st
from pages import DOCS, blocks
from strategies import examples
from test_cli import Run

import cocap_opt as co
from cocap_opt.data import FieldError
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.trajectory import Trajectory
from cocap_opt.missions import FORMATS
from cocap_opt.vision.projection import Projection

Array = npt.NDArray[Any]
ENDINGS = list(READERS)
ANGLES = st.floats(-math.pi / 2, math.pi / 2)


def written(ending: str, flight: Flight, every: float | None = None) -> camera_files.Cameras:
    """The cameras of a flight, from the file of that ending."""
    (content,) = FORMATS[ending].writer()(flight, every).files.values()
    return camera_files.read(ending, content)


def turning() -> tuple[co.Problem, co.Plan]:
    """Two drones of different cameras; the first turns past 180 degrees, tilts, climbs, moves."""
    motion, gimbal = co.Motion(layers=(5.0, 8.0)), co.Camera(tilts=(0.2, 0.9))
    phone = co.Camera(width=1920, height=1080, focal=1400.0, tilts=(0.5,))
    paths = (
        ((2, 2, 0, 3, 0), (3, 2, 0, 4, 1), (3, 3, 1, 5, 1), (4, 3, 1, 5, 0)),
        ((8, 6, 0, 7, 0), (8, 6, 0, 0, 0), (8, 6, 0, 1, 0), (8, 6, 0, 1, 0)),
    )
    plan = co.Plan(paths=tuple(tuple(co.State(*state) for state in path) for path in paths))
    problem = co.Problem(
        name="two", height_map=co.HeightMap(heights=np.zeros((12, 9))), actors=(), horizon=3,
        robots=tuple(
            co.Robot(start=path[0], motion=motion, camera=camera)
            for path, camera in zip(plan.paths, (gimbal, phone), strict=True)
        ), step=2.0,
    )  # fmt: skip
    return problem, plan


BASE = Flight.of(*turning(), False)


@st.composite
def lenses(draw: st.DrawFn) -> co.Camera:
    """Cameras of all sizes and tilts, also straight up and down."""
    return co.Camera(
        width=draw(st.integers(1, 8000)), height=draw(st.integers(1, 6000)),
        focal=draw(st.floats(100, 6000)),
        tilts=tuple(draw(st.lists(ANGLES, min_size=1, max_size=3))),
    )  # fmt: skip


@st.composite
def flights(draw: st.DrawFn) -> Flight:
    """Straight flights of teams of different cameras that turn, tilt, climb and move anyhow.

    They need not be such as drones can fly.
    """
    steps = draw(st.integers(1, 3))
    origin = draw(st.sampled_from([(0.0, 0.0), (-7.25, 3.5), (5e5, 4.5e6)]))
    robots, paths = [], []
    for _ in range(draw(st.integers(1, 3))):
        motion = co.Motion(headings=draw(st.integers(1, 40)), layers=(2.5, 6.0, 40.0))
        camera = draw(lenses())
        states = st.builds(
            co.State, st.integers(0, 7), st.integers(0, 3), st.integers(0, 2),
            st.integers(0, motion.headings - 1), st.integers(0, len(camera.tilts) - 1),
        )  # fmt: skip
        path = draw(st.lists(states, min_size=steps + 1, max_size=steps + 1))
        robots.append(co.Robot(start=path[0], motion=motion, camera=camera))
        paths.append(tuple(path))
    problem = co.Problem(
        name="team", height_map=co.HeightMap(heights=np.zeros((8, 4)), origin=origin), actors=(),
        robots=tuple(robots), horizon=steps, step=draw(st.sampled_from([0.5, 3.0])),
        rules=co.NO_RULES,
    )  # fmt: skip
    plan = co.Plan(paths=tuple(paths))
    straight = Trajectory.straight(problem, plan)
    return BASE._replace(flown=straight, straight=straight, plan=plan)


def places_in_the_image(camera: co.Camera, axes: Array, ways: Array) -> Array:
    """The planner's own projection: px to the right of and below the image's upper left corner."""
    right, up, forward = axes @ ways.T
    u, v = camera.width / 2, camera.height / 2
    return np.column_stack(
        [u + camera.focal * right / forward, v - camera.focal * up / forward]
    )  # fmt: skip


@pytest.mark.parametrize("ending", ENDINGS)
@examples(60)
@given(flights(), st.integers(0, 2**32))
def test_points_are_where_the_planner_sees_them(ending: str, flight: Flight, seed: int) -> None:
    """At each step what is written projects as the planner does, for all headings and tilts."""
    found, problem = written(ending, flight), flight.flown.problem
    draws = np.random.default_rng(seed)
    corner = np.array(found.world["origin"])
    assert corner.tolist() == [*problem.height_map.origin, 0.0]
    assert found.times == [k * problem.step for k in range(problem.horizon + 1)]
    for robot, path, poses in zip(problem.robots, flight.plan.paths, found.poses, strict=True):
        camera, headings = robot.camera, robot.motion.headings
        assert isinstance(camera, co.Camera)
        all_axes = Projection(camera).axes(headings).reshape(headings, len(camera.tilts), 3, 3)
        for state, eye, pose in zip(path, problem.where(robot, path), poses, strict=True):
            assert pose.size == (camera.width, camera.height)
            axes = all_axes[state.heading, state.pitch]
            depth = draws.uniform(1, 100, (20, 1))
            ways = depth * np.column_stack([draws.uniform(-1, 1, (20, 2)), np.ones(20)]) @ axes
            wanted = places_in_the_image(camera, axes, ways)
            pixels = pose.pixels(eye - corner + ways) + pose.first
            np.testing.assert_allclose(pixels, wanted, rtol=0, atol=1e-6)
            assert np.linalg.det(pose.R) == pytest.approx(1)


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize(("smooth", "every", "rows"), [
    (False, None, 4), (False, 0.25, 25), (True, None, 31), (True, 0.7, 10),
])  # fmt: skip
def test_poses_between_the_steps_are_the_flight_s(
    ending: str, smooth: bool, every: float | None, rows: int
) -> None:
    """Each is at the place of the table's row and looks where it does, the image level."""
    flight = Flight.of(*turning(), smooth)
    found, table = written(ending, flight, every), flight.columns(every)
    assert len(found.times) == rows
    assert found.times == table["t"][: len(found.times)].tolist()
    poses = [pose for drone in found.poses for pose in drone]
    assert len(poses) == len(table["t"])
    yaw, pitch = np.radians(table["yaw"]), np.radians(table["pitch"])
    ahead = np.column_stack(
        [np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)]
    )
    places = np.column_stack([table[axis] for axis in "xyz"])
    np.testing.assert_allclose([pose.place for pose in poses], places, atol=1e-9)
    np.testing.assert_allclose([pose.R[2] for pose in poses], ahead, atol=1e-12)
    np.testing.assert_allclose([pose.R[0, 2] for pose in poses], 0, atol=1e-12)
    assert all(pose.R[1, 2] < 0 for pose in poses)  # y is down
    assert {pose.size for pose in found.poses[1]} == {(1920, 1080)}


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_file_has_the_same_bytes_each_time(ending: str) -> None:
    """Nor does it hold a -0, which other programs show."""
    write, flight = FORMATS[ending].writer(), Flight.of(*turning(), True)
    (content,) = write(flight, None).files.values()
    assert write(flight, None).files == {"": content}
    if ending == ".colmap.zip":
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            content = archive.read("images.txt")
    assert b"-0.0," not in content and b" -0.0 " not in content and b"-0.0]" not in content


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("tilt", [-math.pi / 2, math.pi / 2])
def test_cameras_may_look_straight_up_and_down(ending: str, tilt: float) -> None:
    """All rotations are there, those by nothing and by half a turn included."""
    lens = co.Camera(width=400, height=300, focal=200.0, tilts=(tilt,))
    motion = co.Motion(headings=8)
    path = tuple(co.State(1, 1, 0, k) for k in range(8))
    problem = co.Problem(
        name="up and down", height_map=co.HeightMap(heights=np.zeros((3, 3))), actors=(),
        robots=(co.Robot(start=path[0], motion=motion, camera=lens),), horizon=7, step=1.0,
    )  # fmt: skip
    (poses,) = written(ending, Flight.of(problem, co.Plan(paths=(path,)), False)).poses
    for pose, axes in zip(poses, Projection(lens).axes(8), strict=True):
        np.testing.assert_allclose(pose.R, axes * [[1], [-1], [1]], atol=1e-12)
    turned = [np.trace(pose.R) for pose in poses]
    assert max(turned) == pytest.approx(3 if tilt < 0 else -1)
    assert min(turned) == pytest.approx(-1)


@pytest.mark.parametrize("ending", ENDINGS)
def test_teams_of_more_than_ten_keep_their_order(ending: str) -> None:
    """Names are sorted as the readers sort them, by letters or by their last numbers."""
    problem, plan = turning()
    problem = problem.replace(robots=(*problem.robots,) * 6, rules=co.NO_RULES)
    plan = co.Plan(paths=plan.paths * 6)
    straight = Trajectory.straight(problem, plan)
    found = written(ending, BASE._replace(flown=straight, straight=straight, plan=plan))
    assert [poses[0].size[0] for poses in found.poses] == [4000, 1920] * 6


def test_notes_say_the_world_and_the_moments() -> None:
    """Axes, origin, times and what is in between; a last moment that is no whole number of rows."""
    flight = Flight.of(*turning(), False)
    write = FORMATS[".opencv.json"].writer()
    notes = [*map(str, write(flight, None).notes)]
    assert any("y down and z forward" in note and "x = 0, y = 0" in note for note in notes)
    assert any("frame k is at k times 2 s" in n and "change evenly" in n for n in notes)
    smooth = [*map(str, write(Flight.of(*turning(), True), 0.7).notes)]
    words = (
        "k times 0.7 s after step 0, and the last, frame 9, at the flight's end, 6 s; there are 10"
    )
    assert any(words in note and "smoothly" in note for note in smooth)
    assert any("straight lines between them" in note for note in smooth)


def test_cones_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One line names the drone, also in a team that has cameras; nothing is written."""
    problem, plan = turning()
    first, other = problem.robots
    cone = other.replace(camera=co.Cone())
    mixed = problem.replace(robots=(first, cone))
    scene, file = tmp_path / "scene.json", tmp_path / "plan.json"
    co.save(scene, mixed)
    co.save(file, plan, mixed)
    for ending in ENDINGS:
        output = tmp_path / f"film{ending}"
        run = Run(capsys, "fly", scene, file, "-o", output)
        (line,) = run.err.splitlines()
        assert run.code == 2 and not output.exists()
        assert line.startswith(f"cocap-opt: {scene}: robots[1].camera: must be a pinhole camera")
        with pytest.raises(FieldError, match="no intrinsics"):
            FORMATS[ending].writer()(Flight.of(mixed, plan, False), None)


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_earth_is_in_the_file_where_the_scene_knows_it(ending: str) -> None:
    """The world begins at the map's corner, whose place is told; t has no millions of metres."""
    pytest.importorskip("pyproj")
    problem, plan = turning()
    earth = co.Earth(crs="EPSG:25830", heights="sea", base=40.0)
    height_map = problem.height_map.replace(origin=(505_000.0, 4_790_000.0))
    there = problem.replace(height_map=height_map, earth=earth)
    flight = Flight.of(there, plan, False)
    found = written(ending, flight)
    world = found.world
    assert world["origin"] == [505_000.0, 4_790_000.0, 0.0]
    assert "EPSG:25830" in world["crs"] and world["above_sea"] == 40.0
    assert flight.geodesy is not None
    x, y = (np.array([value]) for value in height_map.origin)
    place = np.concatenate(flight.geodesy.degrees(x, y))
    assert [world["latitude"], world["longitude"]] == place.tolist()
    assert 89 < world["x_axis"] < 91
    here = written(ending, Flight.of(problem, plan, False))
    assert set(here.world) == {"origin"}
    for poses, others in zip(found.poses, here.poses, strict=True):
        for pose, other in zip(poses, others, strict=True):
            np.testing.assert_allclose(pose.t, other.t, atol=1e-8)
    assert any("latitude 43.26" in n.text for n in FORMATS[ending].writer()(flight, None).notes)


# -- the whole way: plan, fly, film, triangulate ----------------------------------------


def filmed(problem: co.Problem, flight: Flight) -> list[list[Array]]:
    """The pixels of people's middles in all pictures, by the planner's own projection.

    By drone and step: [A, 2], counted from the image's corner; nan where nobody is in the picture.
    """
    pictures = []
    middles = np.array([actor.middles for actor in problem.actors])
    for robot, path in zip(problem.robots, flight.plan.paths, strict=True):
        camera = robot.camera
        assert isinstance(camera, co.Camera)
        axes = Projection(camera).axes(robot.motion.headings)
        rows = []
        for t, (state, eye) in enumerate(zip(path, problem.where(robot, path), strict=True)):
            view = axes[state.heading * len(camera.tilts) + state.pitch]
            ways = middles[:, t] - eye
            pixels = places_in_the_image(camera, view, ways)
            inside = (pixels > 0) & (pixels < [camera.width, camera.height])
            seen = inside.all(axis=1) & (ways @ view[2] > 0)
            rows.append(np.where(seen[:, None], pixels, np.nan))
        pictures.append(rows)
    return pictures


def found_by(poses: list[Pose], pixels: list[Array]) -> Array:
    """The point [3] that cameras see at pixels, by the direct linear transform."""
    rows = [
        pixel[axis] * pose.P[2] - pose.P[axis]
        for pose, pixel in zip(poses, pixels, strict=True) for axis in (0, 1)
    ]  # fmt: skip
    *_, point = np.linalg.svd(np.array(rows))[2]
    return point[:3] / point[3]


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> tuple[co.Problem, Flight, Path]:
    """The scene bottleneck, the flight of a plan for it, and a folder with the plan."""
    folder = tmp_path_factory.mktemp("film")
    problem = co.load("bottleneck")
    result = co.plan(problem, "sequential")
    assert result.plan is not None
    co.save(folder / "plan.json", result)
    return problem, Flight.of(problem.replace(step=1.0), result.plan, False), folder


def pairs(
    problem: co.Problem, flight: Flight
) -> list[tuple[int, int, tuple[int, int], list[Array]]]:
    """Moments at which two drones at different places have a person in their pictures.

    Each is a step, a person, two drones and the pixels, counted from the corner of the image.
    """
    pictures, found = filmed(problem, flight), []
    for t in range(problem.horizon + 1):
        for j in range(len(problem.actors)):
            seen = [i for i, rows in enumerate(pictures) if not np.isnan(rows[t][j]).any()]
            places = [flight.plan.paths[i][t][:2] for i in seen]
            for a, b in zip(range(len(seen)), range(1, len(seen)), strict=False):
                if places[a] != places[b]:
                    drones = seen[a], seen[b]
                    found.append((t, j, drones, [pictures[i][t][j] for i in drones]))
    assert len(found) > 20
    return found


@pytest.mark.slow
@pytest.mark.parametrize("ending", ENDINGS)
def test_people_are_found_to_a_millimetre(
    ending: str,
    film: tuple[co.Problem, Flight, Path],
    capsys: pytest.CaptureFixture[str],
) -> None:
    """What two drones film of a planned scene gives the middles of people, from each file."""
    problem, flight, folder = film
    output = folder / f"film{ending}"
    run = Run(capsys, "fly", "bottleneck", folder / "plan.json", "--step", 1, "-o", output)
    assert run.code == 0, run.err
    poses = camera_files.read(ending, output.read_bytes()).poses
    for t, j, drones, pixels in pairs(problem, flight):
        cameras = [poses[i][t] for i in drones]
        point = found_by(cameras, [p - c.first for p, c in zip(pixels, cameras, strict=True)])
        assert np.abs(point - problem.actors[j].middles[t]).max() < 1e-3


@pytest.mark.slow
def test_opencv_reads_and_triangulates_the_cameras(
    film: tuple[co.Problem, Flight, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """cv2 reads the file; its projections are the planner's, and its points people's middles."""
    cv2 = pytest.importorskip("cv2", reason="needs opencv-python-headless")
    problem, flight, folder = film
    output = folder / "cv2.opencv.json"
    Run(capsys, "fly", "bottleneck", folder / "plan.json", "--step", 1, "-o", output)
    file = cv2.FileStorage(str(output), cv2.FILE_STORAGE_READ)
    assert file.getNode("t").mat().ravel().tolist() == list(range(problem.horizon + 1))
    nodes = [file.getNode("cameras").at(i) for i in range(file.getNode("cameras").size())]
    assert [node.getNode("name").string() for node in nodes] == [
        "drone0",
        "drone1",
        "drone2",
        "drone3",
    ]
    for t, j, drones, corners in pairs(problem, flight):
        matrices, middle = [], problem.actors[j].middles[t]
        pixels = [place - CENTRE for place in corners]
        for i, place in zip(drones, pixels, strict=True):
            names = "camera_matrix", "distortion_coefficients", "rvec", "tvec"
            K, lens, turns, ways = (nodes[i].getNode(name).mat() for name in names)
            seen, _ = cv2.projectPoints(middle[None], turns[t], ways[t], K, lens)
            np.testing.assert_allclose(seen.ravel(), place, rtol=0, atol=1e-6)
            matrices.append(K @ np.column_stack([cv2.Rodrigues(turns[t])[0], ways[t]]))
        found = cv2.triangulatePoints(*matrices, *(place[:, None] for place in pixels)).ravel()
        assert np.abs(found[:3] / found[3] - middle).max() < 1e-3


@pytest.mark.slow
def test_the_page_s_example_finds_people(
    film: tuple[co.Problem, Flight, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the page on planned cameras shows of OpenCV triangulates from that folder's file."""
    pytest.importorskip("cv2", reason="needs opencv-python-headless")
    problem, flight, _ = film
    files = FORMATS[".opencv.json"].writer()(flight, None).files
    (tmp_path / "film.opencv.json").write_bytes(files[""])
    monkeypatch.chdir(tmp_path)
    page = (DOCS / "how-to" / "planned-cameras.md").read_text(encoding="utf-8")
    (example,) = (text for language, text in blocks(page) if language == "py")
    names: dict[str, Any] = {}
    exec(compile(example, "page", "exec"), names)
    for t, j, drones, pixels in pairs(problem, flight):
        seen = dict(zip(drones, [place - CENTRE for place in pixels], strict=True))
        found = names["triangulate"](t, seen)
        assert np.abs(found - problem.actors[j].middles[t]).max() < 1e-3


@pytest.mark.slow
def test_colmap_reads_the_cameras(film: tuple[co.Problem, Flight, Path], tmp_path: Path) -> None:
    """Its model has an image for each drone and step, which sees people where the planner does."""
    pycolmap = pytest.importorskip("pycolmap")
    problem, flight, _ = film
    (content,) = FORMATS[".colmap.zip"].writer()(flight, None).files.values()
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        archive.extractall(tmp_path)
    model = pycolmap.Reconstruction(tmp_path)
    images = {image.name: image for image in model.images.values()}
    assert len(images) == len(problem.robots) * (problem.horizon + 1)
    assert model.num_points3D() == 0
    for t, j, drones, pixels in pairs(problem, flight):
        for i, place in zip(drones, pixels, strict=True):
            seen = images[f"drone{i}/{t:06d}.jpg"].project_point(problem.actors[j].middles[t])
            np.testing.assert_allclose(seen, place, rtol=0, atol=1e-6)
