"""Cameras of recipes, by name and by numbers."""

import logging
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import examples

from cocap_opt.data import ProblemError
from cocap_opt.output.known_scenes import known_scenes
from cocap_opt.problem import Camera
from cocap_opt.scenarios.hardware import CAMERAS, camera_name
from cocap_opt.scenarios.recipe import EXAMPLE, read
from cocap_opt.scenarios.recipe.cameras import CameraTable

RECIPE = """
steps = 2
[map]
size = [12, 8]
[[walk]]
points = [[2, 3], [10, 4]]
[[drones]]
camera = {camera}
starts = [{ x = 2.5, y = 6.5 }]
"""


def camera(folder: Path, words: str) -> Camera:
    """The camera that a recipe says."""
    path = folder / "scene.toml"
    path.write_text(RECIPE.replace("{camera}", words))
    found = read(path).robots[0].camera
    assert isinstance(found, Camera)
    return found


def degrees(camera: Camera, x: float, y: float) -> float:
    """The angle between the rays to a point (px from the middle) and to its mirror image."""
    ahead = math.hypot(x, y, camera.focal)
    cosine = (camera.focal**2 - x * x - y * y) / ahead**2
    return math.degrees(math.acos(cosine))


@examples(100)
@given(
    st.tuples(st.integers(1000, 6000), st.integers(1000, 4000)),
    st.floats(4, 100),
    st.sampled_from(("fov", "fov_vertical", "fov_diagonal")),
)
def test_angles_are_those_between_rays(size: tuple[int, int], angle: float, field: str) -> None:
    """To the middles of two sides, or to two corners, of the image."""
    width, height = size
    x, y = {
        "fov": (width / 2, 0), "fov_vertical": (0, height / 2),
        "fov_diagonal": (width / 2, height / 2),
    }[field]  # fmt: skip
    found = CameraTable(width=width, height=height, **{field: angle}).camera((0.0,))
    assert degrees(found, x, y) == pytest.approx(angle, rel=1e-6)


def test_lenses_are_told_in_many_ways(tmp_path: Path) -> None:
    """Six ways to say one camera, to the pixel."""
    focal = 2900
    across = math.degrees(2 * math.atan(3840 / 2 / focal))
    corner = math.degrees(2 * math.atan(math.hypot(3840, 2160) / 2 / focal))
    # On film of 36 x 24 mm this lens has the same angle from corner to corner.
    film = math.hypot(36, 24) / 2 / math.tan(math.radians(corner / 2))
    for lens in (
        "focal = 2900", f"fov = {across}", f"fov_diagonal = {corner}", f"lens_35mm = {film}",
        f"fov_vertical = {math.degrees(2 * math.atan(1080 / focal))}",
        f"sensor = 6.4, lens = {6.4 * focal / 3840}",
    ):  # fmt: skip
        found = camera(tmp_path, f"{{ width = 3840, height = 2160, {lens} }}")
        assert (found.width, found.height) == (3840, 2160)
        assert found.focal == pytest.approx(focal, rel=1e-12), lens


def test_film_is_cut_out_of_photos(tmp_path: Path) -> None:
    """A lens that is told of photos of 4:3 is longer in pixels of film that keeps the width.

    Makers say 24 mm and 84 degrees of the Mavic 3, whose pixels others have measured.
    """
    film = CAMERAS["dji-mavic-3-4k"]
    for lens in ("lens_35mm = 24", "fov_diagonal = 84"):
        words = f"{{ width = 3840, height = 2160, {lens}, photo = [4, 3] }}"
        found = camera(tmp_path, words)
        assert found.focal == pytest.approx(film.focal, rel=0.015)
        uncut = camera(tmp_path, words.replace(", photo = [4, 3]", ""))
        assert uncut.focal / found.focal == pytest.approx(math.hypot(16, 9) / 20)
    upright = camera(tmp_path, "{ width = 400, height = 300, fov_vertical = 40, photo = [4, 3] }")
    assert upright.focal == pytest.approx(150 / math.tan(math.radians(20)))


def test_film_comes_first_and_is_as_wide_as_photos(caplog: pytest.LogCaptureFixture) -> None:
    """Names of before keep their photos; film has the same angle across, and 16:9."""
    shapes = [row["shape"] for row in known_scenes()["cameras"]]
    films = shapes.count("16:9")
    assert films == 9 and shapes[:films] == ["16:9"] * films
    assert set(shapes[films:]) == {"4:3", "3:2"}
    for name, film in CAMERAS.items():
        if name.endswith("-4k"):
            photo = CAMERAS[name.removesuffix("-4k")]
            assert film.half_angle == pytest.approx(photo.half_angle, abs=1e-4)
            assert camera_name(film) == name


