"""A compiled step of value iteration, orientation by orientation, each within the cache.

It finds the same maxima as the NumPy passes of `value_iteration`, with which tests compare it.
Imported only if numba is installed.
"""

from functools import partial

import numpy as np

from cocap_opt.compiling import compiled
from cocap_opt.data import FloatArray, IntArray

# Nothing is allocated here, so references need not be counted.
_compiled = partial(compiled, nogil=True, error_model="numpy", _nrt=False)
_inlined = partial(_compiled, kept=False, forceinline=True)


# Only loops over slices that begin at 0, and without `max`, are vectorised.
@_inlined
def _larger(a: float, b: float) -> float:
    return a if a > b else b


@_inlined
def _copy(values: FloatArray, target: FloatArray) -> None:
    for i in range(len(target)):
        target[i] = values[i]


@_inlined
def _add(values: FloatArray, other: FloatArray, target: FloatArray) -> None:
    for i in range(len(target)):
        target[i] = values[i] + other[i]


@_inlined
def _largest(a: FloatArray, b: FloatArray, c: FloatArray, target: FloatArray) -> None:
    for i in range(len(target)):
        target[i] = _larger(_larger(a[i], b[i]), c[i])


@_inlined
def _turn(
    ahead: FloatArray, heading: int, pitch: int, turn: int, pitch_turn: int, values: FloatArray
) -> None:
    """Writes the best values [P] over the turns from a heading and a pitch."""
    headings, pitches = ahead.shape[:2]
    best = ahead[heading, pitch]
    for p in range(max(pitch - pitch_turn, 0), min(pitch + pitch_turn, pitches - 1) + 1):
        if turn == 0 or p != pitch:
            _largest(best, best, ahead[heading, p], values)
            best = values
        for k in range(1, turn + 1):
            left, right = (heading + k) % headings, (heading - k) % headings
            _largest(best, ahead[left, p], ahead[right, p], values)
            best = values


@_inlined
def _raise_to(values: FloatArray, target: FloatArray) -> None:
    for i in range(len(target)):
        target[i] = _larger(values[i], target[i])


@_inlined
def _widen(source: FloatArray, stride: int, target: FloatArray) -> None:
    """Writes the best of the values and of those a stride to either side."""
    n = len(source)
    _largest(
        source[: n - 2 * stride], source[stride : n - stride], source[2 * stride :],
        target[stride : n - stride],
    )  # fmt: skip
    _copy(source[:stride], target[:stride])
    _copy(source[n - stride :], target[n - stride :])


@_inlined
def _move(
    values: FloatArray, reaches: IntArray, strides: IntArray, widths: IntArray, shifts: IntArray,
    places: IntArray, heads: IntArray, room: FloatArray, best: FloatArray,
) -> None:  # fmt: skip
    """Writes the best of the values [P] over moves.

    Each pass widens the window by a leap along one axis. Values that it leaves at both ends lie in
    the border, and no later pass carries them out of it.
    """
    n, source, here = len(values), values, 0
    if len(widths) == 0:
        for axis in range(3):
            for _ in range(reaches[axis]):
                _widen(source, strides[axis], room[here])
                source, here = room[here], 1 - here
        _copy(source, best)
    else:
        best[:] = -np.inf
        done = 0
        for i in range(len(widths)):
            while done < widths[i]:
                _widen(source, strides[2], room[here])
                source, here, done = room[here], 1 - here, done + 1
            first, end = max(0, -shifts[i]), n - max(0, shifts[i])
            _raise_to(source[first + shifts[i] : end + shifts[i]], best[first:end])
    for i in range(len(places)):
        most = values[heads[0, i]]
        for k in range(1, len(heads)):
            most = max(most, values[heads[k, i]])
        best[places[i]] = most


@_compiled
def sweep(
    value: FloatArray, reward: FloatArray, room: FloatArray, turn: int, pitch_turn: int,
    reaches: IntArray, strides: IntArray, widths: IntArray, shifts: IntArray, places: IntArray,
    heads: IntArray,
) -> None:  # fmt: skip
    """Sweeps back over all steps before the last, whose values are given.

    Parameters
    ----------
    value, reward : [T+1, H, Q, P] by heading, pitch and place; writes all values except those of
        the last step
    room : [4, P] working memory
    turn, pitch_turn : largest turns of heading and pitch in a step
    reaches, strides : [3] largest moves in leaps along layers, x and y, and the differences between
        the numbers of places that a leap joins
    widths, shifts : [n] largest leaps along y in rows of moves, increasing, and the differences
        between the numbers of places to which the middles of rows lead; none if the moves are a box
    places, heads : [n] irregular places, and [K, n] the places to which their moves lead
    """
    headings, pitches = value.shape[1:3]
    turned, best = room[0], room[1]
    for t in range(len(value) - 2, -1, -1):
        for h in range(headings):
            for q in range(pitches):
                _turn(value[t + 1], h, q, turn, pitch_turn, turned)
                _move(turned, reaches, strides, widths, shifts, places, heads, room[2:], best)
                _add(best, reward[t, h, q], value[t, h, q])


@_compiled
def best_of_moves(
    ahead: FloatArray, turned: FloatArray, best: FloatArray, room: FloatArray, turn: int,
    pitch_turn: int, reaches: IntArray, strides: IntArray, widths: IntArray, shifts: IntArray,
    places: IntArray, heads: IntArray,
) -> None:  # fmt: skip
    """Finds the best values ahead over turns, and the best of these over the moves of one step.

    Parameters
    ----------
    ahead : [H, Q, P] values ahead, by heading, pitch and place
    turned, best : [H, Q, P] outputs: the best over turns, and over turns and moves
    room : [4, P] working memory
    turn, pitch_turn, reaches, strides, widths, shifts, places, heads : as in `sweep`
    """
    for h in range(ahead.shape[0]):
        for q in range(ahead.shape[1]):
            _turn(ahead, h, q, turn, pitch_turn, turned[h, q])
            _move(
                turned[h, q],
                reaches,
                strides,
                widths,
                shifts,
                places,
                heads,
                room[2:],
                best[h, q],
            )


def call_once() -> None:
    """Calls the kernel for one place, so that it is loaded, or compiled and stored."""
    single, none = np.zeros((1, 1, 1)), np.zeros(0, dtype=np.int64)
    three, heads = np.zeros(3, dtype=np.int64), np.zeros((1, 0), dtype=np.int64)
    rest = np.zeros((4, 1)), 0, 0, three, three, none, none, none, heads
    sweep(np.zeros((1, 1, 1, 1)), np.zeros((1, 1, 1, 1)), *rest)
    best_of_moves(single, single.copy(), single.copy(), *rest)
