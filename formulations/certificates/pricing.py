"""Computes the bound that multipliers prove, and the bound that a tree of decisions proves.

Multipliers. For alpha, beta >= 0 and any non-negative c_1..c_N,

    sqrt(sum c_i) <= alpha sum sqrt(c_i) + beta sum c_i + kappa,
    kappa = (1 - alpha)^2 / (4 beta) if alpha < 1, else 0

since sum sqrt(c_i) >= r := sqrt(sum c_i) and alpha r + beta r^2 + kappa >= r for all r. With
one (alpha, beta) per view sum (t, face) and a multiplier mu >= 0 per conflict row,

    J <= sum w kappa + sum mu + sum_i max_path [ sum_t sum_f w (alpha sqrt(c) + beta c)
                                                 + rewards for moves - mu on rows used ].

Instead, a share theta of a view sum's root may be bounded by an envelope cut (`envelope`): r <=
constant + sum phi_k(i)(sqrt(c_i)), with one phi_k per class k of robots. Then only rho = 1 - sum
theta remains for alpha and beta, and kappa = max(0, rho - alpha)^2 / (4 beta). So may a state cut
(`state_cuts`), whose phi depends on the state in which a robot is.

If the drones that see a person are counted, min(sum c_i, k) replaces the root, c_i is 0 or 1, and
one number gamma replaces (alpha, beta): the share of w that each drone gets. Then kappa is k max(0,
1 - gamma) (`returns`), and there are no cuts, which exist only for roots.

Decisions "at most k" or "at least k robots use this" of a branch-and-price tree are rows, too;
with a multiplier nu >= 0 they add +nu k or -nu k, and a charge or a reward for each use.
"At most none" closes the resource.

Reference pixels z. By concavity of the root,

    sqrt(sum c_i) <= sqrt(z) + sum_i (sqrt(z + c_i) - sqrt(z)).

A proof is a tree. A branch distinguishes two cases: at most k robots use a resource, or at least k
+ 1 do. Every plan belongs to one of the two, so the leaves together cover all plans. A leaf's
multipliers bound the plans that obey the decisions on the way to it, and the largest bound of all
leaves holds for all plans.

Any non-negative numbers give a valid bound, no matter which solver found them. Pricing needs one
plain sweep over the time-expanded graph and no solver.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.arithmetic import exact_sum
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.certificates.format import (
    Branch,
    Certificate,
    CertificateError,
    Decision,
    Leaf,
    Multipliers,
    ProofFile,
    ReferencePixels,
    Row,
    Table,
)
from cocap_opt.formulations.certificates.resources import Resource, charges_of
from cocap_opt.formulations.certificates.state_cuts import AnyCut, CutByStates
from cocap_opt.formulations.certificates.sweep import plain_sweep
from cocap_opt.graph.charges import Charges
from cocap_opt.model import Model
from cocap_opt.objective import marginal_gain
from cocap_opt.returns import Returns
from cocap_opt.stop import Stop, never

UNIT_ROUNDOFF = 2.0**-53


class Pricing(NamedTuple):
    """The bound that a certificate or a proof proves, with its allowance for rounding."""

    bound: float  # rigorous upper bound on J, including rounding
    rounding: float  # the part of the bound that covers rounding errors
    leaves: tuple[float, ...] = ()  # bounds of a proof's leaves, in order
    nodes: int = 0  # nodes of the searches on which the bound rests; 0 if there are none

    @classmethod
    def of(
        cls,
        model: Model,
        certificate: Certificate,
        decisions: Sequence[Decision] = (),
        stop: Stop = never,
    ) -> "Pricing":
        """Returns the upper bound on J that a certificate proves.

        Parameters
        ----------
        decisions : the bound holds for plans that obey these decisions

        Raises
        ------
        CertificateError
            If a number is negative or not finite, an array has the wrong shape, or some plan does
            not obey one of the rows.
        LimitReached
            If a limit is reached.
        """
        prices = CertificatePrices.of(model, certificate, decisions, stop)
        total = prices.pixels.constant + prices.row_constant
        magnitude = prices.pixels.magnitude + prices.row_magnitude
        if not math.isfinite(magnitude):
            raise CertificateError("certificate: multipliers are too large: the bound is infinite")
        # The same sum with all numbers counted as positive: the sum of absolute values along a
        # path.
        sizes = [(r, -abs(c) if math.isfinite(c) else c) for r, c in prices.costs]
        for number, robot_class in enumerate(model.classes):
            reward = prices.rewards(number)
            values, made_of = (
                plain_sweep(model.problem, robot_class, reward, charges_of(model, number, costs))
                for costs in (prices.costs, sizes)
            )
            best = [float(values[starts].max()) for starts in robot_class.starts]
            if -math.inf in best:  # a robot has no path, so there is no plan
                return cls(-math.inf, 0.0)
            total += exact_sum(best)
            magnitude += exact_sum(made_of[starts].max() for starts in robot_class.starts)
        if not (math.isfinite(total) and math.isfinite(magnitude)):
            raise CertificateError("certificate: numbers are too large: the bound is infinite")
        rounding = prices.rounding_factor * magnitude
        return cls(math.nextafter(total + rounding, math.inf), rounding)

    @classmethod
    def of_proof(
        cls,
        model: Model,
        proof: ProofFile,
        progress: Callable[[int, int], None] = lambda done, total: None,
        stop: Stop = never,
    ) -> "Pricing":
        """Returns the upper bound on J that a proof proves: the largest bound of its leaves.

        Parameters
        ----------
        progress : called with the number of leaves checked so far, and the total

        Raises
        ------
        CertificateError
            If the nodes do not form a tree, a resource does not exist, or a leaf is not valid.
        LimitReached
            If a limit is reached.
        """
        _check_branches(model, proof)
        worst, bounds = cls(-math.inf, 0.0), []
        total = sum(isinstance(node, Leaf) for node in proof.nodes)
        for done, (n, leaf, decisions) in enumerate(proof.leaves()):
            stop.check()
            try:
                pricing = cls.of(model, leaf.certificate, decisions, stop)
            except CertificateError as error:
                raise CertificateError(f"nodes[{n}].{error}") from error
            bounds.append(pricing.bound)
            if not pricing.bound <= worst.bound:
                worst = pricing
            progress(done + 1, total)
        return worst._replace(leaves=tuple(bounds))


class CertificatePrices(NamedTuple):
    """The prices that a certificate puts on pixels and resources, from which its bound is
    computed.
    """

    model: Model
    pixels: "_PixelPrices"
    row_constant: float  # constant of rows and decisions
    row_magnitude: float  # sum of the absolute values of the constant's terms
    costs: list[tuple[Resource, float]]

    @classmethod
    def of(
        cls,
        model: Model,
        certificate: Certificate,
        decisions: Sequence[Decision] = (),
        stop: Stop = never,
    ) -> "CertificatePrices":
        """Returns the prices of a certificate; raises the same errors as `Pricing.of`."""
        if isinstance(certificate, Multipliers):
            pixels = _prices_by_multipliers(model, certificate, stop)
            return cls(model, pixels, *_resource_prices(model, certificate, decisions))
        return cls(model, _prices_by_reference(model, certificate), 0.0, 0.0, [])

    def rewards(self, number: int) -> FloatArray:
        """Returns the rewards [T+1, S] of a robot of class `number` for visiting each state."""
        return _node_rewards(self.model, number, self.pixels)

    def charges(self, number: int) -> Charges:
        """Returns the charges for robots of class `number`."""
        return charges_of(self.model, number, self.costs)

    @property
    def rounding_factor(self) -> float:
        """The error of a bound, relative to the sum of its terms' absolute values.

        Every number is a sum of at most `terms` terms, each the result of a few operations: the
        error is below gamma_n times the sum of absolute values (Higham, Accuracy and Stability of
        Numerical Algorithms, 2002, section 3.1), doubled for safety. Marginal gains at reference
        pixels z are differences of roots up to sqrt(z + c); the constant contains w sqrt(z), so
        terms that cancel are counted, too. A step adds a term for each face and each counted
        person, and up to four rewards for its move. The constant of a state cut may contain numbers
        of all its listed states, however few robots there are.
        """
        problem = self.model.problem
        terms = (problem.horizon + 1) * (problem.step_width + 5) + len(self.costs)
        terms += 8 * len(problem.robots) + 64 + 2 * self.pixels.cuts + self.pixels.listed
        return 2 * terms * UNIT_ROUNDOFF / (1 - terms * UNIT_ROUNDOFF)


# -- prices of pixels --------------------------------------------------------------------------


# Given the number of a class, and view sums [n], states [n] and pixels [n], returns their credits
# before weights [n].
Payments = Callable[[int, IntArray, IntArray, FloatArray], FloatArray]


class _PixelPrices(NamedTuple):
    """The prices at which a robot sells its pixels, and the matching constants."""

    constant: float
    constants: FloatArray  # [Z] the constants of view sums
    magnitude: float  # sum of the absolute values of the constant's terms
    paid: Payments
    cuts: int = 0  # number of cuts
    listed: int = 0  # largest number of listed states of a state cut


def _prices_by_multipliers(model: Model, certificate: Multipliers, stop: Stop) -> _PixelPrices:
    alpha = _array(model, certificate.alpha, certificate.views, "certificate.alpha")
    beta = _array(model, certificate.beta, _nothing(certificate.views), "certificate.beta")
    weights, returns = model.problem.view_sum_weights, model.problem.returns
    is_visible = _visible_view_sums(model) > 0
    by_roots = [
        part for part in certificate.usable_cuts(model, stop) if is_visible[part[0].view_sum]
    ]
    by_states = [
        part for part in certificate.usable_state_cuts(model, stop) if is_visible[part[0].view_sum]
    ]
    cuts: list[tuple[AnyCut, float]] = [*by_roots, *by_states]
    if any(cut.view_sum >= returns.n_roots for cut, _ in cuts):
        raise CertificateError("certificate.cuts: cuts exist only for roots of pixels")
    rest = _left_by(cuts, len(alpha))
    needed = np.flatnonzero(is_visible & (alpha < rest))
    if (beta[needed[needed < returns.n_roots]] == 0).any():
        raise CertificateError(
            "certificate.beta: must be > 0 if alpha is less than the share of the root that cuts "
            "leave (1 without cuts)"
        )
    kappa = returns.kappas(alpha, beta, rest)[needed]
    with np.errstate(over="ignore"):  # infinite values are rejected later
        terms = (weights[needed] * kappa).tolist()
    terms += [float(weights[cut.view_sum]) * share * cut.constant for cut, share in cuts]
    constants = np.zeros(len(weights))
    owners = np.array([*needed.tolist(), *(cut.view_sum for cut, _ in cuts)], dtype=np.int64)
    np.add.at(constants, owners, terms)
    magnitude = sum(terms) + sum(_sizes_of_cuts(model, by_roots, by_states))
    listed = max((cut.n_listed for cut, _ in by_states), default=0)
    paid = _payments(returns, alpha, beta, cuts)
    return _PixelPrices(sum(terms), constants, magnitude, paid, len(cuts), listed)


def _sizes_of_cuts(
    model: Model,
    by_roots: Sequence[tuple[Cut, float]],
    by_states: Sequence[tuple[CutByStates, float]],
) -> Iterator[float]:
    """Yields the sums of the absolute values of all numbers of which constants can be made.

    The constant of an envelope cut is made of norms of as many roots as there are robots.
    """
    weights = model.problem.view_sum_weights
    for cut, share in by_roots:
        for number, curve in cut.curves.items():
            most = float(curve.roots.max(initial=0.0) + curve.values.max(initial=0.0))
            yield float(weights[cut.view_sum]) * share * len(model.classes[number].robots) * most
    for state_cut, share in by_states:
        yield float(weights[state_cut.view_sum]) * share * state_cut.magnitude


def _payments(
    returns: Returns, alpha: FloatArray, beta: FloatArray, cuts: Sequence[tuple[AnyCut, float]]
) -> Payments:
    """Returns the function that credits robots by alpha, beta and the shares of cuts."""
    by_view_sum: dict[int, list[tuple[AnyCut, float]]] = {}
    for cut, share in cuts:
        by_view_sum.setdefault(cut.view_sum, []).append((cut, share))

    def paid(number: int, view_sums: IntArray, states: IntArray, pixels: FloatArray) -> FloatArray:
        roots = returns.values_at(view_sums, pixels)
        brought: FloatArray = alpha[view_sums] * roots + beta[view_sums] * pixels
        order = np.argsort(view_sums, kind="stable")
        bounds = np.searchsorted(view_sums[order], np.arange(len(alpha) + 1))
        for view_sum, of_view_sum in by_view_sum.items():
            entries = order[bounds[view_sum] : bounds[view_sum + 1]]
            for cut, share in of_view_sum:
                brought[entries] += share * cut.phi(number, states[entries], roots[entries])
        return brought

    return paid


def _left_by(cuts: Sequence[tuple[AnyCut, float]], n_view_sums: int) -> FloatArray:
    """Returns rho [Z], the share of each root that cuts leave to alpha and beta, rounded up where
    no float is exactly as large.
    """
    shares: dict[int, list[float]] = {}
    for cut, share in cuts:
        shares.setdefault(cut.view_sum, []).append(-share)
    rest = np.ones(n_view_sums)
    for view_sum, negative in shares.items():
        left = exact_sum([1.0, *negative])
        is_less = exact_sum([1.0, *negative, -left]) > 0
        rest[view_sum] = math.nextafter(left, math.inf) if is_less else left
    return rest


def _visible_view_sums(model: Model) -> FloatArray:
    """Returns 1.0 for view sums that count and that some robot can see, otherwise 0.0 [Z]."""
    visible = np.zeros(len(model.problem.view_sum_weights))
    for robot_class in model.classes:
        visible[model.coverage(robot_class).view_sums] = 1.0
    return np.where(model.problem.view_sum_weights > 0, visible, 0.0)


def _prices_by_reference(model: Model, certificate: ReferencePixels) -> _PixelPrices:
    pixels = _array(model, certificate.pixels, certificate.views, "certificate.pixels")
    values = model.problem.view_sum_weights * model.problem.returns.values(pixels)
    constant = exact_sum(values.tolist())
    # Every gain is a difference of values that may be as large as the constant's terms.
    gains = len(model.problem.robots)
    gains *= model.problem.horizon + 1 if model.problem.objective.over_time else 1

    def paid(number: int, view_sums: IntArray, states: IntArray, seen: FloatArray) -> FloatArray:
        return marginal_gain(model.problem, view_sums, pixels[view_sums], seen)

    return _PixelPrices(constant, values, (gains + 1) * constant, paid)


def _node_rewards(model: Model, number: int, prices: _PixelPrices) -> FloatArray:
    """Returns the rewards [T+1, S] of a robot of class `number` for visiting each state."""
    robot_class = model.classes[number]
    table = model.coverage(robot_class)
    states = np.repeat(table.nodes % robot_class.graph.n_states, np.diff(table.indptr))
    with np.errstate(over="ignore", invalid="ignore"):  # infinite values are rejected below
        paid = (
            prices.paid(number, table.view_sums, states, table.pixels)
            * model.problem.view_sum_weights[table.view_sums]
        )
    rewards = np.zeros((model.problem.horizon + 1, robot_class.graph.n_states))
    with np.errstate(over="ignore"):
        rewards.reshape(-1)[table.nodes] = table.row_sums(paid)
        # No path can have a larger sum: if this is finite, nothing in the sweep overflows.
        largest = float(rewards.max(axis=1).sum())
    if not (np.isfinite(paid).all() and math.isfinite(largest)):
        raise CertificateError("certificate: numbers are too large: the bound is infinite")
    return rewards


def _array(model: Model, faces: Table, people: Table, field: str) -> FloatArray:
    """Returns numbers >= 0 from a file, one per view sum [Z].

    Parameters
    ----------
    people : the numbers for counted people, from the field `views`
    field : name of the field with the numbers for faces
    """
    counted = model.problem.count_weights.shape
    return np.concatenate([
        _checked(faces, (model.problem.view_sum_steps, model.n_faces), field),
        _checked(people, counted if counted[1] else (0, 0), "certificate.views"),
    ])  # fmt: skip


def _checked(values: Table, shape: tuple[int, int], field: str) -> FloatArray:
    """Checks the shape and the values of a table; returns all its numbers, row by row."""
    if len(values) != shape[0] or any(len(row) != shape[1] for row in values):
        raise CertificateError(f"{field}: must hold {shape[0]} rows of {shape[1]} numbers")
    array = np.array(values, dtype=np.float64).reshape(-1)
    if not np.isfinite(array).all() or (array < 0).any():
        wrong = array[~(np.isfinite(array) & (array >= 0))]
        raise CertificateError(f"{field}: must be finite and >= 0, not {wrong[0]:g}")
    return array


def _nothing(table: Table) -> Table:
    """Returns a table of zeros of the same shape."""
    return tuple((0.0,) * len(row) for row in table)


# -- prices of resources -----------------------------------------------------------------------


def _resource_prices(
    model: Model, certificate: Multipliers, decisions: Sequence[Decision]
) -> tuple[float, float, list[tuple[Resource, float]]]:
    """Returns the costs of resources: rows cost their multipliers, closed decisions infinity.

    The constant of the rows and decisions, and the sum of its absolute values, are returned first.
    """
    _check_rows(model, certificate.rows)
    if len(certificate.decisions) != len(decisions):
        raise CertificateError(
            f"certificate.decisions: must hold {len(decisions)} multipliers, one per decision"
        )
    terms = [row.multiplier for row in certificate.rows]
    costs = [(row.resource, row.multiplier) for row in certificate.rows]
    for decision, multiplier in zip(decisions, certificate.decisions, strict=True):
        if not (math.isfinite(multiplier) and multiplier >= 0):
            words = f"must be finite and >= 0, not {multiplier!r}"
            raise CertificateError(f"certificate.decisions: {words}")
        if decision.closes:
            costs.append((decision.resource, math.inf))
        else:
            terms.append(decision.sign * multiplier * decision.robots)
            costs.append((decision.resource, decision.sign * multiplier))
    largest = exact_sum(abs(cost) for _, cost in costs if math.isfinite(cost))
    return exact_sum(terms), exact_sum(map(abs, terms)) + largest, costs


def _check_rows(model: Model, rows: tuple[Row, ...]) -> None:
    """Rejects rows that an allowed plan may break."""
    for n, row in enumerate(rows):
        field = f"certificate.rows[{n}]"
        if not (math.isfinite(row.multiplier) and row.multiplier >= 0):
            words = f"must be finite and >= 0, not {row.multiplier!r}"
            raise CertificateError(f"{field}.multiplier: {words}")
        wrong = row.resource.why_absent(model) or row.resource.why_shared(model.problem)
        if wrong:
            raise CertificateError(f"{field}.{wrong}")


# -- the tree of a proof ------------------------------------------------------------------------


def _check_branches(model: Model, proof: ProofFile) -> None:
    """Rejects branches on resources that do not exist."""
    for n, node in enumerate(proof.nodes):
        if isinstance(node, Branch):
            if wrong := node.resource.why_absent(model):
                raise CertificateError(f"nodes[{n}].resource.{wrong}")
            most = len(model.problem.robots)
            if not 0 <= node.robots <= most:
                raise CertificateError(f"nodes[{n}].robots: must be 0..{most}, not {node.robots}")
