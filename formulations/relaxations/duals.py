"""Multipliers as solvers give them, and the certificate that they make."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.certificates.certificate import Curve, EnvelopeCut, Multipliers, Row
from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.certificates.resources import Resource
from cocap_opt.model import Model
from cocap_opt.objective import no_pixels
from cocap_opt.problem.problem import Problem

_K = TypeVar("_K")


def alone_duals(problem: Problem) -> "Duals":
    """Multipliers that count every view as if nobody else saw the face."""
    zeros = no_pixels(problem)
    return Duals(zeros + 1.0, zeros)


@dataclass(frozen=True)
class Duals:
    """Multipliers of the master; any non-negative ones give a bound."""

    alpha: FloatArray  # [Z]
    beta: FloatArray  # [Z] m/px^0.5
    rows: tuple[tuple[Resource, float], ...] = ()  # conflict rows
    cuts: tuple[tuple[Cut, float], ...] = ()  # envelope cuts and their shares theta
    decisions: FloatArray = field(default_factory=lambda: np.zeros(0))

    def certificate(self, model: Model) -> Multipliers:
        """The multipliers as they stand in a certificate."""
        steps = model.problem.view_sum_steps
        kept = [(cut, share) for cut, share in self.cuts if share > 0]
        return Multipliers(
            alpha=tuple(map(tuple, self.alpha.reshape(steps, -1).tolist())),
            beta=tuple(map(tuple, self.beta.reshape(steps, -1).tolist())),
            rows=tuple(Row(resource, mu) for resource, mu in self.rows if mu > 0),
            cuts=tuple(
                EnvelopeCut(
                    *divmod(cut.view_sum, model.n_faces),
                    tuple(
                        Curve(number, tuple(curve.roots.tolist()), tuple(curve.values.tolist()))
                        for number, curve in sorted(cut.curves.items())
                    ),
                    share,
                )
                for cut, share in kept
            ),
            decisions=tuple(self.decisions.tolist()),
        )


def blended(first: Duals, second: Duals, weight: float) -> Duals:
    """weight * first + (1 - weight) * second; rows and cuts that one lacks count as 0 there."""

    def mix(a: Iterable[tuple[_K, float]], b: Iterable[tuple[_K, float]]) -> dict[_K, float]:
        mixed: dict[_K, float] = {}
        for part, share in ((a, weight), (b, 1 - weight)):
            for key, value in part:
                mixed[key] = mixed.get(key, 0.0) + share * value
        return mixed

    cuts = {id(cut): cut for duals in (first, second) for cut, _ in duals.cuts}
    shares = mix(*(((id(cut), share) for cut, share in duals.cuts) for duals in (first, second)))
    return Duals(
        alpha=weight * first.alpha + (1 - weight) * second.alpha,
        beta=weight * first.beta + (1 - weight) * second.beta,
        rows=tuple(mix(first.rows, second.rows).items()),
        cuts=tuple((cuts[key], share) for key, share in shares.items()),
        decisions=weight * first.decisions + (1 - weight) * second.decisions,
    )


def repaired(
    alpha: FloatArray, beta: FloatArray, rest: FloatArray, largest: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Bring multipliers into the range in which kappa is finite and small.

    For a root r the best beta is (rest - alpha) / (2 r), and no root is larger than `largest`.

    Parameters
    ----------
    rest : share of the root that envelope cuts leave
    """
    alpha = np.clip(np.nan_to_num(alpha), 0.0, rest)
    beta = np.maximum(np.nan_to_num(beta), (rest - alpha) / (2 * largest))
    nearly = rest - alpha < 1e-9
    # A little more than the rest, so that no rounding makes it less.
    return np.where(nearly, rest + 1e-12, alpha), np.where(nearly, 0.0, beta)
