"""The joint states that are reached at a step: the best way to each of them."""

from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import FloatArray, IntArray


class Reached(NamedTuple):
    """The joint states that are reached at a step, and the best way to each of them.

    Attributes
    ----------
    values : [L] J, worth of the steps explored so far; onward from a step in the middle, also the
        most that the steps before it can be worth
    placed : [L, R] number of each robot's state
    before : [L] number of the joint state from which it is reached: one of the previous step, or,
        if paths are explored backwards, of the next step
    """

    values: FloatArray
    placed: IntArray
    before: IntArray

    @classmethod
    def empty(cls, robots: int) -> Self:
        """Returns an empty set of joint states for a number of robots."""
        nothing = np.zeros((0, robots), dtype=np.int64)
        return cls(np.zeros(0), nothing, np.zeros(0, dtype=np.int64))

    @classmethod
    def joined(cls, parts: Iterable[Self]) -> Self:
        """Returns the joint states of all parts, in their order; there must be at least one."""
        return cls(*map(np.concatenate, zip(*parts, strict=True)))


def merged(numbers: IntArray, parts: Iterable[Reached]) -> tuple[Reached, IntArray]:
    """Returns the best way to each joint state, best first; and, for each given way [M], the number
    of its joint state among them.

    Parameters
    ----------
    numbers : [R] class of each robot; robots of one class are exchangeable
    """
    values, placed, before = Reached.joined(parts)
    same = sorting_keys(in_order(numbers, placed))
    order = np.lexsort((*sorting_keys(placed), before, -values, *same))
    is_first = np.zeros(len(order), dtype=np.bool_)
    is_first[:1] = True
    for key in same:
        is_first[1:] |= np.diff(key[order]) != 0
    kept = order[is_first]
    best_first = np.argsort(-values[kept], kind="stable")
    number, rank = np.empty(len(order), dtype=np.int64), np.empty_like(best_first)
    rank[best_first] = np.arange(len(kept))
    number[order] = rank[np.cumsum(is_first) - 1]
    kept = kept[best_first]
    return Reached(values[kept], placed[kept], before[kept]), number


def in_order(numbers: IntArray, placed: IntArray) -> IntArray:
    """Returns joint states [L, R] with the states of exchangeable robots in order.

    Parameters
    ----------
    numbers : [R] class of each robot
    """
    same = placed.copy()
    for number in np.unique(numbers):
        alike = numbers == number
        same[:, alike] = np.sort(placed[:, alike], axis=1)
    return same


def sorting_keys(columns: IntArray) -> list[IntArray]:
    """Returns keys for `np.lexsort` that order rows [L, n] of numbers >= 0, the last column first.

    Several columns form one key, as far as 64 bits suffice: sorting then takes much less time.
    """
    keys, most = list[IntArray](), 1
    for column in columns.T[::-1]:
        base = int(column.max(initial=0)) + 1
        if keys and most * base < 2**63:
            keys[0] = keys[0] * base + column
            most *= base
        else:
            keys.insert(0, column)
            most = base
    return keys
