"""The search for the highest joint state, compiled by numba where that is installed.

It does what the plain search of `joint_states` does, about twenty times as fast, and can be
interrupted; the tests hold it to the plain one. Without numba (extra `fast`) the plain one runs.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from typing import Any

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray


@cache
def is_there() -> bool:
    """Returns True if numba is installed."""
    return find_spec("numba") is not None


@dataclass(eq=False)
class Running:
    """A search that has been begun.

    Attributes
    ----------
    data : the arrays that it reads
    memory : the arrays that it writes
    best : largest height found, at first the least one wanted
    floor : least worth, less charges, of a joint state that counts
    """

    data: tuple[Any, ...]
    memory: tuple[Any, ...]
    best: float
    floor: float

    @classmethod
    def of(
        cls,
        views: tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray, FloatArray],
        class_of: IntArray,
        sizes: tuple[int, ...],
        conflict: BoolArray,
        ceilings: Sequence[tuple[float, FloatArray]],
        limits: Sequence[tuple[float, FloatArray]],
        least: float,
        floor: float,
        most_found: int = 0,
    ) -> "Running":
        """Returns a search at its beginning.

        Parameters
        ----------
        views : coverage of the states in compressed sparse rows (first entries [n+1], faces,
            pixels), weights of the faces [F], payments and charges of the states [n]
        class_of, sizes : class of each state [n], not decreasing; robots of each class
        ceilings, limits : their heights, and what each state is paid or charged more than then [n]
        conflict : [n, n] whether two robots may not be in these states at once
        least, floor : as in `joint_states`
        most_found : if not 0, all joint states that count are collected, up to so many
        """
        n, n_faces, robots = len(class_of), len(views[3]), sum(sizes)
        own = np.repeat(np.arange(len(sizes)), sizes)  # class of the robot that is chosen next
        left = np.array([[int((own[d:] == c).sum()) for c in range(len(sizes))]
                         for d in range(robots + 1)])  # fmt: skip
        bounds = [*ceilings, *limits]
        highest = np.array([height for height, _ in bounds])
        more = np.array([more for _, more in bounds]).reshape(len(bounds), n)
        is_limit = np.arange(len(bounds)) >= len(ceilings)
        memory = (
            np.array([0, 1, 0, 0]),  # depth, is its node new, is all done, how many are found
            np.tile(np.arange(n), (robots + 1, 1)),  # positions of states that may be taken
            np.tile([n, 0], (robots + 1, 1)),  # how many, and how many of the next robot's class
            np.zeros(robots + 1, dtype=np.int64),  # next child
            np.zeros((3, robots + 1, n)),  # gains less payments, less charges, and the most
            np.zeros((2, robots + 1, n_faces)),  # pixels so far, and their roots
            np.zeros((2, robots + 1)),  # worth so far less payments, and less charges
            np.tile(highest, (robots + 1, 1)),  # ceilings, limits, less what is paid more so far
            np.full((2, robots), -1),  # positions of the robots' states, and of the highest's
            np.zeros((most_found, robots), dtype=np.int64),  # positions of those that are collected
        )
        return cls((*views, class_of, own, left, conflict, more, is_limit), memory, least, floor)

    @property
    def positions(self) -> tuple[int, ...]:
        """Positions of the states of the highest joint state; none if none is higher."""
        found = self.memory[-2][1]
        return tuple(found.tolist()) if found[0] >= 0 else ()

    @property
    def found(self) -> list[tuple[int, ...]]:
        """Positions of the joint states that were collected."""
        count = int(self.memory[0][3])
        return [tuple(some) for some in self.memory[-1][:count].tolist()]

    @property
    def is_full(self) -> bool:
        """True if there are more joint states to collect than allowed."""
        return bool(self.memory[0][3] > len(self.memory[-1]))

    def advance(self, nodes: int) -> bool:
        """Goes on for so many nodes; returns True once all is done."""
        self.best = float(_kernel()(*self.data, *self.memory, self.best, self.floor, nodes))
        return bool(self.memory[0][2])


@cache
def _kernel() -> Any:
    import numba

    try:
        return numba.njit(cache=True)(_advance)
    except RuntimeError:  # there is no folder to keep what is compiled
        return numba.njit(_advance)


def _advance(
    first: Any, faces: Any, pixels: Any, weights: Any, payment: Any, charge: Any,
    class_of: Any, own: Any, counts: Any, conflict: Any, more_paid: Any, is_limit: Any,
    at: Any, states: Any, numbers: Any, position: Any, values: Any, seen: Any, heights: Any,
    below: Any, chosen: Any, collected: Any, best: float, floor: float, nodes: int,
) -> float:  # fmt: skip
    """Goes on with a search for so many nodes; returns the largest height so far.

    Slices and sorting by NumPy would make numba compile for ten seconds instead of two.
    """
    robots, n_classes = len(own), counts.shape[1]
    largest, largest_low, least = np.empty(n_classes), np.empty(n_classes), np.empty(n_classes)
    done = 0
    d = at[0]
    while d >= 0 and done < nodes:
        if at[1]:  # a new node: what each state would gain, and which are left
            at[1] = 0
            done += 1
            if d == robots:
                if len(collected):
                    if at[3] < len(collected):
                        for k in range(robots):
                            collected[at[3], k] = chosen[0, k]
                    at[3] += 1
                elif heights[0, d] > best:
                    best = heights[0, d]
                    for k in range(robots):
                        chosen[1, k] = chosen[0, k]
                d -= 1
                continue
            for k in range(len(more_paid)):
                for c in range(n_classes):
                    least[c] = np.inf
                for i in range(numbers[d, 0]):
                    s = states[d, i]
                    least[class_of[s]] = min(least[class_of[s]], more_paid[k, s])
                most = below[d, k]
                for c in range(n_classes):
                    if counts[d, c]:
                        most -= counts[d, c] * least[c]
                kept = 0
                for i in range(numbers[d, 0]):
                    s = states[d, i]
                    high = most + least[class_of[s]] - more_paid[k, s]
                    if high >= floor if is_limit[k] else high > best:
                        states[d, kept] = s
                        kept += 1
                numbers[d, 0] = kept
            for c in range(n_classes):
                largest[c], largest_low[c] = -np.inf, -np.inf
            for i in range(numbers[d, 0]):
                s = states[d, i]
                gain = 0.0
                for e in range(first[s], first[s + 1]):
                    f = faces[e]
                    gain += weights[f] * (np.sqrt(seen[0, d, f] + pixels[e]) - seen[1, d, f])
                values[0, d, i] = gain - payment[s]
                values[1, d, i] = gain - charge[s]
                c = class_of[s]
                largest[c] = max(largest[c], values[0, d, i])
                largest_low[c] = max(largest_low[c], values[1, d, i])
            most, most_low = heights[0, d], heights[1, d]
            for c in range(n_classes):
                if counts[d, c]:
                    most += counts[d, c] * largest[c]
                    most_low += counts[d, c] * largest_low[c]
            kept, same = 0, 0
            for i in range(numbers[d, 0]):
                s = states[d, i]
                c = class_of[s]
                high = most - largest[c] + values[0, d, i]
                low = most_low - largest_low[c] + values[1, d, i]
                if high > best and low >= floor:
                    states[d, kept] = s
                    values[0, d, kept], values[1, d, kept] = values[0, d, i], values[1, d, i]
                    values[2, d, kept] = high
                    kept += 1
                    if c == own[d]:
                        same += 1
            # By gain, the first of equals first; they come nearly so, ordered by the node above.
            for i in range(1, same):
                s, gain, low, high = states[d, i], values[0, d, i], values[1, d, i], values[2, d, i]
                j = i
                while j > 0 and values[0, d, j - 1] < gain:
                    states[d, j], values[0, d, j] = states[d, j - 1], values[0, d, j - 1]
                    values[1, d, j], values[2, d, j] = values[1, d, j - 1], values[2, d, j - 1]
                    j -= 1
                states[d, j], values[0, d, j] = s, gain
                values[1, d, j], values[2, d, j] = low, high
            numbers[d, 0], numbers[d, 1] = kept, same
            position[d] = 0
        i = position[d]
        more = counts[d + 1, own[d]]  # robots of this class that come after this one
        if i >= numbers[d, 1] or (
            values[2, d, i] - more * (values[0, d, 0] - values[0, d, i]) <= best
        ):
            d -= 1
            continue
        position[d] = i + 1
        s = states[d, i]
        chosen[0, d] = s
        for f in range(len(weights)):
            seen[0, d + 1, f], seen[1, d + 1, f] = seen[0, d, f], seen[1, d, f]
        for e in range(first[s], first[s + 1]):
            f = faces[e]
            seen[0, d + 1, f] += pixels[e]
            seen[1, d + 1, f] = np.sqrt(seen[0, d + 1, f])
        heights[0, d + 1] = heights[0, d] + values[0, d, i]
        heights[1, d + 1] = heights[1, d] + values[1, d, i]
        for k in range(len(more_paid)):
            below[d + 1, k] = below[d, k] - more_paid[k, s]
        kept = 0
        # Gains only shrink: of one class, what has gained too little here need not be looked at.
        one_class = more > 0 and more == robots - d - 1
        least_gain = best - heights[0, d + 1] - (more - 1) * values[0, d, i]
        for j in range(i if more else numbers[d, 1], numbers[d, 0]):
            if one_class and values[0, d, j] <= least_gain:
                break
            if not conflict[s, states[d, j]]:
                states[d + 1, kept] = states[d, j]
                kept += 1
        numbers[d + 1, 0] = kept
        d += 1
        at[1] = 1
    at[0] = d
    at[2] = d < 0
    return best
