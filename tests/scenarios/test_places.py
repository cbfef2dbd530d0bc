"""Real places: what their files say, and that they can be planned and proved."""

import sys
from pathlib import Path

import numpy as np
import pytest
from others import data
from test_cli import Run

from cocap_opt.data import FloatArray
from cocap_opt.experiments.lab.studies.place import place
from cocap_opt.files.documents import SceneFile, problem_digest
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.touchdowns import LANDING, Touchdowns
from cocap_opt.planners import RECOMMENDED
from cocap_opt.planners.sequential import sequential
from cocap_opt.problem import GoalArea, Problem
from cocap_opt.problem.land_cover import LANDS, in_cells
from cocap_opt.referee import check
from cocap_opt.run.engine import run
from cocap_opt.scenarios import SCENES, load_scene
from cocap_opt.scenarios.built_in.places import FOLDER
from cocap_opt.world.workspace import Workspace

DELFT = FOLDER / "delft"


@pytest.fixture(scope="module")
def delft() -> Problem:
    """The scene, read once."""
    return load_scene("delft")


def test_delft_needs_no_reader_of_maps(monkeypatch: pytest.MonkeyPatch, delft: Problem) -> None:
    """The base install loads it: neither rasterio nor pyproj has a part in that."""
    for module in ("rasterio", "pyproj"):
        monkeypatch.setitem(sys.modules, module, None)
    assert problem_digest(load_scene("delft")) == problem_digest(delft)


def test_delft_says_nothing_when_it_is_read(caplog: pytest.LogCaptureFixture) -> None:
    """A scene that comes with the project has nothing doubtful in it, whatever the seed."""
    for seed in range(3):
        SCENES["delft"](seed)
    load_scene(str(DELFT / "delft-walkers.toml"))
    assert not caplog.records


def test_people_of_delft_walk_where_people_walk(delft: Problem) -> None:
    """Walks are on open ground, clear of houses and gardens, at the pace of people."""
    land = in_cells(delft.land_cover, delft.height_map)
    for actor in delft.actors:
        cells = [delft.height_map.cell_of(x, y) for x, y in actor.poses[:, :2].tolist()]
        kinds = {LANDS[land[cell]] for cell in cells}
        assert kinds <= {"street", "footway", "paved", "green"}, actor.name
        assert not any(delft.height_map.stands_out[cell] for cell in cells)
        pace = np.hypot(*np.diff(actor.poses[:, :2], axis=0).T) / delft.step
        assert 0.5 < pace.max() < 1.6


def test_seeds_of_delft_move_people_alone(delft: Problem) -> None:
    """Another seed has other walks on the same map, with the same drones."""
    other = load_scene("delft", seed=1)
    assert not np.array_equal(other.actors[0].poses, delft.actors[0].poses)
    assert other.robots == delft.robots
    assert np.array_equal(other.height_map.heights, delft.height_map.heights)


def test_land_has_no_part_in_what_a_plan_is_worth(delft: Problem) -> None:
    """Land cover is kept in scene files, and changes no digest."""
    again = SceneFile.of(delft).problem
    assert [a.kind for a in again.land_cover] == [a.kind for a in delft.land_cover]
    assert {a.name for a in again.land_cover} >= {"lane", "Oosteinde", "Rijn-Schie canal", None}
    assert problem_digest(delft.replace(land_cover=())) == problem_digest(delft)


def test_a_place_is_copied_to_be_changed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], delft: Problem
) -> None:
    """The copy is the same scene and says whose data it is; a wrong place or no folder is told."""
    run = Run(capsys, "recipe", "delft", "-o", tmp_path / "shoot", "--json")
    assert run.code == 0
    assert problem_digest(load_scene(run.json["recipe"])) == problem_digest(delft)
    assert "CC BY" in (tmp_path / "shoot" / "README.md").read_text(encoding="utf-8")
    for words, told in (
        (("paris", "-o", tmp_path), "PLACE: must be one of delft, not paris"),
        (("delft",), "--output: must name a folder for the files of delft"),
        (("-o", tmp_path), "--output: needs a PLACE, one of delft"),
    ):
        run = Run(capsys, "recipe", *words)
        assert (run.code, told in run.err) == (2, True), run.err


def test_a_copy_that_was_changed_is_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """To copy a place twice loses nobody's work."""
    words = "recipe", "delft", "-o", tmp_path / "shoot"
    assert [Run(capsys, *words).code for _ in range(2)] == [0, 0]
    recipe = tmp_path / "shoot" / "delft.toml"
    recipe.write_text(f"{recipe.read_text()}# mine\n")
    run = Run(capsys, *words)
    assert run.code == 2
    assert f"{recipe}: exists and has been changed" in run.err
    assert recipe.read_text().endswith("# mine\n")


def test_the_files_are_those_that_the_study_cuts(tmp_path: Path) -> None:
    """The maps are made by `cocap-opt study place`, to the last byte."""
    place(data("delft"), out=tmp_path)
    for made in tmp_path.iterdir():
        assert made.read_bytes() == (DELFT / made.name).read_bytes(), made.name
    assert {file.name for file in DELFT.iterdir()} == {
        *(file.name for file in tmp_path.iterdir()), "delft.toml", "README.md",
        "delft-walkers.toml", "walkers.txt", "walkers-license.txt",
    }  # fmt: skip


