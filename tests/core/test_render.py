"""Rendered pixels, and planned coverage against them."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from PIL import Image
from pool import problems
from strategies import examples, tiny
from takes import in_takes

from cocap_opt.cli.commands import run
from cocap_opt.model import Model
from cocap_opt.output.rendered import (
    FaceView,
    Pose,
)
from cocap_opt.problem import Actor, Camera, Cuboid, Motion, Problem, Robot, State
from cocap_opt.scenarios import load_scene
from cocap_opt.vision.render import SKY, TERRAIN, Renderer
from cocap_opt.world.workspace import HeightMap


def face_on(distance: float = 10.0, tilt: float = 0.0) -> Problem:
    """A camera that looks along +x at the back of a box as high as it flies and more."""
    shape = Cuboid(length=1.0, width=2.0, height=10.0)
    pose = [0.5 + distance + 0.5, 0.5, 0.0, 0.0]
    return Problem(
        name="face-on",
        height_map=HeightMap(heights=np.zeros((1, 1))),
        robots=(
            Robot(
                start=State(0, 0),
                motion=Motion(layers=(5.0,)),
                camera=Camera(width=600, height=400, focal=100.0, tilts=(tilt,)),
            ),
        ),
        actors=(Actor(poses=np.array([pose, pose]), shape=shape),),
        horizon=1,
    )


def test_a_face_straight_ahead_has_the_pixels_of_its_size() -> None:
    """2 x 10 m at 10 m and f = 100 px are 20 x 100 px, in the middle of the image."""
    problem = face_on()
    renderer, robot = Renderer(problem), problem.robots[0]
    pixels = renderer.pixels(robot, 1, State(0, 0))
    assert pixels.tolist() == [0.0, 0.0, 2000.0, 0.0, 0.0]  # front, left, back, right, top
    assert renderer.coverage(robot, 1, State(0, 0))[2] == pytest.approx(100.0)
    shown = renderer.picture(robot, 1, State(0, 0))[0]
    assert shown.shape == (400, 600)
    assert (shown[150:250, 290:310] == 2).all()
    assert (shown == 2).sum() == 2000
    assert (shown[shown != 2] == SKY).all()  # the map's one cell lies behind the image


def test_the_ground_is_below_and_the_sky_above() -> None:
    """Half of a level camera's image on a wide plain is terrain."""
    problem = face_on().replace(height_map=HeightMap(heights=np.zeros((1, 1)), resolution=1e4))
    level = Renderer(problem).picture(problem.robots[0], 1, State(0, 0))[0]
    assert set(np.unique(level[:190])) <= {SKY, 2}
    assert set(np.unique(level[210:])) <= {TERRAIN, 2}


def test_blocks_of_pixels_count_as_many() -> None:
    """With a step of 4 there is a ray for 16 pixels."""
    problem = face_on()
    coarse = Renderer(problem, 4)
    assert coarse.pixels(problem.robots[0], 1, State(0, 0))[2] == pytest.approx(2000, rel=0.25)
    assert coarse.picture(problem.robots[0], 1, State(0, 0))[0].shape == (100, 150)


@examples(20)
@given(st.one_of(problems(), in_takes(problems()).map(lambda drawn: drawn.problem)))
def test_planned_pixels_are_rendered_pixels(problem: Problem) -> None:
    """Of faces in full view planned and rendered pixels differ at the edges only."""
    assume(all(isinstance(robot.camera, Camera) for robot in problem.robots))
    model, renderer = Model(problem, use_cache=False), Renderer(problem)
    rng = np.random.default_rng(0)
    for i in range(len(problem.robots)):
        graph = model.class_of[i].graph
        reached = model.reachable(model.class_of[i])
        for t in range(1, problem.horizon + 1):
            state = graph.state(int(rng.choice(np.flatnonzero(reached[t]))))
            for view in FaceView.all_from(model, renderer, [Pose(i, t, state)]):
                edges = 0.02 * view.unhidden + 8 * np.sqrt(view.unhidden) + 8
                assert view.planned <= view.unhidden + edges
                assert view.rendered <= view.unhidden
                if not view.hidden:
                    assert view.planned == pytest.approx(view.rendered, abs=edges)


