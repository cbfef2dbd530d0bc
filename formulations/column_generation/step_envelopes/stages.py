"""Stages of a certificate, as step envelopes add one after the other."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from cocap_opt.formulations.certificates.format import Stage, StepConstant
from cocap_opt.formulations.certificates.staged import Narrowing


class Stages(NamedTuple):
    """Stages and the narrowing that they lead to, which only change together.

    Searches among more states have found the constants. They get as much room for rounding as a
    checker gives them, who searches among fewer.
    """

    narrowing: Narrowing
    stages: tuple[Stage, ...] = ()

    def then(self, stage: Stage) -> "Stages":
        """Returns the stages with one more, whose constants no joint state is known to exceed."""
        narrowing = self.narrowing.after(stage, lambda k, _: stage.constants[k].constant)
        return Stages(narrowing, (*self.stages, stage))

    def lowered(self, constants: Sequence[StepConstant]) -> "Stages":
        """Returns the stages with one of constants alone; those that lower nothing are left out."""
        narrowing = self.then(Stage(constants=tuple(constants))).narrowing
        lower = narrowing.constants < self.narrowing.constants
        stage = Stage(constants=tuple(claim for claim in constants if lower[claim.t]))
        return Stages(narrowing, (*self.stages, stage))

    def again(self, narrowing: Narrowing, tell: Callable[[], None]) -> "Stages":
        """Returns the same stages from another narrowing on, of a higher target.

        Parameters
        ----------
        tell : called before each stage
        """
        found = Stages(narrowing)
        for stage in self.stages:
            tell()
            found = found.then(stage)
        return found
