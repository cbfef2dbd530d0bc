"""The command `audit`, which checks an instance against its scene with independent code."""

import hashlib
import math
import secrets
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from cocap_opt.cli.options import Json, Scene, Seed, Verbose, load_planned
from cocap_opt.console.exit_codes import FAILED, UNDECIDED
from cocap_opt.console.progress import Watch
from cocap_opt.files.documents import FileError, problem_digest
from cocap_opt.formulations.independent import instance_of
from cocap_opt.formulations.independent.audit import Audit
from cocap_opt.formulations.independent.cocap_check import Instance, Refused
from cocap_opt.formulations.independent.instance_facts import FormatError
from cocap_opt.formulations.independent.scene_facts import UnknownError
from cocap_opt.model import compiled
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import GivenPlan, PlanReader, read_text
from cocap_opt.output.printing import Record, print_texts
from cocap_opt.problem import COVERAGE_VERSION, Problem
from cocap_opt.referee import check
from cocap_opt.run.audited import SOME, WHOLE, audited
from cocap_opt.run.options import Option, UsageError
from cocap_opt.stop import FirstOf, Interrupt, TimeLimit
from cocap_opt.text import printable

_SHOWN = 20  # differences that are printed
_SUM = 1e-9  # relative rounding error of a sum of doubles
_WIDTHS = ("widest_share", "widest_pixels")
_NO_FLINT = (
    "--views: enclosures need python-flint: pip install 'cocap-opt[audit]'; use --views 0 to "
    "leave coverage out"
)


