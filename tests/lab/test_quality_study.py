import math
import re
import sys
from pathlib import Path
from statistics import fmean

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from studies import rows_of, study

from cocap_opt.data import FloatArray
from cocap_opt.experiments.lab.results import STORED
from cocap_opt.experiments.lab.studies.quality import quality as quality_module
from cocap_opt.experiments.lab.studies.quality.cameras import Cameras
from cocap_opt.experiments.lab.studies.quality.hiding import Hiding
from cocap_opt.experiments.lab.studies.quality.plans import (
    ALL,
    TRIANGULATED,
    is_good,
    plan_in_order,
    plans_of,
    random_plan,
)
from cocap_opt.experiments.lab.studies.quality.quality import (
    stored_accuracy,
    stored_agreement,
    stored_plans,
    stored_steps,
)
from cocap_opt.experiments.lab.studies.quality.rows import PersonStep, PlanRow
from cocap_opt.experiments.lab.studies.quality.tables import (
    accuracy_rows,
    agreement_rows,
    choice_rows,
    sentences,
)
from cocap_opt.experiments.lab.studies.quality.trials import Trials, person_steps
from cocap_opt.experiments.lab.studies.quality.triangulation import (
    by_library,
    has_library,
    least_squares,
    nearest_to_rays,
)
from cocap_opt.experiments.lab.studies.quality.walker import JOINTS, joints_of
from cocap_opt.footage.accuracy import jacobians, turning_jacobians
from cocap_opt.footage.poses import Poses
from cocap_opt.footage.quality import Assumptions
from cocap_opt.footage.shares import visible_shares
from cocap_opt.planners.sequential import sequential
from cocap_opt.problem import Actor
from cocap_opt.problem.shapes import Cuboid, Prism, TriangulatedCuboid
from cocap_opt.referee import check
from cocap_opt.scenarios import SCENES, load_scene
from cocap_opt.scenarios.built_in import places
from cocap_opt.vision.projection import Projection

PAGE = Path(__file__).parents[2] / "docs" / "results" / "quality.md"
POSED = Assumptions(position_error=0.05, attitude_error=math.radians(0.5))


def ring(count: int, points: int) -> Cameras:
    """Cameras around the origin, 10 m away, that look at it from 3 m above; the same for each."""
    bearings = np.arange(count) * 1.1
    places = np.stack([10 * np.cos(bearings), 10 * np.sin(bearings), 0 * bearings + 3], axis=-1)
    axes = Projection.axes_towards(bearings + math.pi, np.full(count, -math.atan(0.3)))
    return Cameras(places, axes, np.full(count, 2500.0)).for_points((points,))


def noisy(cameras: Cameras, points: FloatArray, error: float) -> FloatArray:
    """Images of points with normal errors (px)."""
    images = cameras.images(cameras.seen(points))
    return images + np.random.default_rng(3).normal(size=images.shape) * error


# -- the walker ---------------------------------------------------------------------------

SHAPES = st.sampled_from([Cuboid(), Cuboid(length=0.4, width=0.9), Prism(apothem=0.3),
                          TriangulatedCuboid(), Prism(sides=3, height=0.8)])  # fmt: skip


@given(SHAPES, st.floats(-4, 4), st.floats(0, 2))
def test_walkers_stay_inside_of_their_shape(shape: object, yaw: float, pace: float) -> None:
    """All joints are in the circle that fits into the shape, above the ground, below its top."""
    way = np.arange(12) * pace
    poses = np.stack([way, 0 * way + 7, 0 * way + 2, 0 * way + yaw], axis=-1)
    actor = Actor(poses=poses, shape=shape)  # type: ignore[arg-type]
    from_foot = joints_of(actor, 9) - poses[:9, None, :3]
    assert from_foot.shape == (9, len(JOINTS), 3)
    radius = shape.apothem if isinstance(shape, Prism) else min(shape.length, shape.width) / 2  # type: ignore[attr-defined]
    assert np.hypot(from_foot[..., 0], from_foot[..., 1]).max() <= radius + 1e-9
    assert from_foot[..., 2].min() > 0
    assert from_foot[..., 2].max() < actor.shape.height


