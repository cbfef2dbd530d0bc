"""Figures of the table of solvers: a number with what it must reach."""

import math
from typing import Literal, NamedTuple


class Target(NamedTuple):
    """What a figure is to reach."""

    relation: Literal["<", ">="]
    number: float

    def met(self, value: float) -> bool:
        """Whether a value reaches it."""
        return value < self.number if self.relation == "<" else value >= self.number


class Figure(NamedTuple):
    """A measured number.

    Attributes
    ----------
    note : on what it was measured, or why there is no number
    """

    name: str
    value: float
    unit: str
    must: Target | None = None
    moonshot: Target | None = None
    note: str = ""

    @property
    def met(self) -> str:
        """The most that is met, in a word; nothing where nothing is asked for."""
        if self.moonshot is not None and self.moonshot.met(self.value):
            return "moonshot"
        if self.must is not None:
            return "must" if self.must.met(self.value) else "missed"
        return "" if self.moonshot is None else "open"


def below(number: float) -> Target:
    """The value is to be less."""
    return Target("<", number)


def at_least(number: float) -> Target:
    """The value is to be no less."""
    return Target(">=", number)


def number(value: float, unit: str) -> str:
    """A number with its unit."""
    if math.isinf(value):
        return "never" if value > 0 else "-"
    return "-" if math.isnan(value) else f"{value:.3g} {unit}"


def target(wanted: Target | None, unit: str) -> str:
    """A target with its unit."""
    return "" if wanted is None else f"{wanted.relation} {wanted.number:g} {unit}"