def test_a_face_that_only_its_corner_shows_is_planned_by_that_corner() -> None:
    """What hides the rest of a face, outside the image, does not count."""
    problem = face_on(tilt=-0.8)  # it looks up, at the upper edge of the box
    walled = np.zeros((30, 1))
    walled[5] = 5.0  # hides the lower half
    camera = problem.robots[0].camera.replace(height=100)
    robots = (problem.robots[0].replace(camera=camera),)
    problem = problem.replace(height_map=HeightMap(heights=walled), robots=robots)
    (view,) = (
        v for v in FaceView.all_from(Model(problem), Renderer(problem), [Pose(0, 1, State(0, 0))])
        if v.face == 2
    )  # fmt: skip
    assert 0 < view.rendered == view.unhidden
    assert view.planned == pytest.approx(view.rendered, rel=0.05)


def test_rendered_reward_is_near_the_planned_one() -> None:
    """J of rendered pixels, where the camera's image is large enough to count them."""
    problem = load_scene("tiny-share")
    model = Model(problem)
    from cocap_opt.planners import PLANNERS
    from cocap_opt.referee import check
    from cocap_opt.stop import never

    plan = PLANNERS["cocap"](problem, never).plan
    assert plan is not None
    views = list(FaceView.all_from(model, Renderer(problem), Pose.all_of(plan, problem.first_step)))
    verdict = check(problem, plan)
    rendered = FaceView.reward(problem, views, verdict.reward_moves)
    assert rendered == pytest.approx(verdict.reward, rel=0.02)
    row = FaceView.errors(views)
    assert row["faces"] == len(views) and row["clear"] + row["hidden"] <= len(views)


def test_errors_are_of_all_faces_that_are_large_by_plan_or_in_the_picture() -> None:
    """A face that is planned and not in the picture at all is the largest error there is."""

    def seen(planned: float, rendered: float, unhidden: float) -> FaceView:
        return FaceView(Pose(0, 1, State(0, 0)), 0, 1.0, planned, rendered, unhidden)

    views = [seen(500, 400, 1000), seen(399, 399, 1000), seen(0, 400, 900), seen(500, 500, 500)]
    row = FaceView.errors(views)
    assert (row["clear"], row["hidden"], row["hidden, largest error (%)"]) == (1, 2, 100.0)
    row = FaceView.errors([*views, seen(5000, 0, 6000)])
    assert (row["hidden"], row["hidden, median error (%)"]) == (3, 100.0)
    assert row["hidden, largest error (%)"] == np.inf


def test_render_writes_pictures_and_a_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A PNG per drone and step, and what every face has."""
    plan, folder = tmp_path / "plan.json", tmp_path / "views"
    assert run(["plan", "tiny-share", "-o", str(plan)]) == 0
    assert run(["render", "tiny-share", str(plan), "-o", str(folder), "--width", "200"]) == 0
    problem = load_scene("tiny-share")
    names = sorted(path.name for path in folder.glob("*.png"))
    assert len(names) == len(problem.robots) * (problem.horizon + 1)
    with Image.open(folder / names[0]) as picture:
        assert picture.width == min(problem.robots[0].camera.width, 200)
    header, *rows = (folder / "coverage.csv").read_text().splitlines()
    assert header.startswith("robot,step,actor,face,planned (px/m2),rendered (px/m2)")
    assert rows
    assert run(["render", "tiny-share", str(plan), "-o", str(folder), "--width", "0"]) == 2
    assert "--width" in capsys.readouterr().err


def test_nobody_to_see() -> None:
    """Without actors there is terrain and sky."""
    problem = tiny().replace(actors=())
    renderer = Renderer(problem)
    state = problem.robots[0].start
    assert renderer.pixels(problem.robots[0], 1, state).shape == (0,)
    assert set(np.unique(renderer.picture(problem.robots[0], 1, state)[0])) <= {SKY, TERRAIN}
