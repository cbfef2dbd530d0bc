"""Public function that compares teams: numbers of drones, cameras, and flight heights."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cocap_opt.api.arguments import (
    listed,
    listed_numbers,
    require,
    require_number,
    require_path,
    require_problem,
)
from cocap_opt.problem import Problem

if TYPE_CHECKING:
    from cocap_opt.experiments.report.teams import Teams


def team(
    problem: Problem,
    drones: int | Iterable[int] = (1, 2, 3, 4, 5, 6),
    *,
    camera: str | Sequence[str] | None = None,
    heights: Sequence[float] | None = None,
    cameras: int = 2,
    share: float = 0.95,
    at_least: float | None = None,
    time_limit: float = 20.0,
    work_limit: int | None = None,
    out: str | Path | None = None,
    workers: int | None = None,
) -> "Teams":
    """Compare teams: the best plan found for each team, and limits that none of its plans exceeds.

    The drones of a team are copies of the problem's drones, which must all be alike. They choose
    the best start: among the starts of the problem's drones if these may choose, otherwise among
    all free states. Branch-and-price plans each team twice, for J and for the number of drones that
    see each person, and proves as tight a bound for each as the time allows.

    Parameters
    ----------
    problem : the scene, with its drones and people
    drones : numbers of drones, or a single number
    camera : names of cameras, as listed by `cocap-opt scenes`; each is tried in teams of its own.
        None: the camera of the problem's drones
    heights : m, in the reference of the problem's flight heights; for each height, a team that
        stays at it is tried. None: teams use all of the problem's heights
    cameras : number of drones that are to see a person
    share : share of person-steps that this many drones should see
    at_least : share of a person's unobstructed solid angle that must be visible for a drone to
        count as seeing the person. None: that of the problem's objective, or 0.3
    time_limit : seconds for each of the two problems of a team, counted from when coverage is ready
    work_limit : pricing rounds for each of them
    out : folder for scenes, plans, certificates and teams.csv; those that it already has are not
        computed again
    workers : processes, each on a core of its own (default: this process)

    Returns
    -------
    Teams
        Printing it names the fewest drones that reach the share, and what is proved about fewer.
        `table` has a row for each team, with the columns of `teams.csv`, `rows` the same as
        objects, and `plot()` draws them.

    Raises
    ------
    ProblemError
        If the problem's drones are not alike, or none of these teams is possible.
    ValueError
        If another argument is out of range, or `out` cannot be used.
    KeyboardInterrupt
        After Ctrl-C, if there are no rows yet; otherwise the rows say what was found.

    Examples
    --------
    >>> teams = co.team(problem, range(1, 4), time_limit=5)
    >>> teams.table[["drones", "reward", "seen_most", "seen_bound"]]
    """
    from cocap_opt.experiments.report.teams import Teams
    from cocap_opt.experiments.sweeps.sweep import Hired
    from cocap_opt.experiments.sweeps.teams import Asked, compare_teams, team_settings
    from cocap_opt.run.options import Option

    require_problem(problem)
    names = [camera] if isinstance(camera, str) else camera
    if names is not None:
        names = listed(names, "camera", "a name of a camera or several")
        for name in names:
            require(name, "camera", "a name of a camera or several", str)
    if isinstance(drones, int | np.integer) and not isinstance(drones, bool):
        numbers = [int(drones)]
    else:
        numbers = listed(drones, "drones", "a number of drones or several")
    if heights is not None:
        heights = listed_numbers(heights, "heights", "numbers of metres")
    asked = Asked.of(numbers, names, heights, cameras, at_least)
    require_number(share, "share")
    require_number(time_limit, "time_limit")
    wanted = Option("share").require_part(share)
    settings = team_settings(time_limit, work_limit, out is not None or workers is not None)
    hired = Hired(Option("workers").require_cores(workers), None, settings.cell_limit)
    folder = None if out is None else require_path(out, "out")
    rows = compare_teams(problem, 0, asked, settings, folder, hired, quiet=True).rows
    return Teams(tuple(rows), wanted)
