"""A plain sweep: value iteration for checking certificates, written to be read.

It proceeds backwards over the steps, move by move and turn by turn, and shares no code with the
value iteration of planners and pricing. Rewards for moves are taken from the objective's
definition.
"""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.graph.charges import Charges
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.model import RobotClass
from cocap_opt.problem import Objective, Problem, may_end


def plain_sweep(
    problem: Problem, robot_class: RobotClass, reward: FloatArray, charges: Charges
) -> FloatArray:
    """Returns the value of the best path from every state at step 0 [S].

    Parameters
    ----------
    reward : [T+1, S] reward for visiting each state; the objective's rewards for moves are added
    charges : costs of places, states and moves, which are subtracted from the rewards
    """
    (first,) = deque(values_to_go(problem, robot_class, reward, charges), maxlen=1)
    return first


def values_to_go(
    problem: Problem, robot_class: RobotClass, reward: FloatArray, charges: Charges
) -> Iterator[FloatArray]:
    """Yields the value of the best path from every state [S], from step T back to step 0.

    The parameters are those of `plain_sweep`.
    """
    graph, objective = robot_class.graph, problem.objective
    shape = graph.n_orientations, graph.n_places
    rewards, places, states, moves = _terms(graph, objective, charges)
    value = np.where(graph.free, reward[-1].reshape(shape), -np.inf)
    if robot_class.goal is not None:
        _, x, y = graph.coordinates(np.arange(graph.n_places))
        value = np.where(may_end(robot_class.goal, x, y), value, -np.inf)
    value = value - places.get(problem.horizon, 0.0) - states.get(problem.horizon, 0.0)
    yield value.reshape(-1)
    for t in range(problem.horizon - 1, -1, -1):
        best = _best_moves(graph, objective, t, value, graph.turns, rewards, moves)
        value = best + reward[t].reshape(shape) - places.get(t, 0.0) - states.get(t, 0.0)
        yield value.reshape(-1)


def values_so_far(
    problem: Problem,
    robot_class: RobotClass,
    reward: FloatArray,
    charges: Charges,
    first: FloatArray,
) -> Iterator[FloatArray]:
    """Yields the value of the best path into every state [S], from step 0 to step T.

    The value excludes the reward of the state itself: the sum with `values_to_go` is the value of
    the best path through the state.

    Parameters
    ----------
    first : [S] initial value of paths that begin in each state at step 0; -inf if none begins there
    problem, robot_class, reward, charges : as in `plain_sweep`
    """
    graph, objective = robot_class.graph, problem.objective
    shape = graph.n_orientations, graph.n_places
    rewards, places, states, moves = _terms(graph, objective, charges)
    value = np.where(graph.free, first.reshape(shape), -np.inf)
    yield value.reshape(-1)
    turns = _turned_from(graph)
    for t in range(problem.horizon):
        here = value + reward[t].reshape(shape) - places.get(t, 0.0) - states.get(t, 0.0)
        best = _best_moves(graph, objective, t, here, turns, rewards, moves, forwards=True)
        value = np.where(graph.free, best, -np.inf)
        yield value.reshape(-1)


def _best_moves(
    graph: TimeGraph,
    objective: Objective,
    t: int,
    value: FloatArray,
    turns: Sequence[Sequence[int]],
    rewards: Sequence[FloatArray],
    moves: Mapping[tuple[int, int], FloatArray],
    forwards: bool = False,
) -> FloatArray:
    """Returns the best of the moves from step t to t + 1, for each state [O, P].

    Parameters
    ----------
    value : [O, P] value of each state at t + 1, or at t if `forwards`
    turns : orientations to which, or from which, a step can turn
    rewards, moves : as `_terms` returns them
    forwards : True: moves into states at t + 1; False: moves out of states at t
    """
    best, room = np.full(value.shape, -np.inf), np.empty(value.shape)
    open_ = np.flatnonzero((value > -np.inf).any(axis=0))
    if not len(open_):
        return best
    # Moves that do not begin or end at these places are worth -inf: in a narrowed graph, most are.
    first, last = int(open_[0]), int(open_[-1]) + 1
    turned = _plain_turns(turns, value[:, first:last], objective.keep_heading, graph.shape[1])
    for k, shift in enumerate(graph.shifts.tolist()):
        # Among the places for which the move does not run off the range of place numbers.
        back = shift if forwards else -shift
        known = slice(max(first, -back), min(last, graph.n_places - back))
        if known.start >= known.stop:
            continue
        wanted = slice(known.start + back, known.stop + back)
        tails = known if forwards else wanted
        gained = np.add(
            turned[:, known.start - first : known.stop - first], rewards[k][tails],
            out=room[:, tails],
        )  # fmt: skip
        if (t, k) in moves:
            gained -= moves[t, k][tails]
        np.maximum(best[:, wanted], gained, out=best[:, wanted])
    if objective.stationarity:
        # The first move is to stay.
        stay = value + reward_of_staying(objective) - moves.get((t, 0), 0.0)
        best = np.maximum(best, stay)
    return best


