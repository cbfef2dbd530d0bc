"""Best responses: plans one robot of a team for its marginal gain over what the others see.

All planners that plan one robot after another use these functions: `one_by_one` plans the robots
that have no path yet, `in_rounds` replans each robot against all others until nobody gains.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import cycle

from cocap_opt.coordination.low_level import LowLevel, PlannedTeam, SingleRobotPath, SingleRobotTask
from cocap_opt.graph.charges import NO_CHARGES, Charges
from cocap_opt.model import compiled
from cocap_opt.problem import Problem
from cocap_opt.stop import Limit, LimitReached, Stop

# Yields a team as it is planned, step by step, using responses.
Planning = Callable[[PlannedTeam, "Responses"], Iterator[PlannedTeam]]


class Responses:
    """Finds and caches the best path of one robot given its team.

    Attributes
    ----------
    asked : number of paths requested from the low level
    evaluated : number of states whose coverage was evaluated
    limit : the limit because of which a path was chosen after few evaluated views, if any
    """

    def __init__(self, low_level: LowLevel, stop: Stop) -> None:
        self._low_level, self._stop = low_level, stop
        self._known: dict[tuple[object, ...], SingleRobotPath] = {}
        self.asked = self.evaluated = 0
        self.limit: Limit | None = None

    def nobody(self, problem: Problem) -> PlannedTeam:
        """Returns a team in which no robot is planned, with the coverage that the low level needs.

        If a limit ends coverage early, the robots are planned with the available coverage
        (`Model.covered_by`).
        """
        model, is_lazy = compiled(problem), getattr(self._low_level, "is_lazy", False)
        return PlannedTeam.nobody(model if is_lazy else model.covered_by(self._stop))

    def best(self, team: PlannedTeam, robot: int, rules: bool = True) -> SingleRobotPath:
        """Returns a robot's best path given all other planned robots.

        Parameters
        ----------
        rules : True: keep clear of the others' paths; False: ignore collisions

        Raises
        ------
        LimitReached
            If the low level is stopped.
        """
        others = tuple(single and single.path for single in team.without((robot,)).found)
        task = robot, others, rules
        if task not in self._known:
            charges = team.avoiding(robot) if rules else NO_CHARGES
            self._known[task] = self.charged(team, robot, charges)
        return self._known[task]

    def charged(self, team: PlannedTeam, robot: int, charges: Charges) -> SingleRobotPath:
        """Returns a robot's best path under charges, whether or not it is clear of the others.

        Raises
        ------
        LimitReached
            If the low level is stopped.
        """
        seen = team.pixels(without=robot)
        single = self._low_level(SingleRobotTask(team.model, robot, seen, charges, self._stop))
        self.asked += 1
        self.evaluated += single.evaluated
        self.limit = self.limit or single.limit
        return single


def one_by_one(
    team: PlannedTeam, responses: Responses, order: Sequence[int] | None = None, rules: bool = True
) -> Iterator[PlannedTeam]:
    """Yields the team after each robot is planned, until all are planned or one has no path left.

    Under the rules, each robot keeps clear of the robots before it, and of the starts of those
    after it.

    Parameters
    ----------
    order : robots to plan, in order; None: those that are not planned yet, by number
    """
    todo = [i for i, single in enumerate(team.found) if not single] if order is None else [*order]
    for n, robot in enumerate(todo):
        charges = team.avoiding(robot, waiting=todo[n + 1 :]) if rules else NO_CHARGES
        single = responses.charged(team, robot, charges)
        if single.path is None:
            return
        team = team.with_path(robot, single)
        yield team


def in_rounds(
    team: PlannedTeam, responses: Responses, order: Sequence[int] | None = None, rules: bool = True
) -> Iterator[PlannedTeam]:
    """Yields the team after each best response that gains, until no robot can gain.

    Parameters
    ----------
    order : robots that respond in turn; None: all, by number
    """
    robots = list(range(team.size)) if order is None else list(order)
    quiet = 0  # number of consecutive robots that could not gain
    for robot in cycle(robots):
        if quiet == len(robots):
            return
        quiet += 1
        single = responses.best(team, robot, rules)
        if single.path is None or single.path == team.path(robot):
            continue
        changed = team.with_path(robot, single)
        if changed.gains_over(team):
            team, quiet = changed, 1
            yield team


def then_in_rounds(
    nobody: PlannedTeam, responses: Responses, rules: bool = True
) -> Iterator[PlannedTeam]:
    """Yields the team after each robot is planned, and then after each best response that gains."""
    team = nobody
    for team in one_by_one(nobody, responses, rules=rules):
        yield team
    if team.is_whole:
        yield from in_rounds(team, responses, rules=rules)


def greedily(nobody: PlannedTeam, responses: Responses) -> Iterator[PlannedTeam]:
    """Yields the team after each robot is planned, ignoring collisions."""
    return one_by_one(nobody, responses, rules=False)


def greedily_in_rounds(nobody: PlannedTeam, responses: Responses) -> Iterator[PlannedTeam]:
    """Yields the team as `then_in_rounds` does, ignoring collisions."""
    return then_in_rounds(nobody, responses, rules=False)


def followed(team: PlannedTeam, changes: Iterator[PlannedTeam]) -> tuple[PlannedTeam, Limit | None]:
    """Returns the last of a team's changes, and the limit that stopped them, if any."""
    try:
        for changed in changes:
            team = changed
    except LimitReached as reached:
        return team, reached.limit
    return team, None
