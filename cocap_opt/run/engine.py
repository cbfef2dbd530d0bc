"""The engine: runs planners, bounds and exact methods by name within limits, and has the referee
evaluate them.

Commands, the Python interface, sweeps and studies run all methods through this module, including
third-party ones.
"""

import math
from contextlib import suppress
from dataclasses import replace
from functools import cache
from typing import Any

from cocap_opt.console.progress import Watch
from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.certificates import CertificateError, verify
from cocap_opt.formulations.independent import instance_digest
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult, Report, silent
from cocap_opt.method import Method
from cocap_opt.model import Model, compiled
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Result, remedy
from cocap_opt.run.judged import Judged, RefereeError, below_certificate
from cocap_opt.run.options import Allowance
from cocap_opt.run.own_planners import usable_result
from cocap_opt.run.view_share import proved_in
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import LimitReached, Stop, TimeLimit, never
from cocap_opt.timing import timed

BOUND = "bound"  # name of bounds in tables, and therefore not of a planner
BOUND_METHOD = "branch-and-price"  # default of the gap table; it gives a bound at any limit
# Methods that make plans: planners and exact methods.
SOLVERS: dict[str, Method[Any]] = {**PLANNERS, **EXACT}
# scene, and largest number of seconds, with which a method warms up
_SMALL, _WARMING = "tiny-share", 5.0


def record_of(method: str | Method[Any]) -> Method[Any]:
    """Returns the record of a method of a registry by its name, or the record itself."""
    return {**BOUNDS, **SOLVERS}[method] if isinstance(method, str) else method


def is_lazy(name: str) -> bool:
    """Returns True for a method of a registry that does not need the coverage of all states."""
    return name in PLANNERS and PLANNERS[name].lazy


def run(
    problem: Problem,
    method: str | Method[Any],
    stop: Stop = never,
    *,
    name: str = "",
    allowance: Allowance | None = None,
    watch: Watch | None = None,
    seed: int = 0,
    start: Plan | None = None,
    report: Report = silent,
    gap: float = OPTIMALITY,
) -> Judged[Any]:
    """Computes the coverage that a method needs, runs it, and has the referee evaluate its result.

    Parameters
    ----------
    method : the name of a method in a registry, or the record of another method
    stop : ends coverage and search
    name : name of the method, for messages
    allowance : limits of the search only, which begins after coverage
    watch : shows the progress of coverage, which the method would compute silently
    seed, start, report, gap : for methods that take them

    Raises
    ------
    UnsupportedError
        If the method does not support the problem.
    OwnPlannerError
        If a third-party method returns no result.
    RefereeError
        If the referee computes another J than the method, or rejects its plan or its bound.
    """
    known = record_of(method)
    name = name or (method if isinstance(method, str) else known.__name__)
    watch = watch or Watch()
    # this counts neither as coverage nor as search; if limits are forecast, it has been done before
    with stop.paused():
        model = compiled(problem)
    before = model.tables.seconds
    _cover(model, known, stop, watch)
    watch.show(name)
    options: dict[str, Any] = {"start": start, "report": report, "seed": seed, "gap": gap}
    placed = [options[option] for option in ("start", "report") if option in known.takes]
    named = {option: options[option] for option in ("seed", "gap") if option in known.takes}
    allowed = stop if allowance is None else allowance.begin(stop)

    @timed
    def search(problem: Problem) -> Any:
        return usable_result(name, known(problem, allowed, *placed, **named), bounds=known.bounds)

    result = search(problem)
    if known.bounds and result.limit is not None:
        result = replace(result, in_coverage=model.covered_steps <= problem.horizon)
    if known.foreign:
        result = _without_claims(name, problem, result)
    else:
        result = _of_instance(model, result)
    if result.plan is not None and result.plan.stays:  # no drone moves, for lack of time
        words = filter(None, (result.message, remedy(result.limit)))
        result = replace(result, message="; ".join(words))
    result = replace(result, coverage_seconds=model.tables.seconds - before)
    judged = Judged.of(name, problem, result)
    if known.lazy:
        views = result.statistics.get("evaluated")
        return judged._replace(coverage_seconds=0.0, views=None if views is None else int(views))
    return judged._replace(coverage_seconds=model.tables.seconds, views=model.covered_views)


def _without_claims(name: str, problem: Problem, result: Result) -> Result:
    """Returns the result of a third-party method with the bound that its certificate proves.

    Without a certificate, its bound is ignored.

    Raises
    ------
    RefereeError
        If the certificate proves nothing, or less than it claims.
    """
    file = result.certificate if isinstance(result, CertifiedResult) else None
    if file is None:
        return replace(result, bound=math.inf)
    try:
        if words := below_certificate(problem, result):
            raise RefereeError(f"{name}: {words}")
        proved = verify(problem, file, model=compiled(problem)).bound
        return replace(result, bound=proved_in(problem, file, proved))
    except CertificateError as error:
        raise RefereeError(f"{name}: certificate: {error}") from error


def _of_instance(model: Model, result: Any) -> Any:
    """Returns a result whose certificate names its instance, if coverage is complete."""
    file = result.certificate if isinstance(result, CertifiedResult) else None
    if file is None or file.digest != problem_digest(model.problem):
        return result
    if model.covered_steps <= model.problem.horizon:
        return result
    return replace(result, certificate=file.of_instance(instance_digest(model)))


def _cover(model: Model, method: Method[Any], stop: Stop, watch: Watch) -> None:
    """Computes the coverage that a method needs.

    If a limit is reached first, planners keep time to plan with the available coverage, and bounds
    keep time to compute a bound.
    """
    watch.show("coverage")  # code may be compiled before the first views
    progress = watch.countdown("coverage")
    if method.bounds:
        with suppress(LimitReached):  # the method will meet the limit, too
            model.prepare_all(stop, progress)
    elif not method.lazy:
        model.covered_by(stop, progress)


@cache
def warm_up(method: str) -> None:
    """Lets a method load its libraries, some of which take seconds, before its time begins.

    A process does so once; otherwise the first user of a library would bear the time of all others.
    """
    with suppress(Exception):  # if something is wrong, the method itself will report it
        SOLVERS[method](load_scene(_SMALL), TimeLimit(_WARMING))
