"""Certificates: a few numbers from which anyone can recompute an upper bound on J.

Multipliers. For alpha, beta >= 0 and any non-negative c_1..c_N,

    sqrt(sum c_i) <= alpha sum sqrt(c_i) + beta sum c_i + kappa,
    kappa = (1 - alpha)^2 / (4 beta) if alpha < 1, else 0

since sum sqrt(c_i) >= r := sqrt(sum c_i) and alpha r + beta r^2 + kappa >= r for all r. With
one (alpha, beta) per view sum (t, face) and a multiplier mu >= 0 per conflict row,

    J <= sum w kappa + sum mu + sum_i max_path [ sum_t sum_f w (alpha sqrt(c) + beta c)
                                                 + rewards for moves - mu on rows used ].

A share theta of a view sum's root may be bounded by an envelope cut instead (formulations.
envelope): r <= constant + sum phi_k(i)(sqrt(c_i)), with one phi_k per class k of robots. Then
only rho = 1 - sum theta is left for alpha and beta, and kappa = max(0, rho - alpha)^2 /
(4 beta).

Decisions "at most k" or "at least k robots use this" of a branch-and-price tree are rows as
well; multipliers nu >= 0 make them +nu k or -nu k, and a charge or a reward on the use.
"At most none" closes the resource.

Reference pixels z. By concavity of the root,

    sqrt(sum c_i) <= sqrt(z) + sum_i (sqrt(z + c_i) - sqrt(z)).

Any non-negative numbers give a valid bound, whatever solver they came from. Pricing needs
one plain sweep over the time-expanded graph and no solver.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Literal, NamedTuple

import msgspec
import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.certificates import envelope
from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.certificates.resources import Resource, charges_of, misruled, misuse
from cocap_opt.graph.timegraph import NO_CHARGES, Charges, TimeGraph
from cocap_opt.model import Model, RobotClass
from cocap_opt.objective import marginal_gain, view_sum_weights
from cocap_opt.problem.problem import Objective, Problem

UNIT_ROUNDOFF = 2.0**-53
LARGEST_ROOT = 1e50  # of a curve, far beyond any camera's, and its square is finite


class _Part(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of what certificates are made of."""


class Row(_Part, frozen=True):
    """At most one robot uses this resource, by the scene's collision rules."""

    resource: Resource
    multiplier: float


class Decision(_Part, frozen=True):
    """So many robots at most, or at least, use this resource: a branch of a proof's tree."""

    resource: Resource
    sense: Literal["at most", "at least"]
    robots: int

    @property
    def closes(self) -> bool:
        """Whether nobody may use the resource."""
        return self.sense == "at most" and self.robots <= 0

    @property
    def sign(self) -> int:
        """1 where the resource is to be used less, -1 where more."""
        return 1 if self.sense == "at most" else -1


class Curve(_Part, frozen=True):
    """Function phi of one class of robots: linear between breakpoints, then of slope 1."""

    class_number: int = msgspec.field(name="robot_class")
    roots: tuple[float, ...]  # [K] breakpoints > 0, increasing, px^0.5/m
    values: tuple[float, ...]  # [K] phi at them, >= 0


class EnvelopeCut(_Part, frozen=True):
    """Functions phi that bound the root of view sum (t, face); the constant is recomputed."""

    t: int
    face: int
    curves: tuple[Curve, ...]  # of classes in increasing order; the others have phi(s) = s
    share: float  # theta


class Multipliers(_Part, frozen=True, tag="multipliers", omit_defaults=True):
    """Multipliers of the view sums, of the conflict rows and of decisions."""

    alpha: tuple[tuple[float, ...], ...]  # [T+1][F]; [1][F] over time
    beta: tuple[tuple[float, ...], ...]  # likewise, m/px^0.5
    rows: tuple[Row, ...] = ()
    cuts: tuple[EnvelopeCut, ...] = ()
    decisions: tuple[float, ...] = ()  # one per decision that is given, in their order


class ReferencePixels(_Part, frozen=True, tag="reference"):
    """Pixels at which the marginal gains are taken; a plan's pixels give the online bound."""

    pixels: tuple[tuple[float, ...], ...]  # [T+1][F] or [1][F], px/m2


Certificate = Multipliers | ReferencePixels

# What numbers of classes in a file count: robots that differ only in their start are one
# class, or every robot is a class of its own.
Classes = Literal["alike", "single"]


