import math
from itertools import product

import numpy as np
import pytest
from strategies import SHARE

from cocap_opt.data import ProblemError
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.pace import Demand
from cocap_opt.flight.rests import LAWS, PARTS, TURNS, Rests
from cocap_opt.flight.smooth import Smooth
from cocap_opt.graph.motion import allowed_moves
from cocap_opt.problem import (
    Actor,
    Airspace,
    CollisionRules,
    Limits,
    Motion,
    Plan,
    Problem,
    Robot,
    State,
    Stride,
)
from cocap_opt.referee import check
from cocap_opt.world.workspace import HeightMap, Mesh

STEPS, SIZE = 4, 9


def share(law: Rests, tau: float) -> float:
    """Returns s(tau) by integrating the speed that the law's page says, in small steps."""
    if law.ramp == PARTS:
        return 10 * tau**3 - 15 * tau**4 + 6 * tau**5
    ramp = law.ramp / PARTS
    times = np.linspace(0, tau, 20001)
    up = np.clip(np.minimum(times, 1 - times) / ramp, 0, 1)
    speed = (3 * up**2 - 2 * up**3) / (1 - ramp)
    return float(np.trapezoid(speed, times))


@pytest.mark.parametrize("law", LAWS)
def test_laws_lead_from_rest_to_rest_as_fast_as_they_say(law: Rests) -> None:
    """Sampled speeds, accelerations and strays are those of the law, and no larger."""
    points = np.array([[[0.0, 0.0, 0.0]], [[3.0, -4.0, 0.0]]]).reshape(1, 2, 3)
    ways = law.between(points)[0, 0]  # [PARTS, 3, 6]
    taus = np.linspace(0, 1, 2001)
    part = np.minimum((taus * PARTS).astype(int), PARTS - 1)
    u = taus * PARTS - part
    basis = np.array([math.comb(5, k) * u**k * (1 - u) ** (5 - k) for k in range(6)]).T
    along = np.einsum("ndk,nk->nd", ways[part], basis) @ np.array([0.6, -0.8, 0.0]) / 5
    for tau, at in list(zip(taus, along, strict=True))[::100]:
        assert at == pytest.approx(share(law, tau), abs=1e-6)
    speed = np.gradient(along, taus)
    assert speed.min() + 1e-6 >= 0 and speed.max() == pytest.approx(law.rate, rel=1e-3)
    bends = np.abs(np.gradient(speed, taus)[2:-2]).max()
    assert 0.98 * law.acceleration < bends < 1.001 * law.acceleration
    assert np.abs(along - taus).max() == pytest.approx(law.stray, rel=1e-3)
    assert (np.abs(along - taus) <= law.stray).all()


def test_strides_are_of_the_moves_that_limits_allow() -> None:
    """What is not known has no bound; a climb and a descent are one."""
    limits = Limits(speed=6.0, climb=3.0, descent=1.5, acceleration=3.0)
    for law in LAWS:
        stride = law.stride(limits, 2.0)
        assert stride == Stride(
            aside=12.0 / law.rate, upright=3.0 / law.rate, space=12.0 / law.acceleration
        )
        assert law.stride(Limits(), 2.0) == Stride()


def drawn(rng: np.random.Generator) -> tuple[Problem, Rests]:
    """A crowded scene of drones with limits, whose moves are those from rest to rest by a law."""
    law = LAWS[int(rng.integers(len(LAWS)))]
    heights = np.where(rng.random((SIZE, SIZE)) < 0.1, 20.0, 0.0)
    datum = rng.random((SIZE, SIZE)) if rng.random() < 0.4 else None
    lift = rng.random((SIZE, SIZE)) if rng.random() < 0.3 else None
    step = float(rng.uniform(0.5, 3))
    limits = Limits(
        speed=float(rng.uniform(1.5, 4)), climb=2.0, descent=float(rng.uniform(0.7, 2)),
        acceleration=float(rng.uniform(1, 6)) if rng.random() < 0.7 else None,
        yaw_rate=TURNS.rate * math.tau / 8 / step, gimbal_rate=TURNS.rate * 0.5 / step,
    )  # fmt: skip
    motion = Motion(
        radius=2, layers=(4.0, 4.8), clearance=0.3, stride=law.stride(limits, step),
        spacing=int(rng.integers(1, 3)),
    )  # fmt: skip
    feet = np.array([2.0, 4.5, 0.0, 0.0]) + np.arange(STEPS + 1)[:, None] * [0.9, 0.1, 0, 0]
    airspace = Airspace(
        no_fly=(Mesh.box((4.2, 4.2, 0.0), (5.0, 5.5, 4.5)),) if rng.random() < 0.5 else (),
        ceiling=5.5 if rng.random() < 0.3 else None,
        people_aside=1.2,
        people_above=None if rng.random() < 0.6 else 2.6,
        people_stray=law.stray,
    )
    camera = {"start": State(0, 0), "motion": motion, "limits": limits}
    cells = rng.permutation(np.argwhere(heights == 0))[: rng.integers(1, 4)].tolist()
    robots = tuple(Robot(**{**camera, "start": State(x, y)}) for x, y in cells)
    problem = Problem(
        name="rests", robots=robots, horizon=STEPS, step=step, airspace=airspace,
        height_map=HeightMap(heights=heights, datum=datum, lift=lift), actors=(Actor(poses=feet),),
        rules=CollisionRules(separation=1.5, vertical=float(rng.choice([0.0, 0.6]))),
    )  # fmt: skip
    return problem, law


