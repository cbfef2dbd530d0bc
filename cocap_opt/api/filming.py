"""Public functions that measure how well plans film people, and bound it for all plans."""

from cocap_opt.api.arguments import (
    plan_for,
    require_flown,
    require_number,
    require_problem,
    require_whole,
    start_for,
)
from cocap_opt.footage.quality import Assumptions, Quality
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check as judge_plan
from cocap_opt.result import Result
from cocap_opt.run.options import Option
from cocap_opt.run.quality_bound import QualityBound
from cocap_opt.stop import FirstOf, Stop, TimeLimit, never

_USUAL = Assumptions()


def quality(
    problem: Problem,
    plan: Plan | Result | None,
    *,
    at_least: float | None = None,
    pixel_error: float = _USUAL.pixel_error,
    position_error: float = _USUAL.position_error,
    attitude_error: float = _USUAL.attitude_error,
    exposure: float = _USUAL.exposure,
    drone_size: float = _USUAL.drone_size,
    drone_pixels: float = _USUAL.drone_pixels,
) -> Quality:
    """Measure how well a plan films people: by how many drones, how accurately, how sharply.

    Of these numbers, J can include only the number of drones that see each person (`Views`). The
    plan may break collision rules. Pixels are those of the scene's cameras.

    Parameters
    ----------
    problem : the problem that the plan is for
    plan : a plan that can be flown, or a result that has one
    at_least : share of a person's unobstructed solid angle that must be visible for a drone to
        count as seeing the person. None: that of the problem's objective, or 0.3
    pixel_error : px, standard deviation of a point's position in an image, along each axis
    position_error : m, standard deviation of a drone's position along each axis
    attitude_error : rad, standard deviation of a camera's attitude about each axis
    exposure : s, exposure time of an image
    drone_size : m, width of a drone
    drone_pixels : px, smallest width in another drone's image at which a drone counts as in it

    Returns
    -------
    Quality
        Printing it gives a summary in words. `table` has a row per person and step, `summary` a few
        numbers, `by_person` the same numbers for each person, and `worst` describes the worst
        moments in words.

    Raises
    ------
    ValueError
        If the plan cannot be flown in this problem or is known to be for another, if the result has
        no plan, or if a number is out of range; one line.

    Examples
    --------
    >>> co.quality(problem, result).summary.by_two
    >>> co.quality(problem, result, at_least=0.5, position_error=0.05).table
    """
    filmed = plan_for(problem, plan, "measured")
    given = {
        "at_least": Assumptions.of(problem).at_least if at_least is None else at_least,
        "pixel_error": pixel_error, "position_error": position_error,
        "attitude_error": attitude_error, "exposure": exposure, "drone_size": drone_size,
        "drone_pixels": drone_pixels,
    }  # fmt: skip
    for name, value in given.items():
        require_number(value, name)
    assumptions = Assumptions(**given)
    require_flown("plan", judge_plan(problem, filmed))
    return Quality.of(problem, filmed, assumptions=assumptions)


def quality_bound(
    problem: Problem,
    *,
    cameras: int | None = None,
    at_least: float | None = None,
    seconds: float = 10.0,
    time_limit: float | None = None,
    stop: Stop = never,
    start: Plan | Result | None = None,
) -> QualityBound:
    """Prove the largest number of person-steps that several drones can see, whatever their plan.

    For each number of drones up to `cameras`, bound the share of person-steps that at least this
    many drones see, over all plans that obey the rules. The problem's objective does not matter.

    Parameters
    ----------
    problem : the scene, with its drones and people
    cameras : the largest number of drones for which a bound is proved. None: the cameras of the
        problem's objective, or 2
    at_least : share of a person's unobstructed solid angle that must be visible for a drone to
        count as seeing the person. None: that of the objective, or 0.3
    seconds : for each number of drones, excluding coverage
    time_limit : seconds for everything, including coverage
    stop : a further stopping criterion
    start : a plan to begin with; it is ignored if it breaks a rule

    Returns
    -------
    QualityBound
        Printing it states what is proved. `most(2).share` is the share that no plan exceeds,
        `share(quality, 2)` that of a plan, `sentences(quality)` states both, and `results` have the
        certificates.

    Raises
    ------
    ProblemError
        If `cameras` or `at_least` is out of range.
    ValueError
        If the start cannot be flown in this problem, or a number of seconds is not valid.

    Examples
    --------
    >>> co.quality_bound(problem, cameras=2, seconds=5).most(2).share
    """
    require_problem(problem)
    if cameras is not None:
        require_whole(cameras, "cameras")
    if at_least is not None:
        require_number(at_least, "at_least")
    require_number(seconds, "seconds")
    limit = never
    if time_limit is not None:
        require_number(time_limit, "time_limit")
        limit = TimeLimit(Option("time_limit").require_limit(time_limit))
    return QualityBound.of(problem, cameras, at_least).proved(
        FirstOf(stop, limit), Option("seconds").require_limit(seconds), start_for(problem, start)
    )
