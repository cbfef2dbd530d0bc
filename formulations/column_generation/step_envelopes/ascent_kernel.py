"""Local search for high joint states, compiled; only imported where numba is installed."""

from functools import partial
from typing import NamedTuple

import numpy as np

from cocap_opt.compiling import compiled
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.returns import return_of

_MOST_SWEEPS = 50  # over all robots, of one start
_GAIN = 1e-9  # relative, from which on a height counts as higher


class AscentViews(NamedTuple):
    """The arrays that local search reads: of n states, F faces, R robots."""

    first: IntArray  # [n+1] first entry of each state's coverage
    faces: IntArray  # of each entry
    pixels: FloatArray  # of each entry
    weights: FloatArray  # [F]
    n_roots: int  # faces before those that count drones
    caps: FloatArray  # [F - n_roots] k of those
    price: FloatArray  # [n]
    charge: FloatArray  # [n]
    ranges: IntArray  # [R, 2] first state of each robot's class, and the first of the next class
    conflict: BoolArray  # [n, n]


_return_of = partial(compiled, kept=False, forceinline=True)(return_of)


@compiled
def ascend(views: AscentViews, floor: float, teams: IntArray) -> None:
    """Changes each team [R] until no robot can raise its height alone.

    Of the states that a robot may take, those come first with which the joint state counts: its
    worth less its charges is at least the floor. Where there is none, it takes the one that comes
    nearest. Robots at -1 are nowhere yet.
    """
    robots = teams.shape[1]
    seen, values = np.zeros(len(views.weights)), np.zeros(len(views.weights))
    for team in range(len(teams)):
        before = -np.inf
        for _ in range(_MOST_SWEEPS):
            height = 0.0
            for robot in range(robots):
                for f in range(len(seen)):
                    seen[f] = 0.0
                paid, charged, worth = 0.0, 0.0, 0.0
                for other in range(robots):
                    s = teams[team, other]
                    if other == robot or s < 0:
                        continue
                    paid += views.price[s]
                    charged += views.charge[s]
                    for e in range(views.first[s], views.first[s + 1]):
                        seen[views.faces[e]] += views.pixels[e]
                for f in range(len(seen)):
                    values[f] = _return_of(views.n_roots, views.caps, f, seen[f])
                    worth += views.weights[f] * values[f]
                best, best_height, best_low, best_counts = -1, -np.inf, -np.inf, False
                for s in range(views.ranges[robot, 0], views.ranges[robot, 1]):
                    gain = 0.0
                    for e in range(views.first[s], views.first[s + 1]):
                        f = views.faces[e]
                        amount = seen[f] + views.pixels[e]
                        value = _return_of(views.n_roots, views.caps, f, amount)
                        gain += views.weights[f] * (value - values[f])
                    now = worth + gain - paid - views.price[s]
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
                    for other in range(robots):
                        taken = teams[team, other]
                        if other != robot and taken >= 0 and views.conflict[s, taken]:
                            is_free = False
                    if is_free:
                        best, best_height, best_low, best_counts = s, now, low, counts
                if best >= 0:
                    teams[team, robot] = best
                    height = best_height
            if height <= before + _GAIN * abs(height):
                break
            before = height


def call_once() -> None:
    """Searches for no team at all, so that the kernel is loaded, or compiled and kept."""
    none, single = np.zeros(1, dtype=np.int64), np.ones(1)
    views = AscentViews(
        np.array([0, 1]), none, single, single, 1, np.zeros(0), single, single,
        np.array([[0, 1]]), np.zeros((1, 1), dtype=np.bool_),
    )  # fmt: skip
    ascend(views, 0.0, np.zeros((0, 1), dtype=np.int64))
