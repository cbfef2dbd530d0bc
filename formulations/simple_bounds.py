"""Bounds from single-robot sweeps alone.

Source of the online bound: Minoux 1978; Leskovec et al. 2007 (for a budget); here with one
best path per robot.
"""

import time
from dataclasses import replace

import numpy as np

from cocap_opt.formulations.certificates.certificate import ReferencePixels, certify
from cocap_opt.formulations.result import (
    CertifiedResult,
    Report,
    bounded,
    no_bound,
    silent,
    usable_start,
)
from cocap_opt.model import compiled
from cocap_opt.objective import no_pixels, robot_pixels
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Problem
from cocap_opt.stop import Limit, Stop, never


def alone(
    problem: Problem, stop: Stop = never, start: Plan | None = None, report: Report = silent
) -> CertifiedResult:
    """Sum over robots of what each could see if it were alone."""
    return _from_pixels(problem, stop, None, "alone")


def online(
    problem: Problem, stop: Stop = never, start: Plan | None = None, report: Report = silent
) -> CertifiedResult:
    """Online bound from a plan P: J(P) + sum over robots of max_path gain(path | P).

    Where the bound `alone` is lower, or without a plan, it is that. (The rewards for
    moves in J(P) are bounded by the paths' own, so they are not counted twice.)
    """
    plan, message = usable_start(problem, start)
    if plan is None:
        message = message or "no plan to start from"
        message += "; the bound is that of `alone`"
    plans = (None,) if plan is None else (None, plan)
    results = [_from_pixels(problem, stop, some, "online") for some in plans]
    best = min(results, key=lambda result: result.bound)
    seconds = sum(result.seconds for result in results)
    return replace(best, message=message, seconds=seconds)


def _from_pixels(problem: Problem, stop: Stop, start: Plan | None, method: str) -> CertifiedResult:
    begin = time.perf_counter()
    model = compiled(problem)
    limit = model.prepare_all(stop)
    if limit is not Limit.NONE:
        return no_bound(limit, time.perf_counter() - begin)
    pixels = no_pixels(problem)
    if start is not None:
        for robot, path in enumerate(model.paths(start)):
            pixels = pixels + robot_pixels(model, robot, path)
    table = np.reshape(pixels, (problem.view_sum_steps, -1)).tolist()
    certificate = ReferencePixels(tuple(tuple(row) for row in table))
    file = certify(problem, model, method, certificate)
    return bounded(file, Limit.NONE, begin)
