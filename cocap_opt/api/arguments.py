"""Checks of the public functions' arguments, with the messages that refuse wrong ones."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cocap_opt.data import FieldError, ProblemError
from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.certificates.format import CertificateFile, ProofFile
from cocap_opt.formulations.result import CertifiedResult
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import Verdict, check
from cocap_opt.result import Result
from cocap_opt.run.own_planners import plain_plan
from cocap_opt.run.rest import Rest
from cocap_opt.text import on_a_line, other_scene

Bound = CertificateFile | ProofFile


def require(value: object, name: str, allowed: str, *kinds: type) -> None:
    """Raises TypeError, with a readable message, if a value is of none of these types."""
    if not isinstance(value, kinds) or isinstance(value, bool):
        raise TypeError(f"{name}: must be {allowed}, not {on_a_line(value)}")


def require_number(value: object, name: str) -> None:
    """Raises TypeError, with a readable message, unless the value is a Python or NumPy number."""
    require(value, name, "a number", int, float, np.number)


def require_whole(value: object, name: str, allowed: str = "a whole number") -> None:
    """Raises TypeError, with a readable message, unless the value is a whole number."""
    require(value, name, allowed, int, np.integer)


def require_path(value: object, name: str) -> Path:
    """Returns a path; raises TypeError, with a readable message, if the value is not one."""
    require(value, name, "the name of a file or folder", str, Path)
    if "\0" in str(value):
        raise ValueError(
            f"{name}: must be a name in which no character is NUL, not {on_a_line(value)}"
        )
    return Path(str(value))


def require_callable(value: object, name: str, allowed: str = "a function") -> None:
    """Raises TypeError, with a readable message, unless the value can be called."""
    if not callable(value):
        raise TypeError(f"{name}: must be {allowed}, not {on_a_line(value)}")


def require_flag(value: object, name: str) -> None:
    """Raises TypeError, with a readable message, unless the value is True or False."""
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{name}: must be True or False, not {on_a_line(value)}")


def listed(value: object, name: str, allowed: str) -> list[Any]:
    """Returns several values, such as those of a list or an array of NumPy.

    Raises TypeError, with a readable message, for a single value; text counts as one.
    """
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, str | bytes) or not isinstance(value, Iterable):
        raise TypeError(f"{name}: must be {allowed}, not {on_a_line(value)}")
    return list(value)


def listed_numbers(value: object, name: str, allowed: str) -> list[float]:
    """Returns several numbers; raises TypeError, with a readable message, for all else."""
    numbers = listed(value, name, allowed)
    for number in numbers:
        require(number, name, allowed, int, float, np.number)
    return numbers


def require_problem(problem: object) -> None:
    """Raises TypeError, with a readable message, unless the value is a problem."""
    require(problem, "problem", "a Problem; `load` makes one of a scene's name or file", Problem)


def name_of(given: object) -> str:
    """Returns the name, for messages and tables, of a method given by name or as a callable."""
    if isinstance(given, str):
        return given
    return str(getattr(given, "__name__", type(given).__name__))


def require_made_for(name: str, given: object, problem: Problem) -> None:
    """Raises ValueError if a result, or the file that a plan was read from, is for another problem.

    The message names both problems, and says how to use the plan all the same.
    """
    made_for = _made_for(given, problem)
    if made_for is not None:
        way = "Plan(paths=plan.paths)" if isinstance(given, Plan) else "result.plan"
        raise ValueError(f"{name}: it was made for {made_for}; {way} is the plan alone")


def _made_for(given: object, problem: Problem) -> str | None:
    """Returns words for the other problem that an object was made for; None if there is none."""
    if isinstance(given, Plan) and given.made_for:
        digest, scene = given.made_for, given.scene
    elif isinstance(given, Result) and given.problem is not None and given.problem is not problem:
        digest, scene = problem_digest(given.problem), given.problem.name
    else:
        return None
    return None if digest == problem_digest(problem) else other_scene(scene, problem.name)


def require_flown(name: str, verdict: Verdict) -> None:
    """Raises ValueError if a plan cannot be flown."""
    if verdict.violations:
        raise ValueError(f"{name}: {verdict.violations[0]}")


def plan_of(given: Plan | Result | None, name: str = "plan") -> Plan | None:
    """Returns the given plan, or the plan of a given result; its states may be plain tuples."""
    if given is None or isinstance(given, Result):
        return None if given is None else given.plan
    require(given, name, "a Plan or a Result; `read` reads files of plans", Plan)
    return plain_plan(given)


def plan_for(
    problem: Problem, given: Plan | Result | None, purpose: str, name: str = "plan"
) -> Plan:
    """Returns the given plan of a problem, or the plan of a given result.

    Parameters
    ----------
    purpose : use of the plan, such as "flown", for the message
    name : of the argument

    Raises
    ------
    ValueError
        If the result has no plan, or if the result, or the plan according to its file, is for
        another problem.
    """
    require_problem(problem)
    require_made_for(name, given, problem)
    plan = plan_of(given, name)
    if plan is None:
        raise ValueError(f"{name}: the result has no plan to be {purpose}")
    return plan


def start_for(problem: Problem, given: Plan | Result | None) -> Plan | None:
    """Returns the plan that a method starts from, or that of a given result; None if there is none.

    It may come from a problem with other rules or another objective, and may break the rules of
    this one; the method then reports that.

    Raises
    ------
    ValueError
        If it cannot be flown in this problem.
    """
    plan = plan_of(given, "start")
    if plan is not None and (violations := check(problem, plan).violations):
        made_for = _made_for(given, problem)
        words = "it" if made_for is None else f"it was made for {made_for}, and"
        raise ValueError(f"start: {words} cannot be flown in {problem.name}: {violations[0]}")
    return plan


def followed(follow: Plan | Result | None, name: str = "follow") -> Plan:
    """Returns the plan that is flown up to a step, whichever scene it was made for.

    Parameters
    ----------
    name : of the argument

    Raises
    ------
    ValueError
        If there is none.
    """
    plan = plan_of(follow, name)
    if plan is None:
        raise ValueError(f"{name}: must be the plan that is flown, or a result that has one")
    return plan


def rest_of(
    problem: Problem,
    follow: Plan | Result | None,
    from_step: int | None,
    without: Sequence[int],
    name: str = "follow",
) -> Rest:
    """Returns the rest of a mission from a step on.

    Parameters
    ----------
    name : of the argument that is the plan

    Raises
    ------
    ValueError
        If there is no plan or no such step or drone, or if the steps flown so far break a rule;
        one line.
    """
    require_problem(problem)
    plan = followed(follow, name)
    if from_step is None:
        raise ValueError("from_step: must be given: the step up to which the plan has been flown")
    require_whole(from_step, "from_step")
    lost = listed(without, "without", "a list of numbers of drones")
    for drone in lost:
        require_whole(drone, "without", "numbers of drones")
    try:
        return Rest.of(problem, plan, int(from_step), [int(drone) for drone in lost])
    except FieldError:
        raise
    except ProblemError as error:
        raise ValueError(f"{name}: {error}") from error


def bound_in(claim: Plan | Result | Bound) -> Bound | None:
    """Returns the given certificate or proof, or that of a given result; None if there is none."""
    if isinstance(claim, CertifiedResult):
        return claim.certificate
    return None if isinstance(claim, Plan | Result) else claim


def required_bound(claim: object) -> Bound:
    """Returns the given certificate or proof, or that of a given result.

    Raises
    ------
    TypeError
        If the claim is none of these.
    ValueError
        If the result has none.
    """
    words = "a certificate, a proof, or a result that has one"
    require(claim, "certificate", words, CertificateFile, ProofFile, CertifiedResult)
    assert isinstance(claim, CertificateFile | ProofFile | CertifiedResult)
    file = bound_in(claim)
    if file is None:
        raise ValueError("certificate: the result has none")
    return file
