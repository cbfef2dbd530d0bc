"""Simulated flights of plans: a row per scene, seed, kind of flight and wind."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from cocap_opt.data import ProblemError
from cocap_opt.experiments.lab.results import load_csv
from cocap_opt.experiments.lab.studies.flight.measures import (
    delays,
    errors,
    least_apart,
    least_clearance,
)
from cocap_opt.experiments.lab.studies.flight.simulation import simulate, span
from cocap_opt.experiments.lab.studies.flight.wind import Wind
from cocap_opt.experiments.lab.studies.separation.separation import built
from cocap_opt.flight.filming import Film, parts_of
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.pace import Demand
from cocap_opt.flight.smooth import Smooth
from cocap_opt.planners import RECOMMENDED
from cocap_opt.problem import SEPARATION, Plan, Problem
from cocap_opt.referee import check
from cocap_opt.run.engine import run
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.hardware import AIRFRAMES
from cocap_opt.stop import TimeLimit

SMOOTH, STRAIGHT = "smooth", "straight"
AIRFRAME = "px4"  # its limits decide the length of steps if a scene does not define it
_SECONDS = 60.0  # time limit of each plan
_FINE = 2  # lengths of steps are multiples of 1 / _FINE s


class FlightRun(NamedTuple):
    """The outcome of the flights of a plan in a simulator.

    Attributes
    ----------
    step : s
    flight : smooth or straight
    wind : m/s
    span : m, width of the vehicle
    error_mean, error_most : m, distance of drones from where they should be
    late_mean, late_most : s
    apart_planned, apart_flown : m, minimum distance between two drones; inf for one drone
    clear_planned, clear_flown : m, minimum distance to obstacles and ground
    reward, reward_flown : J at the steps, of the plan and of what was filmed
    reward_between, reward_between_flown : J between the steps, too, of the flight and as filmed
    """

    scene: str
    seed: int
    robots: int
    separation: float
    step: float
    flight: str
    wind: float
    span: float
    error_mean: float
    error_most: float
    late_mean: float
    late_most: float
    apart_planned: float
    apart_flown: float
    clear_planned: float
    clear_flown: float
    reward: float
    reward_flown: float
    reward_between: float
    reward_between_flown: float

    @property
    def kept(self) -> float:
        """Share of J that is filmed, at the steps."""
        return self.reward_flown / self.reward if self.reward > 0 else 1.0

    @property
    def kept_between(self) -> float:
        """Share of J that is filmed, between the steps, too."""
        return self.reward_between_flown / self.reward_between if self.reward_between > 0 else 1.0

    @classmethod
    def of(cls, flight: Flight, seed: int, wind: Wind) -> "FlightRun":
        """Simulates a flight and measures it."""
        flown, problem = flight.flown, flight.flown.problem
        parts = parts_of(problem)
        made = simulate(flown, parts, wind)
        ticks = (len(made.reference.times) - 1) // problem.horizon
        off, late = errors(made), delays(made)
        moves = check(problem, flight.plan).reward_moves
        lowest = float(min(made.places[..., 2].min(), flown.pieces[:, :, 2].min()))
        rewards = []
        for count in (1, parts):
            film = Film(problem, count, lowest)
            for views in (flown.at(film.moments), made.views(film.moments)):
                rewards.append(film.reward(film.coverages(views)) + moves)
        return cls(
            problem.name, seed, len(problem.robots), problem.rules.separation, flown.step,
            SMOOTH if flight.is_smooth else STRAIGHT, wind.speed, span(),
            float(off.mean()), float(off.max()), *late,
            flown.least_distance(), least_apart(made.places),
            least_clearance(problem, made.reference.states[..., :3], ticks),
            least_clearance(problem, made.places, ticks),
            *rewards,
        )  # fmt: skip

    @classmethod
    def read(cls, path: Path) -> "list[FlightRun]":
        """Returns the rows of a file that the study wrote."""
        return load_csv(path, cls, "flight")


def flown(scene: str, seed: int, winds: Sequence[float], step: float | None) -> Iterator[FlightRun]:
    """Plans a scene, and yields the outcome of its smooth and its straight flight in each wind.

    Scenes whose rules have no separation get the separation of recipes, and starts that allow it.
    If a scene does not define the length of steps, it is `step`, or else that of `fitting_step`.

    Raises
    ------
    ProblemError
        If there is no plan, no flight of the plan, or both the scene and `step` define the length
        of steps; one line.
    """
    problem = load_scene(scene, seed)
    if problem.step is not None and step is not None:
        raise ProblemError(f"--step: must be left out, as {scene} defines it: {problem.step:g} s")
    if not problem.rules.separation:
        problem = built(scene, seed, SEPARATION, SEPARATION)
    problem = problem.replace(earth=None)
    plan = run(problem, RECOMMENDED, TimeLimit(_SECONDS)).result.plan
    if plan is None:
        raise ProblemError(f"{scene} seed {seed}: no plan was found that could be flown")
    try:
        if problem.step is None:
            problem = problem.replace(step=fitting_step(problem, plan) if step is None else step)
        for is_smooth in (True, False):
            flight = Flight.of(problem, plan, is_smooth)
            for speed in winds:
                yield FlightRun.of(flight, seed, Wind(speed, seed))
    except ProblemError as error:
        raise ProblemError(f"{scene} seed {seed}: {error}") from error


def fitting_step(problem: Problem, plan: Plan) -> float:
    """Returns the shortest step (s, a multiple of 0.5) whose smooth flight keeps PX4's limits."""
    made = Smooth.of(problem.replace(step=1.0), plan)
    limits = AIRFRAMES[AIRFRAME]
    slower = [
        demand._replace(limit=getattr(limits, demand.kind)).slower
        for demand in Demand.all_of(made.trajectory, True)
    ]
    return max(1, math.ceil(_FINE * max(slower) - 1e-6)) / _FINE
