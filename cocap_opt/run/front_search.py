"""Searches a trade-off: adds a plan and a half-plane in the direction with the largest remaining
gap.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from cocap_opt.console.progress import Watch
from cocap_opt.method import Method
from cocap_opt.model import share_coverage
from cocap_opt.planners import RECOMMENDED
from cocap_opt.run.engine import BOUND_METHOD, run
from cocap_opt.run.front import Direction, Front, HalfPlane
from cocap_opt.run.options import Allowance
from cocap_opt.stop import Stop, never

_OF_PLANNER = 0.25  # planner's share of a direction's time
_LEAST = 0.1  # s reserved for the bound


def explored(
    front: Front,
    stop: Stop = never,
    seconds: float = 10.0,
    directions: int = 6,
    planner: str = RECOMMENDED,
    bound: str = BOUND_METHOD,
    watch: Watch | None = None,
    keep: Callable[[Front], None] = lambda front: None,
) -> Front:
    """Returns the trade-off after exploring further directions, or fewer if it is settled before.

    Parameters
    ----------
    stop : ends the search; results found so far are kept
    seconds : time for each direction, excluding coverage; it doubles each time a direction is tried
        again
    directions : largest number of directions
    planner, bound : names of the methods
    keep : called with the trade-off after each direction
    """
    watch = watch or Watch()
    for number in range(directions):
        if front.settled or (number and stop.reached() is not None):
            break
        watch.begin(f"{front.problem.name}, direction {number + 1} of {directions}")
        direction = front.next_direction()
        time = seconds * 2 ** front.tries(direction)
        front = towards(front, direction, stop, time, planner, bound, watch)
        keep(front)
    return front


def towards(
    front: Front, direction: Direction, stop: Stop, seconds: float, planner: str,
    bound: str | Method[Any], watch: Watch, **options: Any,
) -> Front:  # fmt: skip
    """Returns the trade-off with a plan and a half-plane added in one direction.

    Parameters
    ----------
    seconds : time for both, excluding coverage
    options : options of `run`, for the bound
    """
    scene = front.scene(direction)
    share_coverage(scene, front.base)
    made = run(scene, planner, stop, allowance=Allowance(_OF_PLANNER * seconds), watch=watch).result
    front = front.with_plans([made.plan] if made.plan is not None else [])
    start = front.best_in(direction)
    left = Allowance(max(seconds - made.seconds, _LEAST))
    result = run(
        scene, bound, stop, allowance=left, watch=watch,
        start=None if start is None else start.plan, **options,
    ).result  # fmt: skip
    plane = HalfPlane(direction, result.bound, result.certificate)
    front = replace(front, half_planes=(*front.half_planes, plane))
    return front.with_plans([result.plan] if result.plan is not None else [])
