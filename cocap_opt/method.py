"""The record of a method in a registry: planner, bound or exact method, with its guarantees."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast

if TYPE_CHECKING:
    from cocap_opt.problem import Problem
    from cocap_opt.result import Result

    R_co = TypeVar("R_co", bound=Result, covariant=True)
else:
    R_co = TypeVar("R_co", covariant=True)

START_AND_REPORT = frozenset({"start", "report"})  # taken by position, after the stop


class _Docstring:
    """The docstring of a method's function; for the class itself, that of the class."""

    def __init__(self, of_class: str) -> None:
        self._of_class = of_class

    def __get__(self, method: "Method[Any] | None", owner: type) -> str | None:
        return self._of_class if method is None else method.function.__doc__


@dataclass(frozen=True, repr=False)
class Method(Generic[R_co]):
    """A planner, a bound or an exact method: its function, its algorithm, and its guarantees.

    Calling it calls its function. The function's module is imported at first use, as some solvers
    take seconds to import. Signature and docstring are the function's own, so `help` shows them.

    Attributes
    ----------
    call : the function, or its place as "module:function"
    made_of : the algorithms that it combines, in one line
    promises : the guarantees for its results, in one line
    scenes : the scenes that it supports, in a few words
    takes : arguments of the function besides a problem and a stop: "start" and "report" by
        position, "seed" and "gap" by keyword
    lazy : it evaluates only the views that it needs; other methods compute the coverage of all
        states first
    bounds : its result has an upper bound, which requires the coverage of all steps
    obeys_rules : its plans obey all collision rules of the problem; plans of other methods may
        break any of them
    complete : it finds a plan if one exists, unless it is stopped
    optimal : its plan is a proved optimum, unless it is stopped
    certified : a certificate proves its bound, and can be checked independently
    most_robots : largest number of robots that it supports; None: any number
    foreign : it is not part of this project; only a bound that its certificate proves counts
    """

    __doc__ = cast(str, _Docstring(__doc__))

    call: "Callable[..., R_co] | str"
    made_of: str = ""
    promises: str = ""
    scenes: str = "any size"
    takes: frozenset[str] = frozenset()
    lazy: bool = False
    bounds: bool = False
    obeys_rules: bool = False
    complete: bool = False
    optimal: bool = False
    certified: bool = False
    most_robots: int | None = None
    foreign: bool = False

    @property
    def function(self) -> "Callable[..., R_co]":
        """The function itself; its module is imported if necessary."""
        if not isinstance(self.call, str):
            return self.call
        module, _, name = self.call.partition(":")
        found: Callable[..., R_co] = getattr(import_module(module), name)
        return found

    def __call__(self, problem: "Problem", /, *arguments: Any, **options: Any) -> R_co:
        """Calls the function."""
        return self.function(problem, *arguments, **options)

    def __getattr__(self, name: str) -> Any:
        """Gives `inspect` the names of the method, and the function that has its signature."""
        if name in ("__name__", "__qualname__"):
            if isinstance(self.call, str):
                return self.call.partition(":")[2]
            return getattr(self.call, name, type(self.call).__name__)
        if name == "__wrapped__":
            return self.function
        raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")

    def __get__(self, instance: object, owner: type) -> "Method[R_co]":
        """Returns the method itself; as this makes it a descriptor, `help` treats it as a
        function.
        """
        return self

    def __repr__(self) -> str:
        return f"<method {self.__name__}: {self.made_of}>"