def test_arms_swing_against_legs_along_the_way() -> None:
    """A left leg ahead has the right arm ahead; who stands does not swing; bones keep lengths."""
    way = np.arange(0, 3, 0.1)
    poses = np.stack([way, 0 * way, 0 * way, 0 * way], axis=-1)
    joints = joints_of(Actor(poses=poses), len(way)) - poses[:, None, :3]
    at = {name: joints[:, JOINTS.index(name)] for name in JOINTS}
    ahead = at["left knee"][:, 0] - at["left hip"][:, 0]
    arm = at["right elbow"][:, 0] - at["right shoulder"][:, 0]
    assert ahead.max() > 0.1
    assert np.corrcoef(ahead, arm)[0, 1] > 0.99
    assert np.corrcoef(ahead, at["left elbow"][:, 0])[0, 1] < -0.99
    for upper, lower, share in (("hip", "knee", 0.245), ("shoulder", "elbow", 0.186)):
        bones = np.linalg.norm(at[f"left {upper}"] - at[f"left {lower}"], axis=-1)
        np.testing.assert_allclose(bones, share * 1.8)
    still = joints_of(Actor(poses=np.zeros((4, 4))), 4)
    np.testing.assert_array_equal(still, np.broadcast_to(still[:1], still.shape))


# -- cameras and triangulation --------------------------------------------------------------


def test_cameras_move_as_the_derivatives_say() -> None:
    """A little to the side or turned, images shift by what `accuracy` has; axes stay upright."""
    rng, cameras = np.random.default_rng(0), ring(3, 1)
    point = np.array([[0.3, -0.2, 0.9]])
    seen = cameras.seen(point)
    by_point = jacobians(seen, cameras.focal)
    ways, turns = rng.normal(size=(2, 1, 3, 3)) * 1e-5
    for moved, shift in (
        (cameras.moved(ways, 0 * turns), -by_point @ cameras.axes @ ways[..., None]),
        (cameras.moved(0 * ways, turns), turning_jacobians(seen, by_point) @ turns[..., None]),
    ):
        found = cameras.images(seen) - moved.images(moved.seen(point))
        size = np.abs(shift).max()
        assert min(np.abs(found - sign * shift[..., 0]).max() for sign in (1, -1)) < 1e-3 * size
    turned = cameras.moved(ways, 1e5 * turns).axes
    np.testing.assert_allclose(turned @ turned.swapaxes(-1, -2), np.eye(3) * np.ones((1, 3, 1, 1)),
                               atol=1e-12)  # fmt: skip


@given(st.integers(2, 5), st.integers(0, 99))
def test_exact_images_give_the_points(count: int, seed: int) -> None:
    """Least squares, and the point nearest to all rays, are where the images come from."""
    points = np.random.default_rng(seed).uniform(-1, 1, (6, 3))
    cameras = ring(count, 6)
    images = cameras.images(cameras.seen(points))
    np.testing.assert_allclose(nearest_to_rays(cameras, images), points, atol=1e-8)
    white = np.broadcast_to(np.eye(2), (*images.shape, 2))
    np.testing.assert_allclose(least_squares(cameras, images, white, 0 * points), points, atol=1e-6)


def test_least_squares_are_those_of_scipy() -> None:
    """With noise and unequal weights, point by point, beside an optimizer of others."""
    from scipy.optimize import least_squares as by_scipy

    points, cameras = np.random.default_rng(1).uniform(-1, 1, (5, 3)), ring(3, 5)
    images = noisy(cameras, points, 40.0)
    white = np.linalg.inv(np.linalg.cholesky(np.array([[9.0, 2.0], [2.0, 4.0]])))
    whitening = (
        np.broadcast_to(white, (*images.shape, 2)) * np.array([1.0, 2.0, 0.5])[:, None, None]
    )
    found = least_squares(cameras, images, whitening, 0 * points)
    for k in range(len(points)):
        mine = cameras.taken(np.array([k]))

        def errors(point: FloatArray, k: int = k, mine: Cameras = mine) -> FloatArray:
            off = images[k] - mine.images(mine.seen(point[None]))[0]
            return np.asarray((whitening[k] @ off[..., None]).ravel())

        np.testing.assert_allclose(found[k], by_scipy(errors, points[k], xtol=1e-12).x, atol=1e-5)


def test_rays_that_part_are_given_up() -> None:
    """Their least squares are infinitely far away; the search ends, with a number."""
    cameras = ring(2, 1)
    side = Cameras(cameras.places[:, :1] + np.array([[[0.0, 0, 0], [0, 1.0, 0]]]),
                   cameras.axes[:, [0, 0]], cameras.focal)  # fmt: skip
    images = side.images(side.seen(np.zeros((1, 3)))) * [[[1.0], [1.5]]]
    wide = images + np.array([[[-300.0, 0], [300.0, 0]]])
    for each in (wide, -wide):
        found = least_squares(
            side, each, np.broadcast_to(np.eye(2), (1, 2, 2, 2)), np.zeros((1, 3))
        )
        assert np.isfinite(found).all()


