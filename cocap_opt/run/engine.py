"""The engine: planners, bounds and exact methods by name, run within limits and judged.

Commands, the Python face, sweeps and studies run all methods here, those of somebody's own as well.
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

BOUND = "bound"  # what tables call their bounds, and so the name of no planner
BOUND_METHOD = "branch-and-price"  # of the gap table; at any limit it has a bound
# What plans: planners, and exact methods.
SOLVERS: dict[str, Method[Any]] = {**PLANNERS, **EXACT}
_SMALL, _WARMING = "tiny-share", 5.0  # a scene, and most seconds, in which a method warms up


def record_of(method: str | Method[Any]) -> Method[Any]:
    """Returns the record of a method of a registry by its name, or the record itself."""
    return {**BOUNDS, **SOLVERS}[method] if isinstance(method, str) else method


def is_lazy(name: str) -> bool:
    """Returns True for a method of a registry that needs no coverage of all states."""
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
    """Computes the coverage that a method needs, runs it, and has the referee judge its result.

    Parameters
    ----------
    method : the name of one in a registry, or the record of one that is in none
    stop : ends both, coverage and the search
    name : of the method, for messages
    allowance : of the search alone, which begins once coverage is there
    watch : shows how far coverage is, which the method would compute in silence
    seed, start, report, gap : for methods that take them

    Raises
    ------
    UnsupportedError
        If the method takes no such problems.
    OwnPlannerError
        If a method of somebody's own returns no result.
    RefereeError
        If the referee finds another J than the method, or refuses its plan or its bound.
    """
    known = record_of(method)
    name = name or (method if isinstance(method, str) else known.__name__)
    watch = watch or Watch()
    with stop.paused():  # neither coverage nor search; where a limit is forecast it is done before
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
        return usable_result(name, known(problem, allowed, *placed, **named))

    result = search(problem)
    if known.bounds and result.limit is not None:
        result = replace(result, in_coverage=model.covered_steps <= problem.horizon)
    if known.foreign:
        result = _without_claims(name, problem, result)
    else:
        result = _of_instance(model, result)
    if result.plan is not None and result.plan.stays:  # for want of time
        words = filter(None, (result.message, remedy(result.limit)))
        result = replace(result, message="; ".join(words))
    result = replace(result, coverage_seconds=model.tables.seconds - before)
    judged = Judged.of(name, problem, result)
    if known.lazy:
        views = result.statistics.get("evaluated")
        return judged._replace(coverage_seconds=0.0, views=None if views is None else int(views))
    return judged._replace(coverage_seconds=model.tables.seconds, views=model.covered_views)


def _without_claims(name: str, problem: Problem, result: Result) -> Result:
    """Returns the result of somebody's own method with the bound that its certificate proves.

    Without a certificate its bound counts for nothing.

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
    """Returns a result whose certificate names its instance, if all coverage is there."""
    file = result.certificate if isinstance(result, CertifiedResult) else None
    if file is None or file.digest != problem_digest(model.problem):
        return result
    if model.covered_steps <= model.problem.horizon:
        return result
    return replace(result, certificate=file.of_instance(instance_digest(model)))


def _cover(model: Model, method: Method[Any], stop: Stop, watch: Watch) -> None:
    """Computes the coverage that a method needs.

    Where the limit comes first, planners leave time for planning with what there is, and bounds
    for a bound.
    """
    watch.show("coverage")  # before the first views, code may be compiled
    progress = watch.countdown("coverage")
    if method.bounds:
        with suppress(LimitReached):  # the method meets the limit as well
            model.prepare_all(stop, progress)
    elif not method.lazy:
        model.covered_by(stop, progress)


@cache
def warm_up(method: str) -> None:
    """Lets a method load its libraries, some of which take seconds, before its time begins.

    A process does so once; otherwise the first user of a library would wait for all others.
    """
    with suppress(Exception):  # if something is wrong, the method itself tells
        SOLVERS[method](load_scene(_SMALL), TimeLimit(_WARMING))
