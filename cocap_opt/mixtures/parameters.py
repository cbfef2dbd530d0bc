"""Parameters of searches: numbers with units and meanings, checked where they are made."""

import inspect
import math
import re
from dataclasses import dataclass, fields
from typing import Annotated

Share = Annotated[float, "between 0 and 1"]
Shares = tuple[Share, ...]


class Section:
    """The parameters of one part of the search, checked where they are made."""

    def __post_init__(self) -> None:
        """Raises ValueError, naming the parameter, if a number is out of range."""
        for parameter in fields(self):  # type: ignore[arg-type]  # its subclasses are dataclasses
            given, default = getattr(self, parameter.name), parameter.default
            several = given if isinstance(default, tuple) else (given,)
            whole, is_share = isinstance(default, int), parameter.type in (Share, Shares)
            largest = 1 if is_share else math.inf
            if not isinstance(several, tuple) or not all(
                _is_allowed(number, whole, largest) for number in several
            ):
                kind = "a whole number" if whole else "a number"
                most = " between 0 and 1" if is_share else " from 0 on"
                raise ValueError(
                    f"{type(self).__name__}.{parameter.name}: {given!r} is not {kind}{most}"
                )

    @classmethod
    def told(cls) -> dict[str, tuple[str, str]]:
        """Returns the unit and meaning of each parameter by name, as given in the docstring."""
        listed = (inspect.getdoc(cls) or "").partition("----------\n")[2]
        parts = re.findall(r"^(\w+) : (.+)\n((?: {4}.+\n?)+)", listed, re.MULTILINE)
        return {name: (unit, " ".join(meaning.split())) for name, unit, meaning in parts}


def _is_allowed(number: object, whole: bool, largest: float) -> bool:
    """Returns True for a finite number from 0 to the largest, and whole if required."""
    if isinstance(number, bool) or not isinstance(number, int if whole else int | float):
        return False
    return math.isfinite(number) and 0 <= number <= largest


@dataclass(frozen=True)
class AscentParameters(Section):
    """The ascent of a mixture without a master: steps along the gradient.

    Attributes
    ----------
    power : of the gradient
        exponent of each step: 1 is safe and slow; 3 does not settle under rules (field-large)
    most_steps : steps
        largest number of steps between two pricings
    rough : share
        remaining gain of these steps at which pricing follows, as a share of the gap
    least_mean : J
        a robot that gains less keeps its amounts
    least_amount : of a robot
        amount below which a column is dropped
    """

    power: float = 2.0
    most_steps: int = 60
    rough: Share = 0.02
    least_mean: float = 1e-6
    least_amount: float = 1e-4


@dataclass(frozen=True)
class PlanSearchParameters(Section):
    """The search for plans with a pool of columns.

    Attributes
    ----------
    width : states
        states of a robot at a step that prices keep, in addition to those of known columns
    draws : roundings
        random roundings, of which the best is improved
    responses : responses per robot
        budget of the neighbourhood search from each plan
    least_amount : of a robot
        smallest amount of a column of a mixture that is used
    found_amount : of a robot
        amount that the columns of each plan found add to a pool
    most_in_vain : plans
        plans in a row that are improved without a better one, after which the search ends
    """

    width: int = 120
    draws: int = 60
    responses: int = 20
    least_amount: float = 1e-6
    found_amount: float = 0.05
    most_in_vain: int = 12
