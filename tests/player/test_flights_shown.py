"""Flights as the player shows them: smooth between the steps, where that is safe."""

from typing import Any

import numpy as np
import pytest
from players import crossing, planned
from scipy.interpolate import BPoly
from test_flight import flights

from cocap_opt.flight.safety import Nearest
from cocap_opt.flight.smooth import Smooth, spare
from cocap_opt.flight.trajectory import Trajectory
from cocap_opt.player.player import Player
from cocap_opt.player.player_flight import knots
from cocap_opt.player.player_scene import PlayerScene
from cocap_opt.problem import CollisionRules, Plan, Problem
from cocap_opt.scenarios import load_scene

CLOSE = 2e-3  # m and rad: what is left out of the numbers of a page


def shown(problem: Problem, plan: Plan) -> dict[str, Any]:
    """What a page is told of a plan."""
    (found,) = Player(problem, [("", plan)]).data()["plans"]
    return dict(found)


def at(rows: list[list[float]], times: Any) -> Any:
    """Poses [n, 5] at times on the polynomials between rows, by SciPy."""
    table = np.array(rows)
    values = table[:, 1:].reshape(len(rows), 3, 5)
    return BPoly.from_derivatives(table[:, 0], values)(times)


def closely() -> list[tuple[Problem, Plan, Smooth]]:
    """Flights that are cut short as they would come too close to people."""
    found = []
    for problem, plan, _ in flights():
        near = Nearest.of_people(Trajectory.straight(problem, plan))
        assert near is not None
        least = near.distance - spare(problem, problem.robots[0])
        if least >= 0.1:
            problem = problem.replace(airspace=problem.airspace.replace(people_aside=least))
            found.append((problem, plan, Smooth.of(problem, plan)))
    return found


@pytest.mark.slow
def test_the_page_has_the_flight_that_was_checked() -> None:
    """At all times its drones are where the smooth flight is, and look as it says."""
    fewer = 0
    for problem, _, smooth in [*flights(), *closely()]:
        flown, scene = smooth.trajectory, PlayerScene(problem)
        times = np.linspace(0, problem.horizon, 40 * problem.horizon + 1)
        expected = flown.at(times * flown.step)
        each = zip(
            knots(scene, flown), np.split(expected.place, len(problem.robots)),
            np.split(expected.yaw, len(problem.robots)),
            np.split(expected.pitch, len(problem.robots)), strict=True,
        )  # fmt: skip
        for rows, place, yaw, pitch in each:
            poses = at(rows, times)
            np.testing.assert_allclose(poses[:, :3], scene.local(place), atol=CLOSE)
            np.testing.assert_allclose(poses[:, 3], yaw, atol=CLOSE)
            np.testing.assert_allclose(poses[:, 4], -pitch, atol=CLOSE)
            assert {*range(problem.horizon + 1)} <= {row[0] for row in rows}
            fewer += len(rows) < flown.parts * problem.horizon + 1
    assert fewer > 0


@pytest.mark.slow
def test_a_plan_whose_smooth_flight_is_unsafe_flies_straight() -> None:
    """The page then has no rows; drones that only wait, or never move, need none either."""
    for problem, plan, _ in flights():
        assert shown(problem, plan)["knots"] is not None
    crossed, plan = crossing()
    apart = crossed.replace(rules=CollisionRules(separation=0.9))
    assert shown(crossed, plan)["knots"] is not None and shown(apart, plan)["knots"] is None
    scene = load_scene("tiny-share", 0)
    (waits,) = Player(scene).data()["plans"]
    stay = Plan(paths=tuple((robot.start,) * (scene.horizon + 1) for robot in scene.robots))
    assert waits["knots"] is None and shown(scene, stay)["knots"] is None


@pytest.mark.slow
def test_the_closest_approach_is_that_of_the_flight_shown() -> None:
    """As `fly` has it, smooth or straight, beside that of straight legs; it is marked if near."""
    for problem, plan, smooth in flights():
        closest = shown(problem, plan)["closest"]
        if len(problem.robots) == 1:
            assert closest is None
            continue
        straight = Trajectory.straight(problem, plan).least_distance()
        assert closest["apart"] == pytest.approx(smooth.trajectory.least_distance(), abs=1e-4)
        assert closest["straight"] == pytest.approx(straight, abs=1e-4)
    scene = load_scene("bottleneck", 0)
    ((_, plan),) = planned(scene, "cocap")
    flown = Smooth.of(scene.replace(step=1.0), plan).trajectory
    told = shown(scene, plan)
    assert told["closest"]["apart"] == pytest.approx(flown.least_distance(), abs=1e-4)
    drones = [near for near in told["near"] if "person" not in near]
    assert told["closest"]["apart"] == min(near["apart"] for near in drones)
    for near in drones:
        rows = [told["knots"][i] for i in near["robots"]]
        apart = np.subtract(*(at(own, [near["time"]])[0, :3] for own in rows))
        assert np.linalg.norm(apart) == pytest.approx(near["apart"], abs=5e-3)
