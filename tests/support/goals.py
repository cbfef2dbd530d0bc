"""Problems whose drones have goals of several cells."""

import numpy as np
from hypothesis import strategies as st
from pool import problems

from cocap_opt.problem import GoalArea, Problem


@st.composite
def with_areas(draw: st.DrawFn, robots: tuple[int, ...] = (1, 2)) -> Problem:
    """A problem of the pool whose drones have goals of one to three cells, free ones among them."""
    problem = draw(problems(robots=[*robots], goals=False))
    changed = []
    for robot in problem.robots:
        free = robot.motion.free_places(problem.workspace).any(axis=0)
        known = [(int(x), int(y)) for x, y in np.argwhere(free)]
        cells = draw(st.lists(st.sampled_from(known), min_size=1, max_size=3, unique=True))
        changed.append(robot.replace(goal=GoalArea(cells=tuple(cells))))
    return problem.replace(robots=tuple(changed))
