"""The project's own modules, read from the source: where they are and which they import."""

import ast
import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2] / "cocap_opt"
CORE = "cocap_opt"
LINKED = ("formulations", "scenarios", "experiments")  # folders beside the core, linked into it
# What is made of planners and bounds.
RUN = ("console", "output", "run", "pictures", "missions", "player")
FRONT = ("api", "cli")  # what people call


@cache
def sources() -> dict[str, Path]:
    """All modules of the project by their full name, and their files."""
    found = {}
    for folder, _, files in os.walk(ROOT, followlinks=True):
        for file in files:
            if file.endswith(".py"):
                path = Path(folder) / file
                parts = (CORE, *path.relative_to(ROOT).with_suffix("").parts)
                found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def package_of(module: str) -> str:
    """The package that a module belongs to: a linked folder, the lab, or a part of `cocap_opt`."""
    parts = (*module.split("."), "", "")
    if parts[1] in LINKED:
        return "lab" if parts[1:3] == ("experiments", "lab") else parts[1]
    return "run" if parts[1] in RUN else "front" if parts[1] in FRONT else "core"


def prefix(package: str) -> str:
    """Full name of the folder that holds a package's rooms."""
    if package == "lab":
        return f"{CORE}.experiments.lab"
    return f"{CORE}.{package}" if package in LINKED else CORE


def room_of(module: str) -> str:
    """The room of its package that a module is in; empty for the package's own front."""
    inner = module.removeprefix(prefix(package_of(module))).removeprefix(".")
    return inner.split(".")[0]


def imports(module: str) -> frozenset[str]:
    """Everything a module imports, anywhere in it, by its full name."""
    return _imports(module, of_types=True)


def imports_to_run(module: str) -> frozenset[str]:
    """Everything a module imports, anywhere in it, but for type checkers."""
    return _imports(module, of_types=False)


@cache
def _imports(module: str, of_types: bool, in_functions: bool = True) -> frozenset[str]:
    """What a module imports, with or without what only type checkers or functions import."""
    found: set[str] = set()
    for node, is_typing, in_function in _statements(module):
        if (is_typing and not of_types) or (in_function and not in_functions):
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        else:
            assert not node.level, f"{module}: imports are written in full"
            base = node.module or ""
            inner = {f"{base}.{alias.name}" for alias in node.names} & set(sources())
            found |= inner
            if len(inner) < len(node.names):
                found.add(base)
    return frozenset(found)


Import = ast.Import | ast.ImportFrom


@cache
def _statements(module: str) -> list[tuple[Import, bool, bool]]:
    """The imports of a module; if each is for type checkers only, and if it is in a function."""
    tree = ast.parse(sources()[module].read_text(encoding="utf-8"))
    return [*_imports_below(tree, False, False)]


def _imports_below(
    node: ast.AST, is_typing: bool, in_function: bool
) -> Iterator[tuple[Import, bool, bool]]:
    """Yields the imports below a node; only statements, and their parts, have any."""
    for name, value in ast.iter_fields(node):
        if not isinstance(value, list):
            continue
        in_body = name == "body"
        typing = is_typing or (in_body and isinstance(node, ast.If) and _is_of_types(node.test))
        inner = in_function or (
            in_body and isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        )
        for child in value:
            if isinstance(child, Import):
                yield child, typing, inner
            elif isinstance(child, ast.stmt | ast.ExceptHandler | ast.match_case):
                yield from _imports_below(child, typing, inner)


def _is_of_types(test: ast.expr) -> bool:
    return isinstance(test, ast.Name) and test.id == "TYPE_CHECKING"


@cache
def reached(module: str) -> frozenset[str]:
    """All modules of the project that a module loads when it runs, directly or through others.

    A package is imported with each of its modules, so its `__init__` counts too.
    """
    return _closure(module, in_functions=True)


@cache
def loaded_with(module: str) -> frozenset[str]:
    """All modules of the project that importing a module loads; no function of theirs is called."""
    return _closure(module, in_functions=False)


def _closure(module: str, in_functions: bool) -> frozenset[str]:
    seen: set[str] = set()
    todo = [module]
    while todo:
        for name in _imports(todo.pop(), of_types=False, in_functions=in_functions):
            parts = name.split(".")
            for end in range(2, len(parts) + 1):
                part = ".".join(parts[:end])
                if part in sources() and part not in seen:
                    seen.add(part)
                    todo.append(part)
    return frozenset(seen)
