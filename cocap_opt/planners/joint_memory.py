"""The memory that value iteration over pairs of states takes, known before it is taken.

All numbers but the first are of 8 bytes. They are the arrays that `joint_pair` holds at once, which
`tests/core/test_joint.py` measures.
"""

from cocap_opt.planners.joint_pair import Pair

PROCESS = 100e6  # bytes, about: Python, the libraries, the problem, and what is freed but kept
_BYTES = 8.0  # of a number
_TEMPORARIES = 5  # arrays of a step's size that one step back needs at once
_PER_FACE = 2.0  # of each state and face: the coverage and the root of it
_PER_STATE = 40.0  # of each state besides, to spare
_PER_MOVE = 5.0  # of each move from each place: where it leads, while it is found
_PER_PAIR = 6.0  # of each pair of places: whether it is near, while that is found
_PER_VALUE = 2.0  # of each way of b from a near pair and its orientations: values, and the best
_PER_WAY = 20.0  # of each way of b from a near pair: where it leads, and whether it conflicts


def bytes_needed(pair: Pair) -> float:
    """Returns the peak of the process's memory: values of later steps, and the work on one."""
    peak = later = 0.0
    for t in range(pair.horizon, -1, -1):
        (o_a, n_a), (o_b, n_b) = pair.a.sizes(t), pair.b.sizes(t)
        work = (_PER_FACE * pair.model.n_faces + _PER_STATE) * (o_a * n_a + o_b * n_b)
        if t < pair.horizon:
            work += _numbers_of_step_back(pair, t)
        peak = max(peak, later + work)
        later += float(o_a * n_a) * float(o_b * n_b)
    return PROCESS + _BYTES * peak


def _numbers_of_step_back(pair: Pair, t: int) -> float:
    """Returns how many numbers a step back from t+1 to t holds at most."""
    (o_a, n_a), (o_b, n_b) = pair.a.sizes(t), pair.b.sizes(t)
    ahead_a, ahead_b = len(pair.a.places[t + 1]), len(pair.b.places[t + 1])
    whole = float(o_a * (ahead_a + 1)) * float(o_b * (ahead_b + 1))
    ways_a, ways_b = len(pair.a.robot_class.graph.moves), len(pair.b.robot_class.graph.moves)
    numbers = _TEMPORARIES * whole
    numbers += _PER_MOVE * ways_a * n_a
    numbers += _PER_MOVE * ways_b * n_b
    if pair.model.problem.rules.hold_between_steps:
        kept = 2 if pair.bonuses.stationarity else 1
        numbers += kept * kept * whole + kept * float(o_a * (ahead_a + 1)) * float(o_b * n_b)
        pairs = n_a * n_b
        numbers += _PER_PAIR * pairs
        per_way = _PER_VALUE * o_a * o_b + _PER_WAY
        numbers += min(pairs, pair.pairs_at_once()) * ways_b * per_way
    return numbers
