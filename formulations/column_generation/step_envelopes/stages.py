"""Stages of a certificate, which step envelopes add one after the other."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from cocap_opt.formulations.certificates.format import Stage, StepConstant
from cocap_opt.formulations.certificates.staged import Narrowing


class Stages(NamedTuple):
    """Stages and the resulting narrowing, which only change together.

    Their constants were found by searches among more states than a checker searches. They get the
    same allowance for rounding as a checker would give them.
    """

    narrowing: Narrowing
    stages: tuple[Stage, ...] = ()

    def then(self, stage: Stage) -> "Stages":
        """Returns the stages plus one more, whose constants must be proved upper bounds."""
        narrowing = self.narrowing.after(
            stage, lambda k, _: stage.constants[k].constant, lambda k, _: stage.moves[k].constant
        )
        return Stages(narrowing, (*self.stages, stage))

    def lowered(self, constants: Sequence[StepConstant]) -> "Stages":
        """Returns the stages plus one that has only constants; constants that lower nothing are
        left out.
        """
        narrowing = self.then(Stage(constants=tuple(constants))).narrowing
        lower = narrowing.constants < self.narrowing.constants
        stage = Stage(constants=tuple(claim for claim in constants if lower[claim.t]))
        return Stages(narrowing, (*self.stages, stage))

    def again(self, narrowing: Narrowing, tell: Callable[[], None]) -> "Stages":
        """Returns the same stages applied to another narrowing, with a higher target.

        Parameters
        ----------
        tell : called before each stage
        """
        found = Stages(narrowing)
        for stage in self.stages:
            tell()
            found = found.then(stage)
        return found