def _terms(
    graph: TimeGraph, objective: Objective, charges: Charges
) -> tuple[
    list[FloatArray], dict[int, FloatArray], dict[int, FloatArray],
    dict[tuple[int, int], FloatArray],
]:  # fmt: skip
    """Returns rewards for moves and charges as arrays; zones closed near people become charges,
    too.

    Returns
    -------
    The rewards of each move k [P], -inf for places from which it is not open; the charges of places
    by step [P], of states by step [O, P], and of moves by step and k [P], indexed by tail.
    """
    shape = (graph.n_orientations, graph.n_places)
    places, states = dict[int, FloatArray](), dict[int, FloatArray]()
    moves: dict[tuple[int, int], FloatArray] = {}
    charged = Charges.joined([graph.closed, charges])
    for (t, place), cost in charged.places.items():
        places.setdefault(t, np.zeros(graph.n_places))[place] += cost
    for (t, state), cost in charged.states.items():
        states.setdefault(t, np.zeros(shape)).reshape(-1)[state] += cost
    for (t, tail, head), cost in charged.moves.items():
        leads = graph.allowed[:, tail] & (tail + graph.shifts == head)
        for k in np.flatnonzero(leads).tolist():
            moves.setdefault((t, k), np.zeros(graph.n_places))[tail] += cost
    return _rewards(graph, objective), places, states, moves


def reward_of_staying(objective: Objective) -> float:
    """Returns the reward of a step that changes nothing, which is the largest of all."""
    stay = objective.stationarity + objective.keep_cell
    return stay + (objective.keep_heading + objective.balanced)


def _turned_from(graph: TimeGraph) -> list[list[int]]:
    """Returns the orientations from which one step can turn to each orientation."""
    tails: list[list[int]] = [[] for _ in graph.turns]
    for tail, heads in enumerate(graph.turns):
        for head in heads:
            tails[head].append(tail)
    return tails


def _plain_turns(
    turns_of: Sequence[Sequence[int]], value: FloatArray, keep_heading: float, pitches: int
) -> FloatArray:
    """Returns, for each orientation, the best of the values [O, P] over the turns of one step.

    The result includes the reward for keeping the heading.

    Parameters
    ----------
    turns_of : the orientations to, or from, which a step can turn, for each orientation
    pitches : orientations of one heading
    """
    turned = np.stack([value[list(turns)].max(axis=0) for turns in turns_of])
    if keep_heading:
        for orientation, turns in enumerate(turns_of):
            kept = [turn for turn in turns if turn // pitches == orientation // pitches]
            ahead = value[kept].max(axis=0) + keep_heading
            turned[orientation] = np.maximum(turned[orientation], ahead)
    return turned


def _rewards(graph: TimeGraph, objective: Objective) -> list[FloatArray]:
    """Returns the rewards of each move k [P], without those for turns; -inf if the move is not
    open.
    """
    rewards = []
    for shift, allowed in zip(graph.shifts, graph.allowed, strict=True):
        tails = np.flatnonzero(allowed)
        climb, dx, dy = graph.coordinates(tails + shift) - graph.coordinates(tails)
        stays = (climb == 0) & (dx == 0) & (dy == 0)
        reward = np.full(graph.n_places, -np.inf)
        reward[tails] = objective.keep_cell * stays + objective.balanced * (dx + dy == 0)
        rewards.append(reward)
    return rewards
