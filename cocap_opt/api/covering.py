"""Public functions for coverage: a table of all that each drone could see, and its digest."""

import hashlib
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cocap_opt.api.arguments import require_problem, require_whole
from cocap_opt.data import IntArray
from cocap_opt.model import Model, RobotClass, compiled
from cocap_opt.problem import Problem

if TYPE_CHECKING:
    import pandas as pd

_PART = 100_000  # states that are digested at once


def coverage(problem: Problem, robot: int = 0) -> "pd.DataFrame":
    """Compute the coverage c(i, t, f): the pixels per m2 that a drone's states give each face.

    With this table and the allowed moves of the drones, you can build your own model: a plan's J is
    the sum, over steps and faces, of the weight times the square root of the pixels that all drones
    together give the face at the step. With `over_time`, the pixels of all steps are added before
    the root is taken. The table contains no rewards or charges for moves.

    Parameters
    ----------
    problem : the scene, with its drones and people
    robot : number of the drone; drones with the same motion and camera see the same from a state

    Returns
    -------
    DataFrame
        A row for each step, each state that the drone can reach by then, and each face that it sees
        from there: `step`, the state as `x`, `y`, `layer`, `heading`, `pitch`, then `actor`, `face`
        (of the actor), `pixels` (px/m2, above 0), and `weight` (of the face at the step). Steps
        that do not count, such as the first, are left out.

    Raises
    ------
    ValueError
        If there is no drone with this number.

    Examples
    --------
    >>> co.coverage(problem).groupby(["step", "x", "y", "layer", "heading"]).pixels.sum()
    """
    from pandas import DataFrame

    require_problem(problem)
    require_whole(robot, "robot")
    if robot not in range(len(problem.robots)):
        last = len(problem.robots) - 1
        raise ValueError(f"robot: must be a number from 0 to {last}, not {robot!r}")
    model = compiled(problem)
    robot_class = model.class_of[robot]
    graph, nodes = robot_class.graph, model.coverage(robot_class).nodes
    can_be_in = graph.reachable(model.starts(robot), problem.horizon).reshape(-1)[nodes]
    columns, view_sums = _columns(model, robot_class, nodes[can_be_in])
    return DataFrame(columns | {"weight": problem.view_sum_weights[view_sums]})


def coverage_digest(problem: Problem) -> str:
    """Compute a digest of all coverage of a problem, for comparing machines and versions.

    Two problems with the same digest agree on all pixels to the last bit, and hence on each J. The
    digest depends on what drones can see and reach, but not on names, weights, rewards or collision
    rules. The page on file formats defines the digest.

    Parameters
    ----------
    problem : the scene, with its drones and people

    Returns
    -------
    str
        64 hexadecimal digits.

    Raises
    ------
    TypeError
        If `problem` is not a problem.

    Examples
    --------
    >>> co.coverage_digest(problem)
    """
    require_problem(problem)
    model, digest = compiled(problem), hashlib.sha256()
    kinds = {c.sight: c for c in model.classes}  # classes that see alike share a table
    for robot_class in kinds.values():
        nodes = model.coverage(robot_class).nodes
        for part in np.array_split(nodes, len(nodes) // _PART + 1):
            columns = list(_columns(model, robot_class, part)[0].values())
            rows = np.empty((len(columns[0]), len(columns)), dtype="<i8")
            for number, column in enumerate(columns):
                is_whole = column.dtype.kind == "i"
                rows[:, number] = column if is_whole else column.astype("<f8").view("<i8")
            digest.update(rows.tobytes())
    return digest.hexdigest()


def _columns(
    model: Model, robot_class: RobotClass, nodes: IntArray
) -> tuple[dict[str, NDArray[Any]], IntArray]:
    """Returns the coverage from some nodes as columns, and the view sum that each row adds to."""
    graph, table = robot_class.graph, model.coverage(robot_class)
    owner = model.problem.face_owner
    position, entries = table.entries(nodes)
    of_faces = table.view_sums[entries] < model.problem.returns.n_roots
    position, entries = position[of_faces], entries[of_faces]
    steps, states = np.divmod(nodes[position], graph.n_states)
    orientations, places = np.divmod(states, graph.n_places)
    headings, pitches = np.divmod(orientations, graph.shape[1])
    layers, x, y = graph.coordinates(places)
    view_sums = table.view_sums[entries]
    faces = view_sums % max(len(owner), 1)
    return {
        "step": steps, "x": x, "y": y, "layer": layers, "heading": headings, "pitch": pitches,
        "actor": owner[faces], "face": faces - np.searchsorted(owner, owner[faces]),
        "pixels": table.pixels[entries],
    }, view_sums  # fmt: skip
