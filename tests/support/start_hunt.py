"""Problems with free starts against brute force over all starts and paths: a hunt for wrong bounds.

`python tests/support/start_hunt.py 10000` draws so many small problems, with rules, goals, takes
and both returns, and asks of each: planners' plans are valid and no better than the optimum, bounds
and certificates are no less, and what is called optimal is. It stops at the first that is wrong,
made small.
"""

import argparse
import math
import sys
import time
from collections import Counter
from typing import NamedTuple

from brute_force import optimum
from counting import either
from hypothesis import HealthCheck, Phase, assume, given, seed, settings
from hypothesis import strategies as st
from strategies import drawn_meetings, drawn_problems, number_of_plans, with_choices
from takes import InTakes, in_takes

from cocap_opt.data import ProblemError
from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.certificates import verify
from cocap_opt.formulations.result import CertifiedResult
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import NO_RULES, Problem, State
from cocap_opt.referee import check
from cocap_opt.result import Reason, UnsupportedError

BATCH = 100  # problems of one seed
# Planners and bounds that take part at random, beside branch-and-price, which always does.
PLANNED = ("greedy-lazy", "sequential-rounds", "cocap", "cocap-vs", "cocap-lns")
MOST_PLANS = 5000
LONGER = ("cocap-prices",)  # of which fewer problems are asked
OTHERS = ("joint", "alone", "online", "envelope", "column-generation", "highs", "cp-sat")
METHODS = {**PLANNERS, **BOUNDS, **EXACT}


class Drawn(NamedTuple):
    """A problem, its best plan's J by brute force, what is special about it, and who is asked."""

    problem: Problem
    best: float
    kinds: tuple[str, ...]
    asked: tuple[str, ...]


@st.composite
def choosing(draw: st.DrawFn, drawn: st.SearchStrategy[Problem]) -> Problem:
    """Problems as `drawn`, in which at least one drone chooses its start."""
    problem = draw(drawn)
    if all(isinstance(robot.start, State) for robot in problem.robots):
        try:
            problem = problem.replace(robots=draw(with_choices(problem.robots)))
        except ProblemError:
            assume(False)
    assume(any(not isinstance(robot.start, State) for robot in problem.robots))
    assume(number_of_plans(problem) <= MOST_PLANS)
    return problem


@st.composite
def drawn_starts(draw: st.DrawFn) -> Drawn:
    """Problems in which at least one drone chooses its start."""
    plain = choosing(
        st.one_of(drawn_problems(over_time=True), drawn_meetings(2), drawn_meetings(3))
    )
    if draw(st.sampled_from([True, False, False])):
        taken: InTakes = draw(in_takes(plain))
        problem = taken.problem
    else:
        problem = draw(either(plain))
    best = taken.optimum()[1] if problem.takes else optimum(problem).value
    kinds = {
        "takes": bool(problem.takes),
        "views": problem.objective.views is not None,
        "goals": any(robot.goal is not None for robot in problem.robots),
        "rules": problem.rules != NO_RULES,
        "over time": problem.objective.over_time,
        "no plan": math.isinf(best),
    }
    planner = draw(st.sampled_from((*PLANNED, *PLANNED, *LONGER)))
    asked = ("branch-and-price", planner, draw(st.sampled_from(OTHERS)))
    return Drawn(problem, best, tuple(name for name, true in kinds.items() if true), asked)


def judge(drawn: Drawn, name: str) -> str:
    """Plan <= optimum <= bound of one method. Returns how its run ended."""
    problem, best = drawn.problem, drawn.best
    most = METHODS[name].most_robots
    if most and len(problem.robots) > most:
        return "not for so many"
    try:
        result = METHODS[name](problem)
    except UnsupportedError:
        return "not for such problems"
    size = 1e-9 * (1 + abs(best)) if math.isfinite(best) else 0.0
    valid = False
    if result.plan is not None:
        verdict = check(problem, result.plan)
        valid = verdict.valid
        assert math.isclose(verdict.reward, result.value, rel_tol=1e-9, abs_tol=1e-9)
        assert not valid or result.value <= best + size
    if not isinstance(result, CertifiedResult):
        assert valid or math.isinf(best) or result.plan is None or verdict.conflicts
        return "valid" if valid else "no valid plan"
    assert result.plan is None or valid
    assert result.bound >= best - size
    file = result.certificate
    if file is not None and file.bound is not None:
        assert verify(problem, file).bound >= best - size
    if METHODS[name].optimal:
        if result.reason is Reason.OPTIMAL:
            assert math.isclose(result.value, best, rel_tol=1e-4, abs_tol=1e-6)
        if result.reason is Reason.INFEASIBLE:
            assert math.isinf(best)
        if name == "branch-and-price":
            assert result.reason in (Reason.OPTIMAL, Reason.INFEASIBLE)
    return str(result.reason.value)


def hunt(count: int, first: int) -> Counter[str]:
    """Draw and judge so many problems; a counterexample is raised, made small."""
    counts: Counter[str] = Counter()
    begin, batch = time.monotonic(), first

    @settings(
        max_examples=BATCH,
        deadline=None,
        database=None,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    @given(drawn_starts())
    def judge_all(drawn: Drawn) -> None:
        ended = {f"{name}: {judge(drawn, name)}": 1 for name in drawn.asked}
        counts.update({"problems": 1, **dict.fromkeys(drawn.kinds, 1), **ended})

    while counts["problems"] < count:
        seed(batch)(judge_all)()
        batch += 1
        seconds = time.monotonic() - begin
        sys.stderr.write(f"{counts['problems']} problems, {seconds:.0f} s, next seed {batch}\n")
    return counts


def main() -> None:
    """Hunt as the command line says, and print how often what was met."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int, help="how many problems")
    parser.add_argument("--first", type=int, default=0, help="the seed of the first batch")
    arguments = parser.parse_args()
    for name, times in sorted(hunt(arguments.count, arguments.first).items()):
        sys.stdout.write(f"{times:7d}  {name}\n")


if __name__ == "__main__":
    main()
