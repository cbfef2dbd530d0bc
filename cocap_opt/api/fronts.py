"""The face's trade-offs between J and the drones that see each person."""

from cocap_opt.api.arguments import require_problem
from cocap_opt.problem import Problem, Views
from cocap_opt.run.front import Front
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
    problem : the drones, the people, and where they are; the weight of views in its objective does
        not matter
    cameras : drones that see a person, from which on more add nothing. None: those of the
        problem's objective, or 2
    at_least : share of a person, by solid angle, that must be visible in a drone's image. None:
        that of the objective, or 0.3
    share : of all possible views, around which plans and bounds are found first. None: that of the
        objective, if it has one
    directions : how many weights of J and views are tried at most, until the trade-off is settled
    seconds : of each of them, coverage not included; each time that one is tried again it has twice
        as many as before
    time_limit : seconds of all of them, the coverage included
    stop : a further stopping criterion
    so_far : a trade-off of the same problem, which is gone on with

    Returns
    -------
    Front
        With its `plans`, none of which is better than another in both, and the `half_planes` that
        all plans are in, each with its certificate. `reward_bound(views)` is the J that no plan of
        at least so many views exceeds, `best_with(views)` the best one found, `views_bound` the
        views that no plan exceeds, `gap` the most that is left between plans and proofs, and
        `settled` is True if nothing is. `table` has all of them.

    Raises
    ------
    ProblemError
        If `cameras`, `at_least` or `share` is out of range.
    ValueError
        If `so_far` is of another problem.

    Examples
    --------
    >>> front = co.front(problem, cameras=2)
    >>> front.best_with(0.9 * front.most_views)
    """
    require_problem(problem)
    views = problem.objective.views or Views()
    given = {"cameras": cameras, "at_least": at_least, "share": share}
    views = views.replace(**{name: x for name, x in given.items() if x is not None})
    begun = Front.of(problem, views.cameras, views.at_least)
    if so_far is not None:
        if not so_far.is_of(begun):
            raise ValueError("so_far: must be of the same problem, cameras and share")
        begun = so_far
    limit = never if time_limit is None else TimeLimit(time_limit)
    wanted = None if views.share is None else views.share * begun.most_views
    return begun.explored(FirstOf(stop, limit), seconds, directions, wanted=wanted)