def test_the_library_finds_the_points() -> None:
    """Of exact images; of noisy ones about what least squares find."""
    pytest.importorskip("aniposelib", reason="needs aniposelib: pip install -e '.[triangulation]'")
    points, cameras = np.random.default_rng(1).uniform(-1, 1, (5, 3)), ring(3, 5)
    first = Cameras(*(part[0] for part in cameras))
    for error, close in ((0.0, 1e-6), (5.0, 0.01)):
        found = by_library(first, noisy(cameras, points, error))
        np.testing.assert_allclose(found, points, atol=close + 0.01 * error)


# -- plans and trials -------------------------------------------------------------------------


def test_plans_obey_the_rules_and_differ() -> None:
    """Random plans and those in random orders can be flown, and seeds give others."""
    problem = load_scene("corridor", 0)
    for make in (random_plan, plan_in_order):
        made = [make(problem, seed) for seed in (0, 0)]
        assert all(plan is not None and check(problem, plan).valid for plan in made)
        assert made[0] == made[1]
    assert random_plan(problem, 0) != random_plan(problem, 1)
    assert set(TRIANGULATED) < set(ALL)
    assert is_good("sequential") and is_good("order 3")
    assert not is_good("formation") and not is_good("random 0")


def test_joints_are_hidden_as_people_are() -> None:
    """A whole person has all joints in the picture; of a tenth few are; in between both agree."""
    problem = load_scene("bottleneck", 0)
    plan = sequential(problem).plan
    assert plan is not None
    poses, shares = Poses.of(problem, plan), visible_shares(problem, plan)
    steps = problem.horizon + 1
    joints = np.stack([joints_of(a, steps) for a in problem.actors], axis=1)
    t, i, j = np.nonzero(shares > 0)
    cameras = Cameras(poses.places[t, i][:, None, None], poses.axes[t, i][:, None, None],
                      np.full((len(t), 1, 1), 2500.0))  # fmt: skip
    where = joints[t, j] - [*problem.height_map.origin, 0.0]
    sees = Hiding(problem).sees(t, j, i[:, None], cameras, where)[..., 0].mean(axis=1)
    share = shares[t, i, j]
    assert (share > 1 - 1e-9).sum() > 3
    assert (sees[share > 1 - 1e-9] == 1).all()
    assert sees[share >= 0.9].mean() > 0.95  # as the page says
    assert sees[share < 0.1].mean() < 0.1
    assert np.corrcoef(share, sees)[0, 1] > 0.9


def test_predicted_errors_are_those_that_are_measured() -> None:
    """With and without errors of poses, over all person-steps of a plan: as many draws say."""
    problem = load_scene("bridge", 0)
    (planned,) = plans_of(problem, 0, ["sequential"], math.inf)
    assert planned.row.by_two == 1
    rows = list(person_steps(problem, 0, planned, Trials(60, 6, Assumptions(), POSED, False)))
    assert len(rows) == 6
    assert len({(row.step, row.person) for row in rows}) == 6
    for row in rows:
        assert row.middle == pytest.approx(planned.quality.errors[row.step, row.person], rel=1e-3)
        assert row.measured == pytest.approx(row.predicted, rel=0.1)
        assert row.measured_posed == pytest.approx(row.predicted_posed, rel=0.35)
        assert row.predicted < row.predicted_posed
        assert math.isnan(row.library)
        assert row.kept == 1 and row.predicted_kept >= row.predicted * 0.999


