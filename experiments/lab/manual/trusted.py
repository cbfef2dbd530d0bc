"""The code that must be trusted to believe a bound: the checker's modules and lines, by layer."""

import ast
from collections.abc import Callable, Iterable
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from cocap_opt.experiments.lab.results import markdown
from cocap_opt.files.code import with_imports

CHECKER = "cocap_opt.formulations.certificates"
UPPER = f"{CHECKER}.staged"
COMPILED = frozenset(
    f"{UPPER}.{name}"
    for name in ("compiled_search", "kernel_arrays", "relaxation_kernel", "search_kernel")
)
AUDIT = tuple(
    f"cocap_opt.formulations.independent.{name}"
    for name in ("scene_facts", "instance_facts", "differences", "enclosures", "audit")
)
# Modules that the core imports for other purposes; checking never loads them.
UNUSED = frozenset(
    f"cocap_opt.{name}"
    for name in (
        "problem.pictures", "problem.map_frame", "problem.start_ground", "vision.cache",
        "files.code", "files.known_digests", "compiling.apart", "vision.compiled_sight",
        "vision.view_kernel",
    )
)  # fmt: skip
_DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


class Trusted(NamedTuple):
    """Modules that must be trusted together.

    Attributes
    ----------
    modules : their full names, sorted
    lines : number of lines of code, without blank lines, comments and docstrings
    """

    modules: tuple[str, ...]
    lines: int

    @classmethod
    def of(cls, modules: Iterable[str]) -> "Trusted":
        """Counts the lines of modules."""
        names = tuple(sorted(modules))
        return cls(names, sum(map(code_lines, names)))


def storeys() -> dict[str, Trusted]:
    """Returns `core`, `lower`, `upper` and `compiled`, each without those before it."""
    loaded = with_imports(CHECKER)
    upper = {name for name in loaded if name.startswith(f"{UPPER}.")}
    lower = {name for name in loaded if name.startswith(f"{CHECKER}.")} - upper
    # Packages' __init__ modules that only list their contents do not count.
    core = {name for name in loaded - lower - upper - UNUSED if code_lines(name)}
    return {
        "core": Trusted.of(core),
        "lower": Trusted.of(lower),
        "upper": Trusted.of(upper - COMPILED),
        "compiled": Trusted.of(COMPILED),
    }


def code_lines(module: str) -> int:
    """Returns the lines of code of a module."""
    spec = find_spec(module)
    if spec is None or spec.origin is None:
        raise ValueError(f"{module}: there is no such module")
    text = Path(spec.origin).read_text(encoding="utf-8")
    documentation: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, _DOCUMENTED) and ast.get_docstring(node) is not None:
            documentation |= set(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    return sum(
        bool(line.strip()) and not line.strip().startswith("#") and number not in documentation
        for number, line in enumerate(text.splitlines(), 1)
    )


def _table() -> str:
    """Returns a line for each kind of claim, with the code that must be trusted for it."""
    told = {
        "core": ("any bound", "the core below: scene, graph, coverage"),
        "lower": ("any bound", "formulations/certificates: sums, no search"),
        "upper": ("staged certificates", "formulations/certificates/staged: searches"),
        "compiled": ("staged certificates, unless plain", "the same searches, compiled by numba"),
    }
    rows = [
        {"to believe": what, "trust": room, "modules": len(part.modules), "lines": part.lines}
        for (what, room), part in ((told[name], part) for name, part in storeys().items())
    ]
    return markdown(rows)


def _lines(name: str) -> str:
    return f"{storeys()[name].lines:,}"


TRUSTED: dict[str, Callable[[], str]] = {
    "trusted": _table,
    **{f"{name}_lines": partial(_lines, name) for name in ("core", "lower", "upper", "compiled")},
    "audit_lines": lambda: f"{Trusted.of(AUDIT).lines:,}",
}
