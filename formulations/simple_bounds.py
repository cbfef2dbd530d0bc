"""Bounds from single-robot sweeps alone.

Source of the online bound: Minoux 1978; Leskovec et al. 2007 (for a budget); here with one
best path per robot.
"""

from dataclasses import replace

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.certificates import CertificateFile, ReferencePixels, certify
from cocap_opt.formulations.early_bound import early_bound
from cocap_opt.formulations.result import (
    CertifiedResult,
    Report,
    checked_start,
    silent,
)
from cocap_opt.model import Model, compiled
from cocap_opt.problem import Plan, Problem
from cocap_opt.stop import LimitReached, Stop, never
from cocap_opt.timing import timed

__all__ = ["alone", "online"]


@timed
def alone(
    problem: Problem, stop: Stop = never, start: Plan | None = None, report: Report = silent
) -> CertifiedResult:
    """Computes the sum over drones of the most that each could see if it were alone."""
    model = compiled(problem)
    try:
        model.prepare_all(stop)
    except LimitReached as reached:
        return early_bound(problem, reached.limit)
    return CertifiedResult.bounded(_at_pixels(model, problem.no_pixels(), "alone"), {})


@timed
def online(
    problem: Problem, stop: Stop = never, start: Plan | None = None, report: Report = silent
) -> CertifiedResult:
    """Computes the online bound of a plan P: J(P) + sum over drones of max_path gain(path | P).

    Where the bound `alone` is lower, or without a plan, it is that. (The rewards for
    moves in J(P) are bounded by the paths' own, so they are not counted twice.)
    """
    plan, message = checked_start(problem, start)
    if plan is None:
        message = f"{message or 'no plan to start from'}; the bound is that of `alone`"
    model = compiled(problem)
    try:
        model.prepare_all(stop)
    except LimitReached as reached:
        early = early_bound(problem, reached.limit)
        words = "; ".join(filter(None, (message, early.message)))
        return replace(early, message=words)
    references = [problem.no_pixels()]
    if plan is not None:
        references.append(_pixels_of(model, plan))
    files = [_at_pixels(model, pixels, "online") for pixels in references]
    best = min(files, key=lambda file: file.proved)
    return replace(CertifiedResult.bounded(best, {}), message=message)


def _pixels_of(model: Model, plan: Plan) -> FloatArray:
    """Returns the pixels that all robots of a plan have of each view sum [Z]."""
    pixels = model.problem.no_pixels()
    for robot, path in enumerate(model.paths(plan)):
        pixels = pixels + model.robot_pixels(robot, path)
    return pixels


def _at_pixels(model: Model, pixels: FloatArray, method: str) -> CertificateFile:
    """Returns the certificate of the marginal gains at reference pixels [Z]."""
    table = np.reshape(pixels, (model.problem.view_sum_steps, -1)).tolist()
    certificate = ReferencePixels(tuple(tuple(row) for row in table))
    return certify(model.problem, model, method, certificate)