def test_drones_of_delft_end_above_free_ground(delft: Problem) -> None:
    """No place in which they may end is above a house, water or the gardens that are closed."""
    (goal,) = {robot.goal for robot in delft.robots}
    assert isinstance(goal, GoalArea)
    cells = tuple(np.array(goal.cells).T)
    assert not delft.height_map.stands_out[cells].any()
    kinds = {LANDS[land] for land in in_cells(delft.land_cover, delft.height_map)[cells].tolist()}
    assert {"street", "green"} <= kinds and not kinds & {"water", "building"}
    gardens = Workspace(delft.height_map, (), delft.workspace.no_fly).forbidden.low[1:]
    assert np.isfinite(gardens).any() and not np.isfinite(gardens[(slice(None), *cells)]).any()


@pytest.mark.slow
def test_nothing_is_said_against_landings_of_delft(delft: Problem) -> None:
    """Neither a roof is below a drone of its plan at the last step, nor another drone near it."""
    plan = sequential(delft).plan
    assert plan is not None
    assert not [*Touchdowns.of(Flight.of(delft, plan, False)).warnings({LANDING})]


@pytest.mark.long(seconds=20)
@pytest.mark.parametrize(("scene", "share"), [("delft", 0.99), ("walkers", 0.97)])
def test_a_shorter_delft_is_planned_and_proved(
    scene: str, share: float, request: pytest.FixtureRequest
) -> None:
    """The recommended plan of its first steps obeys all rules, and a proof shows its gap."""
    short: Problem = request.getfixturevalue(scene).until(2)
    plan = run(short, RECOMMENDED).result
    assert plan.plan is not None and not check(short, plan.plan).violations
    proved = run(short, "branch-and-price").result
    assert proved.bound is not None
    assert proved.bound >= plan.value >= share * proved.bound


NAMES = {
    "Rijn-Schie canal", "Oosteinde", "Oranje Plantage", "'t Carto", "Klaeuwshofje", "lane",
    "courtyard", "mound",
}  # fmt: skip


def test_names_of_delft_are_on_the_map(delft: Problem) -> None:
    """Each is written in its own area, within the map, and the README says where it is from."""
    named = [area for area in delft.land_cover if area.name is not None]
    assert {area.name for area in named} == NAMES and len(named) == len(NAMES)
    low, high = np.array(delft.height_map.ends)
    for area in named:
        assert area.holds(np.array([area.label])).all(), area.name
        assert (low < area.label).all() and (area.label < high).all(), area.name
    told = (DELFT / "README.md").read_text(encoding="utf-8")
    assert all(name in told for name in NAMES)


def test_the_readme_has_the_license_of_everything() -> None:
    """Whose the maps, the tracks and the names are."""
    told = (DELFT / "README.md").read_text(encoding="utf-8")
    for owner in ("BGT", "CC BY", "AHN", "cjio", "PedPy", "5e0f29b", "MIT", "Jülich"):
        assert owner in told, owner
    license = (DELFT / "walkers-license.txt").read_text(encoding="utf-8")
    assert "Copyright (c) 2022 Forschungszentrum Jülich GmbH, IAS-7" in license
    assert all(f"`{file.name}`" in told or file.suffix == ".prj" or file.name == "README.md"
               for file in DELFT.iterdir())  # fmt: skip


@pytest.fixture(scope="module")
def walkers() -> Problem:
    """The scene with recorded people, read once."""
    return load_scene(str(DELFT / "delft-walkers.toml"))


def measured(frame: int) -> FloatArray:
    """The places [4, 2] (m) of people 3 to 6 in a frame of the experiment, in its corridor."""
    rows = (
        line.split() for line in (DELFT / "walkers.txt").read_text(encoding="utf-8").splitlines()
    )
    found = {int(row[0]): row[2:] for row in rows if row[0] != "#" and int(row[1]) == frame}
    return np.array([found[k] for k in (3, 4, 5, 6)], dtype=np.float64) / 100


def test_walkers_are_where_they_were_measured(walkers: Problem) -> None:
    """Each step is a frame of the file, turned by 36.7 degrees and moved: nothing is stretched."""
    turn = np.exp(1j * np.radians(36.7))
    for t, frame in enumerate(range(190, 341, 30)):
        there = measured(frame) @ [1, 1j] * turn + complex(84937.94, 447539.82)
        found = np.array([actor.poses[t, :2] for actor in walkers.actors]) @ [1, 1j]
        assert np.abs(found - there).max() < 1e-6, frame
    assert (walkers.horizon, walkers.step) == (5, 30 / 25)


def test_walkers_stay_in_the_lane(walkers: Problem) -> None:
    """They are clear of houses at every frame, not only at steps."""
    land = in_cells(walkers.land_cover, walkers.height_map)
    turn = np.exp(1j * np.radians(36.7))
    for frame in range(190, 341, 10):
        for there in (measured(frame) @ [1, 1j] * turn + complex(84937.94, 447539.82)).tolist():
            cell = walkers.height_map.cell_of(there.real, there.imag)
            assert LANDS[land[cell]] in {"street", "footway", "paved"}
            assert not walkers.height_map.stands_out[cell]


@pytest.mark.slow
def test_walkers_are_filmed_within_all_limits(walkers: Problem) -> None:
    """A plan obeys all rules, and its smooth flights can be flown."""
    plan = sequential(walkers).plan
    assert plan is not None and not check(walkers, plan).violations
    Flight.of(walkers, plan, True)  # LimitError, if the autopilot's limits were exceeded
