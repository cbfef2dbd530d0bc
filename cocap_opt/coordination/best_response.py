"""Best responses: one robot's best path given what the others see, by value iteration."""

from cocap_opt.data import FloatArray
from cocap_opt.graph.charges import NO_CHARGES, Charges
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.value_iteration import Swept, backward_sweep, best_path
from cocap_opt.model import Model, Path
from cocap_opt.objective import marginal_reward
from cocap_opt.stop import Stop, never


def best_response(
    model: Model,
    robot: int,
    pixels: FloatArray,
    charges: Charges = NO_CHARGES,
    stop: Stop = never,
) -> Path | None:
    """Returns a robot's path of the largest marginal gain; None where the charges leave none.

    One backward sweep over all states of the time-expanded graph, then the path is read off
    forward. It is exact and needs the coverage of every reachable state.

    Parameters
    ----------
    pixels : [Z] px/m2 that the other robots have in every view sum
    charges : costs of places, moves and states; infinite where the robot must not go
    stop : stopping criterion, checked at every step

    Raises
    ------
    LimitReached
        If a limit is reached before the path is there.
    """
    robot_class, bonuses = model.class_of[robot], Bonuses.of(model.problem.objective)
    graph, reward = robot_class.graph, marginal_reward(model, robot_class, pixels)
    # Another array of that size would take as long to make as the sweep itself.
    in_place = Swept(reward, len(reward) - 1)
    value = backward_sweep(graph, reward, bonuses, charges, robot_class.goal, stop, in_place)
    path = best_path(graph, value, model.start(robot), bonuses, charges)
    return None if path is None else tuple(path)
