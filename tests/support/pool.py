"""Small random problems that all properties share: drawn once per process, and solved once.

Most of the time of a property went into drawing problems and counting their plans. So
properties take theirs from here; what brute force finds on them (`brute_force.optimum`) is
remembered, too. The properties that carry the most still draw their own (`drawn_problems`), and
a hunt for bugs (COCAP_OPT_EXAMPLES, HYPOTHESIS_PROFILE) draws anew for all.
"""

import os
from collections.abc import Collection
from functools import cache

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from strategies import MOST_PLANS, QUICK, drawn_meetings, drawn_problems, number_of_plans

from cocap_opt.problem import Problem

HUNT = "COCAP_OPT_EXAMPLES" in os.environ or "HYPOTHESIS_PROFILE" in os.environ
# How many problems of each kind are drawn.
ALONE, TEAMS, PAIRS, TRIPLES = (12, 20, 10, 8) if QUICK else (50, 80, 45, 35)


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

    def fits(problem: Problem) -> bool:
        return (
            len(problem.robots) in robots
            and number_of_plans(problem) <= most_plans
            and (goals or all(robot.goal is None for robot in problem.robots))
            and (over_time or not problem.objective.over_time)
        )

    return st.deferred(lambda: st.sampled_from(list(filter(fits, (*_alone(), *_teams())))))


def meetings(team: int = 2) -> st.SearchStrategy[Problem]:
    """Robots in one another's way, two or three; see `drawn_meetings`."""
    if HUNT:
        return drawn_meetings(team)
    return st.deferred(lambda: st.sampled_from(_meetings(team)))


@cache
def _alone() -> list[Problem]:
    return _some(drawn_problems(st.just(1), over_time=True), ALONE)


@cache
def _teams() -> list[Problem]:
    return _some(drawn_problems(st.sampled_from([2, 3]), over_time=True), TEAMS)


@cache
def _meetings(team: int) -> list[Problem]:
    return _some(drawn_meetings(team), PAIRS if team == 2 else TRIPLES)


def _some(strategy: st.SearchStrategy[Problem], count: int) -> list[Problem]:
    """Draws so many problems, the same ones always; those of few plans are first.

    Each comes from a run of its own: in one run more than half are the same, or nearly, for
    hypothesis varies what it has drawn. Of problems in which there is little to choose, or
    nobody to see, a few are kept.
    """
    drawn = [_drawn(strategy, number) for number in range(count)]
    dull = [problem for problem in drawn if not problem.actors or number_of_plans(problem) < 4]
    kept = [problem for problem in drawn if problem not in dull] + dull[: count // 6]
    return sorted(kept, key=number_of_plans)


def _drawn(strategy: st.SearchStrategy[Problem], number: int) -> Problem:
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
    return drawn[-1]
