"""Third-party planners by name: `module:function`, or a name provided by an installed package.

A package provides planners through its entry points in the group `cocap_opt.planners`. None of them
is imported before it is named, so a broken planner affects nothing else.
"""

from collections.abc import Sequence
from importlib.metadata import EntryPoint, entry_points

from cocap_opt.console.streams import say
from cocap_opt.method import Method
from cocap_opt.result import Result
from cocap_opt.run.engine import BOUND, SOLVERS
from cocap_opt.run.options import Option, UsageError
from cocap_opt.run.own_planners import OwnPlanner, OwnPlannerError
from cocap_opt.text import meant

GROUP = "cocap_opt.planners"  # group of entry points
# forms of names, besides the built-in names
FORMS = "module:function, or a planner of an installed package"


def own_planners(option: Option, names: Sequence[str]) -> dict[str, OwnPlanner]:
    """Returns the third-party planners among some planners, by name.

    Raises
    ------
    UsageError
        If no planner has the name, if several packages provide it, or if it cannot be used.
    """
    offered = _offered()
    found = {}
    for name in names:
        if name in SOLVERS:
            _tell_taken(name, offered)
            continue
        try:
            found[name] = OwnPlanner.found(name, _reference(option, name, offered))
        except OwnPlannerError as error:
            raise UsageError(f"{option.name}: {error}") from error
    return found


def planner_named(option: Option, name: str) -> Method[Result]:
    """Returns the record of a built-in or third-party planner.

    Raises
    ------
    UsageError
        As for `own_planners`.
    """
    found = own_planners(option, [name])
    return found[name].method if found else SOLVERS[name]


def _offered() -> dict[str, list[EntryPoint]]:
    """Returns the planners of installed packages by name, without duplicates."""
    found: dict[str, list[EntryPoint]] = {}
    try:
        offered = list(entry_points(group=GROUP))
    except Exception:  # a package with a damaged record
        return found
    for point in offered:
        others = found.setdefault(point.name, [])
        if point.value not in [other.value for other in others]:
            others.append(point)
    return found


def _reference(option: Option, name: str, offered: dict[str, list[EntryPoint]]) -> str:
    """Returns the module:function of a planner."""
    module, colon, path = name.partition(":")
    if colon:
        if not all(part.isidentifier() for part in (*module.split("."), *path.split("."))):
            raise UsageError(f"{option.name}: must be module:function, not {name!r}")
        return name
    several = offered.get(name, [])
    if not several or name == BOUND:
        known = [*SOLVERS, *(other for other in offered if other not in SOLVERS)]
        words = f"must be one of {', '.join(known)}, or module:function, not {name!r}"
        raise UsageError(f"{option.name}: {words}{meant(name, known)}")
    if several[1:]:
        who = ", ".join(f"{_package(point)} ({point.value})" for point in several)
        words = f"several packages provide {name!r}: {who}; name one as module:function"
        raise UsageError(f"{option.name}: {words}")
    value = several[0].value.partition("[")[0].strip()
    if not value.partition(":")[2]:
        words = f"{_package(several[0])} provides {value!r}, which is not a module:function"
        raise UsageError(f"{option.name}: {name}: {words}")
    return value


def _tell_taken(name: str, offered: dict[str, list[EntryPoint]]) -> None:
    """Logs that a package provides a planner under a name that is already in use."""
    for point in offered.get(name, []):
        say(
            f"{name} is the name of a built-in planner; for that of {_package(point)}, use "
            f"{point.value}"
        )


def _package(point: EntryPoint) -> str:
    return "a package" if point.dist is None else str(point.dist.name)
