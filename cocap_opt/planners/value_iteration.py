"""Single-robot planning by value iteration: exact on the time-expanded graph."""

from cocap_opt.graph.move_rewards import bonuses_of
from cocap_opt.objective import marginal_reward, no_pixels, robot_pixels
from cocap_opt.planners.single import SingleRobotPath, SingleRobotTask
from cocap_opt.stop import Limit


def value_iteration(task: SingleRobotTask) -> SingleRobotPath:
    """Best path of one robot for the marginal view reward over what the others see.

    One backward sweep over all states of the time-expanded graph, then the path is read off
    forward. It needs the coverage of every reachable state.
    """
    model, robot_class = task.model, task.model.class_of[task.robot]
    limit = task.stop()
    limit = model.prepare(robot_class, task.stop) if limit is Limit.NONE else limit
    if limit is not Limit.NONE:
        return SingleRobotPath(None, no_pixels(model.problem), 0, limit)
    bonuses = bonuses_of(model.problem.objective)
    reward = marginal_reward(model, robot_class, task.pixels)
    value = robot_class.graph.backward_sweep(reward, bonuses, task.charges, robot_class.goal)
    path = robot_class.graph.best_path(value, model.start(task.robot), bonuses, task.charges)
    if path is None:
        return SingleRobotPath(None, no_pixels(model.problem), 0)
    return SingleRobotPath(tuple(path), robot_pixels(model, task.robot, tuple(path)), 0)
