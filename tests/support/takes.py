"""Random problems with takes, and the mean over takes by problems without any.

Nothing of `cocap_opt.problem.takes` is used: the problem of each take is put together anew from the
people as they were drawn, and J is computed there.
"""

import math
from typing import NamedTuple

import numpy as np
from brute_force import all_paths, bonus_of, pixels_of, views_of
from hypothesis import assume
from hypothesis import strategies as st
from strategies import actors

from cocap_opt.data import ProblemError
from cocap_opt.problem import Actor, Plan, Problem, Take, Views
from cocap_opt.referee import _Referee, check


class InTakes(NamedTuple):
    """A problem with takes, and that of each take alone with its probability."""

    problem: Problem
    alone: list[tuple[float, Problem]]

    def mean(self, plan: Plan) -> float:
        """J of a plan: the mean of what the referee finds in each take, moves and all."""
        return math.fsum(p * check(part, plan).reward for p, part in self.alone)

    def optimum(self) -> tuple[Plan | None, float]:
        """The best of all plans that are safe in each take, on average, one by one."""
        robots = range(len(self.problem.robots))
        paths = [all_paths(self.problem, robot) for robot in robots]
        means = np.zeros([len(of_robot) for of_robot in paths])
        if not means.size:
            return None, -math.inf
        for p, part in self.alone:
            means += p * self._views(part, paths)
        for robot in robots:
            bonuses = np.array([bonus_of(self.problem, path) for path in paths[robot]])
            means += bonuses.reshape([-1 if i == robot else 1 for i in robots])
        for flat in np.argsort(-means, axis=None, kind="stable").tolist():
            at = np.unravel_index(flat, means.shape)
            plan = Plan(paths=tuple(paths[i][k] for i, k in enumerate(at)))
            if all(_obeys(part, plan) for _, part in self.alone):
                return plan, float(means[at])
        return None, -math.inf

    @staticmethod
    def _views(part: Problem, paths: list[list[tuple]]) -> np.ndarray:
        """View rewards [n, ..] of all combinations of paths in one take."""
        if not part.actors:
            return np.zeros([len(of_robot) for of_robot in paths])
        shape = [len(of_robot) for of_robot in paths]
        pixels = np.zeros((1, part.horizon + 1, pixels_of(part, 0, []).shape[2]))
        for i, of_robot in enumerate(paths):
            more = pixels_of(part, i, of_robot)
            pixels = (pixels[:, None] + more).reshape(-1, *more.shape[1:])
        return views_of(part, pixels).reshape(shape)


def _obeys(problem: Problem, plan: Plan) -> bool:
    """True if a plan obeys the rules of a problem; what it sees is not looked at."""
    return not (_Referee(problem).violations(plan) or _Referee(problem).conflicts(plan))


@st.composite
def in_takes(draw: st.DrawFn, drawn: st.SearchStrategy[Problem], counting: bool = True) -> InTakes:
    """Problems as `drawn` with other people, of whom some are in one take each, some in all.

    With `counting` some of them count the drones that see people, with a weight for each.
    """
    plain = draw(drawn)
    shares = draw(st.lists(st.integers(0, 4), min_size=1, max_size=3).filter(any))
    takes = tuple(
        Take(name=f"take {'abc'[k]}", probability=share / sum(shares))
        for k, share in enumerate(shares)
    )
    people = draw(st.lists(actors(plain.height_map, plain.horizon), min_size=1, max_size=2))
    # Side by side or within each other, people of one take hide each other, and of two do not.
    near = st.sampled_from([(0.3, 0.2, 0.0, 0.4), (0.9, -0.7, 0.0, 0.0), (-0.2, 1.3, 0.0, 2.0)])
    for aside in draw(st.lists(near, max_size=2)):
        poses = people[0].poses + np.array(aside)
        people.append(draw(st.sampled_from(people)).replace(poses=poses, importance=None))
    if plain.objective.over_time:
        people = [person.replace(importance=None) for person in people]
    names = [None, *(take.name for take in takes)]
    people = [person.replace(take=draw(st.sampled_from(names))) for person in people]
    if draw(st.booleans()):  # somebody walks the same way in another take
        people.append(people[0].replace(take=takes[-1].name))
    objective = plain.objective
    weights: tuple[float, ...] | float = 1.0
    if counting and draw(st.booleans()):
        weight = st.sampled_from([0.0, 3.0, 20.0])
        weights = draw(st.one_of(weight, st.tuples(*[weight] * len(people))))
        views = Views(
            cameras=draw(st.sampled_from([1, 2])), weight=weights,
            at_least=draw(st.sampled_from([0.02, 0.3])),
        )  # fmt: skip
        objective = objective.replace(views=views, pixels=draw(st.sampled_from([1.0, 0.0])))
    try:
        problem = plain.replace(actors=tuple(people), takes=takes, objective=objective)
    except ProblemError:
        assume(False)
    alone = []
    for take in takes:
        inside = [j for j, person in enumerate(people) if person.take in (None, take.name)]
        mine = objective
        if objective.views is not None and isinstance(weights, tuple):
            chosen = tuple(weights[j] for j in inside)
            mine = objective.replace(views=objective.views.replace(weight=chosen))
        there: tuple[Actor, ...] = tuple(people[j].replace(take=None) for j in inside)
        alone.append((take.probability, plain.replace(actors=there, objective=mine)))
    return InTakes(problem, alone)


def random_plan(problem: Problem, rng: np.random.Generator) -> Plan | None:
    """A plan of paths at random, which need not obey the rules between drones; or None."""
    paths = [all_paths(problem, robot) for robot in range(len(problem.robots))]
    if not all(paths):
        return None
    return Plan(paths=tuple(of_robot[rng.integers(len(of_robot))] for of_robot in paths))
