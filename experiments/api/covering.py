"""The face's coverage: what each drone could see, as a table for models of one's own."""

from typing import TYPE_CHECKING

import numpy as np

from cocap_opt.experiments.api.arguments import require_problem
from cocap_opt.model import compiled
from cocap_opt.problem import Problem

if TYPE_CHECKING:
    import pandas as pd


def coverage(problem: Problem, robot: int = 0) -> "pd.DataFrame":
    """Compute the coverage c(i, t, f): the pixels per m2 that a drone's states give each face.

    With the moves that the drone is allowed it is all that a model of your own needs: a plan's J is
    the sum, over steps and faces, of weight times the square root of the pixels that all drones
    together give the face at the step. With `over_time` the pixels of all steps are added before
    the root is taken; rewards and charges for moves are apart.

    Parameters
    ----------
    problem : the drones, the people, and where they are
    robot : number of the drone; drones alike in motion and camera see the same from a state

    Returns
    -------
    DataFrame
        A row for each step, state that the drone can reach by then, and face that it sees from
        there: `step`, the state as `x`, `y`, `layer`, `heading`, `pitch`, then `actor`, `face` (of
        the actor), `pixels` (px/m2, above 0), and `weight` (of the face at the step). Steps that do
        not count, such as the first, are left out.

    Raises
    ------
    ValueError
        If there is no drone of this number.

    Examples
    --------
    >>> co.coverage(problem).groupby(["step", "x", "y", "layer", "heading"]).pixels.sum()
    """
    from pandas import DataFrame

    require_problem(problem)
    if robot not in range(len(problem.robots)):
        last = len(problem.robots) - 1
        raise ValueError(f"robot: must be a number from 0 to {last}, not {robot!r}")
    model = compiled(problem)
    robot_class, owner = model.class_of[robot], problem.face_owner
    graph, table = robot_class.graph, model.coverage(robot_class)
    start = graph.index(problem.robots[robot].start)
    can_be_in = graph.reachable([start], problem.horizon).reshape(-1)[table.nodes]
    position, entries = table.entries(table.nodes[can_be_in])
    steps, states = np.divmod(table.nodes[can_be_in][position], graph.n_states)
    orientations, places = np.divmod(states, graph.n_places)
    headings, pitches = np.divmod(orientations, graph.shape[1])
    layers, x, y = graph.coordinates(places)
    view_sums = table.view_sums[entries]
    faces = view_sums % len(owner)
    return DataFrame({
        "step": steps, "x": x, "y": y, "layer": layers, "heading": headings, "pitch": pitches,
        "actor": owner[faces], "face": faces - np.searchsorted(owner, owner[faces]),
        "pixels": table.pixels[entries], "weight": problem.view_sum_weights[view_sums],
    })  # fmt: skip
