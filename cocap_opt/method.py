"""The record of a method in a registry: a planner, a bound or an exact method, and its promises."""

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
    """The docstring of a method's function; that of the class, if the class itself is asked."""

    def __init__(self, of_class: str) -> None:
        self._of_class = of_class

    def __get__(self, method: "Method[Any] | None", owner: type) -> str | None:
        return self._of_class if method is None else method.function.__doc__


@dataclass(frozen=True, repr=False)
class Method(Generic[R_co]):
    """A planner, a bound or an exact method: what it is made of, takes and promises.

    It is called as its function is, whose module is imported at first use: some solvers take
    seconds. Signature and docstring are the function's own, so that `help` shows them.

    Attributes
    ----------
    call : the function, or where it is, as "module:function"
    made_of : of what it is made, in one line
    promises : what holds for its results, in one line
    scenes : those that it takes, in a few words
    takes : what the function takes besides a problem and a stop: "start" and "report" by position,
        "seed" and "gap" by keyword
    lazy : it evaluates only the views that it touches; others need the coverage of all states
    bounds : its result has an upper bound, which takes the coverage of all steps
    obeys_rules : its plans obey all collision rules that the problem has; others may break each
    complete : it gives no plan only where there is none, unless it is stopped
    optimal : its plan is a proved optimum, unless it is stopped
    certified : a certificate proves its bound, which others can check
    most_robots : None for any number of them
    foreign : it is none of this project's: its bound is what its certificate proves
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
        """The function itself; its module is imported if it is not there yet."""
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
        """Returns the method itself; that it can be an attribute makes `help` see a function."""
        return self

    def __repr__(self) -> str:
        return f"<method {self.__name__}: {self.made_of}>"
