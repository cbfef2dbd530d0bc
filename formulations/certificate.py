"""Certificates: a few numbers from which anyone can recompute an upper bound on J.

Multipliers. For alpha, beta >= 0 and any non-negative c_1..c_N,

    sqrt(sum c_i) <= alpha sum sqrt(c_i) + beta sum c_i + kappa,
    kappa = (1 - alpha)^2 / (4 beta) if alpha < 1, else 0

since sum sqrt(c_i) >= r := sqrt(sum c_i) and alpha r + beta r^2 + kappa >= r for all r. With
one (alpha, beta) per group (t, face) and a multiplier mu >= 0 per conflict row,

    J <= sum w kappa + sum mu + sum_i max_path [ sum_t sum_f w (alpha sqrt(c) + beta c)
                                                 + stationarity - mu on rows used ].

Reference pixels z. By concavity of the root,

    sqrt(sum c_i) <= sqrt(z) + sum_i (sqrt(z + c_i) - sqrt(z)).

Any non-negative numbers give a valid bound, whatever solver they came from. Pricing needs
one plain sweep over the time-expanded graph and no solver.
"""

import math
from collections.abc import Callable
from typing import Literal, NamedTuple

import msgspec
import numpy as np

from cocap_opt.constraints import place_of
from cocap_opt.io import problem_digest
from cocap_opt.model import Model, RobotClass
from cocap_opt.problem import Cell, FloatArray, IntArray, Problem
from cocap_opt.reward import group_weights, marginal_gain

UNIT_ROUNDOFF = 2.0**-53


class CellsRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="cells"):
    """At most one robot is in these cells at step t; any two of them conflict."""

    t: int
    cells: tuple[Cell, ...]
    multiplier: float


class SwapRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="swap"):
    """At most one robot moves between these two cells, either way, from t to t+1."""

    t: int
    cells: tuple[Cell, Cell]
    multiplier: float


Row = CellsRow | SwapRow


class Multipliers(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="multipliers"):
    """Multipliers of the groups and of the conflict rows."""

    alpha: tuple[tuple[float, ...], ...]  # [T+1][F]
    beta: tuple[tuple[float, ...], ...]  # [T+1][F] m/px^0.5
    rows: tuple[Row, ...] = ()


class ReferencePixels(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="reference"):
    """Pixels at which the marginal gains are taken; a plan's pixels give the online bound."""

    pixels: tuple[tuple[float, ...], ...]  # [T+1][F] px/m2


Certificate = Multipliers | ReferencePixels


class CertificateFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A certificate with the bound it claims and the digest of its scene."""

    format: Literal["cocap-opt certificate"] = "cocap-opt certificate"
    version: Literal[1] = 1
    scene: str
    digest: str  # of the problem
    method: str
    bound: float | None  # None: -infinity, there is no plan
    certificate: Certificate

    @property
    def proved(self) -> float:
        """The claimed bound as a number."""
        return -math.inf if self.bound is None else self.bound


class CertificateError(ValueError):
    """A certificate does not fit its problem or is not valid; the message names the field."""


class Pricing(NamedTuple):
    """What a certificate is worth."""

    bound: float  # rigorous upper bound on J, rounding included
    rounding: float  # the part of it that covers rounding errors


def certify(problem: Problem, model: Model, method: str, certificate: Certificate) -> (
    CertificateFile
):  # fmt: skip
    """Price a certificate and write the bound it gives beside it."""
    bound = price(model, certificate).bound
    return CertificateFile(
        scene=problem.name,
        digest=problem_digest(problem),
        method=method,
        bound=None if bound == -math.inf else bound,
        certificate=certificate,
    )


def verify(problem: Problem, file: CertificateFile) -> Pricing:
    """Recompute a certificate's bound from the problem alone, with fresh coverage.

    Raises
    ------
    CertificateError
        If it belongs to another scene, is not valid, or claims less than it proves.
    """
    if file.digest != problem_digest(problem):
        raise CertificateError("digest: the certificate belongs to another scene")
    pricing = price(Model(problem, use_cache=False), file.certificate)
    if not pricing.bound <= file.proved:
        raise CertificateError(
            f"bound: claims {file.proved!r}, but the multipliers prove only {pricing.bound!r}"
        )
    return pricing


def price(model: Model, certificate: Certificate) -> Pricing:
    """Upper bound on J that a certificate proves.

    Raises
    ------
    CertificateError
        If a number is negative or not finite, an array has the wrong shape, or a row is not
        one that every plan obeys.
    """
    problem = model.problem
    rows: tuple[Row, ...] = ()
    if isinstance(certificate, Multipliers):
        rows = certificate.rows
        constant, pay = _price_multipliers(model, certificate)
    else:
        constant, pay = _price_reference(model, certificate)
    _check_rows(problem, rows)
    charge = sum(row.multiplier for row in rows)
    if not math.isfinite(charge):
        raise CertificateError("certificate.rows: multipliers too large, the bound is infinite")
    total, magnitude = constant + charge, abs(constant) + charge
    for group in model.classes:
        reward = _node_rewards(model, group, pay)
        value = _plain_sweep(model, group, reward, rows)
        best = [float(value[start]) for start in group.starts]
        if -math.inf in best:  # a robot without any path: there is no plan
            return Pricing(-math.inf, 0.0)
        total += math.fsum(best)
        magnitude += len(best) * _largest_path(model, reward, rows)
    # Every number above is a sum of at most `terms` terms, each the result of a few
    # operations: the error is below gamma_n times the sum of absolute values (Higham,
    # Accuracy and Stability of Numerical Algorithms, 2002, section 3.1), doubled for safety.
    # Marginal gains at reference pixels z are differences of roots up to sqrt(z + c); the
    # constant holds w sqrt(z), so that what cancels is counted too.
    terms = (problem.horizon + 1) * (model.n_faces + 2) + len(rows) + 8 * len(problem.robots) + 64
    rounding = 2 * terms * UNIT_ROUNDOFF / (1 - terms * UNIT_ROUNDOFF) * magnitude
    return Pricing(math.nextafter(total + rounding, math.inf), rounding)


# What a certificate pays for pixels (px/m2) [n] in groups [n], before the weights.
Payment = Callable[[IntArray, FloatArray], FloatArray]


def _array(model: Model, values: tuple[tuple[float, ...], ...], field: str) -> FloatArray:
    shape = (model.problem.horizon + 1, model.n_faces)
    if len(values) != shape[0] or any(len(row) != shape[1] for row in values):
        raise CertificateError(f"{field}: must hold {shape[0]} rows of {shape[1]} numbers")
    array = np.array(values, dtype=np.float64).reshape(-1)
    if not np.isfinite(array).all() or (array < 0).any():
        raise CertificateError(f"{field}: must be finite and >= 0")
    return array


def _visible_groups(model: Model) -> FloatArray:
    """1.0 for groups that some robot can see and that count [G]; others add nothing to J."""
    visible = np.zeros((model.problem.horizon + 1) * model.n_faces)
    for group in model.classes:
        visible[model.coverage(group).groups] = 1.0
    return np.where(group_weights(model.problem) > 0, visible, 0.0)


def _price_multipliers(model: Model, certificate: Multipliers) -> tuple[float, Payment]:
    alpha = _array(model, certificate.alpha, "certificate.alpha")
    beta = _array(model, certificate.beta, "certificate.beta")
    weights = group_weights(model.problem)
    needed = np.flatnonzero((_visible_groups(model) > 0) & (alpha < 1))
    if (beta[needed] == 0).any():
        raise CertificateError("certificate.beta: must be > 0 where alpha < 1")
    kappa = (1 - alpha[needed]) ** 2 / (4 * beta[needed])
    constant = math.fsum((weights[needed] * kappa).tolist())
    if not math.isfinite(constant):
        raise CertificateError("certificate.beta: too small, the bound is infinite")

    def pay(groups: IntArray, pixels: FloatArray) -> FloatArray:
        return alpha[groups] * np.sqrt(pixels) + beta[groups] * pixels

    return constant, pay


def _price_reference(model: Model, certificate: ReferencePixels) -> tuple[float, Payment]:
    pixels = _array(model, certificate.pixels, "certificate.pixels")
    roots = group_weights(model.problem) * np.sqrt(pixels)
    return math.fsum(roots.tolist()), lambda groups, seen: marginal_gain(pixels[groups], seen)


def _node_rewards(model: Model, group: RobotClass, pay: Payment) -> FloatArray:
    """What the certificate pays for being in a state [T+1, S]."""
    table = model.coverage(group)
    paid = pay(table.groups, table.pixels) * group_weights(model.problem)[table.groups]
    if not np.isfinite(paid).all():
        raise CertificateError("certificate: too large, the bound is infinite")
    rewards = np.zeros((model.problem.horizon + 1, group.graph.n_states))
    rewards.reshape(-1)[table.nodes] = table.row_sums(paid)
    return rewards


def _plain_sweep(
    model: Model, group: RobotClass, reward: FloatArray, rows: tuple[Row, ...]
) -> FloatArray:
    """Best path value from every state at step 0 [S], move by move and turn by turn."""
    graph, problem = group.graph, model.problem
    shape = (graph.n_orientations, graph.n_places)
    bonus = problem.objective.stationarity
    cell_charges, swap_charges = _charges(model, group, rows)
    value = np.where(graph.free, reward[-1].reshape(shape), -np.inf)
    if group.goal is not None:
        _, x, y = graph.coordinates(np.arange(graph.n_places))
        value = np.where((x == group.goal[0]) & (y == group.goal[1]), value, -np.inf)
    value = value - cell_charges.get(problem.horizon, 0.0)
    for t in range(problem.horizon - 1, -1, -1):
        turned = np.stack([value[turns].max(axis=0) for turns in graph.turns])
        best = np.full(shape, -np.inf)
        for k, heads in enumerate(graph.neighbours):
            tails = np.flatnonzero(heads >= 0)
            ahead = (
                turned[:, heads[tails]]
                - swap_charges.get((t, k), np.zeros(1))[tails if (t, k) in swap_charges else 0]
            )
            best[:, tails] = np.maximum(best[:, tails], ahead)
        if bonus:
            best = np.maximum(best, value + bonus)
        value = best + reward[t].reshape(shape) - cell_charges.get(t, 0.0)
    return value.reshape(-1)


def _charges(
    model: Model, group: RobotClass, rows: tuple[Row, ...]
) -> tuple[dict[int, FloatArray], dict[tuple[int, int], FloatArray]]:
    """Sum of multipliers on places per step [P], and on moves k from places per step [P]."""
    graph = group.graph
    at: dict[int, FloatArray] = {}
    leaving: dict[tuple[int, int], FloatArray] = {}
    for row in rows:
        places = [place_of(model, group, cell) for cell in row.cells]
        if isinstance(row, CellsRow):
            charges = at.setdefault(row.t, np.zeros(graph.n_places))
            for place in places:
                if place is not None:
                    charges[place] += row.multiplier
        elif places[0] is not None and places[1] is not None:
            for tail, head in (places, places[::-1]):
                for k in np.flatnonzero(graph.neighbours[:, tail] == head).tolist():
                    costs = leaving.setdefault((row.t, k), np.zeros(graph.n_places))
                    costs[tail] += row.multiplier
    return at, leaving


def _check_rows(problem: Problem, rows: tuple[Row, ...]) -> None:
    """Refuse rows that some allowed plan may break."""
    width, depth = problem.height_map.shape
    for n, row in enumerate(rows):
        field = f"certificate.rows[{n}]"
        last = problem.horizon if isinstance(row, CellsRow) else problem.horizon - 1
        if not 0 <= row.t <= last:
            raise CertificateError(f"{field}.t: must be 0..{last}, not {row.t}")
        if not (math.isfinite(row.multiplier) and row.multiplier >= 0):
            raise CertificateError(f"{field}.multiplier: must be finite and >= 0")
        for x, y, layer in row.cells:
            if not (0 <= x < width and 0 <= y < depth and 0 <= layer < len(problem.layers)):
                raise CertificateError(f"{field}.cells: ({x}, {y}, {layer}) is outside the map")
        if len(set(row.cells)) != len(row.cells):
            raise CertificateError(f"{field}.cells: must differ")
        if isinstance(row, SwapRow):
            if not problem.rules.swap:
                raise CertificateError(f"{field}: the scene has no swap rule")
        elif not all(problem.too_close(a, b) for a in row.cells for b in row.cells):
            raise CertificateError(f"{field}.cells: two robots may be in these cells at once")


def _largest_path(model: Model, reward: FloatArray, rows: tuple[Row, ...]) -> float:
    """Bound on the sum of absolute values along any path."""
    paid = math.fsum(reward.max(axis=1).tolist())
    bonus = model.problem.objective.stationarity * model.problem.horizon
    return paid + bonus + math.fsum(row.multiplier for row in rows)
