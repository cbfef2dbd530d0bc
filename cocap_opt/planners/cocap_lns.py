"""The planner that is recommended: constraint tree and rounds, then large neighbourhood search.

It is made of the others' parts: sequential planning and rounds of best responses give a first
plan; CoCap's tree with a focal list, from a root planned in rounds, gives another one, repaired if
it has conflicts left after few nodes; the better one is improved by large neighbourhood search.
Where sequential planning fails, the tree goes on until it finds a plan, or has proved that there
is none.
"""

import sys
from collections import Counter
from collections.abc import Iterator

import numpy as np

from cocap_opt.planners.cocap import EXHAUSTED, algorithm_1
from cocap_opt.planners.constraint_tree import ConstraintTree
from cocap_opt.planners.low_level import value_iteration
from cocap_opt.planners.neighbourhoods import neighbourhood_search
from cocap_opt.planners.open_nodes import FocalNodes
from cocap_opt.planners.responses import (
    Responses,
    followed,
    greedily,
    greedily_in_rounds,
    in_rounds,
    then_in_rounds,
)
from cocap_opt.planners.team import Team
from cocap_opt.problem import Problem
from cocap_opt.result import Reason, Result
from cocap_opt.stop import FirstOf, LimitReached, Stop, WorkLimit, never
from cocap_opt.timing import timed

# Measured on bottleneck-tight and passage, seeds 0 to 4: J is 0.07 % higher on the former than with
# a third of these nodes, or none; with three times as many it is 0.2 % lower on the latter.
_NODES = 3  # of the tree, for each robot, where there is a plan already; at least:
_FEW_NODES = 20
# For each robot. Measured on passage, bottleneck and the tight scenes, seeds 0 to 9, three random
# seeds each, in processor time of sequential planning: 17 take 17 to 19 times as long, and J is
# 0.33 % (passage) and 0.07 % (bottleneck-tight) below the best known; 32 take 35 times as long for
# about 0.2 %, 64 take 70 times for about 0.1 %.
RESPONSES = 17


@timed
def cocap_lns(problem: Problem, stop: Stop = never, responses: int = RESPONSES) -> Result:
    """Plan by sequential planning, constraint tree and large neighbourhood search.

    Parameters
    ----------
    responses : paths per robot that value iteration is asked for before the search ends; more of
        them take longer and come nearer to the optimum

    Returns
    -------
    Result
        No robot alone can better its plan, unless a limit has stopped it: then it is the best plan
        so far. `statistics` holds the number of `responses`.
    """
    nobody, asked = Team.of(problem, value_iteration, stop), Responses(value_iteration, stop)
    changes = _better_and_better(nobody, asked, stop, responses * nobody.size)
    team, limit = followed(nobody, changes)
    if limit is None and not team.is_whole:
        return Result.without_plan(Reason.INFEASIBLE, EXHAUSTED)
    return team.hovering().result(limit, {"responses": asked.asked})


def _better_and_better(
    nobody: Team, responses: Responses, stop: Stop, asked: int
) -> Iterator[Team]:
    """Yields the team as it is planned, and then each better one."""
    team = nobody
    for team in then_in_rounds(nobody, responses):
        yield team
    other = _from_tree(team, responses, stop)
    if other is not None and not (team.is_whole and team.value >= other.value):
        yield (team := other)
    if team.is_whole:
        rng = np.random.default_rng(0)
        yield from neighbourhood_search(team, responses, asked, rng)


def _from_tree(known: Team, responses: Responses, stop: Stop) -> Team | None:
    """Returns the plan of CoCap's tree after rounds; None if it has none, or is not worth a try.

    Where it needs many nodes, it is the plan of the node with the fewest conflicts, repaired. A
    tree whose root has more conflicts than it may have nodes is not begun.

    Parameters
    ----------
    known : as sequential planning has it; if it is not whole, the tree may have any size
    """
    nobody = Team.nobody(known.model)
    nodes = max(_NODES * known.size, _FEW_NODES) if known.is_whole else sys.maxsize
    root = followed(nobody, greedily(nobody, responses))[0]
    stop.check()
    if root.is_whole and len(root.conflicts) > nodes:
        return None
    open_nodes, enough = FocalNodes(), FirstOf(stop, WorkLimit(nodes))
    tree = ConstraintTree(root, responses, enough, open_nodes, greedily_in_rounds)
    try:
        found = algorithm_1(tree)
    except LimitReached:
        stop.check()
        found = open_nodes.nearest()
    team = None if found is None else _repaired(found.team, responses)
    return None if team is None else followed(team, in_rounds(team, responses))[0]


def _repaired(team: Team, responses: Responses) -> Team | None:
    """Returns the team without conflicts; None where a robot finds no way clear of the others.

    Again and again the robot in most conflicts is planned anew, clear of all others.
    """
    while team.conflicts:
        involved = Counter(robot for conflict in team.conflicts for robot in conflict.robots)
        robot = min(involved, key=lambda i: (-involved[i], i))
        single = responses.best(team, robot)
        if single.path is None:
            return None
        team = team.with_path(robot, single)
    return team
