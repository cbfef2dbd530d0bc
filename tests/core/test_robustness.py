import math
from dataclasses import replace

import numpy as np
import pytest
from losing import value_with
from test_flight import STEPS, counted, flights

from cocap_opt.data import FloatArray
from cocap_opt.flight import filming
from cocap_opt.flight.filming import view_reward
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.robustness import Robustness, missing_distance
from cocap_opt.flight.trajectory import Trajectory
from cocap_opt.footage.losses import Losses, steps_in_words
from cocap_opt.footage.quality import Quality
from cocap_opt.problem import (
    Actor,
    Airspace,
    CollisionRules,
    Motion,
    Objective,
    Plan,
    Problem,
    Robot,
    State,
    Take,
)
from cocap_opt.problem.takes import of_people
from cocap_opt.world.workspace import HeightMap

FINE = 4e-3  # m, by which the least of samples may be more than the least
STEP = 0.5  # s, of the random scenes


def teams() -> list[tuple[Problem, Plan, Trajectory]]:
    """Some random scenes of several drones, with plans and smooth flights."""
    found = [(problem, plan, made.trajectory) for problem, plan, made in flights()]
    return [one for one in found if len(one[0].robots) > 1][:2]


def places(flown: Trajectory, times: FloatArray) -> FloatArray:
    """Where drones are [R, n, 3] m at some times; they hover before and after."""
    return flown.at(np.clip(times, 0.0, flown.seconds)).place.reshape(len(flown.pieces), -1, 3)


def least(one: FloatArray, others: FloatArray) -> float:
    """The least of distances [.., n, d] from places [n, d]."""
    return float(np.linalg.norm(others - one, axis=-1).min())


@pytest.mark.parametrize("lag", [0.13, 1.7])
def test_drones_that_lag_are_as_near_as_samples_say(lag: float) -> None:
    """Whichever drone is late by part of a step or several, until it has finished: the minimum
    distances to the others and to people, who then stand.
    """
    for problem, _, flown in teams():
        (actor,) = problem.actors
        times = np.linspace(0.0, flown.seconds + lag, 2001)
        punctual, late = places(flown, times), places(flown, times - lag)
        pairs = [least(late[i], np.delete(punctual, i, axis=0)) for i in range(len(late))]
        pairs += [least(punctual[i], punctual[i + 1 :]) for i in range(len(late) - 1)]
        found = Robustness(flown).with_laggard(lag)
        assert min(pairs) - FINE <= found.apart <= min(pairs) + 1e-9
        walk = [np.interp(times / STEP, range(STEPS + 1), axis) for axis in actor.middles[:, :2].T]
        aside = least(np.column_stack(walk), late[..., :2])
        aside = min(aside, least(np.column_stack(walk), punctual[..., :2]))
        assert aside - FINE <= found.aside <= aside + 1e-9


@pytest.mark.parametrize("late", [-1.2, 0.13])
def test_people_who_are_late_or_early_are_as_near_as_samples_say(late: float) -> None:
    """They stand before they begin and after they end; the flight's duration counts."""
    for problem, _, flown in teams():
        (actor,) = problem.actors
        times = np.linspace(0.0, flown.seconds, 2001)
        steps = (times - late) / STEP
        walk = [np.interp(steps, range(STEPS + 1), axis) for axis in actor.middles[:, :2].T]
        expected = least(np.column_stack(walk), places(flown, times)[..., :2])
        found = Robustness(flown).with_people(late=late)
        assert expected - FINE <= found.aside <= expected + 1e-9


@pytest.mark.parametrize("people_count", [False, True])
def test_what_is_filmed_is_that_of_another_scene_or_plan(people_count: bool) -> None:
    """Whole steps late, a metre aside: J of a scene, or of a plan, in which that is so."""
    problem, plan, _ = teams()[0]
    if people_count:
        problem = counted(problem, 0.3, weight=100.0)
    straight = Trajectory.straight(problem, plan)
    robustness = Robustness(straight)
    (actor,) = problem.actors

    def reward(poses: FloatArray) -> float:
        other = problem.replace(actors=(actor.replace(poses=poses),), airspace=Airspace())
        return view_reward(Trajectory.straight(other, plan), 4)

    poses = actor.poses
    assert robustness.as_planned.reward == pytest.approx(reward(poses), rel=1e-12)
    late = robustness.with_people(late=STEP).reward
    assert late == pytest.approx(reward(np.vstack([poses[:1], poses[:-1]])), rel=1e-9)
    early = robustness.with_people(late=-STEP).reward
    assert early == pytest.approx(reward(np.vstack([poses[1:], poses[-1:]])), rel=1e-9)
    yaw = poses[:, 3]
    left = poses + np.column_stack([-np.sin(yaw), np.cos(yaw), 0 * yaw, 0 * yaw])
    assert robustness.with_people(left=1.0).reward == pytest.approx(reward(left), rel=1e-9)
    worst = []
    for i, path in enumerate(plan.paths):
        paths = [*plan.paths]
        paths[i] = (path[0], *path[:-1])
        worst.append(view_reward(Trajectory.straight(problem, Plan(paths=tuple(paths))), 4))
    assert robustness.with_laggard(STEP).reward == pytest.approx(min(worst), rel=1e-9)


