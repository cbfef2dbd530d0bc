"""Public functions that change problems: views, free starts, the rest of a mission, and takes."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from cocap_opt.api.arguments import (
    listed,
    listed_numbers,
    require,
    require_number,
    require_problem,
    require_whole,
    rest_of,
)
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Result
from cocap_opt.run import start_sets
from cocap_opt.run.drawn_takes import with_drawn_takes
from cocap_opt.run.options import Option
from cocap_opt.scenarios.spread import Spread
from cocap_opt.vision import default_weights

_PROBABILITIES = "probabilities", "a number for each take"


def with_views(
    problem: Problem,
    cameras: int = 2,
    weight: float | Sequence[float] | Literal["first"] | None = None,
    at_least: float = 0.3,
    share: float | None = None,
) -> Problem:
    """Reward several drones that see each person, besides pixels.

    J then has one more part: for each person and step, the number of drones that see the person
    (but at most `cameras`), times `weight` and the person's importance. `Views` defines when a
    drone sees a person.

    Parameters
    ----------
    problem : the problem; any views that it counted before are replaced
    cameras : drones beyond this number add nothing
    weight : weight of one drone that sees a person at one step, in px^0.5/m; one number for all
        people or one for each. None: half the reward of one unobstructed view in which the person
        fills a third of the image's height, averaged over eight directions around the person and
        over the drones' cameras. "first": more than all pixels and moves together, so a plan with
        more views is better, whatever its pixels. This holds if all importances other than 0 are
        equal; otherwise, pixels may decide between plans whose views differ by less than the least
        importance
    at_least : share of a person's unobstructed solid angle that must be visible in a drone's image
    share : share of all possible views that plans should keep; `front` finds the best that do

    Returns
    -------
    Problem
        The problem with `objective.views`, in which weights are numbers.

    Raises
    ------
    ProblemError
        If a number is out of range, or no drone has a camera with an image from which a weight
        could be found; one line names the field.

    Examples
    --------
    >>> twice = co.with_views(problem, cameras=2)
    >>> co.plan(twice, "cocap", time_limit=10).value
    """
    require_problem(problem)
    require_whole(cameras, "cameras")
    require_number(at_least, "at_least")
    if share is not None:
        require_number(share, "share")
    given = weight if isinstance(weight, str) else _numbers(weight)
    return default_weights.with_views(problem, cameras, given, at_least, share)


def with_starts(
    problem: Problem, starts: Literal["free", "random", "greedy"] = "free", seed: int = 0
) -> Problem:
    """Let drones start elsewhere: wherever it is best, at random, or at starts chosen greedily.

    Starts matter more than the choice of planner. With fixed starts, a bound holds only for those
    starts; with free starts, it holds for all of them.

    Parameters
    ----------
    problem : the problem; drones that already choose their start, among states or in an area, keep
        that choice, and the others may start in every free state
    starts : "free": planners choose the starts; "random": fixed starts, drawn from the possible
        ones so that they keep the rules; "greedy": fixed starts, those of the paths that
        `sequential` plans when drones may start anywhere: one drone after the other takes the best
        path given the earlier ones
    seed : of random starts

    Returns
    -------
    Problem
        The problem with other starts; its name states the choice.

    Raises
    ------
    ProblemError
        If no such starts are found.

    Examples
    --------
    >>> best = co.solve(co.with_starts(problem), time_limit=60)
    >>> best.value
    """
    require_problem(problem)
    require(starts, "starts", "free, random or greedy", str)
    if starts not in start_sets.KINDS:
        raise ValueError(f"starts: must be free, random or greedy, not {starts!r}")
    if starts == start_sets.RANDOM:
        return start_sets.with_random_starts(problem, Option("seed").require_whole(seed))
    if starts == start_sets.GREEDY:
        return start_sets.with_greedy_starts(problem)
    return start_sets.with_free_starts(problem)


def rest(
    problem: Problem,
    plan: Plan | Result | None,
    from_step: int,
    without: Sequence[int] = (),
) -> Problem:
    """Make the scene of the rest of a mission, after a plan has been flown up to a step.

    People walk on from that step, each drone starts in its state at that step, and the scene ends
    with the mission's last step. Views at its first step belong to the part that was flown, so that
    J of the whole mission is J of that part plus J of the rest.

    Parameters
    ----------
    problem : the scene of the whole mission; its people may walk differently from those that the
        plan was made for
    plan : a plan of the whole mission, or a result that has one
    from_step : the step at which the rest begins, from 1 to T - 1
    without : numbers of the drones that are lost at that step and contribute nothing from then on

    Returns
    -------
    Problem
        A scene like any other, with the drones that still fly; `save` writes it. Certificates for
        the rest are certificates of this scene.

    Raises
    ------
    ValueError
        If there is no such step or drone, the steps before cannot be flown in this problem, or
        pixels add up over time; one line.

    Examples
    --------
    >>> left = co.rest(problem, result, 1, without=[1])
    >>> co.bound(left, time_limit=10).bound
    """
    return rest_of(problem, plan, from_step, without, "plan").scene


def takes(
    problem: Problem,
    count: int = 3,
    delay: float = 0.0,
    aside: float = 0.0,
    speed: float = 0.0,
    seed: int = 0,
    probabilities: Sequence[float] | None = None,
    people: Sequence[int] | None = None,
) -> Problem:
    """Let people walk differently: draw takes around their walks.

    In the first take people walk as given. In each of the others every person is late or early,
    walks to one side, and is slower or faster, by amounts drawn from normal distributions. A draw
    that leads into an obstacle, off the map, into another person of the same take, or too close to
    a drone's fixed start is repeated; a person for whom 50 draws fail walks as given, and a warning
    says so. If the walk as given is inside obstacles at some steps, draws may be so at as many.
    People hide only people of the same take. J becomes the mean over the takes, and plans keep away
    from the people of all of them.

    Parameters
    ----------
    problem : the problem, without takes
    count : number of takes, the first included, 2 to 100
    delay, aside, speed : standard deviations: in s, in m, and as a share of the speed
    seed : of the draws
    probabilities : of the takes, which sum to 1 (default: all equal)
    people : numbers of the people who may walk differently (default: all). The others walk as
        given in all takes

    Returns
    -------
    Problem
        The problem with the takes "as given", "take 1", "take 2" and so on; its name says so.

    Raises
    ------
    ProblemError
        If a number is out of range, or there are delays but no seconds per step; one line names the
        field.

    Examples
    --------
    >>> hedged = co.takes(problem, count=4, delay=1.0, aside=0.3, seed=1)
    >>> co.plan(hedged, "cocap", time_limit=10).value
    """
    require_problem(problem)
    for name, value in (("delay", delay), ("aside", aside), ("speed", speed)):
        require_number(value, name)
    require_whole(count, "count")
    return with_drawn_takes(
        problem,
        int(count),
        Spread(float(delay), float(aside), float(speed)),
        Option("seed").require_whole(seed),
        None if probabilities is None else listed_numbers(probabilities, *_PROBABILITIES),
        None if people is None else listed(people, "people", "numbers of people"),
    )


def _numbers(weight: float | Sequence[float] | None) -> float | tuple[float, ...] | None:
    """Returns a number, or a number for each person; they are checked elsewhere."""
    if isinstance(weight, Sequence | np.ndarray):
        return tuple(weight)
    if weight is not None:
        require_number(weight, "weight")
    return weight
