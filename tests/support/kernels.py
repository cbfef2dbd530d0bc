"""Kernels for tests: in a process that has done nothing yet, or in which none is ever loaded."""

from cocap_opt.compiling import Kernel
from cocap_opt.stop import Stop


class NotLoaded(Kernel):
    """One that is never loaded."""

    def _load_where_worth_it(self, work: float, stop: Stop | None) -> None:
        pass


def of_views(kind: type[Kernel] = Kernel) -> Kernel:
    """That of views."""
    functions = "cocap_opt.vision.view_kernel"
    return kind("cocap_opt.vision.compiled_sight", "coverage", 13.0, functions)


def of_sweeps(kind: type[Kernel] = Kernel) -> Kernel:
    """That of value iteration."""
    return kind("cocap_opt.graph.sweep_kernel", "value iteration", 4.0)


def of_responses(kind: type[Kernel] = Kernel) -> Kernel:
    """That of best responses over few states."""
    return kind("cocap_opt.coordination.response_kernel", "best responses", 3.0)
