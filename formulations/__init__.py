"""Bounds and exact optima. To add one: one file, and one line in a registry below.

This front imports nothing of its package: whoever imports the certificates loads no method.
"""

import inspect
from collections.abc import Mapping
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from cocap_opt.formulations.result import BoundMethod, CertifiedResult, ExactMethod

__all__ = ["BOUNDS", "EXACT"]


class _OfTheFunction:
    """An attribute that a lazy method takes over from the function that it stands for.

    Asked of the class itself it is the class's own, so that `help` can describe the class too.
    """

    def __init__(self, own: str | None) -> None:
        self._own = own

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, method: "_LazyMethod | None", owner: type) -> object:
        if method is None:
            return self._own
        function = method.load()
        if self._name == "__signature__":
            return inspect.signature(function)
        return getattr(function, self._name)


class _LazyMethod:
    """A bound or exact method whose module is imported at first use: some solvers take seconds.

    Signature and docstring are the function's own, so that `help` shows them.

    Attributes
    ----------
    summary : one line, known without the import
    """

    __doc__ = cast(str, _OfTheFunction(__doc__))
    __signature__ = _OfTheFunction(None)

    def __init__(self, module: str, name: str, summary: str) -> None:
        self._module = f"cocap_opt.formulations.{module}"
        self.__name__ = self.__qualname__ = name
        self.__module__ = self._module
        self.summary = summary

    def load(self) -> Any:
        """Imports the module, if it is not there yet, and returns the function."""
        return getattr(import_module(self._module), self.__name__)

    def __call__(self, *arguments: Any, **options: Any) -> "CertifiedResult":
        """Calls the function with the arguments that `BoundMethod` or `ExactMethod` names."""
        result: CertifiedResult = self.load()(*arguments, **options)
        return result

    def __get__(self, instance: object, owner: type) -> "_LazyMethod":
        """Returns the method itself; that it can be an attribute makes `help` see a function."""
        return self

    def __repr__(self) -> str:
        return f"<method {self.__name__}: {self.summary}>"

    def __reduce__(self) -> tuple[type, tuple[str, str, str]]:
        module = self._module.removeprefix("cocap_opt.formulations.")
        return _LazyMethod, (module, self.__name__, self.summary)


BOUNDS: "Mapping[str, BoundMethod]" = MappingProxyType(
    {
        "alone": _LazyMethod("simple_bounds", "alone", "every drone as if it were alone"),
        "online": _LazyMethod(
            "simple_bounds", "online", "J of a plan and what each drone could add"
        ),
        "concave": _LazyMethod(
            "relaxations.cone_program", "concave", "concave relaxation over the aggregated flow"
        ),
        "single-view": _LazyMethod(
            "relaxations.cone_program", "single_view", "concave relaxation with single-view cuts"
        ),
        "envelope": _LazyMethod(
            "relaxations.cone_program", "envelope", "concave relaxation with envelope cuts"
        ),
        "column-generation": _LazyMethod(
            "column_generation.column_generation",
            "column_generation",
            "relaxation over paths with all cuts, any size, and a plan",
        ),
    }
)

EXACT: "Mapping[str, ExactMethod]" = MappingProxyType(
    {
        "brute-force": _LazyMethod("brute_force", "brute_force", "all plans, one by one"),
        "branch-and-price": _LazyMethod(
            "column_generation.branch_and_price",
            "branch_and_price",
            "proved optima: a tree over column generation",
        ),
        "highs": _LazyMethod(
            "integer_programs.mathopt", "highs", "integer program by outer approximation with HiGHS"
        ),
        "scip": _LazyMethod(
            "integer_programs.mathopt", "scip", "integer program by outer approximation with SCIP"
        ),
        "cp-sat": _LazyMethod(
            "integer_programs.cp_sat",
            "cp_sat",
            "integer program by outer approximation with CP-SAT",
        ),
        "scip-nonlinear": _LazyMethod(
            "integer_programs.scip_nonlinear",
            "scip_nonlinear",
            "nonlinear integer program with SCIP; needs PySCIPOpt",
        ),
    }
)
