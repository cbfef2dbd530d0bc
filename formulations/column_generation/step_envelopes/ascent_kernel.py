"""Compiled local search for high joint states; imported only if numba is installed."""

from functools import partial
from typing import NamedTuple

import numpy as np

from cocap_opt.compiling import compiled
from cocap_opt.data import BoolArray, FloatArray, IndexArray, IntArray
from cocap_opt.returns import return_of

_MOST_SWEEPS = 50  # sweeps over all robots, per start
_GAIN = 1e-9  # relative; smaller increases do not count


class AscentViews(NamedTuple):
    """The arrays that local search reads, for n states, F faces, R robots."""

    first: IndexArray  # [n+1] first entry of each state's coverage
    faces: IndexArray  # face of each entry
    pixels: FloatArray  # pixels of each entry
    weights: FloatArray  # [F]
    n_roots: int  # number of faces before those that count drones
    caps: FloatArray  # [F - n_roots] cap k of each of those
    price: FloatArray  # [n]
    charge: FloatArray  # [n]
    ranges: IntArray  # [R, 2] first state of each robot's class, and the first of the next class
    place_of: IndexArray  # [n] place of each state, out of P places
    too_near: BoolArray  # [P, P] True if two robots may not be there at once


_return_of = partial(compiled, kept=False, forceinline=True)(return_of)


class _Scratch(NamedTuple):
    """The arrays that scans write, for F faces and n states."""

    seen: FloatArray  # [F] pixels of the other robots
    values: FloatArray  # [F] worth of these pixels, without weights
    highest: FloatArray  # [n] largest height of a joint state with each state


@partial(compiled, kept=False)
def _scanned(
    views: AscentViews, floor: float, team: IntArray, robot: int, states: IntArray,
    scratch: _Scratch, is_noted: bool,
) -> tuple[int, float]:  # fmt: skip
    """Returns the best of some states for a robot, -1 if none is free, and the resulting height.

    The robot's current state is a candidate, too.

    Preferred are states with which the joint state counts, i.e. its worth less its charges is at
    least the floor. If there are none, the state that comes closest to it is chosen.
    """
    seen, values = scratch.seen, scratch.values
    for f in range(len(seen)):
        seen[f] = 0.0
    paid, charged, worth = 0.0, 0.0, 0.0
    for other in range(len(team)):
        if other == robot or team[other] < 0:
            continue
        s = np.uint32(team[other])
        paid += views.price[s]
        charged += views.charge[s]
        for e in range(views.first[s], views.first[s + 1]):
            seen[views.faces[e]] += views.pixels[e]
    for f in range(len(seen)):
        values[f] = _return_of(views.n_roots, views.caps, f, seen[f])
        worth += views.weights[f] * values[f]
    best, best_height, best_low, best_counts = -1, -np.inf, -np.inf, False
    for k in range(-1, len(states)):
        taken = states[k] if k >= 0 else team[robot]
        if taken < 0:
            continue
        s, gain = np.uint32(taken), 0.0
        for e in range(views.first[s], views.first[s + 1]):
            f = views.faces[e]
            value = _return_of(views.n_roots, views.caps, f, seen[f] + views.pixels[e])
            gain += views.weights[f] * (value - values[f])
        now = worth + gain - paid - views.price[s]
        if is_noted:
            scratch.highest[s] = max(scratch.highest[s], now)
        low = worth + gain - charged - views.charge[s]
        counts = low >= floor
        if counts and best_counts:
            is_better = now > best_height
        elif counts != best_counts:
            is_better = counts
        else:
            is_better = low > best_low
        if not is_better:
            continue
        is_free = True
        for other in range(len(team)):
            if other == robot or team[other] < 0:
                continue
            if views.too_near[views.place_of[s], views.place_of[team[other]]]:
                is_free = False
        if is_free:
            best, best_height, best_low, best_counts = taken, now, low, counts
    return best, best_height


@partial(compiled, kept=False)
def _raise(
    views: AscentViews, floor: float, team: IntArray, states: IntArray, spans: IntArray,
    scratch: _Scratch, is_noted: bool,
) -> None:  # fmt: skip
    """Changes a team [R] until no robot can raise the height alone by moving to one of some states.

    Parameters
    ----------
    states : states that robots may take
    spans : [R, 2] the first of these states for each robot's class, and one past the last
    is_noted : True: record the largest height of a joint state with each state
    """
    before, robots, as_before = -np.inf, len(team), -1
    for _ in range(_MOST_SWEEPS):
        height = 0.0
        for robot in range(robots):
            if as_before == robots - 1 and team[robot] >= 0:
                return  # no other robot has changed since this robot's last response
            allowed = states[spans[robot, 0] : spans[robot, 1]]
            best, best_height = _scanned(views, floor, team, robot, allowed, scratch, is_noted)
            as_before = as_before + 1 if best in (-1, team[robot]) else 0
            if best >= 0:
                team[robot], height = best, best_height
        if height <= before + _GAIN * abs(height):
            break
        before = height


@partial(compiled, kept=False)
def _highest(highest: FloatArray, ranges: IntArray, most: int, spans: IntArray) -> IntArray:
    """Returns the highest states of each class, and stores the range for each robot's class in
    spans.
    """
    chosen, end = np.empty(len(highest), dtype=np.int64), 0
    for robot in range(len(ranges)):
        first, last = ranges[robot]
        if robot and ranges[robot - 1, 0] == first:
            spans[robot] = spans[robot - 1]
            continue
        order = first + np.argsort(-highest[first:last])[:most]
        chosen[end : end + len(order)] = np.sort(order)
        spans[robot, 0], spans[robot, 1] = end, end + len(order)
        end += len(order)
    return chosen[:end]


@compiled
def ascend(
    views: AscentViews, floor: float, teams: IntArray, most_full: int, most_high: int
) -> None:
    """Changes each team [R] until no robot can raise the height alone by moving to an allowed
    state.

    Robots at -1 have no state yet.

    Parameters
    ----------
    floor : smallest worth less charges of a joint state that counts
    most_full : number of first teams whose robots may take all states
    most_high : number of states of a class that the robots of later teams may take: those that gave
        the largest heights when one robot of the first teams was moved there
    """
    n, faces = len(views.price), len(views.weights)
    scratch = _Scratch(np.zeros(faces), np.zeros(faces), np.full(n, -np.inf))
    states, spans = np.arange(n), views.ranges.copy()
    for number in range(len(teams)):
        is_full = number < most_full
        if number == most_full:
            states = _highest(scratch.highest, views.ranges, most_high, spans)
        _raise(views, floor, teams[number], states, spans, scratch, is_full)


def call_once() -> None:
    """Runs a search without teams, so that the kernel is loaded, or compiled and stored."""
    none, single = np.zeros(1, dtype=np.uint32), np.ones(1)
    views = AscentViews(
        np.array([0, 1], dtype=np.uint32), none, single, single, 1, np.zeros(0), single, single,
        np.array([[0, 1]]), none, np.zeros((1, 1), dtype=np.bool_),
    )  # fmt: skip
    ascend(views, 0.0, np.zeros((0, 1), dtype=np.int64), 0, 1)
