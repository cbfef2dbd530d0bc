"""The visible share of each person in the drones' images along a plan."""

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.footage.poses import require_paths
from cocap_opt.graph.motion import Window
from cocap_opt.problem import Plan, Problem
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.views import StateViews


def visible_shares(problem: Problem, plan: Plan) -> FloatArray:
    """Returns the visible shares [T+1, R, A] of people, 0 to 1, for each drone.

    Shares are ratios of solid angles: of the part visible in the image, and of the whole person
    without obstructions. A `Cone` sees the whole person or nothing.

    Raises
    ------
    ValueError
        If the plan does not have a path of T+1 states for each robot.
    """
    require_paths(problem, plan)
    steps = np.arange(problem.horizon + 1)
    shares = np.zeros((len(steps), len(problem.robots), len(problem.actors)))
    if not problem.actors:
        return shares
    cells = [(state.x, state.y) for path in plan.paths for state in path]
    window = Window.around(cells, 0, problem.workspace)
    geometry = FaceGeometry(problem)
    for i, (robot, path) in enumerate(zip(problem.robots, plan.paths, strict=True)):
        views = StateViews.within(window, geometry, problem, robot)
        states = np.array([views.graph.index(state) for state in path])
        found = views.people(steps * views.n_states + states)
        shares[found.rows, i, found.people] = found.shares
    return shares
