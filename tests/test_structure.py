"""Imports go one way, as the design says. Read from the source; holds for files added later."""

import ast
from functools import cache
from graphlib import TopologicalSorter
from itertools import combinations
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("cocap_opt", "scenarios", "formulations", "experiments")
# What each package may import of the project besides itself.
ALLOWED = {
    "cocap_opt": set[str](),
    "scenarios": {"cocap_opt"},
    "formulations": {"cocap_opt"},
    "experiments": {"cocap_opt", "scenarios", "formulations"},
}
# The order of the core: none of these uses a later one, directly or through others.
ORDER = (
    "data", "polygons", "columns", "workspace", "stop", "problem", "bonuses", "motion",
    "timegraph", "projection", "visibility", "faces", "views", "coverage", "plan", "reward",
    "check", "doubts", "result", "planners", "io",
)  # fmt: skip
SOLVERS = {"cvxpy", "clarabel", "highspy", "ortools"}


def module_name(path: Path) -> str:
    """Dotted name of a source file."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def sources() -> dict[str, Path]:
    """All modules of the project and their files."""
    return {
        module_name(path): path for package in PACKAGES for path in (ROOT / package).rglob("*.py")
    }


@cache
def imports(module: str) -> frozenset[str]:
    """Everything a module imports, anywhere in it, by its full name."""
    path = sources()[module]
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                package = (
                    module.split(".") if path.name == "__init__.py" else module.split(".")[:-1]
                )
                package = package[: len(package) - node.level + 1]
                base = ".".join([*package, base] if base else package)
            found.add(base)
            found |= {
                f"{base}.{alias.name}"
                for alias in node.names
                if f"{base}.{alias.name}" in sources()
            }
    return frozenset(found)


@cache
def reached(module: str) -> frozenset[str]:
    """All modules of the project that a module imports, directly or through others.

    A package is imported with each of its modules, so its `__init__` counts too.
    """
    seen: set[str] = set()
    todo = [module]
    while todo:
        for name in imports(todo.pop()):
            parts = name.split(".")
            for end in range(1, len(parts) + 1):
                part = ".".join(parts[:end])
                if part in sources() and part not in seen:
                    seen.add(part)
                    todo.append(part)
    return frozenset(seen)


def within(names: frozenset[str], package: str) -> set[str]:
    """Those of the names that are the package or in it."""
    return {name for name in names if name == package or name.startswith(f"{package}.")}


def test_the_sources_are_found() -> None:
    """These tests look at the real files: every package is there, and imports are seen."""
    assert {name.split(".")[0] for name in sources()} == set(PACKAGES)
    assert "cocap_opt.problem" in imports("cocap_opt.motion")
    assert "networkx" in imports("cocap_opt.motion")
    assert "cocap_opt.problem" in reached("cocap_opt.planners.greedy")


@pytest.mark.parametrize("package", PACKAGES)
def test_packages_import_one_way(package: str) -> None:
    """The core imports no other package; scenes and formulations the core only."""
    for module in sources():
        if module.split(".")[0] == package:
            used = {name.split(".")[0] for name in imports(module)} & set(PACKAGES)
            assert used <= ALLOWED[package] | {package}, module


@pytest.mark.parametrize(("earlier", "later"), list(combinations(ORDER, 2)))
def test_the_core_is_in_order(earlier: str, later: str) -> None:
    """No module of the core uses one that comes later in the design's order."""
    for module in within(frozenset(sources()), f"cocap_opt.{earlier}"):
        assert not within(reached(module), f"cocap_opt.{later}"), module


def test_no_module_imports_itself_in_a_circle() -> None:
    """Imports have no cycles, packages' fronts (`__init__`) left aside."""
    fronts = {name for name, path in sources().items() if path.name == "__init__.py"}
    inner = set(sources()) - fronts
    order = TopologicalSorter({module: imports(module) & inner for module in inner})
    order.prepare()  # raises CycleError


def test_the_referee_is_independent() -> None:
    """The referee uses no planner, no reward code, no compiled model and no cache."""
    used = reached("cocap_opt.check")
    for part in ("planners", "reward", "model", "constraints", "cache", "result"):
        assert not within(used, f"cocap_opt.{part}")


@pytest.mark.parametrize("judge", ["cocap_opt.check", "formulations.certificate"])
def test_judges_compute_rewards_for_moves_themselves(judge: str) -> None:
    """Referee and certificates do not take them from what planners and pricing use."""
    assert "cocap_opt.bonuses" not in imports(judge)


def test_planners_and_formulations_are_strangers() -> None:
    """A bound cannot depend on the plan it bounds: neither side uses the other, at any depth."""
    for module in sources():
        if module.startswith("cocap_opt.planners"):
            assert not within(reached(module), "formulations"), module
        if module.split(".")[0] == "formulations":
            assert not within(reached(module), "cocap_opt.planners"), module
            assert not within(reached(module), "scenarios"), module
            assert not within(reached(module), "experiments"), module


def test_scenes_use_no_planner() -> None:
    """A scene is made without planning it."""
    for module in sources():
        if module.split(".")[0] == "scenarios":
            assert not within(reached(module), "cocap_opt.planners"), module


def test_the_core_calls_no_solver() -> None:
    """Planners, referee and certificates' foundations run without any optimisation package."""
    for module in sources():
        if module.split(".")[0] in ("cocap_opt", "scenarios"):
            assert not {name.split(".")[0] for name in imports(module)} & SOLVERS, module


def test_nothing_imports_the_tests() -> None:
    """The package works without its tests."""
    helpers = {path.stem for path in Path(__file__).parent.glob("*.py")}
    for module in sources():
        used = {name.split(".")[0] for name in imports(module)}
        assert not used & {*helpers, "pytest", "hypothesis"}, module
