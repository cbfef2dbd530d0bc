"""Large neighbourhood search: improves a team by changing a few robots at a time.

A neighbourhood is up to eight robots with similar views. One of three moves is made. (1) Two robots
that are near each other exchange the rest of their paths, which changes no views: in a queue before
a narrow passage they change places, and may then find better paths to these places. (2) One robot
takes the path that would be best if it were alone in the air, and the robots in its way are
replanned. (3) Some robots, chosen at random, are replanned one by one in random order, each clear
of all others; sometimes the first of these must leave its former path at a random step, as a robot
that gives way must in CoCap's tree: otherwise two robots would only find the two ways of sharing
the work in which one goes first. If the plan is nearly as good as before, the neighbourhood makes
rounds of best responses. Moves that gain nothing in the end are undone.

Source: Shaw 1998; for paths of many robots MAPF-LNS, Li et al. 2021.
"""

from collections.abc import Iterator

import numpy as np

from cocap_opt.coordination.low_level import PlannedTeam, SingleRobotPath
from cocap_opt.coordination.responses import Responses, in_rounds
from cocap_opt.data import IntArray
from cocap_opt.graph.charges import NO_CHARGES, Charges

# Measured on scene `passage`, seeds 40 to 51, five random seeds each: J is 0.04 % higher with
# _EXCHANGING = 0.3 than with 0. The other parameters matter less than random seeds do.
LARGEST = 8  # robots of a neighbourhood; `_neighbours` selects them if there are more
_EXCHANGING = 0.3  # share of neighbourhoods in which two robots exchange the rest of their paths
_GIVING_WAY = 0.4  # share of the others in which one robot flies as if it were alone
_DEVIATING = 0.3  # share of the remaining ones in which the first robot must leave its former path
_PROMISING = 0.005  # relative loss up to which best responses in a neighbourhood are worthwhile


def neighbourhood_search(
    team: PlannedTeam, responses: Responses, asked: int, rng: np.random.Generator
) -> Iterator[PlannedTeam]:
    """Yields each better team that is found.

    Parameters
    ----------
    team : a whole team that obeys the rules
    asked : number of paths requested from `responses` after which no further neighbourhood is
        started
    """
    # A neighbourhood whose responses are all cached requests no paths, so tries are counted, too.
    tries = asked - responses.asked
    while responses.asked < asked and tries > 0 and team.size > 1:
        tries -= 1
        robot = int(rng.integers(team.size))
        neighbours = _neighbours(team, robot)
        if rng.random() < _EXCHANGING:
            changed = _exchanged(team, neighbours, rng)
        elif rng.random() < _GIVING_WAY:
            changed = _with_its_way(team, robot, responses, rng)
        else:
            changed = _some_anew(team, neighbours, responses, rng)
        if changed is None or changed.value < team.value * (1 - _PROMISING):
            continue
        as_before = [changed.found[i] is team.found[i] for i in neighbours]
        order = neighbours[np.argsort(np.logical_not(as_before), kind="stable")]
        for settled in in_rounds(changed, responses, order.tolist()):
            changed = settled
        if changed.gains_over(team):
            team = changed
            yield team


def _neighbours(team: PlannedTeam, robot: int) -> IntArray:
    """Returns a robot and those whose views overlap most with its own [n]; all robots if there are
    few.
    """
    if team.size <= LARGEST:
        return np.arange(team.size)
    roots = np.sqrt([single.pixels for single in team.found if single is not None])
    shared = np.minimum(roots, roots[robot]) @ team.model.problem.view_sum_weights
    shared[robot] = np.inf
    return np.argsort(-shared, kind="stable")[:LARGEST]