class Claim(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What files that prove a bound say of it, and of the scene that it belongs to."""

    scene: str
    digest: str  # of the problem
    method: str
    classes: Classes = "alike"
    bound: float | None  # None: -infinity, there is no plan

    @property
    def proved(self) -> float:
        """The claimed bound as a number."""
        return -math.inf if self.bound is None else self.bound


class CertificateFile(Claim, frozen=True, kw_only=True):
    """A certificate with the bound it claims and the digest of its scene."""

    format: Literal["cocap-opt certificate"] = "cocap-opt certificate"
    version: Literal[3] = 3
    certificate: Certificate


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
        classes="single" if model.is_apart else "alike",
        bound=None if bound == -math.inf else bound,
        certificate=certificate,
    )


def model_of(problem: Problem, classes: Classes) -> Model:
    """A problem compiled anew for checking, its coverage computed and not taken from a cache."""
    model = Model(problem, use_cache=False)
    return model.apart() if classes == "single" else model


def verify(problem: Problem, file: CertificateFile) -> Pricing:
    """Recompute a certificate's bound from the problem alone, with fresh coverage.

    Raises
    ------
    CertificateError
        If it belongs to another scene, is not valid, or claims less than it proves.
    """
    if file.digest != problem_digest(problem):
        raise CertificateError("digest: the certificate belongs to another scene")
    pricing = price(model_of(problem, file.classes), file.certificate)
    if not pricing.bound <= file.proved:
        raise CertificateError(
            f"bound: claims {file.proved!r}, but the multipliers prove only {pricing.bound!r}"
        )
    return pricing


def price(model: Model, certificate: Certificate, decisions: Sequence[Decision] = ()) -> Pricing:
    """Upper bound on J that a certificate proves.

    Parameters
    ----------
    decisions : the bound is for plans that obey these as well

    Raises
    ------
    CertificateError
        If a number is negative or not finite, an array has the wrong shape, or a row is not
        one that every plan obeys.
    """
    problem = model.problem
    if isinstance(certificate, Multipliers):
        offer = _offer_of_multipliers(model, certificate)
        charged = _charged(model, certificate, decisions)
    else:
        offer, charged = _offer_of_reference(model, certificate), _Charged(0.0, 0.0, [])
    total = offer.constant + charged.constant
    magnitude = offer.magnitude + charged.magnitude
    if not math.isfinite(magnitude):
        raise CertificateError("certificate: multipliers too large, the bound is infinite")
    for number, robot_class in enumerate(model.classes):
        reward = _node_rewards(model, number, offer)
        value = _plain_sweep(model, robot_class, reward, charges_of(model, number, charged.costs))
        best = [float(value[start]) for start in robot_class.starts]
        if -math.inf in best:  # a robot without any path: there is no plan
            return Pricing(-math.inf, 0.0)
        total += sum(best)
        # The same with all numbers counted as positive: what a path's sum is made of.
        sizes = [(r, -abs(c) if math.isfinite(c) else c) for r, c in charged.costs]
        made_of = _plain_sweep(model, robot_class, reward, charges_of(model, number, sizes))
        magnitude += sum(float(made_of[start]) for start in robot_class.starts)
    if not (math.isfinite(total) and math.isfinite(magnitude)):
        raise CertificateError("certificate: too large, the bound is infinite")
    # Every number above is a sum of at most `terms` terms, each the result of a few
    # operations: the error is below gamma_n times the sum of absolute values (Higham,
    # Accuracy and Stability of Numerical Algorithms, 2002, section 3.1), doubled for safety.
    # Marginal gains at reference pixels z are differences of roots up to sqrt(z + c); the
    # constant holds w sqrt(z), so that what cancels is counted too.
    # A step adds a term for each face, and up to four rewards for its move.
    terms = (problem.horizon + 1) * (model.n_faces + 5) + len(charged.costs)
    terms += 8 * len(problem.robots) + 64 + 2 * offer.cuts
    rounding = 2 * terms * UNIT_ROUNDOFF / (1 - terms * UNIT_ROUNDOFF) * magnitude
    return Pricing(math.nextafter(total + rounding, math.inf), rounding)


class _Offer(NamedTuple):
    """What a certificate pays for pixels, and the constants that go with it."""

    constant: float
    magnitude: float  # sum of the absolute values that the constant is made of
    # Number of a class, view sums [n], pixels [n] -> what it is paid for them, before weights.
    pay: Callable[[int, IntArray, FloatArray], FloatArray]
    cuts: int = 0  # how many there are


class _Charged(NamedTuple):
    """What a certificate charges for resources, and the constants that go with it."""

    constant: float
    magnitude: float
    costs: list[tuple[Resource, float]]


def _charged(model: Model, certificate: Multipliers, decisions: Sequence[Decision]) -> _Charged:
    """Costs of resources: conflict rows at their multipliers, closed decisions at infinity."""
    _check_rows(model, certificate.rows)
    if len(certificate.decisions) != len(decisions):
        raise CertificateError(
            f"certificate.decisions: must hold {len(decisions)} multipliers, one per decision"
        )
    terms = [row.multiplier for row in certificate.rows]
    costs = [(row.resource, row.multiplier) for row in certificate.rows]
    for decision, multiplier in zip(decisions, certificate.decisions, strict=True):
        if not (math.isfinite(multiplier) and multiplier >= 0):
            raise CertificateError("certificate.decisions: must be finite and >= 0")
        if decision.closes:
            costs.append((decision.resource, math.inf))
        else:
            terms.append(decision.sign * multiplier * decision.robots)
            costs.append((decision.resource, decision.sign * multiplier))
    largest = sum(abs(cost) for _, cost in costs if math.isfinite(cost))
    return _Charged(sum(terms), sum(map(abs, terms)) + largest, costs)


def _array(model: Model, values: tuple[tuple[float, ...], ...], field: str) -> FloatArray:
    shape = (model.problem.view_sum_steps, model.n_faces)
    if len(values) != shape[0] or any(len(row) != shape[1] for row in values):
        raise CertificateError(f"{field}: must hold {shape[0]} rows of {shape[1]} numbers")
    array = np.array(values, dtype=np.float64).reshape(-1)
    if not np.isfinite(array).all() or (array < 0).any():
        raise CertificateError(f"{field}: must be finite and >= 0")
    return array


def _visible_view_sums(model: Model) -> FloatArray:
    """1.0 for view sums that some robot can see and that count [Z]; others add nothing to J."""
    visible = np.zeros(model.problem.view_sum_steps * model.n_faces)
    for robot_class in model.classes:
        visible[model.coverage(robot_class).view_sums] = 1.0
    return np.where(view_sum_weights(model.problem) > 0, visible, 0.0)


def _offer_of_multipliers(model: Model, certificate: Multipliers) -> _Offer:
    alpha = _array(model, certificate.alpha, "certificate.alpha")
    beta = _array(model, certificate.beta, "certificate.beta")
    weights = view_sum_weights(model.problem)
    cuts = usable_cuts(model, certificate.cuts)
    shares: dict[int, list[float]] = {}
    for cut, share in cuts:
        shares.setdefault(cut.view_sum, []).append(-share)
    rest = np.ones_like(alpha)
    for view_sum, own_shares in shares.items():
        rest[view_sum] = math.nextafter(math.fsum([1.0, *own_shares]), math.inf)
    needed = np.flatnonzero((_visible_view_sums(model) > 0) & (alpha < rest))
    if (beta[needed] == 0).any():
        raise CertificateError("certificate.beta: must be > 0 where alpha < 1")
    kappa = (rest[needed] - alpha[needed]) ** 2 / (4 * beta[needed])
    terms = (weights[needed] * kappa).tolist()
    terms += [float(weights[cut.view_sum]) * share * cut.constant for cut, share in cuts]
    # What the cuts' constants are made of: norms of as many roots as there are robots.
    made_of = [
        float(weights[cut.view_sum])
        * len(model.classes[number].robots)
        * float(curve.roots.max(initial=0.0) + curve.values.max(initial=0.0))
        for cut, _ in cuts
        for number, curve in cut.curves.items()
    ]
    by_view_sum: dict[int, list[tuple[Cut, float]]] = {}
    for cut, share in cuts:
        by_view_sum.setdefault(cut.view_sum, []).append((cut, share))

    def pay(number: int, view_sums: IntArray, pixels: FloatArray) -> FloatArray:
        roots = np.sqrt(pixels)
        paid: FloatArray = alpha[view_sums] * roots + beta[view_sums] * pixels
        order = np.argsort(view_sums, kind="stable")
        bounds = np.searchsorted(view_sums[order], np.arange(len(alpha) + 1))
        for view_sum, own in by_view_sum.items():
            entries = order[bounds[view_sum] : bounds[view_sum + 1]]
            for cut, share in own:
                paid[entries] += share * cut.phi(number, roots[entries])
        return paid

    return _Offer(sum(terms), sum(terms) + sum(made_of), pay, len(cuts))


def usable_cuts(model: Model, cuts: tuple[EnvelopeCut, ...]) -> list[tuple[Cut, float]]:
    """Cuts with the constants that make them valid, and their shares."""
    steps, faces = model.problem.horizon + 1, model.n_faces
    sizes = model.class_sizes
    if cuts and model.problem.objective.over_time:
        raise CertificateError("certificate.cuts: none hold where pixels add up over time")
    found = []
    for n, cut in enumerate(cuts):
        field = f"certificate.cuts[{n}]"
        if not (0 <= cut.t < steps and 0 <= cut.face < faces):
            raise CertificateError(f"{field}: there is no view_sum ({cut.t}, {cut.face})")
        if not 0 <= cut.share <= 1:
            raise CertificateError(f"{field}.share: must be 0..1, not {cut.share}")
        numbers = (-1, *(curve.class_number for curve in cut.curves), len(sizes))
        if not all(a < b for a, b in pairwise(numbers)):
            raise CertificateError(
                f"{field}.curves: robot_class must be increasing, 0..{len(sizes) - 1}"
            )
        for k, curve in enumerate(cut.curves):
            _check_curve(curve, f"{field}.curves[{k}]")
        functions, constant = _functions(cut.curves, sizes)
        if constant is None:
            raise CertificateError(f"{field}.curves: too many roots for so many robots")
        found.append((Cut(cut.t * faces + cut.face, functions, constant), cut.share))
    return found


@lru_cache(maxsize=4096)  # the leaves of a proof share most of their cuts
def _functions(
    curves: tuple[Curve, ...], sizes: tuple[int, ...]
) -> tuple[Mapping[int, envelope.Curve], float | None]:
    """Functions of a cut by class, and its constant; None where that takes too long."""
    functions = {
        curve.class_number: envelope.Curve(np.array(curve.roots), np.array(curve.values))
        for curve in curves
    }
    if envelope.work_of(functions, sizes) > envelope.MOST_WORK:
        return functions, None
    return functions, envelope.constant_of(functions, sizes)


def _check_curve(curve: Curve, field: str) -> None:
    """Refuse a curve that is no function."""
    points = (0.0, *curve.roots)
    if len(points) < 2 or not all(a < b <= LARGEST_ROOT for a, b in pairwise(points)):
        raise CertificateError(f"{field}.roots: must be > 0, <= {LARGEST_ROOT:g} and increasing")
    if len(curve.values) != len(curve.roots) or not all(
        0 <= value <= LARGEST_ROOT for value in curve.values
    ):
        raise CertificateError(f"{field}.values: must hold a number 0..{LARGEST_ROOT:g} per root")


def _offer_of_reference(model: Model, certificate: ReferencePixels) -> _Offer:
    pixels = _array(model, certificate.pixels, "certificate.pixels")
    roots = view_sum_weights(model.problem) * np.sqrt(pixels)
    constant = math.fsum(roots.tolist())
    # Every gain is a difference of roots that may be as large as the constant's.
    gains = len(model.problem.robots)
    gains *= model.problem.horizon + 1 if model.problem.objective.over_time else 1

    def pay(number: int, view_sums: IntArray, seen: FloatArray) -> FloatArray:
        return marginal_gain(pixels[view_sums], seen)

    return _Offer(constant, (gains + 1) * constant, pay)


def _node_rewards(model: Model, number: int, offer: _Offer) -> FloatArray:
    """What the certificate pays a class for being in a state [T+1, S]."""
    robot_class = model.classes[number]
    table = model.coverage(robot_class)
    with np.errstate(over="ignore"):
        paid = (
            offer.pay(number, table.view_sums, table.pixels)
            * view_sum_weights(model.problem)[table.view_sums]
        )
    rewards = np.zeros((model.problem.horizon + 1, robot_class.graph.n_states))
    with np.errstate(over="ignore"):
        rewards.reshape(-1)[table.nodes] = table.row_sums(paid)
        # What no path can exceed: where this is finite, nothing in the sweep overflows.
        largest = float(rewards.max(axis=1).sum())
    if not (np.isfinite(paid).all() and math.isfinite(largest)):
        raise CertificateError("certificate: too large, the bound is infinite")
    return rewards


def _plain_sweep(
    model: Model, robot_class: RobotClass, reward: FloatArray, charges: Charges = NO_CHARGES
) -> FloatArray:
    """Best path value from every state at step 0 [S], move by move and turn by turn."""
    graph, problem = robot_class.graph, model.problem
    shape = (graph.n_orientations, graph.n_places)
    objective = problem.objective
    stay = objective.stationarity + objective.keep_cell
    stay += objective.keep_heading + objective.balanced
    bonuses = _bonuses_of_moves(graph, objective)
    places, states, moves = _spread_charges(robot_class, charges)
    value = np.where(graph.free, reward[-1].reshape(shape), -np.inf)
    if robot_class.goal is not None:
        _, x, y = graph.coordinates(np.arange(graph.n_places))
        value = np.where((x == robot_class.goal[0]) & (y == robot_class.goal[1]), value, -np.inf)
    value = value - places.get(problem.horizon, 0.0) - states.get(problem.horizon, 0.0)
    for t in range(problem.horizon - 1, -1, -1):
        turned = _plain_turns(graph, value, objective.keep_heading)
        best = np.full(shape, -np.inf)
        for k, heads in enumerate(graph.neighbours):
            tails = np.flatnonzero(heads >= 0)
            ahead = turned[:, heads[tails]]
            if k in bonuses:
                ahead = ahead + bonuses[k]
            if (t, k) in moves:
                ahead = ahead - moves[t, k][tails]
            best[:, tails] = np.maximum(best[:, tails], ahead)
        if objective.stationarity:
            best = np.maximum(best, value + stay)
        value = best + reward[t].reshape(shape) - places.get(t, 0.0) - states.get(t, 0.0)
    return value.reshape(-1)


def _plain_turns(graph: TimeGraph, value: FloatArray, keep_heading: float) -> FloatArray:
    """Best of the orientations that one step can turn to [O, P], the heading's reward included."""
    turned = np.stack([value[turns].max(axis=0) for turns in graph.turns])
    if keep_heading:
        pitches = graph.shape[1]
        for orientation, turns in enumerate(graph.turns):
            kept = [turn for turn in turns if turn // pitches == orientation // pitches]
            ahead = value[kept].max(axis=0) + keep_heading
            turned[orientation] = np.maximum(turned[orientation], ahead)
    return turned


def _bonuses_of_moves(graph: TimeGraph, objective: Objective) -> dict[int, FloatArray]:
    """Rewards of each move from the places where it is open, by its number, turns aside."""
    bonuses: dict[int, FloatArray] = {}
    if not objective.keep_cell and not objective.balanced:
        return bonuses
    for k, heads in enumerate(graph.neighbours):
        tails = np.flatnonzero(heads >= 0)
        climb, dx, dy = graph.coordinates(heads[tails]) - graph.coordinates(tails)
        stays = (climb == 0) & (dx == 0) & (dy == 0)
        bonuses[k] = objective.keep_cell * stays + objective.balanced * (dx + dy == 0)
    return bonuses


def _spread_charges(
    robot_class: RobotClass, charges: Charges
) -> tuple[dict[int, FloatArray], dict[int, FloatArray], dict[tuple[int, int], FloatArray]]:
    """Charges on places [P] and states [O, P] per step, and on moves k from places [P]."""
    graph = robot_class.graph
    places: dict[int, FloatArray] = {}
    for (t, place), cost in charges.places.items():
        places.setdefault(t, np.zeros(graph.n_places))[place] += cost
    states: dict[int, FloatArray] = {}
    for (t, state), cost in charges.states.items():
        own = states.setdefault(t, np.zeros((graph.n_orientations, graph.n_places)))
        own.reshape(-1)[state] += cost
    moves: dict[tuple[int, int], FloatArray] = {}
    for (t, tail, head), cost in charges.moves.items():
        for k in np.flatnonzero(graph.neighbours[:, tail] == head).tolist():
            moves.setdefault((t, k), np.zeros(graph.n_places))[tail] += cost
    return places, states, moves


def _check_rows(model: Model, rows: tuple[Row, ...]) -> None:
    """Refuse rows that some allowed plan may break."""
    for n, row in enumerate(rows):
        field = f"certificate.rows[{n}]"
        if not (math.isfinite(row.multiplier) and row.multiplier >= 0):
            raise CertificateError(f"{field}.multiplier: must be finite and >= 0")
        wrong = misuse(model, row.resource) or misruled(model.problem, row.resource)
        if wrong:
            raise CertificateError(f"{field}.{wrong}")
