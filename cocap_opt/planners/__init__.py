"""Planners: callables from a problem to a result. A new one needs one file and one line below."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Protocol

from cocap_opt.method import Method
from cocap_opt.problem import Problem
from cocap_opt.result import Result
from cocap_opt.stop import Stop

__all__ = ["PLANNERS", "RECOMMENDED", "Planner"]


class Planner(Protocol):
    """A method that plans all robots of a problem, and proves nothing unless its result says so.

    Any function that takes a problem and a stopping criterion and returns a `Result` is a planner.
    """

    def __call__(self, problem: Problem, stop: Stop, /) -> Result:
        """Plan a problem; at a limit, return the best plan so far."""


# The planner with the best plans among those for problems of any size; the default of the commands.
RECOMMENDED = "cocap-prices"

_ALONE = "no single drone can improve it"
_COMPLETE = "a plan, or a proof that none exists, unless it is stopped"
_OBEYS = {"obeys_rules": True}
_SOLVES = {"obeys_rules": True, "complete": True}


def _planner(call: str, made_of: str, promises: str, **claims: Any) -> Method[Result]:
    return Method(f"cocap_opt.planners.{call}", made_of, promises, **claims)


PLANNERS: Mapping[str, Method[Result]] = MappingProxyType(
    {
        "greedy": _planner(
            "greedy:greedy",
            "each drone in turn, collisions ignored",
            "at least half the best J without rules; may collide",
        ),
        "greedy-rounds": _planner(
            "greedy:greedy_rounds",
            "greedy, then rounds of best responses, collisions ignored",
            f"{_ALONE}; may collide",
        ),
        "sequential": _planner(
            "sequential:sequential",
            "each drone in turn, clear of the earlier ones",
            "obeys the rules",
            **_OBEYS,
        ),
        "sequential-rounds": _planner(
            "sequential:sequential_rounds",
            "sequential, then rounds of best responses that obey the rules",
            _ALONE,
            **_OBEYS,
        ),
        "best-of-orders": _planner(
            "sequential:best_of_orders",
            "sequential in ten different orders",
            "at least as good as sequential",
            **_OBEYS,
        ),
        "cocap": _planner(
            "cocap:cocap", "constraint tree over value iteration, Alg. 1", _COMPLETE, **_SOLVES
        ),
        "greedy-lazy": _planner(
            "greedy:greedy_lazy",
            "greedy over lazy value iteration",
            "the plan of greedy",
            lazy=True,
        ),
        "sequential-lazy": _planner(
            "sequential:sequential_lazy",
            "sequential over lazy value iteration",
            "the plan of sequential",
            lazy=True,
            **_OBEYS,
        ),
        "cocap-lazy": _planner(
            "cocap:cocap_lazy",
            "cocap over lazy value iteration",
            "the plan of cocap",
            lazy=True,
            **_SOLVES,
        ),
        "cocap-vs": _planner(
            "cocap:cocap_vs",
            "constraint tree over view search, Alg. 2",
            _COMPLETE,
            lazy=True,
            **_SOLVES,
        ),
        "cocap-vs-undiscounted": _planner(
            "cocap:cocap_vs_undiscounted",
            "cocap-vs with undiscounted values",
            _COMPLETE,
            lazy=True,
            **_SOLVES,
        ),
        "cocap-rounds": _planner(
            "cocap:cocap_rounds", "cocap from a root planned in rounds", _COMPLETE, **_SOLVES
        ),
        "cocap-focal": _planner(
            "cocap:cocap_focal",
            "cocap-rounds with a focal list, then rounds of best responses",
            f"{_COMPLETE}; {_ALONE}",
            **_SOLVES,
        ),
        "cocap-lns": _planner(
            "cocap_lns:cocap_lns",
            "sequential (cocap-focal if it fails), rounds, large neighbourhood search",
            f"{_COMPLETE}; {_ALONE}",
            **_SOLVES,
        ),
        "cocap-prices": _planner(
            "cocap_prices:cocap_prices",
            "sequential (cocap-focal if it fails), then searches guided by prices",
            f"{_COMPLETE}; {_ALONE}",
            takes=frozenset({"start"}),
            **_SOLVES,
        ),
        "joint": _planner(
            "joint:joint",
            "value iteration over both drones at once",
            "the proved optimum",
            **_SOLVES,
            optimal=True,
            most_robots=2,
        ),
        "formation": _planner(
            "formation:formation",
            "drones on circles around the people",
            "obeys the rules",
            lazy=True,
            **_OBEYS,
        ),
        "myopic": _planner("greedy:myopic", "each drone as if it were alone", "collides"),
        "one-step": _planner(
            "one_step:one_step",
            "each drone in turn takes the best next view",
            "obeys the rules",
            lazy=True,
            **_OBEYS,
        ),
    }
)