def _exchanged(
    team: PlannedTeam, neighbours: IntArray, rng: np.random.Generator
) -> PlannedTeam | None:
    """Returns the team in which two of the neighbours exchange the rest of their paths.

    Returns None if no two can: they must have the same motion and cameras, and be near each other
    at some step.
    """
    first, second = rng.permutation(neighbours)[:2].tolist()
    conflict = team.model.problem.paths_conflict
    for t in rng.permutation(_crossings(team, first, second)).tolist():
        ends = team.path(first)[t:], team.path(second)[t:]
        changed = team
        for robot, end in ((first, ends[1]), (second, ends[0])):
            path = team.path(robot)[:t] + end
            changed = changed.with_path(robot, SingleRobotPath.of(team.model, robot, path))
        now = [changed.cells(i)[t - 1 : t + 1] for i in range(team.size)]
        pairs = ((i, k) for i in (first, second) for k in range(team.size) if k != i)
        if not any(conflict(now[i], now[k]) for i, k in pairs):
            return changed
    return None


def _crossings(team: PlannedTeam, first: int, second: int) -> IntArray:
    """Returns the first steps from which two robots can have each other's states."""
    robot_class = team.model.class_of[first]
    if robot_class is not team.model.class_of[second]:
        return np.zeros(0, dtype=np.int64)
    graph, (p, q) = robot_class.graph, (np.array(team.path(i)) for i in (first, second))
    steps = np.flatnonzero(p[1:] != q[1:])
    for tails, heads in ((p, q), (q, p)):
        shifts = (heads[steps + 1] - tails[steps]) % graph.n_places
        steps = steps[np.isin(shifts, graph.shifts % graph.n_places)]
        leads = [heads[t + 1] in graph.successors(t, int(tails[t])) for t in steps.tolist()]
        steps = steps[np.array(leads, dtype=np.bool_)]
    return steps + 1


def _with_its_way(
    team: PlannedTeam, robot: int, responses: Responses, rng: np.random.Generator
) -> PlannedTeam | None:
    """Returns the team in which a robot has its best path, and the robots in its way are replanned.

    Returns None if it already has that path, or leaves the others no path.
    """
    single = responses.best(team, robot, rules=False)
    if single.path is None:
        return None
    changed = team.with_path(robot, single)
    if not changed.gains_over(team):
        return None
    cells, conflict = changed.cells(robot), team.model.problem.paths_conflict
    others = [i for i in range(team.size) if i != robot and conflict(cells, changed.cells(i))]
    return _anew(changed.without(others), rng.permutation(others).tolist(), responses)


def _some_anew(
    team: PlannedTeam, neighbours: IntArray, responses: Responses, rng: np.random.Generator
) -> PlannedTeam | None:
    """Returns the team with some of the neighbours replanned; None if one has no path left."""
    first, *others = rng.permutation(neighbours)[: rng.integers(2, len(neighbours) + 1)].tolist()
    left = team.without((first, *others))
    if rng.random() >= _DEVIATING:
        return _anew(left, [first, *others], responses)
    charges = Charges.joined([left.avoiding(first), _leaving(team, first, rng)])
    single = responses.charged(left, first, charges)
    return None if single.path is None else _anew(left.with_path(first, single), others, responses)


def _anew(team: PlannedTeam, robots: list[int], responses: Responses) -> PlannedTeam | None:
    """Returns the team with the given robots replanned in order; None if one has no path left."""
    for robot in robots:
        single = responses.best(team, robot)
        if single.path is None:
            return None
        team = team.with_path(robot, single)
    return team


def _leaving(team: PlannedTeam, robot: int, rng: np.random.Generator) -> Charges:
    """Returns charges that close the places of a robot's path from a random step on."""
    robot_class, path = team.model.class_of[robot], np.array(team.path(robot), dtype=np.int64)
    end = len(path) - (robot_class.goal is not None)  # the goal remains open
    if end < 2:
        return NO_CHARGES
    steps = np.arange(rng.integers(1, end), end)
    places = path[steps] % robot_class.graph.n_places
    return Charges.closing(np.column_stack([steps, places]), np.zeros((0, 3), dtype=np.int64))
