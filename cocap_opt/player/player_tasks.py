"""The people that each drone films most, in groups, few enough that each has its own colour."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.problem import Problem

MOST_GROUPS = 8  # more groups would not have distinguishable colours

Data = dict[str, Any]


def groups_of_people(problem: Problem) -> list[list[int]]:
    """Returns people one by one if they are few, otherwise groups of people near each other.

    Ward's method clusters people by their places at all steps. Groups are sorted by their first
    members.
    """
    people = len(problem.actors)
    if people <= MOST_GROUPS:
        return [[j] for j in range(people)]
    from scipy.cluster.hierarchy import fcluster, linkage  # slow to import

    walks = [actor.poses[: problem.horizon + 1, :3].ravel() for actor in problem.actors]
    numbers = fcluster(linkage(np.array(walks), "ward"), MOST_GROUPS, "maxclust")
    groups: list[list[int]] = [
        np.flatnonzero(numbers == number).tolist() for number in np.unique(numbers)
    ]
    return sorted(groups)


def tasks(problem: Problem, pixels: FloatArray, groups: Sequence[list[int]]) -> list[int | None]:
    """Returns the group that each drone covers most, over all steps that count.

    Parameters
    ----------
    pixels : [R, T+1, F] coverage of each face by each drone

    Returns
    -------
    Numbers of groups, None for a drone that sees nobody.
    """
    if not groups:
        return [None] * len(pixels)
    group_of: IntArray = np.empty(len(problem.actors), dtype=np.int64)
    for number, people in enumerate(groups):
        group_of[people] = number
    is_of = group_of[problem.face_owner][:, None] == np.arange(len(groups))
    brought = pixels[:, problem.first_step :].sum(axis=1) @ is_of.astype(np.float64)
    return [int(row.argmax()) if row.max() > 0 else None for row in brought]


def told_group(problem: Problem, people: Sequence[int]) -> str:
    """Returns the numbers of the people in a group; for one person also the name, if known."""
    name = problem.actors[people[0]].name if len(people) == 1 else None
    numbers = ", ".join(map(str, people))
    return numbers if name is None else f"{name} ({numbers})"
