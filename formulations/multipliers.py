"""Turning a solver's multipliers into a certificate's."""

from collections.abc import Mapping

import numpy as np

from cocap_opt.problem import FloatArray, Problem
from formulations.certificate import Multipliers
from formulations.rows import Key, certificate_row


def repaired(
    alpha: FloatArray, beta: FloatArray, largest: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Bring multipliers into the range in which kappa is finite and small.

    For a root r the best beta is (1 - alpha) / (2 r), and no root is larger than `largest`.
    """
    alpha, beta = np.clip(alpha, 0.0, 1.0), np.maximum(beta, 0.0)
    beta = np.maximum(beta, (1 - alpha) / (2 * largest))
    nearly_one = 1 - alpha < 1e-9
    return np.where(nearly_one, 1.0, alpha), np.where(nearly_one, 0.0, beta)


def certificate_of(
    problem: Problem, alpha: FloatArray, beta: FloatArray, rows: Mapping[Key, float]
) -> Multipliers:
    """Certificate of multipliers of groups [G] and of conflict rows."""
    shape = (problem.horizon + 1, len(problem.face_weights))
    return Multipliers(
        alpha=tuple(map(tuple, alpha.reshape(shape).tolist())),
        beta=tuple(map(tuple, beta.reshape(shape).tolist())),
        rows=tuple(certificate_row(key, mu) for key, mu in rows.items() if mu > 0),
    )
