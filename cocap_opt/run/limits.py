"""The limits of one computation, which begin to count when it begins."""

from typing import NamedTuple

from cocap_opt.stop import FirstOf, Stop, TimeLimit, WorkLimit, never


class Allowance(NamedTuple):
    """The limits of one computation, which begin to count with it."""

    seconds: float
    work: int | None = None  # units of `WorkLimit`; any number if None

    def begin(self, stop: Stop = never) -> Stop:
        """Returns a stop that is reached with `stop`, or once this allowance is spent."""
        criteria = [stop, TimeLimit(self.seconds)]
        if self.work is not None:
            criteria.append(WorkLimit(self.work))
        return FirstOf(*criteria)


class Awaiting(FirstOf):
    """Reached with another stop and, from `begin` on, once an allowance is spent.

    What comes before `begin`, as coverage does, is charged to nobody.
    """

    def __init__(self, stop: Stop, allowance: Allowance) -> None:
        super().__init__(stop)
        self._allowance = allowance

    def begin(self) -> None:
        """Lets the allowance begin to count."""
        self._criteria = (self._allowance.begin(*self._criteria),)
