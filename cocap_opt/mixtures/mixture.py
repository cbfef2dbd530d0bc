"""Mixtures of columns: several paths of each robot, with weights."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.mixtures.columns import Column


class Mixture(NamedTuple):
    """Columns with weights; the weights of each robot's columns add up to 1, or nearly so."""

    columns: list[Column]
    amounts: FloatArray  # [n] amount of the robot on each column

    def joined(self, columns: Sequence[Column]) -> "Mixture":
        """Returns the mixture with new columns; each gets the same amount as an old column of its
        robot.
        """
        known = {column.key for column in self.columns}
        new = [column for column in columns if column.key not in known]
        all_columns = [*self.columns, *new]
        robots = np.array([column.robot for column in all_columns])
        amounts = np.append(self.amounts, (1 / np.bincount(robots)[robots])[len(known) :])
        return Mixture(all_columns, amounts / np.bincount(robots, amounts)[robots])

    def raised(self, amounts: FloatArray, least: float) -> "Mixture":
        """Returns the columns with new amounts [n], dropping those with at most the least
        amount.
        """
        kept = np.flatnonzero(amounts > least)
        return Mixture([self.columns[n] for n in kept.tolist()], amounts[kept])

    def used(self, least: float = 1e-9) -> Iterator[tuple[Column, float]]:
        """Yields the columns with amounts above `least`, and their amounts."""
        for n in np.flatnonzero(self.amounts > least).tolist():
            yield self.columns[n], float(self.amounts[n])