def _audit(
    scene: Scene,
    /,
    *plan: Annotated[Path, Parameter(help="plan whose states' coverage is checked, too")],
    seed: Seed = 0,
    instance: Annotated[
        Path | None,
        Parameter(help="instance from `export` (default: the one that `export` would write)"),
    ] = None,
    views: Annotated[
        float | None,
        Parameter(
            help="N: check the coverage of the N states with most pixels, and of N random ones; "
            "inf: all states; 0: none, not even a plan's (default: all of up to "
            f"{WHOLE:,} states, else {SOME:,})"
        ),
    ] = None,
    draw: Annotated[
        int | None,
        Parameter(help="seed of the random states (default: a new one in each run)"),
    ] = None,
    time_limit: Annotated[
        float,
        Parameter(help="seconds after which no more coverage is checked; inf: no limit"),
    ] = math.inf,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Check an exported instance against its scene: exit 0 only if they agree.

    Places, moves, turns, closed places, starts, goals, rewards, rules, weights
    and reachable states are recomputed from the scene's JSON, by networkx and
    code that shares nothing with `export`. Pixels and a plan's J must lie in
    intervals computed by interval arithmetic (python-flint). Each difference
    is a line with both values. Exit code 1: there is a difference; 3: there is
    none, but some numbers are too close to a limit to decide, or the time limit
    or Ctrl-C left out some states. Scenes that are not supported, such as those
    with general meshes, are rejected.

    Example: cocap-opt audit bottleneck plan.json --views 2000
    """
    if views is not None and not (views >= 0 and (math.isinf(views) or views.is_integer())):
        raise UsageError(f"--views: must be a whole number, 0 or more, or inf, not {views}")
    time_limit = Option("--time-limit").require_limit(time_limit)
    draw = secrets.randbits(32) if draw is None else draw
    problem = load_planned(scene, seed)
    given = PlanReader(scene, problem).plans(plan)
    if given:
        problem = given[0].problem
    paths = [found.plan.paths for found in given]
    with Watch.on_terminal(f"{problem.name} seed {seed}") as watch:
        text = _text(instance, problem, watch)
        progress = watch.counter("state enclosed")
        try:
            with Interrupt.caught() as interrupt:
                stop = FirstOf(TimeLimit(time_limit), interrupt)
                audit = audited(problem, text, paths, views, draw, progress, stop)
        except UnknownError as error:
            raise UsageError(f"SCENE: the audit does not support {error}") from error
        except FormatError as error:
            raise FileError(f"{instance}: {error}") from error
        except ImportError as error:
            raise UsageError(_NO_FLINT) from error
    audit.differences += _claims(plan, given, audit)
    answer = {
        "scene": problem.name, "seed": seed, "digest": problem_digest(problem),
        "instance": instance, "sha256": hashlib.sha256(text.encode()).hexdigest(), "draw": draw,
        **_told(audit),
    }  # fmt: skip
    if words := "; ".join(_against_rules(problem, plan, given)):
        answer["message"] = "; ".join(filter(None, (answer.get("message"), words)))
    differences = [*audit.differences, *(audit.coverage.differences if audit.coverage else ())]
    if json:
        print_result({**answer, "differences": differences}, json)
    else:
        shown = {key: f"{answer[key]:.1e}" for key in _WIDTHS if key in answer}
        shown["rewards_enclosed"] = "\n".join(f"{a!r} to {b!r}" for a, b in audit.rewards)
        if answer["agrees"] and _is_open(audit):
            shown["agrees"] = "no difference found, but not all is decided"
        if undecided := answer.get("numbers_undecided"):
            shown["numbers_undecided"] = f"{undecided:,} of {answer['numbers_enclosed']:,}"
        print_result(answer | shown, json, verbose)
        if differences:
            left = len(differences) - _SHOWN
            more = [f"and {left} more; --json has all"] if left > 0 else []
            print_texts([], [*differences[:_SHOWN], *more])
    if differences:
        return FAILED
    return UNDECIDED if _is_open(audit) else 0


def _is_open(audit: Audit) -> bool:
    """Returns True if something is undecided: it is too close to a limit, or time ran out."""
    return _has_close_calls(audit) or bool(audit.coverage and audit.coverage.left)


def _has_close_calls(audit: Audit) -> bool:
    """Returns True if something is too close to a limit to be decided."""
    return bool(audit.unsure or (audit.coverage and audit.coverage.undecided))


def _claims(plans: Sequence[Path], given: Sequence[GivenPlan], audit: Audit) -> Iterator[str]:
    """Yields lines for plans whose claimed J is outside its enclosure."""
    for path, found, (low, high) in zip(plans, given, audit.rewards, strict=False):
        claim = None if found.file is None else found.file.reward
        if claim is not None and not low - _SUM * low <= claim <= high + _SUM * high:
            yield f"{printable(str(path))}: J: scene {low!r} to {high!r}, plan {claim!r}"


def _against_rules(
    problem: Problem, plans: Sequence[Path], given: Sequence[GivenPlan]
) -> Iterator[str]:
    """Yields lines for plans that break a rule; the audit itself compares only J."""
    for path, found in zip(plans, given, strict=True):
        if not check(problem, found.plan).valid:
            yield f"{printable(str(path))}: breaks a rule; run `verify` for details"


def _text(path: Path | None, problem: Problem, watch: Watch) -> str:
    """Returns the instance in a file, or the one that is made from the scene now."""
    if path is not None:
        text = read_text(path)
        try:
            coverage = Instance(text).coverage
        except Refused as error:
            raise FileError(f"{path}: {error}") from error
        if coverage != COVERAGE_VERSION:
            words = f"must be {COVERAGE_VERSION}, which the audit supports, not {coverage}"
            raise FileError(f"{path}: coverage: {words}")
        return text
    return instance_of(compiled(problem), watch.counter("coverage"))


def _told(audit: Audit) -> Record:
    """Returns the numbers of compared items, and of those that do not agree."""
    found: dict[str, Any] = {
        "places": audit.places,
        "moves": audit.moves,
        "states_reached": audit.reached,
        "states_that_see": audit.sights,
        "near_people_undecided": audit.unsure or None,
    }
    if (coverage := audit.coverage) is not None:
        found |= {
            "views_enclosed": coverage.states,
            "views_left": coverage.left or None,
            "numbers_enclosed": coverage.numbers,
            "numbers_undecided": coverage.undecided,
            "widest_share": coverage.wide_share,
            "widest_pixels": coverage.wide_pixels,
            "rewards_enclosed": audit.rewards,
        }
    found["agrees"] = not audit.differences and not (coverage and coverage.differences)
    words = ["coverage was left out"] if coverage is None else []
    if _has_close_calls(audit):
        words.append("undecided numbers may be right or wrong")
    if words:
        found["message"] = "; ".join(words)
    return found


COMMANDS = {"audit": _audit}