@pytest.mark.slow(seconds=8)
def test_the_study_of_a_tiny_scene(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It writes tables that can be read, and says so where the library is not installed."""
    monkeypatch.setitem(sys.modules, "aniposelib", None)
    monkeypatch.setattr(quality_module, "ALL", TRIANGULATED)
    words = ("--scene", "tiny-share", "tiny-hover", "--seeds", 0, "--draws", 2, "--out", tmp_path)
    assert study("quality", *words) == 0
    out, err = capsys.readouterr()
    assert "aniposelib is not installed: pip install -e '.[triangulation]'" in err
    assert "tiny-hover: left out, as it has fewer than two drones with pinhole cameras" in err
    assert "\n tiny " in out
    steps = PersonStep.read(tmp_path / "quality.csv")
    assert {step.cameras for step in steps} == {2}
    assert all(math.isnan(step.library) for step in steps)
    assert len(PlanRow.read(tmp_path / "quality-plans.csv")) >= len(TRIANGULATED)
    assert (tmp_path / "quality.png").stat().st_size > 10_000
    assert not has_library()


def test_what_cannot_be_drawn_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line, the exit code 2, and nothing written."""
    for words, expected in (
        (("--draws", 1), "--draws: must be 2..10000, not 1"),
        (("--seeds", "x"), "--seeds: must be numbers"),
    ):
        assert study("quality", *words, "--out", tmp_path / "out") == 2
        err = capsys.readouterr().err.splitlines()
        assert len(err) == 1 and expected in err[0]
        assert not (tmp_path / "out").exists()


# -- stored results ---------------------------------------------------------------------------


def test_all_scenes_with_two_drones_are_stored() -> None:
    """Each with its plans, three seeds of those that are small; tiny ones if there is a plan."""
    stored = {(row.scene, row.seed) for row in stored_plans()}
    expected = {
        (name, seed)
        for name in SCENES
        if not name.startswith("tiny-")
        for seed in range(1 if name.startswith("field-l") or name in places.SCENES else 3)
    }
    assert {key for key in stored if not key[0].startswith("tiny-")} == expected
    triangulated = {(step.scene, step.seed) for step in stored_steps()}
    assert expected < triangulated <= stored
    assert {step.planner for step in stored_steps()} == set(TRIANGULATED)


def test_the_target_is_met() -> None:
    """The error that is told is within a tenth of what least squares have, in the median."""
    rows = [row for row in rows_of(STORED / "quality.csv") if not row["scene"].startswith("tiny-")]
    ratios = [float(row["measured"]) / float(row["middle"]) for row in rows]
    assert len(ratios) > 1000
    assert 0.9 < np.median(ratios) < 1.1
    assert f"{np.median(ratios):.2f} (" in sentences(stored_steps(), stored_plans())[0]


def test_the_page_tells_what_is_stored() -> None:
    """It inserts both parts; their numbers, computed again by plain means, are those of files."""
    page = PAGE.read_text(encoding="utf-8")
    assert "quote: quality_accuracy" in page and "quote: quality_objective" in page
    steps, plans = stored_steps(), stored_plans()
    shown = {row["scene"]: row for row in accuracy_rows(steps)}
    for scene in ("corridor", "passage", "field-large"):
        of_scene = [step for step in steps if step.scene == scene]
        assert shown[scene]["person-steps"] == len(of_scene)
        middle = np.median([step.measured / step.predicted for step in of_scene])
        assert shown[scene]["measured / predicted"].startswith(f"{middle:.2f} (")
        assert f"| {scene} " in stored_accuracy()
    assert {row["scene"] for row in agreement_rows(plans)} <= set(SCENES)
    for row in choice_rows(plans):
        of_scene = [plan for plan in plans if plan.scene == row["scene"]]
        best = [
            max((p for p in of_scene if p.seed == seed), key=lambda plan: plan.reward).by_two
            for seed in {plan.seed for plan in of_scene}
        ]
        assert row["two views, plan of largest J"] == f"{100 * np.mean(best):.0f} %"


def test_the_words_for_and_against_the_objective_hold() -> None:
    """Over all plans ranks agree, among those that look for J much less, as the sentences say."""
    for_, against, price = sentences([], stored_plans())
    assert for_.startswith("For J:") and against.startswith("Against J:")
    every, among = (
        [float(number) for number in re.findall(r"[+-]\d\.\d\d", said)] for said in (for_, against)
    )
    assert len(every) == len(among) == 3
    assert min(every) > 0.5
    assert all(few < many - 0.2 for few, many in zip(among, every, strict=True))
    beaten, of = map(int, re.findall(r"In (\d+) of (\d+) instances", against)[0])
    assert beaten > of / 2
    assert price.startswith("The gain is ")
    shown = {
        kind: {
            scene: fmean(p.by_two for p in stored_plans() if p[:3:2] == (scene, kind))
            for scene in SCENES
            if not scene.startswith("tiny-")
        }
        for kind in ("formation", "cocap-lns")
    }
    assert {s for s, share in shown["formation"].items() if share >= shown["cocap-lns"][s]} == {
        "bridge", "field-long",
    }  # fmt: skip  # as the page says
    assert all(said.removeprefix("- ") in (for_, against, price)
               for said in stored_agreement().splitlines() if said.startswith("- "))  # fmt: skip


def test_the_stored_rows_are_what_the_study_does() -> None:
    """Those of one plan, made again, are the same but for the library."""
    stored = [s for s in stored_steps() if s[:3] == ("corridor", 0, "sequential")]
    problem = load_scene("corridor", 0)
    (planned,) = plans_of(problem, 0, ["sequential"], math.inf)
    assert planned.row in stored_plans()
    again = list(person_steps(problem, 0, planned, Trials(20, 30, Assumptions(), POSED, False)))
    assert len(again) == len(stored)
    for old, new in zip(stored, again, strict=True):
        assert old._replace(library=math.nan)[:6] == new[:6]
        for name in ("angle", "middle", "predicted", "measured", "measured_posed", "kept"):
            assert getattr(new, name) == pytest.approx(getattr(old, name), rel=2e-3)
