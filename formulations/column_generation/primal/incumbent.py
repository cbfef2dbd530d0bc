"""Incumbents: plans that obey all rules, as one column per robot."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cocap_opt.coordination.team import Team
from cocap_opt.formulations.certificates.resources import Visit
from cocap_opt.formulations.column_generation.master.resource_use import ResourceUse
from cocap_opt.formulations.relaxations.flow import assigned_heads
from cocap_opt.mixtures.columns import Arc, Column
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.model import Model, Path
from cocap_opt.problem import Plan

_NO_MOVE = -1e3  # lower than any flow along a move

# By class and step, the states of its robots, one for each robot.
_Heads = defaultdict[tuple[int, int], list[int]]


@dataclass(frozen=True)
class Incumbent(Team[Column]):
    """A plan that obeys all rules, as one column per robot."""

    @classmethod
    def of(cls, model: Model, columns: Sequence[Column]) -> "Incumbent | None":
        """Returns the plan that consists of one column per robot; None if it breaks a rule."""
        team = cls(model, tuple(columns))
        return team if team.obeys_the_rules else None

    @classmethod
    def along(cls, model: Model, paths: Sequence[Path]) -> "Incumbent | None":
        """Returns the plan that consists of one path per robot; None if it breaks a rule."""
        return cls.of(model, [Column.of(model, i, path) for i, path in enumerate(paths)])

    @classmethod
    def of_plan(cls, model: Model, plan: Plan | None) -> "Incumbent | None":
        """Returns a plan as an incumbent; None if there is no plan, or if it breaks a rule."""
        return None if plan is None else cls.along(model, model.paths(plan))

    @classmethod
    def of_integral(cls, model: Model, mixture: Mixture) -> "Incumbent | None":
        """Returns the plan of an integral mixture; None if it is fractional or breaks a rule."""
        paths = _integral_paths(model, mixture)
        return None if paths is None else cls.along(model, paths)

    @property
    def columns(self) -> tuple[Column, ...]:
        """Columns of all robots, robot by robot."""
        return tuple(column for column in self.found if column is not None)

    def in_model(self, model: Model) -> "Incumbent":
        """Returns the same plan, with the class numbers of another model."""
        return Incumbent(model, tuple(column.in_model(model) for column in self.columns))

    def of_others(self, *robots: int) -> list[Column]:
        """Returns the columns of all robots except the given ones."""
        return [column for column in self.columns if column.robot not in robots]

    def changed(self, column: Column) -> "Incumbent | None":
        """Returns the plan with another column for one robot; None if it breaks a rule."""
        columns = [*self.columns]
        columns[column.robot] = column
        return Incumbent.of(self.model, columns)


def _integral_paths(model: Model, mixture: Mixture) -> list[Path] | None:
    """Returns the paths of all robots if the mixture is integral; None if it is fractional.

    A mixture is integral if every state is used by an integral number of robots, even along
    fractional paths. From step to step, robots move from the states at t to where most of the
    mixture moves.
    """
    use = ResourceUse.of(model, mixture)
    if not use.has_integral_states:
        return None
    heads: _Heads = defaultdict(list)
    for resource, amount in use.states.items():
        assert isinstance(resource, Visit)
        number = resource.class_number
        state = model.classes[number].graph.index(resource.state)
        heads[number, resource.t] += [state] * round(amount)
    flow: defaultdict[Arc, float] = defaultdict(float)
    for column, amount in mixture.used():
        for arc in column.arcs:
            flow[arc] += amount
    paths: dict[int, Path] = {}
    for number, robot_class in enumerate(model.classes):
        of_class = _paths_of_class(model, number, heads, flow)
        if of_class is None:
            return None
        paths |= zip(robot_class.robots, of_class, strict=True)
    return [paths[robot] for robot in range(len(model.problem.robots))]


def _paths_of_class(
    model: Model, number: int, heads: _Heads, flow: Mapping[Arc, float]
) -> list[Path] | None:
    """Returns the paths of the robots of a class; None if they cannot move from head to head.

    Parameters
    ----------
    flow : amount of the mixture along each arc
    """
    starts = [dict.fromkeys(starts.tolist(), 0.0) for starts in model.classes[number].starts]
    at = assigned_heads(starts, heads[number, 0], _NO_MOVE)
    along = []
    for t in range(model.problem.horizon):
        if at is None:
            return None
        along.append(at)
        ends = heads[number, t + 1]
        arcs = [{end: Arc(number, t, tail, end) for end in ends} for tail in at]
        ahead = [{end: flow[arc] for end, arc in each.items() if arc in flow} for each in arcs]
        at = assigned_heads(ahead, ends, _NO_MOVE)
    return None if at is None else list(zip(*along, at, strict=True))