def random_plan(problem: Problem, rng: np.random.Generator) -> Plan | None:
    """A plan of random moves, which dart to and fro, drone by drone."""
    paths: list[tuple[State, ...]] = []
    for i, robot in enumerate(problem.robots):
        alone, moves = problem.replace(robots=problem.robots[: i + 1]), robot.motion.moves
        for _ in range(60):
            path = [problem.first_starts[i]]
            for _ in range(STEPS):
                climb, dx, dy = moves[int(rng.integers(len(moves)))]
                a = path[-1]
                new = a._replace(
                    x=a.x + dx, y=a.y + dy, layer=a.layer + climb,
                    heading=int(a.heading + rng.integers(-1, 2)) % 8,
                )  # fmt: skip
                path.append(new if not _fault(alone, i, a, new) else a)
            if check(alone, Plan(paths=(*paths, tuple(path)))).valid:
                paths.append(tuple(path))
                break
        else:
            return None
    return Plan(paths=tuple(paths))


def _fault(problem: Problem, i: int, a: State, b: State) -> str:
    """Says why a drone alone cannot move from a state to another."""
    robot = problem.robots[i].replace(start=a)
    try:
        alone = problem.replace(robots=(robot,), actors=(), horizon=1)
        verdict = check(alone, Plan(paths=((a, b),)))
    except ProblemError as error:
        return str(error)
    return "".join(verdict.violations)


@pytest.mark.slow
def test_every_plan_of_moves_between_rests_has_a_smooth_flight() -> None:
    """Whatever the moves and their order: nothing is near, and no limit is exceeded."""
    rng, flown, rested, most = np.random.default_rng(0), 0, 0, round(60 * SHARE)
    while flown < most:
        try:
            problem, _ = drawn(rng)
            plan = random_plan(problem, rng)
        except ProblemError:
            continue
        if plan is None or plan.stays:
            continue
        made = Smooth.of(problem, plan)
        assert not made.dangers
        assert all(demand.is_kept for demand in Demand.all_of(made.trajectory, is_smooth=True))
        assert Flight.of(problem, plan, smooth=True).is_smooth
        flown, rested = flown + 1, rested + (made.trajectory.parts == PARTS)
    assert rested > most // 6  # or nothing was put to the test


def test_moves_beyond_the_stride_are_none_for_planners_and_referee() -> None:
    """The graph has the moves that the referee allows, on slopes, in lattices, and no other."""
    rng = np.random.default_rng(1)
    for _ in range(12):
        datum = rng.random((5, 5)) * 2 if rng.random() < 0.7 else None
        lift = rng.random((5, 5)) if rng.random() < 0.5 else None
        stride = Stride(
            aside=float(rng.uniform(1, 3)), upright=float(rng.uniform(0.2, 2)),
            space=float(rng.uniform(1, 3)) if rng.random() < 0.7 else None,
        )  # fmt: skip
        motion = Motion(radius=2, layers=(4.0, 5.0), stride=stride, spacing=int(rng.integers(1, 3)))
        height_map = HeightMap(heights=np.zeros((5, 5)), datum=datum, lift=lift)
        problem = Problem(
            name="stride", height_map=height_map, actors=(), horizon=1,
            robots=(Robot(start=State(2, 2), motion=motion),),
        )  # fmt: skip
        found = {
            move for move, starts in allowed_moves(problem.workspace, motion) if starts[0, 2, 2]
        }
        for climb, dx, dy in product((0, 1), range(-2, 3), range(-2, 3)):
            plan = Plan(paths=((State(2, 2), State(2 + dx, 2 + dy, climb)),))
            assert check(problem, plan).valid == ((climb, dx, dy) in found)


def test_ceilings_are_above_the_ground_and_not_above_lifted_heights() -> None:
    """A layer that the lift takes above the ceiling is closed there, and only there."""
    lift = np.zeros((3, 3))
    lift[1, 1] = 2.0
    height_map = HeightMap(heights=np.zeros((3, 3)), datum=np.zeros((3, 3)), lift=lift)
    problem = Problem(
        name="lid", height_map=height_map, actors=(), horizon=1, airspace=Airspace(ceiling=5.0),
        robots=(Robot(start=State(0, 0), motion=Motion(layers=(4.0,))),),
    )  # fmt: skip
    free = problem.robots[0].motion.free_places(problem.workspace)[0]
    assert not free[1, 1] and free.sum() == 8
