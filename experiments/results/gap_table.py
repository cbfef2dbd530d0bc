"""The gap table, cell by cell: a scene and a seed, a plan per planner, and what bounds them."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import msgspec

from cocap_opt.experiments.console.progress import Watch
from cocap_opt.experiments.results.files import plan_file, save
from cocap_opt.experiments.results.layout import stem_of
from cocap_opt.experiments.results.rows import (
    BOUND_METHOD,
    Bounded,
    Judged,
    Row,
    bound_part,
    gap_row,
    hold_against,
    judge,
    planner_part,
    run_certified,
    run_planner,
    without_rules,
)
from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult, Report
from cocap_opt.model import compiled
from cocap_opt.problem.problem import Problem
from cocap_opt.result import Reason, Result, relative_gap
from cocap_opt.stop import Limit, Stop
from cocap_opt.vision.render import Renderer

Limits = Callable[[], Stop]  # makes a limit that begins to count at once
Reports = Callable[[str], Report]  # makes what a search for a bound reports to, by its name
WITHOUT_RULES, WITH_RULES = "without rules", "with rules"  # names of the two searches


def cover(problem: Problem, stop: Stop, watch: Watch) -> None:
    """Compute coverage before any limit of a planner or a bound begins to count.

    Results then do not depend on what coverage has been computed before.
    """
    watch.coverage_of(problem)
    compiled(problem).prepare_all(stop)


def plans_of(
    problem: Problem,
    seed: int,
    planners: Sequence[str],
    limits: Limits,
    folder: Path | None,
    watch: Watch,
) -> dict[str, Judged[Result]]:
    """A judged plan by planner; `cover` comes before, so that no planner's seconds hold it."""
    plans = {}
    for name in planners:
        watch.show(name)
        plans[name] = judged = run_planner(problem, name, limits())
        content = plan_file(problem, name, judged)
        if folder is not None and content is not None:
            save(folder / f"plans/{stem_of(problem.name, seed)}-{name}.json", content)
    return plans


def rows_of(
    problem: Problem,
    seed: int,
    plans: Mapping[str, Judged[Result]],
    limits: Limits,
    folder: Path | None,
    watch: Watch,
) -> list[Row]:
    """Rows of plans, by whomever they are, against what bounds them all."""
    under, free = bounds_of(
        problem, list(plans.values()), limits, watch, lambda run: watch.report(f"{run}:")
    )
    stem = stem_of(problem.name, seed)
    bounded = Bounded(under, _save_certificate(folder, stem, under.result))
    if free is under:
        bounded_free = bounded
    else:
        bounded_free = Bounded(free, _save_certificate(folder, f"{stem}-free", free.result))
    bound = bound_part(bounded, bounded_free)
    return [
        gap_row(planner_part(problem, seed, name, judged), bound) for name, judged in plans.items()
    ]


def rendered_j(problem: Problem, judged: Judged[Result]) -> float | None:
    """J of a plan's rendered pixels; None where there is no plan."""
    from cocap_opt.experiments.results.rendered import (  # matplotlib is slow
        face_views,
        poses_of,
        rendered_reward,
    )

    if judged.result.plan is None or judged.verdict is None:
        return None
    poses = poses_of(judged.result.plan, problem.first_step)
    views = face_views(compiled(problem), Renderer(problem), poses)
    return rendered_reward(problem, views, judged.verdict.reward_moves)


def _save_certificate(folder: Path | None, stem: str, result: CertifiedResult) -> str:
    """Path of the file in the folder; empty where there is none."""
    certificate = result.certificate
    if folder is None or certificate is None:
        return ""
    path = f"certificates/{stem}.json"
    save(folder / path, certificate)
    return path


def bounds_of(
    problem: Problem,
    plans: Sequence[Judged[Result]],
    limits: Limits,
    watch: Watch,
    reports: Reports,
) -> tuple[Judged[CertifiedResult], Judged[CertifiedResult]]:
    """Best plan and best certified bound under the scene's rules, and without any rules.

    What bounds all plans bounds those that obey the rules, and the best plan of all may obey
    them; so the problem without rules comes first, and sometimes settles both.
    """
    problem_free = without_rules(problem)
    watch.coverage_of(problem_free)
    start = _best(plans).result.plan
    free = run_certified(problem_free, BOUND_METHOD, limits(), start, reports(WITHOUT_RULES))
    if problem_free is problem:
        return free, free
    known = [judged.result for judged in plans if isinstance(judged.result, CertifiedResult)]
    known.append(_under_rules(problem, free.result))
    bound = min((b for b in known if b.certificate), key=_bound, default=known[-1])
    best = _best([j for j in (*plans, judge(BOUND_METHOD, problem, free.result)) if j.valid])
    if relative_gap(best.reward, bound.bound) > OPTIMALITY and bound.bound >= 0:
        start = best.result.plan
        found = run_certified(problem, BOUND_METHOD, limits(), start, reports(WITH_RULES))
        best = _best([best, found])
        tightest = min(found.result, bound, key=_bound)
        bound = replace(found.result, bound=tightest.bound, certificate=tightest.certificate)
    under = _joined(best, bound)
    if best.reward > free.reward:  # what obeys the rules may fly where there are none
        free = _joined(best, free.result)
    return under, free


def _bound(result: Result) -> float:
    return result.bound


def _best(plans: Sequence[Judged[Result]]) -> Judged[Result]:
    none = Judged(Result(None, -math.inf, Reason.FAILED), None)
    return max(plans, key=lambda judged: judged.reward, default=none)


def _under_rules(problem: Problem, free: CertifiedResult) -> CertifiedResult:
    """A bound on all plans, as one on those that obey a problem's rules."""
    if free.certificate is None:
        return free
    digest = problem_digest(problem)
    return replace(free, certificate=msgspec.structs.replace(free.certificate, digest=digest))


def _joined(best: Judged[Result], bound: CertifiedResult) -> Judged[CertifiedResult]:
    """A plan and a bound that may come from different runs, and what they prove together."""
    hold_against(BOUND_METHOD, best.reward, bound.bound)
    reason, limit = bound.reason, bound.limit
    if relative_gap(best.reward, bound.bound) <= OPTIMALITY:
        reason, limit = Reason.OPTIMAL, Limit.NONE
    elif bound.bound < 0:  # J >= 0
        reason, limit = Reason.INFEASIBLE, Limit.NONE
    plan, value = best.result.plan, best.result.value
    result = replace(bound, plan=plan, value=value, reason=reason, limit=limit)
    return Judged(result, best.verdict)


def told_apart(problems: dict[tuple[str, int], Problem]) -> dict[tuple[str, int], Problem]:
    """Problems by (scene as typed, seed), no two scenes of one name.

    A scene that has another's name, or a name that another was typed as, is called as it was
    typed. The name is no part of a problem's digest, so certificates and plans still fit.
    """
    claimed: dict[str, set[str]] = {}
    for (scene, _), problem in problems.items():
        claimed.setdefault(problem.name, set()).add(scene)
        claimed.setdefault(scene, set()).add(scene)
    return {
        (scene, seed): problem.replace(name=scene) if len(claimed[problem.name]) > 1 else problem
        for (scene, seed), problem in problems.items()
    }
