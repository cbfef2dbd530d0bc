"""The reference of `import cocap_opt as co`, made from signatures and docstrings."""

import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from enum import Enum
from functools import partial
from types import ModuleType

from numpydoc.docscrape import NumpyDocString, Parameter

# The parts of the pages, and the names that each shows, in order; methods follow their class.
NAMES: Mapping[str, tuple[str, ...]] = {
    "scenes": ("load", "with_views", "with_starts", "takes", "coverage", "coverage_digest"),
    "plans": ("plan", "rest", "check", "quality", "replans"),
    "bounds_and_proofs": ("bound", "solve", "verify", "explain", "gap"),
    "comparisons": ("front", "quality_bound", "team", "compare_takes"),
    "pictures_and_flights": ("show", "trajectory", "robustness"),
    "files": ("read", "save"),
    "versions": ("show_versions",),
    "problem": ("Problem", "Problem.plot", "Problem.replace", "Problem.without_rules"),
    "map_and_airspace": ("HeightMap", "Mesh", "Airspace", "Earth"),
    "drones": (
        "Robot", "State", "StartStates", "StartArea", "GoalArea", "Motion", "Camera", "Cone",
        "Limits",
    ),
    "people": ("Actor", "Take", "Cuboid", "Prism", "TriangulatedCuboid"),
    "objective_and_rules": ("Objective", "Views", "CollisionRules"),
    "plans_and_results": (
        "Plan", "Result", "Result.plot", "CertifiedResult", "Replanned", "Replanned.summary",
        "Snapshot", "Reason", "Player", "Player.save",
    ),
    "judgements": (
        "Verdict", "Verified", "Quality", "Quality.summary", "Quality.by_person", "Quality.worst",
        "Quality.table", "Quality.plot", "QualityBound", "QualityBound.most", "QualityBound.share",
        "QualityBound.sentences", "QualityBound.scene",
    ),
    "trade_offs_and_teams": (
        "Front", "Front.table", "Front.plot", "Front.best_with", "Front.reward_bound",
        "Front.most_views", "Front.views_bound", "Front.gap", "Front.settled", "Front.no_plan",
        "Front.seen", "Front.sentences", "Teams", "Teams.table", "Teams.sentences", "Teams.plot",
    ),
    "conflicts": ("VertexConflict", "SwapConflict", "PassConflict"),
    "stopping": ("Stop", "Stop.reached", "TimeLimit", "WorkLimit", "FirstOf", "Limit"),
    "errors": (
        "ProblemError", "FileError", "CertificateError", "UnsupportedError", "RefereeError",
    ),
}  # fmt: skip
_WIDEST = 80  # characters of a line of code that a page shows without scrolling
_LONGEST = 30  # characters of a default; a longer default is replaced by its kind
_MODULES = re.compile(r"\b(?:[a-z_]\w*\.)+(?=[A-Za-z])")
_LISTED = ("Parameters", "Attributes", "Returns", "Raises")


def _part(names: tuple[str, ...], face: ModuleType) -> str:
    """Returns the entries of some names, one after another."""
    return "\n\n".join(text for name in names for text in _paragraphs(name, face) if text)


PYTHON: Mapping[str, Callable[[ModuleType], str]] = {
    f"python_{part}": partial(_part, names) for part, names in NAMES.items()
}


def _paragraphs(name: str, face: ModuleType) -> Iterator[str]:
    """Yields heading, signature, description, lists and example of a function or class."""
    owner, _, inner = name.partition(".")
    thing = getattr(face, owner)
    found = inspect.getattr_static(thing, inner) if inner else thing
    yield f"{'###' if inner else '##'} {name}"
    if isinstance(found, property):
        found = found.fget
    elif not (isinstance(thing, type) and issubclass(thing, Enum | Exception)):
        called = getattr(thing, inner) if inner else thing
        yield f"```py\n{_signature(name if inner else f'co.{name}', called)}\n```"
    text = NumpyDocString(inspect.getdoc(found) or "")
    yield " ".join(text["Summary"])
    yield from "\n".join(text["Extended Summary"]).strip().split("\n\n")
    if isinstance(thing, type) and issubclass(thing, Enum):
        yield "\n".join(f"- `{owner}.{member.name}`" for member in thing)
    for title in _LISTED:
        if rows := text[title]:
            yield f"**{title}**"
            yield "\n".join(map(_line, rows))
    if example := "\n".join(text["Examples"]).strip():
        yield f"```pycon\n{example}\n```"


def _line(row: Parameter) -> str:
    """Returns an item of a list; in these docstrings, the meaning follows a colon."""
    name, meaning = (row.name, row.type) if row.name else (row.type, "")
    words = "\n".join(filter(None, [meaning, *row.desc]))
    told, *items = (" ".join(part.split()) for part in re.split(r"(?m)^\s*- ", words))
    return "\n".join([f"- `{name}`: {told}", *(f"  - {item}" for item in items)])


def _signature(name: str, called: Callable[..., object]) -> str:
    """Returns a call with its parameters, on one line if it fits, without names of modules."""
    found = inspect.signature(called)
    words, starred = list[str](), False
    for parameter in found.parameters.values():
        if parameter.name == "self":
            continue
        if parameter.kind is parameter.KEYWORD_ONLY and not starred:
            words.append("*")
        starred |= parameter.kind in (parameter.KEYWORD_ONLY, parameter.VAR_POSITIONAL)
        words.append(_parameter(parameter))
    end = ""
    if found.return_annotation not in (found.empty, None) and not isinstance(called, type):
        end = f" -> {_annotation(found.return_annotation)}"
    line = f"{name}({', '.join(words)}){end}"
    if len(line) <= _WIDEST:
        return line
    return "\n".join([f"{name}(", *(f"    {word}," for word in words), f"){end}"])


def _parameter(parameter: inspect.Parameter) -> str:
    stars = "*" if parameter.kind is parameter.VAR_POSITIONAL else ""
    text = f"{stars}{parameter.name}"
    if parameter.annotation is not parameter.empty:
        text += f": {_annotation(parameter.annotation)}"
    return text if parameter.default is parameter.empty else f"{text} = {_default(parameter)}"


def _annotation(annotation: object) -> str:
    return _MODULES.sub("", inspect.formatannotation(annotation)).replace("'", "")


def _default(parameter: inspect.Parameter) -> str:
    text = _MODULES.sub("", repr(parameter.default)).replace("'", '"')
    if text.startswith("<"):  # an object without a readable form
        return "..."
    return text if len(text) <= _LONGEST else f"{type(parameter.default).__name__}(...)"
