"""Planners: callables from a problem to a result. To add one: one file, one line below."""

from typing import Protocol

from cocap_opt.planners.cocap import cocap, cocap_lazy, cocap_vs, cocap_vs_undiscounted
from cocap_opt.planners.formation import formation
from cocap_opt.planners.greedy import greedy, greedy_lazy, greedy_rounds
from cocap_opt.planners.joint import joint
from cocap_opt.planners.myopic import myopic
from cocap_opt.planners.one_step import one_step
from cocap_opt.planners.sequential import sequential, sequential_lazy
from cocap_opt.problem import Problem
from cocap_opt.result import Result
from cocap_opt.stop import Stop, never

__all__ = ["LAZY", "PLANNERS", "Planner"]


class Planner(Protocol):
    """A method that plans all robots of a problem, and proves nothing unless it says so."""

    def __call__(self, problem: Problem, stop: Stop = never) -> Result:
        """Plan a problem; at a limit, return the best plan so far."""


PLANNERS: dict[str, Planner] = {
    "greedy": greedy,
    "greedy-rounds": greedy_rounds,
    "sequential": sequential,
    "cocap": cocap,
    "greedy-lazy": greedy_lazy,
    "sequential-lazy": sequential_lazy,
    "cocap-lazy": cocap_lazy,
    "cocap-vs": cocap_vs,
    "cocap-vs-undiscounted": cocap_vs_undiscounted,
    "joint": joint,
    "formation": formation,
    "myopic": myopic,
    "one-step": one_step,
}

# Planners that evaluate only the views they touch, and so need no coverage of all states before.
LAZY = frozenset(
    {
        "greedy-lazy",
        "sequential-lazy",
        "cocap-lazy",
        "cocap-vs",
        "cocap-vs-undiscounted",
        "formation",
        "one-step",
    }
)
