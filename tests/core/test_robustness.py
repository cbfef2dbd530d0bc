import numpy as np
import pytest
from test_flight import STEPS, counted, flights

from cocap_opt.data import FloatArray
from cocap_opt.flight.filming import view_reward
from cocap_opt.flight.robustness import Robustness
from cocap_opt.flight.trajectory import Trajectory
from cocap_opt.problem import Actor, Airspace, CollisionRules, Plan, Problem, Robot, State
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
    """Whichever drone is late by part of a step or several: its least distance to the others."""
    for _, _, flown in teams():
        times = np.linspace(0.0, flown.seconds + lag, 2001)
        punctual, late = places(flown, times), places(flown, times - lag)
        pairs = [least(late[i], np.delete(punctual, i, axis=0)) for i in range(len(late))]
        pairs += [least(punctual[i], punctual[i + 1 :]) for i in range(len(late) - 1)]
        found = Robustness(flown).with_laggard(lag)
        assert min(pairs) - FINE <= found.apart <= min(pairs) + 1e-9


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
    for left, near in ((1.0, nobody), (-0.29, nobody), (-0.31, people)):
        found = robustness.with_people(left=left)
        assert (found.apart, found.aside) == pytest.approx((3.0, 2.5 + left))
        assert found.too_near == near
