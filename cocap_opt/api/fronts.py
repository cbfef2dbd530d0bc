"""Public function for the trade-off between J and the number of drones that see each person."""

from dataclasses import replace

from cocap_opt.api.arguments import require, require_number, require_problem, require_whole
from cocap_opt.problem import Problem
from cocap_opt.run.front import Front
from cocap_opt.run.front_search import explored
from cocap_opt.run.options import Option
from cocap_opt.stop import FirstOf, Stop, TimeLimit, never


def front(
    problem: Problem,
    *,
    cameras: int | None = None,
    at_least: float | None = None,
    share: float | None = None,
    directions: int = 6,
    seconds: float = 10.0,
    time_limit: float | None = None,
    stop: Stop = never,
    so_far: Front | None = None,
) -> Front:
    """Enclose the trade-off between J and the number of drones that see each person.

    Parameters
    ----------
    problem : the scene, with its drones and people; the weight of views in its objective does
        not matter
    cameras : number of drones on a person beyond which more add nothing. None: the number of
        `so_far`, else that of the problem's objective, else 2
    at_least : share of a person, by solid angle, that must be visible in a drone's image. None: the
        share of `so_far`, else that of the objective, else 0.3
    share : share of all possible views around which plans and bounds are found first. None: the
        share of `so_far`, else that of the objective, if it has one
    directions : largest number of weightings of J and views to try until the trade-off is settled
    seconds : for each weighting, excluding coverage; doubled whenever a weighting is tried again
    time_limit : seconds for all of them, including coverage
    stop : a further stopping criterion
    so_far : a trade-off of the same problem, which is continued

    Returns
    -------
    Front
        With its `plans`, none of which is better than another in both respects, and the
        `half_planes` that contain all plans, each with its certificate. `reward_bound(views)` is
        the J that no plan with at least this many views exceeds, `best_with(views)` the best such
        plan found, `views_bound` the number of views that no plan exceeds, `gap` the largest gap
        left between plans and proofs, and `settled` is True if there is none. `table` has a row for
        each plan and half-plane. Printing the object describes them in words.

    Raises
    ------
    ProblemError
        If `cameras`, `at_least` or `share` is out of range.
    ValueError
        If `so_far` is for another problem or counts other views, or another number is not valid.

    Examples
    --------
    >>> front = co.front(problem, cameras=2)
    >>> front.best_with(0.9 * front.most_views)
    """
    require_problem(problem)
    if cameras is not None:
        require_whole(cameras, "cameras")
    for name, value in (("at_least", at_least), ("share", share)):
        if value is not None:
            require_number(value, name)
    require_whole(directions, "directions")
    Option("directions").require_whole(int(directions), 1)
    require_number(seconds, "seconds")
    Option("seconds").require_limit(seconds)
    limit = never
    if time_limit is not None:
        require_number(time_limit, "time_limit")
        limit = TimeLimit(Option("time_limit").require_limit(time_limit))
    known = problem
    if so_far is not None:
        require(so_far, "so_far", "a Front, which `front` returns", Front)
    if so_far is not None:  # arguments that are not given are taken from there
        known = problem.replace(objective=problem.objective.replace(views=so_far.views))
    begun = Front.of(known, cameras, at_least, share)
    begun = replace(begun, problem=problem)
    if so_far is not None:
        if not so_far.is_of(begun):
            had = so_far.views
            raise ValueError(
                "so_far: must be of the same problem, with the same cameras and at_least; it has "
                f"cameras={had.cameras}, at_least={had.at_least:g}"
            )
        begun = replace(so_far, views=begun.views)
    return explored(begun, FirstOf(stop, limit), seconds, int(directions))
