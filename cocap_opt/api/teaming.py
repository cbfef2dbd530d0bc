"""The face's comparison of teams: how many drones, with which camera, at which height."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cocap_opt.api.arguments import require_number, require_problem
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
    """Compare teams: what so many drones reach, and what no team of that kind can.

    The drones of a team are like those of the problem, which must be alike, and start where it is
    best: if those of the problem may choose their start, in one of these states, otherwise in any
    free one. Each team is planned twice by branch-and-price, for J and for the number of drones
    that see each person, and both are proved as far as time allows.

    Parameters
    ----------
    problem : the drones, the people, and where they are
    drones : numbers of drones, or one of them
    camera : names of cameras, as `cocap-opt scenes` lists them, each of which makes teams of its
        own; None: that of the problem's drones
    heights : m, as the problem's flight heights are; at each of them is a team that stays there;
        None: all of the problem's
    cameras : drones that are to see a person
    share : of person-steps that are to be seen by so many
    at_least : share of the solid angle that a person has with nothing in the way, from which on a
        drone sees them. None: that of the problem's objective, or 0.3
    time_limit : seconds for each of the two problems of a team, from when coverage is there
    work_limit : pricing rounds for each of them
    out : folder that keeps scenes, plans, certificates and teams.csv; what is there is not computed
        again
    workers : processes, each on a core of its own; this process if not given

    Returns
    -------
    Teams
        Printed it names the fewest drones that reach the share, and what is proved of fewer.
        `table` has a row for each team, with the columns of `teams.csv`, `rows` the same as
        objects, and `plot()` draws them.

    Raises
    ------
    ProblemError
        If the problem's drones are not alike, or there can be none of these teams.
    ValueError
        If another argument is out of range, or `out` cannot be used.
    KeyboardInterrupt
        After Ctrl-C, if there are no rows yet; else rows say what was found.

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
    numbers = [drones] if isinstance(drones, int) else drones
    asked = Asked.of(numbers, names, heights, cameras, at_least)
    require_number(share, "share")
    wanted = Option("share").require_part(share)
    settings = team_settings(time_limit, work_limit, out is not None or workers is not None)
    hired = Hired(Option("workers").require_cores(workers), None, settings.cell_limit)
    folder = None if out is None else Path(out)
    rows = compare_teams(problem, 0, asked, settings, folder, hired, quiet=True)
    return Teams(tuple(rows), wanted)
