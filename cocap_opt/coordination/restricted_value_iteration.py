"""Value iteration over few states of each robot, for searching near a plan.

With only the promising states (`kept_states`) and the edges between them in arrays (`kept_graph`),
a best response takes a seventh of the time of one over all states on a small map, and does not slow
down on a large map. It may miss the best path, which a best response over all states then finds.
Half of the states are the best if all others keep their paths, half are the best if the robot were
alone, since others will change their paths. Alternatively, all of them are the best at given
prices, which account for the other robots' views.
"""

from collections.abc import Sequence
from typing import Self

from cocap_opt.coordination.kept_graph import KeptGraph
from cocap_opt.coordination.kept_states import Beam, worth_of, worths_of
from cocap_opt.coordination.low_level import PlannedTeam, SingleRobotPath, SingleRobotTask
from cocap_opt.data import BoolArray, FloatArray
from cocap_opt.objective import marginal_reward
from cocap_opt.stop import Stop

# Number of states of a robot that are kept at a step. Measured on scenes `passage` and
# `bottleneck-tight`, seeds 0 to 9: J is 0.14 and 0.09 % below the optimum with 80, 0.11 and 0.05 %
# with 120, and 0.12 and 0.07 % with 160 states and 42 responses per robot, which take as long.
_WIDTH = 120


class RestrictedValueIteration:
    """A low level that finds a robot's best path over its most promising states.

    Parameters
    ----------
    graphs : the kept states of each robot
    """

    def __init__(self, graphs: Sequence[KeptGraph]) -> None:
        self._graphs = graphs

    @classmethod
    def beside(cls, team: PlannedTeam, stop: Stop, width: int = _WIDTH) -> Self:
        """Returns a low level over the states that are best given the other robots' paths, and best
        alone.

        Parameters
        ----------
        team : a whole team
        width : largest number of states kept at each step, in addition to those of the path in
            `team`

        Raises
        ------
        LimitReached
            If a limit is reached before the states are found.
        """
        model, nothing, graphs = team.model, team.model.problem.no_pixels(), []
        rewards = [marginal_reward(model, robot_class, nothing) for robot_class in model.classes]
        alone = worths_of(model, rewards, stop)
        for robot, robot_class in enumerate(model.class_of):
            stop.check()
            reward = marginal_reward(model, robot_class, team.pixels(without=robot))
            worth = worth_of(model, robot_class, reward, stop), alone[robot_class.number]
            layers = Beam(team, robot, width, worth).layers()
            graphs.append(KeptGraph(model, robot_class, layers))
        return cls(graphs)

    @classmethod
    def at_rewards(
        cls,
        team: PlannedTeam,
        rewards: Sequence[FloatArray],
        known: Sequence[BoolArray],
        stop: Stop,
        width: int,
    ) -> Self:
        """Returns a low level over the states that are best by given rewards.

        Parameters
        ----------
        team : a whole team
        rewards : rewards [T+1, S] of the states of each class
        known : [T+1, S] for each class, True for states that are always kept if they are reached
        width : largest number of other states kept at each step

        Raises
        ------
        LimitReached
            If a limit is reached before the states are found.
        """
        model, graphs = team.model, []
        worths = worths_of(model, rewards, stop)
        for robot, robot_class in enumerate(model.class_of):
            stop.check()
            number = robot_class.number
            layers = Beam(team, robot, width, [worths[number]], known[number]).layers()
            graphs.append(KeptGraph(model, robot_class, layers))
        return cls(graphs)

    def __call__(self, task: SingleRobotTask) -> SingleRobotPath:
        """Plans a task.

        Raises
        ------
        LimitReached
            If a limit is reached.
        """
        task.stop.check()
        graph = self._graphs[task.robot]
        path = graph.best_path(task.pixels, graph.charged(task.charges))
        return SingleRobotPath.of(task.model, task.robot, path)
