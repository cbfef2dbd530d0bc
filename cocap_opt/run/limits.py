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
