"""Small random problems that all properties share: drawn once per session, solved once a process.

The workers of a session draw them together and leave them in a folder for one another.
Most of the time of a property went into drawing problems and counting their plans. So
properties take theirs from here; what brute force finds on them (`brute_force.optimum`) is
remembered, too. The properties that carry the most still draw their own (`drawn_problems`), and
a hunt for bugs (COCAP_OPT_EXAMPLES, HYPOTHESIS_PROFILE) draws anew for all.
"""

import os
import pickle
from collections.abc import Collection, Iterable
from functools import cache
from pathlib import Path
from typing import NamedTuple

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from strategies import MOST_PLANS, QUICK, drawn_meetings, drawn_problems, number_of_plans

from cocap_opt.files.atomic_write import write_atomically
from cocap_opt.problem import Problem

HUNT = "COCAP_OPT_EXAMPLES" in os.environ or "HYPOTHESIS_PROFILE" in os.environ
# How many problems of each kind are drawn.
ALONE, TEAMS, PAIRS, TRIPLES = (12, 20, 10, 8) if QUICK else (50, 80, 45, 35)
FOLDER = "COCAP_OPT_TEST_POOL"  # names the folder in which workers leave what they have drawn


class Drawn(NamedTuple):
    """A problem, and how many plans it has, which is dear to count."""

    problem: Problem
    plans: int


def problems(
    robots: Collection[int] = (1, 2, 3),
    most_plans: int = MOST_PLANS,
    goals: bool = True,
    over_time: bool = False,
) -> st.SearchStrategy[Problem]:
    """Problems of several classes, rules, goals and layers; see `drawn_problems`."""
    if HUNT:
        team = [n for n in (2, 2, 3, 1) if n in robots]
        return drawn_problems(st.sampled_from(team), most_plans, goals, over_time)

    def fits(drawn: Drawn) -> bool:
        problem = drawn.problem
        return (
            len(problem.robots) in robots
            and drawn.plans <= most_plans
            and (goals or all(robot.goal is None for robot in problem.robots))
            and (over_time or not problem.objective.over_time)
        )

    return st.deferred(lambda: st.sampled_from(_problems_of(filter(fits, (*_alone(), *_teams())))))


def meetings(team: int = 2) -> st.SearchStrategy[Problem]:
    """Robots in one another's way, two or three; see `drawn_meetings`."""
    if HUNT:
        return drawn_meetings(team)
    return st.deferred(lambda: st.sampled_from(_problems_of(_meetings(team))))


def _problems_of(pool: Iterable[Drawn]) -> list[Problem]:
    return [drawn.problem for drawn in pool]


@cache
def _alone() -> list[Drawn]:
    return _some("alone", drawn_problems(st.just(1), over_time=True), ALONE)


@cache
def _teams() -> list[Drawn]:
    return _some("teams", drawn_problems(st.sampled_from([2, 3]), over_time=True), TEAMS)


@cache
def _meetings(team: int) -> list[Drawn]:
    return _some(f"meetings-{team}", drawn_meetings(team), PAIRS if team == 2 else TRIPLES)


def _some(kind: str, strategy: st.SearchStrategy[Problem], count: int) -> list[Drawn]:
    """Draws so many problems, the same ones always; those of few plans are first.

    Each comes from a run of its own: in one run more than half are the same, or nearly, for
    hypothesis varies what it has drawn. Of problems in which there is little to choose, or
    nobody to see, a few are kept.
    """
    folder = os.environ.get(FOLDER)
    order = range(count)
    if os.environ.get("PYTEST_XDIST_WORKER", "gw0") != "gw0":
        order = order[::-1]  # two workers that draw at the same time meet in the middle
    by_number = {
        number: _shared(Path(folder) / f"{kind}-{number}", strategy, number)
        if folder
        else _drawn(strategy, number)
        for number in order
    }
    drawn = [by_number[number] for number in range(count)]
    dull = [one for one in drawn if not one.problem.actors or one.plans < 4]
    kept = [one for one in drawn if one not in dull] + dull[: count // 6]
    return sorted(kept, key=lambda one: one.plans)


def _shared(path: Path, strategy: st.SearchStrategy[Problem], number: int) -> Drawn:
    """Reads a problem that another worker of the session has drawn, or draws it for all."""
    if path.exists():
        found: Drawn = pickle.loads(path.read_bytes())
        return found
    drawn = _drawn(strategy, number)
    path.parent.mkdir(exist_ok=True)
    write_atomically({path: pickle.dumps(drawn)})
    return drawn


def _drawn(strategy: st.SearchStrategy[Problem], number: int) -> Drawn:
    """Draws a problem by its number."""
    drawn: list[Problem] = []

    @seed(number)
    @settings(
        max_examples=2,  # the first is the simplest one
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(strategy)
    def keep(problem: Problem) -> None:
        drawn.append(problem)

    keep()
    return Drawn(drawn[-1], number_of_plans(drawn[-1]))
