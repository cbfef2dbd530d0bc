"""The search for a trade-off: a plan and a half-plane more in the direction with the most room."""

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

_OF_PLANNER = 0.25  # of a direction's time
_LEAST = 0.1  # s that are left for the bound


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
    """Returns the trade-off after some directions more, or fewer if it is settled by then.

    Parameters
    ----------
    stop : ends all of them; what is found until then counts
    seconds : of each direction, coverage not included; each time that one is tried again it has
        twice as many as before
    directions : how many at most
    planner, bound : the methods
    keep : is given the trade-off after each direction
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
    """Returns the trade-off with a plan and a half-plane of a direction.

    Parameters
    ----------
    seconds : for both, coverage not included
    options : of `run`, for the bound
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
