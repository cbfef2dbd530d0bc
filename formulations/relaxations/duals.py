"""The multipliers that solvers return, and the certificate made from them."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates import (
    ClassCurve,
    ClassPayments,
    EnvelopeCut,
    Multipliers,
    Row,
    StateCut,
)
from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.certificates.format import tables_of
from cocap_opt.formulations.certificates.resources import Resource
from cocap_opt.formulations.certificates.state_cuts import AnyCut, CutByStates
from cocap_opt.model import Model
from cocap_opt.problem import Problem

_K = TypeVar("_K")


@dataclass(frozen=True)
class Duals:
    """Multipliers of a relaxation; any non-negative numbers give a bound."""

    alpha: FloatArray  # [Z]
    beta: FloatArray  # [Z] m/px^0.5
    rows: tuple[tuple[Resource, float], ...] = ()  # conflict rows
    cuts: tuple[tuple[AnyCut, float], ...] = ()  # cuts and their shares theta
    decisions: FloatArray = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def alone(cls, problem: Problem) -> "Duals":
        """Returns the multipliers that price every view as if no other drone saw the face."""
        zeros = problem.no_pixels()
        return cls(zeros + 1.0, zeros)

    def blended(self, other: "Duals", weight: float) -> "Duals":
        """Returns weight * self + (1 - weight) * other.

        Rows and cuts that are missing in one of them count as 0 there.
        """

        def mix(a: Iterable[tuple[_K, float]], b: Iterable[tuple[_K, float]]) -> dict[_K, float]:
            mixed: dict[_K, float] = {}
            for part, share in ((a, weight), (b, 1 - weight)):
                for key, value in part:
                    mixed[key] = mixed.get(key, 0.0) + share * value
            return mixed

        both = (self, other)
        cuts = {id(cut): cut for duals in both for cut, _ in duals.cuts}
        shares = mix(*(((id(cut), share) for cut, share in duals.cuts) for duals in both))
        return Duals(
            alpha=weight * self.alpha + (1 - weight) * other.alpha,
            beta=weight * self.beta + (1 - weight) * other.beta,
            rows=tuple(mix(self.rows, other.rows).items()),
            cuts=tuple((cuts[key], share) for key, share in shares.items()),
            decisions=weight * self.decisions + (1 - weight) * other.decisions,
        )

    def certificate(self, model: Model) -> Multipliers:
        """Returns the multipliers in the form of a certificate."""
        alpha, _ = tables_of(model.problem, self.alpha)
        beta, _ = tables_of(model.problem, self.beta)
        # For counted people, alpha and beta have the same effect.
        _, views = tables_of(model.problem, self.alpha + self.beta)
        return Multipliers(
            alpha=alpha,
            beta=beta,
            rows=tuple(Row(resource, mu) for resource, mu in self.rows if mu > 0),
            cuts=tuple(
                _written(model, cut, share)
                for cut, share in self.cuts
                if share > 0 and isinstance(cut, Cut)
            ),
            state_cuts=tuple(
                _written_by_states(model, cut, share)
                for cut, share in self.cuts
                if share > 0 and isinstance(cut, CutByStates)
            ),
            decisions=tuple(self.decisions.tolist()),
            views=views,
        )


def _written(model: Model, cut: Cut, share: float) -> EnvelopeCut:
    """Returns a cut in the form of a certificate."""
    curves = tuple(
        ClassCurve(number, tuple(curve.roots.tolist()), tuple(curve.values.tolist()))
        for number, curve in sorted(cut.curves.items())
    )
    t, face = divmod(cut.view_sum, model.n_faces)
    return EnvelopeCut(t, face, curves, share)


def _written_by_states(model: Model, cut: CutByStates, share: float) -> StateCut:
    """Returns a state cut in the form of a certificate."""
    payments = tuple(
        ClassPayments(
            number,
            tuple(map(model.classes[number].graph.state, listed.states.tolist())),
            tuple(listed.values.tolist()),
        )
        for number, listed in sorted(cut.listed.items())
    )
    t, face = divmod(cut.view_sum, model.n_faces)
    return StateCut(t, face, payments, cut.slope, share)


def repaired_roots(
    problem: Problem,
    *,
    view_sums: IntArray,
    scale: FloatArray,
    weights: FloatArray,
    single_view: FloatArray,
    pixels: FloatArray,
    cut_at: IntArray,
    cuts: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Adjusts multipliers of view sums to the range in which they prove a small bound.

    A solver's multipliers may be negative, too large or NaN. Its program maximises sum weights u
    with u^2 <= z, where u is a root in units of `scale` and z the pixels in units of scale^2. The
    shares of cuts sum to at most the whole root; if they leave the share `rest` of a root r, the
    best beta is (rest - alpha) / (2 r), and no root is larger than if all robots had the best view
    at all steps. For counted people, u <= k replaces u^2 <= z, and there is only alpha.

    Parameters
    ----------
    view_sums : [z] numbers of the view sums in the program, r of them with roots
    scale : [z] unit of each root, px^0.5/m
    weights : [z] weight of each root or count in the program
    single_view : [z] multipliers of u <= sum of roots of pixels, or <= sum of counts
    pixels : [r] multipliers of z <= sum of pixels
    cut_at : [k] position of each cut's view sum among `view_sums`
    cuts : [k] multipliers of the cuts

    Returns
    -------
    alpha [Z] and beta [Z] in px and metres, and the shares of the cuts [k].
    """
    shares = np.clip(np.nan_to_num(cuts) / weights[cut_at], 0.0, 1.0)
    taken = np.bincount(cut_at, shares, minlength=len(weights))
    shares = shares / np.maximum(taken, 1.0)[cut_at]
    rest = np.maximum(1 - taken, 0.0)
    own_alpha = np.clip(np.nan_to_num(single_view / weights), 0.0, rest)
    returns = problem.returns.part(view_sums)
    # A cap that the team cannot exceed has no price.
    own_alpha[returns.n_roots :][returns.caps >= len(problem.robots)] = 1.0
    alpha, beta = problem.no_pixels() + 1.0, problem.no_pixels()
    alpha[view_sums] = own_alpha
    n = returns.n_roots
    rest, left, of_roots = rest[:n], (rest - own_alpha)[:n], view_sums[:n]
    largest = np.sqrt(problem.most_views_of_a_face) * scale[:n]
    own_beta = np.nan_to_num(pixels / (weights[:n] * scale[:n]))
    own_beta = np.maximum(own_beta, left / (2 * largest))
    nearly = left < 1e-9
    # Slightly more than the rest, so that rounding cannot make it smaller.
    alpha[of_roots[nearly]] = rest[nearly] + 1e-12
    beta[of_roots] = np.where(nearly, 0.0, own_beta)
    return alpha, beta, shares
