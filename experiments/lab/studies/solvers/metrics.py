"""Metrics of the table of solvers: a number beside the number that it must reach."""

import math
from typing import Literal, NamedTuple, Self


class Target(NamedTuple):
    """A number that a figure is to reach."""

    relation: Literal["<", ">="]
    number: float

    @classmethod
    def below(cls, number: float) -> Self:
        """Makes the target of being less than a number."""
        return cls("<", number)

    @classmethod
    def at_least(cls, number: float) -> Self:
        """Makes the target of being at least a number."""
        return cls(">=", number)

    def met(self, value: float) -> bool:
        """Returns True if a value reaches the target."""
        return value < self.number if self.relation == "<" else value >= self.number


class Metric(NamedTuple):
    """A measured number.

    Attributes
    ----------
    note : the instances that it was measured on, or why there is no number
    """

    name: str
    value: float
    unit: str
    must: Target | None = None
    moonshot: Target | None = None
    note: str = ""

    @property
    def met(self) -> str:
        """The most ambitious target that is met, in a word; empty without a target."""
        if self.moonshot is not None and self.moonshot.met(self.value):
            return "moonshot"
        if self.must is not None:
            return "must" if self.must.met(self.value) else "missed"
        return "" if self.moonshot is None else "open"

    @property
    def words(self) -> str:
        """The number with its unit."""
        if math.isinf(self.value):
            return "never" if self.value > 0 else "-"
        return "-" if math.isnan(self.value) else f"{self.value:.3g} {self.unit}"

    @property
    def targets(self) -> dict[str, str]:
        """The targets by their names, with their unit; empty where there is none."""
        named = {"must": self.must, "moonshot": self.moonshot}
        return {
            name: "" if target is None else f"{target.relation} {target.number:g} {self.unit}"
            for name, target in named.items()
        }
