"""Envelope cuts as they stand in files, checked and completed by the constants that prove them."""

from functools import lru_cache
from itertools import pairwise

import numpy as np

from cocap_opt.formulations.certificates.envelope import Curve, Cut
from cocap_opt.formulations.certificates.format import CertificateError, ClassCurve, EnvelopeCut
from cocap_opt.model import Model

MOST_WORK = 256  # breakpoints of all classes, each counted once per robot of its class
LARGEST_ROOT = 1e50  # of a curve, far beyond any camera's, and its square is finite


def usable_cuts(model: Model, cuts: tuple[EnvelopeCut, ...]) -> list[tuple[Cut, float]]:
    """Returns cuts with the constants that make them valid, and their shares.

    Raises
    ------
    CertificateError
        If a cut belongs to no view sum, is no function, or its constant takes too long.
    """
    if cuts and model.problem.objective.over_time:
        raise CertificateError("certificate.cuts: none hold where pixels add up over time")
    found = []
    for n, cut in enumerate(cuts):
        _check_cut(model, cut, f"certificate.cuts[{n}]")
        view_sum = cut.t * model.n_faces + cut.face
        found.append((_valid(view_sum, cut.curves, model.class_sizes), cut.share))
    return found


def _check_cut(model: Model, cut: EnvelopeCut, field: str) -> None:
    """Refuses a cut that belongs to no view sum or class, or that takes too long."""
    sizes = model.class_sizes
    if not (0 <= cut.t <= model.problem.horizon and 0 <= cut.face < model.n_faces):
        raise CertificateError(f"{field}: there is no view sum ({cut.t}, {cut.face})")
    if not 0 <= cut.share <= 1:
        raise CertificateError(f"{field}.share: must be 0..1, not {cut.share}")
    numbers = (-1, *(curve.class_number for curve in cut.curves), len(sizes))
    if not all(a < b for a, b in pairwise(numbers)):
        raise CertificateError(
            f"{field}.curves: robot_class must be increasing, 0..{len(sizes) - 1}"
        )
    for k, curve in enumerate(cut.curves):
        _check_curve(curve, f"{field}.curves[{k}]")
    if sum(sizes[curve.class_number] * len(curve.roots) for curve in cut.curves) > MOST_WORK:
        raise CertificateError(f"{field}.curves: too many roots for so many robots")


@lru_cache(maxsize=4096)  # the leaves of a proof share most of their cuts
def _valid(view_sum: int, curves: tuple[ClassCurve, ...], sizes: tuple[int, ...]) -> Cut:
    """Returns a cut with the constant that makes it valid."""
    functions = {
        curve.class_number: Curve(np.array(curve.roots), np.array(curve.values)) for curve in curves
    }
    return Cut.valid(view_sum, functions, sizes)


def _check_curve(curve: ClassCurve, field: str) -> None:
    """Refuses a curve that is no function."""
    points = (0.0, *curve.roots)
    if len(points) < 2 or not all(a < b <= LARGEST_ROOT for a, b in pairwise(points)):
        raise CertificateError(f"{field}.roots: must be > 0, <= {LARGEST_ROOT:g} and increasing")
    if len(curve.values) != len(curve.roots) or not all(
        0 <= value <= LARGEST_ROOT for value in curve.values
    ):
        raise CertificateError(f"{field}.values: must hold a number 0..{LARGEST_ROOT:g} per root")
