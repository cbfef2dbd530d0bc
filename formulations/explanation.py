"""Explains a gap by the terms that add up to the difference between a bound and a plan's J.

Let V_t be the values-to-go of the priced graphs, r_t their rewards (including charges and rewards
for moves), and pay_i robot i's credit for a view sum. For a plan P and a certificate with bound B,

    B - J(P) = sum over robots and steps of V_t(x_t) - r_t(x_t) - V_t+1(x_t+1)        path
             + sum over view sums of w (constant + sum_i pay_i(c_i) - sqrt(sum_i c_i))   face
             + the same for counted people, with min(sum_i c_i, k) for the root        views
             + sum over conflict rows of mu (1 - used)                                    row
             + sum over decisions of +-nu (k - used)                                 decision
             + the largest bound of a proof's leaves - that of the plan's own leaf     leaves
             - reduction of the bound by stages and by trying paths                  stages
             + excess of the claimed bound over the proved bound                        claim
             + allowance for rounding.                                                 rounding

The first term can be split by step, since a path's rewards telescope against V; the others are the
bound's own terms, evaluated for the plan. If the plan obeys the rules, only the term of stages can
be negative: V is the value of the best path, and `certificates.pricing` proves the others
nonnegative. A violated rule that has a price appears as a negative row. All terms are computed by
the certificates' own sweep.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.certificates import (
    Branch,
    Certificate,
    CertificateFile,
    Decision,
    Multipliers,
    Pricing,
    ProofFile,
    Staged,
)
from cocap_opt.formulations.certificates.pricing import CertificatePrices
from cocap_opt.formulations.certificates.resources import Resource
from cocap_opt.formulations.certificates.sweep import values_to_go
from cocap_opt.graph.charges import Charges
from cocap_opt.model import Model, Path, PathCells
from cocap_opt.problem import Plan
from cocap_opt.referee import rewards_of_move

_NOTHING = 1e-9  # tolerance for the bound of a scene in which no reward can be collected
Kind = Literal["path", "face", "views", "row", "decision", "leaves", "stages", "claim", "rounding"]


class Term(NamedTuple):
    """One term of a gap; fields that do not apply to its kind are None.

    A path term is the loss that a robot incurs by its move from `step` to the next step. A face
    term is the amount by which the certificate's credits for a face of an actor at a step exceed
    the reward of all robots together; if pixels add up over time, it has no step. A views term
    belongs to a counted person whom `robots` robots see. A stages term, which is negative, is the
    amount by which a certificate's stages, and the paths that were tried, lower the bound of its
    multipliers.
    """

    kind: Kind
    amount: float
    step: int | None = None
    robot: int | None = None
    actor: int | None = None
    face: int | None = None  # the face's number among the actor's faces
    resource: Resource | None = None  # the resource of a row or a decision
    sense: Literal["at most", "at least"] | None = None
    # capacity of the resource (at most, or at least), or number of robots that see the person
    robots: int | None = None
    price: float | None = None  # mu or nu
    users: tuple[int, ...] | None = None  # robots that use the resource

    @property
    def is_broken(self) -> bool:
        """True if the plan violates the rule to which the term belongs.

        Decisions are never violated: the plan's leaf is the one whose decisions it obeys.
        """
        return self.kind == "row" and len(self.users or ()) > 1


class _OwnLeaf(NamedTuple):
    """The leaf of a proof whose decisions a plan obeys."""

    node: int  # the node's number in the file
    position: int  # the leaf's position among the leaves
    bound: float


@dataclass(frozen=True)
class Explanation:
    """The terms of the gap between a bound and a plan.

    Attributes
    ----------
    bound : the bound that the file claims
    reward : J of the plan
    terms : all terms except faces that add nothing and rows without a price; empty if they are
        unknown
    leaf : in a proof, the leaf that the plan belongs to
    """

    bound: float
    reward: float
    terms: tuple[Term, ...]
    leaf: _OwnLeaf | None = None

    @property
    def gap(self) -> float:
        """The difference between the bound and J, in units of J."""
        return self.bound - self.reward

    def of_kind(self, *kinds: Kind) -> list[Term]:
        """Returns the terms of the given kinds, in order."""
        return [term for term in self.terms if term.kind in kinds]

    def total(self, *kinds: Kind) -> float:
        """Returns the sum of the terms of the given kinds, or of all terms if no kind is given."""
        return math.fsum(term.amount for term in self.terms if not kinds or term.kind in kinds)

    def share(self, amount: float) -> float:
        """Returns an amount as a share of the bound, or 0 if the bound is 0."""
        return amount / self.bound if self.bound > _NOTHING else 0.0

    def losses(self) -> FloatArray:
        """Returns the loss of each robot by its move at each step [R, T], in units of J.

        The loss at the first move includes the loss by the choice of a start, if there was one. If
        the terms are unknown, the array has no robots.
        """
        paths = self.of_kind("path")
        if not paths:
            return np.zeros((0, 0))
        size = 1 + max(term.robot or 0 for term in paths)
        return np.array([term.amount for term in paths]).reshape(size, -1)


def explain(
    model: Model,
    plan: Plan,
    reward: float,
    file: CertificateFile | ProofFile,
    proved: float | None = None,
) -> Explanation:
    """Returns the terms of the gap between a file's bound and a plan's J.

    Parameters
    ----------
    plan : a plan that can be flown; it may break collision rules
    reward : J of the plan, as the referee computes it
    proved : for a proof, the largest bound of its leaves, as found by `verify`; None: use the claim
        of the file, without a term for its excess

    Raises
    ------
    CertificateError
        If the file's numbers are not valid.
    ValueError
        If the file claims that there is no plan.
    """
    if not math.isfinite(file.proved):
        raise ValueError(
            "certificate: it proves that no plan exists, so there is no gap to explain"
        )
    model = model.disaggregated() if file.classes == "single" else model
    paths = model.paths(plan)
    passed = [PathCells.of(model, robot, path) for robot, path in enumerate(paths)]
    node = _leaf_of(model, file, passed) if isinstance(file, ProofFile) else None
    position, certificate, decisions = _numbers(file, node)
    is_staged = isinstance(file, CertificateFile) and isinstance(file.certificate, Staged)
    pricing = Pricing.of(model, certificate, decisions)
    prices = CertificatePrices.of(model, certificate, decisions)
    is_lone = node is None and not is_staged
    largest = pricing.bound if is_lone else file.proved if proved is None else proved
    terms = (
        *_path_terms(prices, plan, paths),
        *_view_terms(prices, paths),
        *_row_terms(model, certificate, decisions, passed),
        *([] if node is None else [Term("leaves", largest - pricing.bound)]),
        *([Term("stages", largest - pricing.bound)] if is_staged else []),
        Term("claim", file.proved - largest),
        Term("rounding", pricing.rounding),
    )
    leaf = None if node is None else _OwnLeaf(node, position, pricing.bound)
    return Explanation(file.proved, reward, terms, leaf)


def _leaf_of(model: Model, proof: ProofFile, paths: Sequence[PathCells]) -> int:
    """Returns the number of the leaf whose decisions the paths obey."""
    number = 0
    while isinstance(node := proof.nodes[number], Branch):
        used = sum(node.resource.used_by(model, path) for path in paths)
        number = node.at_most if used <= node.robots else node.at_least
    return number


def _numbers(
    file: CertificateFile | ProofFile, node: int | None
) -> tuple[int, Certificate, tuple[Decision, ...]]:
    """Returns a leaf's position among the leaves, its certificate, and the decisions that lead to
    it.

    A single certificate counts as the only leaf of a tree without decisions. For a staged
    certificate, its multipliers are returned.
    """
    if isinstance(file, CertificateFile):
        numbers = file.certificate
        return 0, numbers.multipliers if isinstance(numbers, Staged) else numbers, ()
    leaves = enumerate(file.leaves())
    return next(
        (position, leaf.certificate, decisions)
        for position, (n, leaf, decisions) in leaves
        if n == node
    )


# -- paths --------------------------------------------------------------------------------


def _path_terms(prices: CertificatePrices, plan: Plan, paths: Sequence[Path]) -> Iterator[Term]:
    """Yields the loss of each robot by its move at each step."""
    model = prices.model
    losses: dict[int, list[float]] = {}
    for number, robot_class in enumerate(model.classes):
        reward, charges = prices.rewards(number), prices.charges(number)
        sweep = values_to_go(model.problem, robot_class, reward, charges)
        along = np.array([paths[robot] for robot in robot_class.robots])  # [robots, T+1]
        steps = range(model.problem.horizon, -1, -1)
        ahead: list[FloatArray] = []
        for t, values in zip(steps, sweep, strict=True):
            ahead.append(values[along[:, t]])
        ahead.reverse()
        # from this line on, the values are those of step 0
        best = [float(values[starts].max()) for starts in robot_class.starts]
        for k, robot in enumerate(robot_class.robots):
            path, states = paths[robot], plan.paths[robot]
            worth = [float(values[k]) for values in ahead]
            gains = _gains(charges, reward, path, robot_class.graph.n_places)
            objective = model.problem.objective
            moves = [sum(rewards_of_move(objective, *move)) for move in pairwise(states)]
            losses[robot] = [
                worth[t] - gains[t] - moves[t] - worth[t + 1] for t in range(len(moves))
            ]
            losses[robot][0] += best[k] - worth[0]  # the loss by the choice of a start
    for robot in range(len(paths)):
        for t, loss in enumerate(losses[robot]):
            yield Term("path", loss, step=t, robot=robot)


def _gains(charges: Charges, reward: FloatArray, path: Path, n_places: int) -> list[float]:
    """Returns the priced reward at each step, including charges for the next move [T+1]."""
    gains = []
    for t, state in enumerate(path):
        place = state % n_places
        cost = charges.places.get((t, place), 0.0) + charges.states.get((t, state), 0.0)
        if t + 1 < len(path):
            cost += charges.moves.get((t, place, path[t + 1] % n_places), 0.0)
        gains.append(float(reward[t, state]) - cost)
    return gains


# -- faces and people ---------------------------------------------------------------------


def _view_terms(prices: CertificatePrices, paths: Sequence[Path]) -> Iterator[Term]:
    """Yields the terms of faces and counted people: the excess of credits over rewards at each
    step.
    """
    model, problem = prices.model, prices.model.problem
    weights, paid = problem.view_sum_weights, prices.pixels.constants.copy()
    seen = problem.no_pixels()
    for robot, path in enumerate(paths):
        robot_class = model.class_of[robot]
        table, number = model.coverage(robot_class), robot_class.number
        nodes = np.arange(len(path)) * robot_class.graph.n_states + np.array(path)
        which, entries = table.entries(nodes)
        view_sums, pixels = table.view_sums[entries], table.pixels[entries]
        credits = prices.pixels.paid(number, view_sums, np.array(path)[which], pixels)
        np.add.at(paid, view_sums, weights[view_sums] * credits)
        np.add.at(seen, view_sums, pixels)
    slack = paid - weights * problem.returns.values(seen)
    # number of the face among its actor's faces
    first = np.searchsorted(problem.face_owner, problem.face_owner)
    for view_sum in np.flatnonzero(slack).tolist():
        if view_sum >= problem.returns.n_roots:
            step, person = divmod(view_sum - problem.returns.n_roots, len(problem.actors))
            yield Term(
                "views", float(slack[view_sum]), step=step, actor=person,
                robots=round(seen[view_sum]),
            )  # fmt: skip
            continue
        step, face = divmod(view_sum, model.n_faces)
        yield Term(
            "face",
            float(slack[view_sum]),
            step=None if problem.objective.over_time else step,
            actor=int(problem.face_owner[face]),
            face=face - int(first[face]),
        )


# -- rows and decisions -------------------------------------------------------------------


def _row_terms(
    model: Model,
    certificate: Certificate,
    decisions: Sequence[Decision],
    paths: Sequence[PathCells],
) -> Iterator[Term]:
    """Yields the prices of unused capacity, by row and by decision."""
    if not isinstance(certificate, Multipliers):
        return

    def users_of(resource: Resource) -> tuple[int, ...]:
        return tuple(i for i, path in enumerate(paths) if resource.used_by(model, path))

    for row in certificate.rows:
        if row.multiplier > 0:
            users = users_of(row.resource)
            amount = row.multiplier * (1 - len(users))
            yield Term(
                "row", amount, step=row.resource.t, resource=row.resource,
                sense="at most", robots=1, price=row.multiplier, users=users,
            )  # fmt: skip
    for decision, price in zip(decisions, certificate.decisions, strict=True):
        users = users_of(decision.resource)
        # A closed resource has no price, and nobody in this leaf uses it.
        price = 0.0 if decision.closes else price
        amount = decision.sign * price * (decision.robots - len(users))
        yield Term(
            "decision", amount, step=decision.resource.t, resource=decision.resource,
            sense=decision.sense, robots=decision.robots, price=price, users=users,
        )  # fmt: skip
