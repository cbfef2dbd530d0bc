"""Planners: callables from a problem to a result. To add one: one file, one line below."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Protocol

from cocap_opt.planners.cocap import (
    cocap,
    cocap_focal,
    cocap_lazy,
    cocap_rounds,
    cocap_vs,
    cocap_vs_undiscounted,
)
from cocap_opt.planners.cocap_lns import cocap_lns
from cocap_opt.planners.formation import formation
from cocap_opt.planners.greedy import greedy, greedy_lazy, greedy_rounds, myopic
from cocap_opt.planners.joint import joint
from cocap_opt.planners.one_step import one_step
from cocap_opt.planners.sequential import (
    best_of_orders,
    sequential,
    sequential_lazy,
    sequential_rounds,
)
from cocap_opt.problem import Problem
from cocap_opt.result import Result
from cocap_opt.stop import Stop, never

__all__ = ["LAZY", "PLANNERS", "RECOMMENDED", "NamedPlanner", "Planner"]


class Planner(Protocol):
    """A method that plans all robots of a problem, and proves nothing unless it says so.

    Any function that takes a problem and a stop and returns a `Result` is one.
    """

    def __call__(self, problem: Problem, stop: Stop, /) -> Result:
        """Plan a problem; at a limit, return the best plan so far."""


class NamedPlanner(Planner, Protocol):
    """A planner that has a name here; it can be called with a problem alone."""

    def __call__(self, problem: Problem, stop: Stop = never) -> Result:
        """Plan a problem; at a limit, return the best plan so far."""


PLANNERS: Mapping[str, NamedPlanner] = MappingProxyType(
    {
        "greedy": greedy,
        "greedy-rounds": greedy_rounds,
        "sequential": sequential,
        "sequential-rounds": sequential_rounds,
        "best-of-orders": best_of_orders,
        "cocap": cocap,
        "greedy-lazy": greedy_lazy,
        "sequential-lazy": sequential_lazy,
        "cocap-lazy": cocap_lazy,
        "cocap-vs": cocap_vs,
        "cocap-vs-undiscounted": cocap_vs_undiscounted,
        "cocap-rounds": cocap_rounds,
        "cocap-focal": cocap_focal,
        "cocap-lns": cocap_lns,
        "joint": joint,
        "formation": formation,
        "myopic": myopic,
        "one-step": one_step,
    }
)

# The nearest to the optimum of those that take problems of any size, and what commands use if no
# planner is named.
RECOMMENDED = "cocap-lns"

# Planners that evaluate only the views they touch, and so need no coverage of all states before:
# those whose low level is a `low_level.LazyLowLevel`, and `one-step`, which has no low level.
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
