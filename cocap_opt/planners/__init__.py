"""Planners: callables from a Problem to a Result. To add one: one file, one line below."""

from collections.abc import Callable

from cocap_opt.planners.cocap import cocap
from cocap_opt.planners.formation import formation
from cocap_opt.planners.greedy import greedy
from cocap_opt.planners.joint import joint
from cocap_opt.planners.myopic import myopic
from cocap_opt.planners.one_step import one_step
from cocap_opt.planners.sequential import sequential
from cocap_opt.planners.view_search import ViewSearch
from cocap_opt.problem.problem import Problem
from cocap_opt.result import Result
from cocap_opt.stop import Stop

Planner = Callable[[Problem, Stop], Result]

PLANNERS: dict[str, Planner] = {
    "greedy": greedy,
    "greedy-rounds": lambda problem, stop: greedy(problem, stop, rounds=10),
    "sequential": sequential,
    "cocap": cocap,
    "cocap-vs": lambda problem, stop: cocap(problem, stop, low_level=ViewSearch()),
    "joint": joint,
    "formation": formation,
    "myopic": myopic,
    "one-step": one_step,
}