def test_a_late_drone_that_ends_among_people_breaks_the_rules() -> None:
    """It flies through somebody who has stopped by then, after the last step of the plan."""
    walk = Actor(poses=np.array([[5.5, 6.5 - t, 0.0, -math.pi / 2] for t in range(7)]))
    path = tuple(State(x, 0) for x in range(3, 10))
    problem = Problem(
        name="late", height_map=HeightMap(heights=np.zeros((14, 8))), actors=(walk,), horizon=6,
        robots=(Robot(start=path[0]),), step=1.0, airspace=Airspace(people_aside=2.0),
    )  # fmt: skip
    found = Robustness(Trajectory.straight(problem, Plan(paths=(path,)))).with_laggard(6.0)
    assert found.aside == pytest.approx(0.0, abs=1e-3)
    assert found.missing["people"] == pytest.approx(2.0, abs=1e-3)


def test_rules_are_kept_as_long_as_they_are() -> None:
    """One drone follows another 3 m behind at 1 m/s, past somebody who stands 2.5 m aside."""
    person = Actor(poses=np.tile([6.5, 3.0, 0.0, 0.0], (6, 1)))  # looks along the flights
    problem = Problem(
        name="row", height_map=HeightMap(heights=np.zeros((12, 4))), actors=(person,), horizon=5,
        robots=(Robot(start=State(0, 0)), Robot(start=State(3, 0))), step=1.0,
        rules=CollisionRules(separation=2.0), airspace=Airspace(people_aside=2.2),
    )  # fmt: skip
    plan = Plan(paths=tuple(tuple(State(x + k, 0) for k in range(6)) for x in (0, 3)))
    robustness = Robustness(Trajectory.straight(problem, plan))
    nobody, drones, people = set[str](), {"drones"}, {"people"}
    for lag, near in ((0.99, nobody), (1.01, drones)):
        found = robustness.with_laggard(lag)
        assert (found.apart, found.aside) == pytest.approx((3 - lag, 2.5))
        assert found.too_near == near
        assert found.missing.get("drones", 0.0) == pytest.approx(max(lag - 1, 0.0), abs=2e-4)
    for left, near in ((1.0, nobody), (-0.29, nobody), (-0.31, people)):
        found = robustness.with_people(left=left)
        assert (found.apart, found.aside) == pytest.approx((3.0, 2.5 + left))
        assert found.too_near == near
        assert found.missing.get("people", 0.0) == pytest.approx(max(-0.3 - left, 0.0), abs=2e-4)


@pytest.mark.slow
def test_the_missing_distance_is_that_of_samples() -> None:
    """Random polynomials, with and without a distance in height beside which none is asked for."""
    rng, missed, shares = np.random.default_rng(3), 0, np.linspace(0, 1, 4001)
    bernstein = np.column_stack(
        [math.comb(5, k) * shares**k * (1 - shares) ** (5 - k) for k in range(6)]
    )
    for k in range(60):
        ways = rng.normal(0, 2, (3, 3, 6))
        rules = CollisionRules(separation=1.5, vertical=0.0 if k % 2 else 1.0)
        points = np.einsum("nik,tk->nti", ways, bernstein).reshape(-1, 3)
        counts = np.abs(points[:, 2]) < 1.0 if rules.vertical else np.ones(len(points), np.bool_)
        flat = points[:, :2] if rules.vertical else points
        lacks = (1.5 - np.linalg.norm(flat[counts], axis=-1)).max(initial=0.0)
        found = missing_distance(ways, rules)
        assert lacks - 1e-5 <= found <= lacks + FINE
        missed += lacks > 0.1
    assert 10 < missed < 60


