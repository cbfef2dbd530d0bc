"""The incumbent: a plan that obeys all rules, as one column per robot."""

from collections.abc import Sequence
from typing import NamedTuple

from cocap_opt.formulations.column_generation.columns import Column
from cocap_opt.model import Model, Path
from cocap_opt.objective import objective
from cocap_opt.problem import Plan, conflicts

_LEAST_GAIN = 1e-12  # relative, so that rounding is no gain


class Incumbent(NamedTuple):
    """A plan that obeys all rules, as one column per robot."""

    value: float  # J
    columns: tuple[Column, ...]  # robot by robot

    @classmethod
    def of(cls, model: Model, columns: Sequence[Column]) -> "Incumbent | None":
        """Returns the plan made of one column per robot; None if it breaks a rule."""
        paths = [column.path for column in columns]
        if next(conflicts(model.problem, model.plan(paths)), None) is not None:
            return None
        return cls(objective(model, paths), tuple(columns))

    @classmethod
    def along(cls, model: Model, paths: Sequence[Path]) -> "Incumbent | None":
        """Returns the plan of one path per robot; None if it breaks a rule."""
        return cls.of(model, [Column.of(model, i, path) for i, path in enumerate(paths)])

    @classmethod
    def of_plan(cls, model: Model, plan: Plan | None) -> "Incumbent | None":
        """Returns a plan as an incumbent; None without one and if it breaks a rule."""
        return None if plan is None else cls.along(model, model.paths(plan))

    @property
    def paths(self) -> tuple[Path, ...]:
        """Paths of all robots."""
        return tuple(column.path for column in self.columns)

    def in_model(self, model: Model) -> "Incumbent":
        """Returns the same plan with the numbers of another model's classes."""
        return Incumbent(self.value, tuple(column.in_model(model) for column in self.columns))

    def without(self, *robots: int) -> list[Column]:
        """Returns the columns of all other robots."""
        return [column for column in self.columns if column.robot not in robots]

    def changed(self, model: Model, *columns: Column) -> "Incumbent | None":
        """Returns the plan with other columns for their robots; None if it breaks a rule."""
        all_columns = [*self.columns]
        for column in columns:
            all_columns[column.robot] = column
        return Incumbent.of(model, all_columns)

    def clearly_better_than(self, other: "Incumbent") -> bool:
        """Returns True if the gain is more than rounding."""
        return self.value > other.value * (1 + _LEAST_GAIN)
