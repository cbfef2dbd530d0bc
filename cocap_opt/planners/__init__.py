"""Planners: callables from a problem to a result. To add one: one file, one line below."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Protocol

from cocap_opt.method import Method
from cocap_opt.problem import Problem
from cocap_opt.result import Result
from cocap_opt.stop import Stop

__all__ = ["PLANNERS", "RECOMMENDED", "Planner"]


class Planner(Protocol):
    """A method that plans all robots of a problem, and proves nothing unless it says so.

    Any function that takes a problem and a stop and returns a `Result` is one.
    """

    def __call__(self, problem: Problem, stop: Stop, /) -> Result:
        """Plan a problem; at a limit, return the best plan so far."""


# The nearest to the optimum of those that take problems of any size, and what commands use if no
# planner is named.
RECOMMENDED = "cocap-lns"

_ALONE = "no drone alone can better it"
_COMPLETE = "a plan, or the proof that there is none, if it is not stopped"
PLANNERS: Mapping[str, Method[Result]] = MappingProxyType(
    {
        "greedy": Method(
            "cocap_opt.planners.greedy:greedy",
            "each drone in turn, collisions ignored",
            "half the best J without rules; collides",
        ),
        "greedy-rounds": Method(
            "cocap_opt.planners.greedy:greedy_rounds",
            "greedy, then rounds of best responses",
            f"{_ALONE}; collides",
        ),
        "sequential": Method(
            "cocap_opt.planners.sequential:sequential",
            "each drone in turn, clear of the earlier ones",
            "obeys the rules",
            obeys_rules=True,
        ),
        "sequential-rounds": Method(
            "cocap_opt.planners.sequential:sequential_rounds",
            "sequential, then rounds that obey the rules",
            _ALONE,
            obeys_rules=True,
        ),
        "best-of-orders": Method(
            "cocap_opt.planners.sequential:best_of_orders",
            "sequential in ten orders",
            "at least as good as sequential",
            obeys_rules=True,
        ),
        "cocap": Method(
            "cocap_opt.planners.cocap:cocap",
            "constraint tree over value iteration, Alg. 1",
            _COMPLETE,
            obeys_rules=True,
            complete=True,
        ),
        "greedy-lazy": Method(
            "cocap_opt.planners.greedy:greedy_lazy",
            "greedy over lazy value iteration",
            "the plan of greedy",
            lazy=True,
        ),
        "sequential-lazy": Method(
            "cocap_opt.planners.sequential:sequential_lazy",
            "sequential over lazy value iteration",
            "the plan of sequential",
            lazy=True,
            obeys_rules=True,
        ),
        "cocap-lazy": Method(
            "cocap_opt.planners.cocap:cocap_lazy",
            "cocap over lazy value iteration",
            "the plan of cocap",
            lazy=True,
            obeys_rules=True,
            complete=True,
        ),
        "cocap-vs": Method(
            "cocap_opt.planners.cocap:cocap_vs",
            "constraint tree over view search, Alg. 2",
            _COMPLETE,
            lazy=True,
            obeys_rules=True,
            complete=True,
        ),
        "cocap-vs-undiscounted": Method(
            "cocap_opt.planners.cocap:cocap_vs_undiscounted",
            "cocap-vs, values not discounted",
            _COMPLETE,
            lazy=True,
            obeys_rules=True,
            complete=True,
        ),
        "cocap-rounds": Method(
            "cocap_opt.planners.cocap:cocap_rounds",
            "cocap from a root planned in rounds",
            _COMPLETE,
            obeys_rules=True,
            complete=True,
        ),
        "cocap-focal": Method(
            "cocap_opt.planners.cocap:cocap_focal",
            "cocap-rounds with a focal list, then rounds",
            f"{_COMPLETE}; {_ALONE}",
            obeys_rules=True,
            complete=True,
        ),
        "cocap-lns": Method(
            "cocap_opt.planners.cocap_lns:cocap_lns",
            "sequential (cocap-focal where it fails), rounds, large neighbourhood search",
            f"{_COMPLETE}; {_ALONE}",
            obeys_rules=True,
            complete=True,
        ),
        "joint": Method(
            "cocap_opt.planners.joint:joint",
            "value iteration over both drones at once",
            "the proved optimum",
            obeys_rules=True,
            complete=True,
            optimal=True,
            most_robots=2,
        ),
        "formation": Method(
            "cocap_opt.planners.formation:formation",
            "drones on circles around the people",
            "obeys the rules",
            lazy=True,
            obeys_rules=True,
        ),
        "myopic": Method(
            "cocap_opt.planners.greedy:myopic",
            "every drone as if alone",
            "collides",
        ),
        "one-step": Method(
            "cocap_opt.planners.one_step:one_step",
            "each drone in turn, the best next view",
            "obeys the rules",
            lazy=True,
            obeys_rules=True,
        ),
    }
)