@pytest.mark.parametrize("tilts", [[10, 10], [10, 60, 30], [60, 10, 30]])
def test_tilts_are_in_order(tmp_path: Path, tilts: list[float]) -> None:
    """Drones turn their cameras by so many tilts of the list; each must be beside the next."""
    with pytest.raises(ProblemError, match="tilts: must increase or decrease"):
        camera(tmp_path, f'"px4-gimbal"\ntilts = {tilts}')
    assert len(camera(tmp_path, f'"px4-gimbal"\ntilts = {sorted({*tilts})}').tilts) > 0
    assert camera(tmp_path, '"px4-gimbal"\ntilts = [60, 10]').tilts[0] > 1.0


def test_photos_are_pointed_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """One line says which name films, and nothing is said of cameras that have no other."""
    camera(tmp_path, '"skydio-2"')
    words = 'camera = "skydio-2" has the shape of its photos; use "skydio-2-4k" for film'
    assert caplog.messages == [words]
    caplog.clear()
    for name in ("skydio-2-4k", "px4-mono", "greedy-perspectives"):
        with caplog.at_level(logging.WARNING):
            camera(tmp_path, f'"{name}"')
    assert caplog.messages == []


def test_a_camera_that_is_not_given_is_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """J depends on the camera, so none is assumed in silence."""
    path = tmp_path / "scene.toml"
    path.write_text(RECIPE.replace("camera = {camera}\n", ""))
    with caplog.at_level(logging.WARNING):
        found = read(path).robots[0].camera
    assert isinstance(found, Camera)
    assert camera_name(found) == "greedy-perspectives"
    words = "drones[0]: camera: not given; greedy-perspectives, 4000 x 3000 px, is assumed"
    assert caplog.messages == [words]


@pytest.mark.parametrize(("words", "message"), [
    ("", "must give the lens by focal .px., fov, fov_vertical or fov_diagonal .degrees., sensor"),
    ("fov = 60, focal = 900", "must have only one of focal and fov: each gives the lens"),
    ("fov = 60, lens = 4, sensor = 6", "must have only one of fov and lens"),
    ("lens = 4.3", "sensor: must be given beside lens, both in mm"),
    ("sensor = 6.17, fov = 60", "lens: must be given beside sensor, both in mm"),
    ("fov = 60, photo = [4, 3]", "photo: must be left out beside fov, which it does not change"),
    ("focal = 900, photo = [4, 3]", "photo: must be left out beside focal"),
    ("fov_diagonal = 84, photo = [21, 9]", "photo: must be no flatter than the image of 3840 x 2"),
    ("sensor = 6.17e-3, lens = 4.7", "lens: must be of a lens that sees 0.2 to 170"),
    ("focal = 24", "focal: must be of a lens that sees .*, not 178.6; focal and the image are"),
    ("fov = 1.47", "fov: must be 3.2 degrees or more, not 1.47; 1.47 radians are 84.2 deg"),
])  # fmt: skip
def test_contradictions_are_named(tmp_path: Path, words: str, message: str) -> None:
    """One line with the table, the field and what is allowed."""
    numbers = ", ".join(["width = 3840, height = 2160", *filter(None, [words])])
    with pytest.raises(ProblemError, match=rf"drones\[0\].camera[.:] ?{message}") as error:
        camera(tmp_path, f"{{ {numbers} }}")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("words", "message"), [
    ("{ width = 3840, height = 2160, fov = 180 }", r"drones\[0\].camera.fov: must be .* < 180"),
    ("{ width = 3840, height = 2160, fov_diagonal = 0 }", r"camera.fov_diagonal: must be .* > 0"),
    ("{ width = 0, height = 2160, fov = 60 }", "width: must be a whole number from 1 to 100,000"),
    ("{ width = 3840, fov = 60 }", "height"),
    ("{ width = 3840, height = 2160, fovv = 60 }", "unknown field `fovv`; did you mean fov"),
    ("7", r"drones\[0\].camera: must be"),
    ('"gopro"', "not 'gopro'; or numbers, such as { width = 3840, height = 2160, fov = 65 }"),
])  # fmt: skip
def test_numbers_out_of_range_are_named(tmp_path: Path, words: str, message: str) -> None:
    """Those that no camera has."""
    with pytest.raises(ProblemError, match=message) as error:
        camera(tmp_path, words)
    assert "\n" not in str(error.value)


def test_the_example_of_numbers_is_one(tmp_path: Path) -> None:
    """The line that the manual has as a comment is read, too."""
    line = next(row for row in EXAMPLE.splitlines() if row.startswith("# camera = "))
    words = line.removeprefix("# camera = ").split("  ")[0]
    assert camera(tmp_path, words).half_angle == pytest.approx(math.radians(65 / 2))


@pytest.mark.parametrize(
    ("tilts", "is_said"), [("0.6", 1), ("0, -1.57", 1), ("0", 0), ("2, 30", 0), ("-90", 0)]
)
def test_tilts_that_may_be_radians_are_asked_about(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, tilts: str, is_said: bool
) -> None:
    """Cameras of ground robots state them so; almost level cameras are rare."""
    known = "{ width = 400, height = 300, focal = 200 }\n"
    camera(tmp_path, f"{known}tilts = [{tilts}]")
    words = f"tilts: {tilts} degrees are almost level: are they radians?"
    assert caplog.text.count(words) == is_said
