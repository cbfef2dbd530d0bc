"""Large neighbourhood search: some robots of a plan are planned anew, again and again.

A neighbourhood is up to eight robots that see much of the same. Some of them lose their paths and
are planned anew one by one in a random order, clear of all others; then the neighbourhood settles
in rounds of best responses. Now and then the first of them must leave the way that it had from a
random step on, as in CoCap's tree a robot must that gives way: otherwise two robots know two ways
to share the work, and no third. What does not gain is forgotten.

Source: large neighbourhood search, Shaw 1998; for paths of many robots MAPF-LNS, Li et al. 2021.
"""

from collections.abc import Iterator

import numpy as np

from cocap_opt.data import IntArray
from cocap_opt.graph.charges import NO_CHARGES, Charges
from cocap_opt.planners.responses import Responses, in_rounds
from cocap_opt.planners.team import Team

LARGEST = 8  # robots of a neighbourhood
DEVIATING = 0.3  # share of the neighbourhoods whose first robot must leave its way


def neighbourhood_search(
    team: Team, responses: Responses, asked: int, rng: np.random.Generator
) -> Iterator[Team]:
    """Yield each better team that is found.

    Parameters
    ----------
    team : whole, and obeys the rules
    asked : paths for which `responses` may have been asked when the search ends
    """
    tries = asked - responses.asked  # what is remembered asks for nothing
    while responses.asked < asked and tries > 0 and team.size > 1:
        tries -= 1
        neighbours = _neighbours(team, int(rng.integers(team.size)))
        anew = rng.permutation(neighbours)[: rng.integers(2, len(neighbours) + 1)].tolist()
        changed = _planned_anew(team, anew, responses, rng)
        if changed is None:
            continue
        kept = [i for i in neighbours.tolist() if i not in anew]
        for settled in in_rounds(changed, responses, [*kept, *anew]):
            changed = settled
        if changed.gains_over(team):
            team = changed
            yield team


def _neighbours(team: Team, robot: int) -> IntArray:
    """Return a robot and those that see most of what it sees [n]; all where they are few."""
    if team.size <= LARGEST:
        return np.arange(team.size)
    roots = np.sqrt([single.pixels for single in team.found if single is not None])
    shared = np.minimum(roots, roots[robot]) @ team.model.problem.view_sum_weights
    shared[robot] = np.inf
    return np.argsort(-shared, kind="stable")[:LARGEST]


def _planned_anew(
    team: Team, anew: list[int], responses: Responses, rng: np.random.Generator
) -> Team | None:
    """Return the team with some robots planned anew in this order; None where no way is left."""
    changed, deviates = team.without(anew), rng.random() < DEVIATING
    for n, robot in enumerate(anew):
        if n == 0 and deviates:
            single = responses.charged(changed, robot, _leaving(team, robot, rng))
        else:
            single = responses.best(changed, robot)
        if single.path is None:
            return None
        changed = changed.with_path(robot, single)
    return changed


def _leaving(team: Team, robot: int, rng: np.random.Generator) -> Charges:
    """Return charges that close the places of a robot's path from a random step on."""
    single, robot_class = team.found[robot], team.model.class_of[robot]
    path = np.array(single.path if single is not None else (), dtype=np.int64)
    end = len(path) - (robot_class.goal is not None)  # the goal stays open
    if end < 2:
        return NO_CHARGES
    steps = np.arange(rng.integers(1, end), end)
    places = path[steps] % robot_class.graph.n_places
    return Charges.closing(np.column_stack([steps, places]), np.zeros((0, 3), dtype=np.int64))
