"""The options of sweeps that choose where to compute: in this process, in several, or on a
scheduler.
"""

from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.cli.options import Workers
from cocap_opt.experiments.sweeps.instances import Settings
from cocap_opt.experiments.sweeps.sweep import Hired
from cocap_opt.run.options import Option, UsageError


@Parameter(name="*")
@dataclass(frozen=True)
class Workforce:
    """The options that choose the workers."""

    workers: Workers = None
    scheduler: Annotated[
        str | None, Parameter(help="address of a dask scheduler whose workers to use")
    ] = None
    cell_limit: Annotated[
        float | None,
        Parameter(
            help="seconds after which a worker is stopped, with the planner or bound it runs"
        ),
    ] = None

    @property
    def is_elsewhere(self) -> bool:
        """True if other processes compute."""
        return self.workers is not None or self.scheduler is not None

    def hired(self, settings: Settings) -> Hired:
        """Returns the workers that the options name."""
        if self.workers is not None and self.scheduler is not None:
            raise UsageError(
                "--workers: a scheduler has its own workers; omit one of the two options"
            )
        Option("--workers").require_cores(self.workers)
        limit = self.cell_limit
        if limit is not None and not limit > 0:
            raise UsageError(f"--cell-limit: must be a number of seconds > 0, not {limit}")
        if limit is not None and not self.is_elsewhere:
            raise UsageError(
                "--cell-limit: requires --workers or --scheduler; this process has no limit"
            )
        return Hired(self.workers, self.scheduler, limit or settings.cell_limit)


HERE = Workforce()
