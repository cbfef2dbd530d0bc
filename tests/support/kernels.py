"""Kernels for tests: in a process that has done nothing yet, or in which none is ever loaded."""

from cocap_opt.compiling import Kernel


class NotLoaded(Kernel):
    """One that is never loaded."""

    def _load(self, work: float, may_compile: bool) -> None:
        pass


def of_views(kind: type[Kernel] = Kernel) -> Kernel:
    """That of views."""
    return kind("cocap_opt.vision.compiled_sight", "what finds coverage", 13.0)


def of_sweeps(kind: type[Kernel] = Kernel) -> Kernel:
    """That of value iteration."""
    return kind("cocap_opt.graph.sweep_kernel", "value iteration", 4.0)