@pytest.mark.long
@pytest.mark.parametrize("over_time", [False, True])
@pytest.mark.parametrize("people_count", [False, True])
def test_a_lost_drone_leaves_what_another_evaluator_says(
    over_time: bool, people_count: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each drone at each step: J at the steps, and who is seen by a scene without the drone."""
    monkeypatch.setattr(filming, "PARTS", 1)
    for problem, plan, _ in teams()[:1]:
        objective = Objective(
            stationarity=7.0, keep_heading=0.5, over_time=over_time, count_start=over_time
        )
        scene = problem.replace(objective=objective)
        scene = counted(scene, 0.3, weight=100.0) if people_count else scene
        losses = Losses(Flight.of(scene, plan, smooth=False))
        seen = Quality.of(scene, plan).views
        for row in losses.rows([0, 2, STEPS]):
            i, step = row.lost_drone, row.lost_step
            assert row.left.reward == pytest.approx(value_with(scene, plan, step, [i]), rel=1e-9)
            others = scene.replace(robots=tuple(np.delete(np.array(scene.robots, object), i)))
            paths = (*plan.paths[:i], *plan.paths[i + 1 :])
            views = np.vstack([seen[:step], Quality.of(others, Plan(paths=paths)).views[step:]])
            views = views[scene.first_step :]
            assert row.seen.by_two == pytest.approx((views >= 2).mean())
            assert row.seen.by_none == pytest.approx((views == 0).mean())
            gone = {t for found in row.seen.no_longer for t in found.steps}
            both = (seen[scene.first_step :] >= 2) & (views < 2)
            assert gone == {t + scene.first_step for t in np.flatnonzero(both.any(axis=1))}
        for i in range(len(plan.paths)):
            left = [value_with(scene, plan, step, [i]) for step in range(STEPS + 1)]
            worst = losses.worst_step(i)
            assert (
                left[worst] == pytest.approx(min(left))
                and (np.array(left[worst + 1 :]) > min(left)).all()
            )


def test_a_lost_drone_is_near_nobody_once_it_is_gone() -> None:
    """Until its step it counts as all others do."""
    for problem, _, flown in teams():
        robustness = Robustness(flown)
        for step in (0, 2):
            found, times = robustness.with_lost(0, step), np.linspace(0, flown.seconds, 2001)
            at = places(flown, times)
            before = times <= step * STEP
            pairs = [least(at[i], at[i + 1 :]) for i in range(1, len(at) - 1)]
            pairs += [least(at[0, before], at[1:, before])] if step else []
            expected = min(pairs, default=np.inf)
            assert found.apart == pytest.approx(expected, abs=FINE)
            assert problem.actors and found.aside >= robustness.as_planned.aside - 1e-9


def test_steps_are_named_in_runs() -> None:
    """Runs of steps are told by their ends."""
    assert steps_in_words([4]) == "step 4"
    assert steps_in_words([0, 1, 2, 5, 7, 8]) == "steps 0-2, 5, 7-8"


def test_each_take_is_the_scene_of_its_people_alone() -> None:
    """J of takes has J as planned as its mean; nobody of another take is near a drone."""
    problem, _, made = flights()[0]
    walkers = problem.actors
    takes = (Take("as planned", 0.25), Take("aside", 0.75))
    poses = [actor.poses + np.array([3.0, 0.0, 0.0, 0.0]) for actor in walkers]
    people = (
        *(actor.replace(take="as planned") for actor in walkers),
        *(
            actor.replace(take="aside", poses=moved)
            for actor, moved in zip(walkers, poses, strict=True)
        ),
    )
    objective = of_people(problem.objective, len(walkers), [*range(len(walkers))] * 2)
    both = problem.replace(actors=people, takes=takes, objective=objective, airspace=Airspace())
    flown = replace(made.trajectory, problem=both)
    robustness = Robustness(flown)
    found = [robustness.with_take(k) for k in range(2)]
    alone = Robustness(replace(made.trajectory, problem=problem.replace(airspace=Airspace())))
    assert found[0].reward == pytest.approx(alone.as_planned.reward)
    mean = sum(take.probability * each.reward for take, each in zip(takes, found, strict=True))
    assert robustness.as_planned.reward == pytest.approx(mean)
    assert min(each.aside for each in found) == pytest.approx(robustness.as_planned.aside)


def test_takes_count_by_their_probability() -> None:
    """Two drones see the person of the likely take, and nobody that of the other: 90 and 10 %."""
    drone = Robot(start=State(3, 0), motion=Motion(headings=1))
    walks = [np.tile(pose, (3, 1)) for pose in ([9.0, 1.0, 0.0, math.pi], [1.0, 5.5, 0.0, 0.0])]
    scene = Problem(
        name="takes", height_map=HeightMap(heights=np.zeros((14, 8))), horizon=2, step=1.0,
        robots=(drone, drone.replace(start=State(3, 1))),
        actors=(Actor(poses=walks[0], take="likely"), Actor(poses=walks[1], take="unlikely")),
        takes=(Take("likely", 0.9), Take("unlikely", 0.1)),
    )  # fmt: skip
    plan = Plan(paths=tuple((robot.start,) * 3 for robot in scene.robots))
    losses = Losses(Flight.of(scene, plan, smooth=False))
    found = losses.seen(losses.as_planned)
    assert (found.by_two, found.by_none) == pytest.approx((0.9, 0.1))
    assert found.by_two == pytest.approx(Quality.of(scene, plan).summary.by_two)
