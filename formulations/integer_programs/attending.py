"""Long calls into solvers, that limits and Ctrl-C can end."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from typing import TypeVar

from cocap_opt.stop import Stop

POLL = 0.05  # s

T = TypeVar("T")


def attend(
    work: Callable[[], T], stop: Stop, tick: Callable[[], None], interrupt: Callable[[], None]
) -> T:
    """Does work in another thread, while this one asks for limits and hears of Ctrl-C.

    Parameters
    ----------
    tick : called every now and then
    interrupt : called again and again from when a limit is reached until the work ends

    Returns
    -------
    The outcome of the work, also where it was interrupted.
    """
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(work)
        try:
            while not wait([future], POLL).done:
                tick()
                if stop.reached():
                    interrupt()
        finally:
            while not wait([future], POLL).done:  # an exception is on its way out
                interrupt()
    return future.result()
