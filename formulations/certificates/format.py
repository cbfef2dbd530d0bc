"""The format of certificate and proof files, and the checks of cuts and trees.

Both are documents (`cocap_opt.files.documents`): JSON with a `format` and a `version`, read
strictly. A certificate contains one set of numbers that bounds J. A proof contains a tree of
decisions, and such numbers at each of its leaves.
"""

import math
from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise
from typing import ClassVar, Literal, Self

import msgspec
import numpy as np
from msgspec import UNSET, UnsetType

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.files.documents import SAMPLED, Document
from cocap_opt.formulations.certificates.envelope import Curve, Cut
from cocap_opt.formulations.certificates.resources import Resource, Visit
from cocap_opt.formulations.certificates.state_cuts import CutByStates, ListedStates
from cocap_opt.model import Model
from cocap_opt.problem import Objective, Problem, State
from cocap_opt.stop import Stop, never

MOST_NODES = 1_000_000
MOST_WORK = 256  # breakpoints of all classes, each counted once per robot of its class
OPTIMISTIC: Literal["optimistic"] = "optimistic"
MOST_STATES = 1000  # states of one class in a state cut
LARGEST_ROOT = 1e50  # px^0.5/m, far more than any camera gives; its square is finite

# Class numbers in a file refer either to classes of robots that differ only in their start
# ("alike"), or to robots, each of which forms its own class ("single").
Classes = Literal["alike", "single"]
# [T+1][F], or [1][F] if pixels add up over time; for counted people [T+1][A].
Table = tuple[tuple[float, ...], ...]


class CertificateError(ValueError):
    """A certificate does not fit its problem or is not valid; the message names the field."""


class UnfinishedError(CertificateError):
    """Verification reached its limit of work or time; the claim may still hold."""


class _Part(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of the parts of a file."""


class Row(_Part, frozen=True):
    """A row "at most one robot uses this resource", which follows from the scene's collision rules.

    Attributes
    ----------
    resource : the resource that at most one robot may use, by the scene's collision rules
    multiplier : mu >= 0, added to the bound and charged to each user; in units of J
    """

    resource: Resource
    multiplier: float


class Decision(_Part, frozen=True):
    """A decision: at most, or at least, a number of robots use this resource."""

    resource: Resource
    sense: Literal["at most", "at least"]
    robots: int

    @property
    def closes(self) -> bool:
        """True if no robot may use the resource."""
        return self.sense == "at most" and self.robots <= 0

    @property
    def sign(self) -> int:
        """1 if the decision limits the use of the resource, -1 if it requires it."""
        return 1 if self.sense == "at most" else -1


class ClassCurve(_Part, frozen=True):
    """The function phi of one class: linear between breakpoints, with slope 1 beyond the last.

    Attributes
    ----------
    robot_class : number of the class, from 0
    roots : [K] breakpoints > 0, increasing, px^0.5/m; phi(0) = 0, and phi is straight from
        0 to the first and from each to the next
    values : [K] phi at them, >= 0
    """

    class_number: int = msgspec.field(name="robot_class")
    roots: tuple[float, ...]
    values: tuple[float, ...]

    def check(self, field: str) -> None:
        """Raises CertificateError, naming the field, if the curve is not a function."""
        points = (0.0, *self.roots)
        if len(points) < 2 or not all(a < b <= LARGEST_ROOT for a, b in pairwise(points)):
            raise CertificateError(
                f"{field}.roots: must be > 0, <= {LARGEST_ROOT:g} and increasing"
            )
        if len(self.values) != len(self.roots) or not all(
            0 <= value <= LARGEST_ROOT for value in self.values
        ):
            raise CertificateError(
                f"{field}.values: must contain a number 0..{LARGEST_ROOT:g} per root"
            )


class EnvelopeCut(_Part, frozen=True):
    """Functions phi that bound the root of view sum (t, face); the checker recomputes the constant.

    Attributes
    ----------
    t : step
    face : number of the face, 0 to F-1, in the order of alpha
    curves : phi of classes, in increasing order; all other classes have phi(s) = s
    share : theta, 0..1: the share of the root that this cut bounds; alpha and beta bound the rest,
        1 minus the shares of all cuts of the view sum
    """

    t: int
    face: int
    curves: tuple[ClassCurve, ...]
    share: float

    def check(self, model: Model, field: str) -> None:
        """Raises CertificateError if the view sum or a class does not exist, or if computing the
        constant would take too long.

        Parameters
        ----------
        field : name of the cut in its file, for the message
        """
        sizes = model.class_sizes
        _check_view_sum(model, self.t, self.face, self.share, field)
        numbers = (-1, *(curve.class_number for curve in self.curves), len(sizes))
        if not all(a < b for a, b in pairwise(numbers)):
            raise CertificateError(
                f"{field}.curves: robot_class must be increasing, 0..{len(sizes) - 1}"
            )
        for k, curve in enumerate(self.curves):
            curve.check(f"{field}.curves[{k}]")
        if sum(sizes[curve.class_number] * len(curve.roots) for curve in self.curves) > MOST_WORK:
            raise CertificateError(f"{field}.curves: too many roots for this number of drones")

    def valid(self, model: Model) -> Cut:
        """Returns the cut with the constant that makes it valid."""
        view_sum = self.t * model.n_faces + self.face
        return _valid(view_sum, self.curves, model.class_sizes)


class ClassPayments(_Part, frozen=True):
    """phi at some states of one class.

    Attributes
    ----------
    robot_class : number of the class, from 0
    states : [n] distinct states (x, y, layer, heading, pitch), in any order; the layer is the
        number of the height among those of the class. States that no robot can reach, or that see
        nothing of the face, have no effect
    values : [n] phi at them, >= 0, px^0.5/m
    """

    class_number: int = msgspec.field(name="robot_class")
    states: tuple[State, ...]
    values: tuple[float, ...]

    def check(self, model: Model, t: int, field: str) -> None:
        """Raises CertificateError, naming the field, if a state does not exist, or a value is
        wrong.
        """
        if not 0 < len(self.states) <= MOST_STATES:
            raise CertificateError(f"{field}.states: must be 1..{MOST_STATES} states")
        for state in self.states:
            if wrong := Visit(t, state, self.class_number).why_absent(model):
                raise CertificateError(f"{field}.states: {wrong}")
        if len(set(self.states)) < len(self.states):
            raise CertificateError(f"{field}.states: must be distinct")
        if len(self.values) != len(self.states) or not all(
            0 <= value <= LARGEST_ROOT for value in self.values
        ):
            raise CertificateError(
                f"{field}.values: must contain a number 0..{LARGEST_ROOT:g} per state"
            )

    def valid(self, model: Model, view_sum: int) -> ListedStates:
        """Returns phi by state numbers."""
        numbers = model.classes[self.class_number].graph.indices(np.array(self.states))
        values = np.array(self.values)
        return ListedStates.of(model, self.class_number, view_sum, numbers, values)


class StateCut(_Part, frozen=True):
    """Numbers phi of states that bound the root of view sum (t, face), as no two robots are in one
    cell; the checker recomputes the constant.

    Attributes
    ----------
    t : step
    face : number of the face, 0 to F-1, in the order of alpha
    payments : phi of states, by class in increasing order
    slope : m/px^0.5, > 0; in all other states, phi is the root s of the robot's pixels or slope
        s^2, whichever is smaller
    share : theta, 0..1: the share of the root that this cut bounds; alpha and beta bound the rest,
        1 minus the shares of all cuts of the view sum
    """

    t: int
    face: int
    payments: tuple[ClassPayments, ...]
    slope: float
    share: float

    def check(self, model: Model, field: str) -> None:
        """Raises CertificateError if the view sum, a class or a state does not exist.

        Parameters
        ----------
        field : name of the cut in its file, for the message
        """
        _check_view_sum(model, self.t, self.face, self.share, field)
        if not 1 / LARGEST_ROOT <= self.slope <= LARGEST_ROOT:
            allowed = f"{1 / LARGEST_ROOT:g}..{LARGEST_ROOT:g}"
            raise CertificateError(f"{field}.slope: must be {allowed}, not {self.slope}")
        numbers = (-1, *(paid.class_number for paid in self.payments), len(model.classes))
        if not all(a < b for a, b in pairwise(numbers)):
            raise CertificateError(
                f"{field}.payments: robot_class must be increasing, 0..{len(model.classes) - 1}"
            )
        for k, paid in enumerate(self.payments):
            paid.check(model, self.t, f"{field}.payments[{k}]")

    def valid(self, model: Model, stop: Stop = never) -> CutByStates:
        """Returns the cut with the constant that makes it valid; raises LimitReached."""
        view_sum = self.t * model.n_faces + self.face
        listed = {paid.class_number: paid.valid(model, view_sum) for paid in self.payments}
        return CutByStates.valid(model, view_sum, self.slope, listed, stop)


class Multipliers(_Part, frozen=True, tag="multipliers", omit_defaults=True):
    """Multipliers of view sums, conflict rows, cuts and decisions.

    Attributes
    ----------
    type : `multipliers`
    alpha : [T+1][F] >= 0, price of the root of a robot's pixels; one row per step from 0 to T, with
        one number per face: actors in order, the faces of each in order (for a box: front, left,
        back, right, top). A single row [1][F] if pixels add up over time
    beta : same shape, >= 0, price of the pixels, m/px^0.5; for faces that count and can be seen,
        must be > 0 if alpha is less than the share of the root that cuts leave (1 without cuts)
    rows : rows of the scene's rules that have a price
    cuts : envelope cuts; empty if pixels add up over time
    state_cuts : state cuts; empty if pixels add up over time, or if robots may share a cell
    decisions : nu >= 0, one per decision on the way from the root of a proof down to the leaf;
        empty in a certificate. "At most n" adds nu n to the bound and charges each user nu, "at
        least n" subtracts nu n from the bound and credits each user with nu; it is ignored for "at
        most 0"
    views : [T+1][A] >= 0, price of a drone that sees a person, before its weight; only in scenes
        that count such drones
    """

    alpha: Table
    beta: Table
    rows: tuple[Row, ...] = ()
    cuts: tuple[EnvelopeCut, ...] = ()
    state_cuts: tuple[StateCut, ...] = ()
    decisions: tuple[float, ...] = ()
    views: Table = ()

    def usable_cuts(self, model: Model, stop: Stop = never) -> list[tuple[Cut, float]]:
        """Returns the cuts, each with the constant that makes it valid, and their shares.

        Raises
        ------
        CertificateError
            If a cut belongs to no view sum, is not a function, or its constant takes too long.
        LimitReached
            Between two cuts.
        """
        if self.cuts and model.problem.objective.over_time:
            raise CertificateError("certificate.cuts: must be empty if pixels add up over time")
        found = []
        for n, cut in enumerate(self.cuts):
            stop.check()
            cut.check(model, f"certificate.cuts[{n}]")
            found.append((cut.valid(model), cut.share))
        return found

    def usable_state_cuts(
        self, model: Model, stop: Stop = never
    ) -> list[tuple[CutByStates, float]]:
        """Returns the state cuts, each with the constant that makes it valid, and their shares.

        Raises
        ------
        CertificateError
            If a cut belongs to no view sum, a state does not exist, or the scene allows none.
        LimitReached
            If a limit is reached.
        """
        if self.state_cuts and (
            model.problem.objective.over_time or not model.problem.rules.vertex
        ):
            raise CertificateError(
                "certificate.state_cuts: must be empty if pixels add up over time, or if robots "
                "may share a cell"
            )
        found = []
        for n, cut in enumerate(self.state_cuts):
            stop.check()
            cut.check(model, f"certificate.state_cuts[{n}]")
            found.append((cut.valid(model, stop), cut.share))
        return found


class ReferencePixels(_Part, frozen=True, tag="reference", omit_defaults=True):
    """Pixels at which marginal gains are taken; the pixels of a plan give the online bound.

    Attributes
    ----------
    type : `reference`
    pixels : [T+1][F] px/m2, steps and faces as in alpha
    views : [T+1][A] >= 0, number of drones that see each person; only in scenes that count them
    """

    pixels: Table
    views: Table = ()


def tables_of(problem: Problem, values: FloatArray) -> tuple[Table, Table]:
    """Returns values of view sums [Z] as two tables of a file: one for faces, one for counted
    people.
    """
    n = problem.returns.n_roots
    faces = _table(values[:n].reshape(problem.view_sum_steps, -1))
    if len(values) == n:
        return faces, ()
    return faces, _table(values[n:].reshape(problem.horizon + 1, -1))


def _table(values: FloatArray) -> Table:
    return tuple(map(tuple, values.tolist()))


class StepPrices(_Part, frozen=True, omit_defaults=True):
    """Prices of some states at a step: credits that a class's robots receive for visiting them.

    Attributes
    ----------
    t : step
    robot_class : number of the class, from 0
    states : states with a new price
    payments : the new price of each of these states, in units of J; may be < 0
    others : amount by which the prices of all other states of the class rise
    """

    t: int
    class_number: int = msgspec.field(name="robot_class")
    states: tuple[State, ...]
    prices: tuple[float, ...] = msgspec.field(name="payments")
    others: float = 0.0


class StepConstant(_Part, frozen=True):
    """A claim that no remaining joint state of a step has a larger reduced profit than this.

    The constant replaces the sum of the constants of the step's faces, and is checked by a search.

    Attributes
    ----------
    t : step
    constant : K, in units of J
    """

    t: int
    constant: float


class MoveConstant(_Part, frozen=True):
    """A claim that no remaining move of the team between two steps has a larger reduced profit.

    The reduced profit of a move is that of its two joint states together. The constant replaces the
    sum of the constants of both steps if it is smaller, and is checked by a search. It holds until
    a stage sets new prices at one of the two steps, or a constant of a move that begins one step
    earlier or later.

    Attributes
    ----------
    t : the first of the two steps
    constant : K, in units of J
    """

    t: int
    constant: float


class Stage(_Part, frozen=True, omit_defaults=True):
    """A stage of a staged certificate; at its end, further states are closed.

    Attributes
    ----------
    payments : prices of states that replace earlier ones from this stage on
    constants : constants of steps; a step with new prices needs one
    moves : constants of moves between two steps, at the prices and constants of this stage
    """

    prices: tuple[StepPrices, ...] = msgspec.field(default=(), name="payments")
    constants: tuple[StepConstant, ...] = ()
    moves: tuple[MoveConstant, ...] = ()


class Tail(_Part, frozen=True):
    """A loss at the end of plans: how far all plans above the target fall short of the bound, at
    the latest steps alone.

    Attributes
    ----------
    t : step, 0..T, at which the tail begins; it ends with the last step
    loss : J that every plan above the target loses from that step on
    """

    t: int
    loss: float


class Staged(_Part, frozen=True, tag="staged", omit_defaults=True):
    """Multipliers, and the stages that narrow down the states of better plans.

    It proves that no plan's J is above the target or, if higher, the bound of the remaining plans.

    Attributes
    ----------
    type : `staged`
    multipliers : multipliers before the first stage
    target : J; only plans above it are bounded
    stages : in their order
    paths_above : J >= target: at the end, the joint paths of all robots in plans above this number
        are explored, and the bound is this number or the largest J among them; null: no paths are
        explored
    paths_from : step, 1..T, at which that begins: paths are explored from there to the end, and
        then back to the start; null: from the start
    tails : losses of ever longer tails, proved one after the other; together with paths_above none
    """

    multipliers: Multipliers
    target: float
    stages: tuple[Stage, ...]
    paths_above: float | None = None
    paths_from: int | None = None
    tails: tuple[Tail, ...] = ()


Certificate = Multipliers | ReferencePixels


class _Claim(Document, frozen=True, kw_only=True):
    """The claim of a file that proves a bound, and the scene to which the claim belongs."""

    scene: str
    digest: str  # digest of the problem
    method: str
    classes: Classes = "alike"
    coverage_version: int | None = None
    instance: str | UnsetType = UNSET
    objective: Objective | UnsetType = UNSET
    bound: float | None  # None: -inf, there is no plan

    def problem_of(self, scene: Problem) -> Problem:
        """Returns the problem that the file bounds: the scene, possibly with another objective.

        Raises
        ------
        CertificateError
            If the objective names people who are not in the scene.
        """
        if isinstance(self.objective, UnsetType) or self.objective == scene.objective:
            return scene  # the same object, whose digest is cached
        try:
            return scene.replace(objective=self.objective)
        except ProblemError as error:
            raise CertificateError(f"objective: does not fit the scene; {error}") from error

    def of_instance(self, digest: str) -> Self:
        """Returns the file with the digest of the instance from which it was computed."""
        return msgspec.structs.replace(self, instance=digest)

    def with_objective(self, objective: Objective) -> Self:
        """Returns the file with the objective of its bound added."""
        return msgspec.structs.replace(self, objective=objective)

    @property
    def proved(self) -> float:
        """The claimed bound as a number."""
        return -math.inf if self.bound is None else self.bound


class CertificateFile(_Claim, frozen=True, kw_only=True):
    """A certificate with the bound that it claims and the digest of its scene.

    Attributes
    ----------
    format, version : kind and version of the file
    scene : name of the scene
    digest : digest of the problem; it depends on every number of the scene
    method : name of the method that found the numbers, for information only
    classes : meaning of class numbers. `alike`: classes of robots that differ only in their start,
        in the order of their first robots; `single`: each robot is a class
    coverage_version : version of the formula for pixels; null: not recorded
    instance : SHA-256 of the instance that `export` writes for the problem, whose coverage was
        used; omitted: not recorded, or coverage was incomplete
    objective : the complete objective of the bound; omitted: the scene's objective. `digest` is the
        digest of the scene with this objective
    bound : the claimed J that no plan exceeds; null: there is no plan
    coverage : `optimistic` if a limit interrupted the computation of coverage: the bound then
        assumes that nothing hides anybody at the missing steps. The claim is checked on true
        coverage
    certificate : the numbers that prove the bound
    """

    older = SAMPLED
    kind: ClassVar[str] = "certificate"
    format: Literal["cocap-opt certificate"] = "cocap-opt certificate"
    version: Literal[4, 5, 6, 7, 8] = 8
    coverage: Literal["optimistic"] | UnsetType = UNSET
    certificate: Certificate | Staged

    @property
    def numbers(self) -> str:
        """The word for the numbers that prove the bound, for messages."""
        return "stages" if isinstance(self.certificate, Staged) else "multipliers"

    @property
    def proof(self) -> str:
        """The kind of proof in words: numbers only, or numbers and searches to repeat."""
        if isinstance(self.certificate, ReferencePixels):
            return "reference pixels, no search"
        is_staged = isinstance(self.certificate, Staged)
        return "searched, in stages" if is_staged else "multipliers, no search"


class Branch(_Part, frozen=True, tag="branch"):
    """A node of a proof that distinguishes two cases: at most `robots` robots use the resource, or
    more.

    Attributes
    ----------
    type : `branch`
    resource : the resource that the robots use
    robots : n, 0..R
    at_most : number of the node in which at most n robots use the resource
    at_least : number of the node in which at least n + 1 do
    """

    resource: Resource
    robots: int
    at_most: int
    at_least: int


class Leaf(_Part, frozen=True, tag="leaf"):
    """Multipliers that bound the plans of a leaf.

    Attributes
    ----------
    type : `leaf`
    certificate : the multipliers; `decisions` has one number per branch on the way from the root
    """

    certificate: Multipliers


class ProofFile(_Claim, frozen=True, kw_only=True):
    """A proof with the bound that it claims and the digest of its scene.

    Attributes
    ----------
    format, version : kind and version of the file
    scene : name of the scene
    digest : digest of the problem; it depends on every number of the scene
    method : name of the method that found the numbers, for information only
    classes : meaning of class numbers. `alike`: classes of robots that differ only in their start,
        in the order of their first robots; `single`: each robot is a class
    coverage_version : version of the formula for pixels; null: not recorded
    instance : SHA-256 of the instance that `export` writes for the problem, whose coverage was
        used; omitted: not recorded, or coverage was incomplete
    objective : the complete objective of the bound; omitted: the scene's objective. `digest` is the
        digest of the scene with this objective
    bound : the claimed J that no plan exceeds; null: there is no plan
    nodes : nodes of the tree; the first is the root, and each other node follows its only parent
    """

    older = SAMPLED
    format: Literal["cocap-opt proof"] = "cocap-opt proof"
    version: Literal[3, 4, 5, 6] = 6
    nodes: tuple[Branch | Leaf, ...]

    kind: ClassVar[str] = "proof"
    numbers: ClassVar[str] = "leaves"

    @property
    def proof(self) -> str:
        """The kind of proof in words."""
        leaves = sum(isinstance(node, Leaf) for node in self.nodes)
        of_tree = "" if leaves == 1 else f" at {leaves:,} leaves of a tree"
        return f"multipliers{of_tree}, no search"

    def leaves(self) -> Iterator[tuple[int, Leaf, tuple[Decision, ...]]]:
        """Yields the number and the content of each leaf, with the decisions on the way to it.

        Raises
        ------
        CertificateError
            If the nodes do not form a tree: every node except the first must be the child of
            exactly one earlier branch.
        """
        parents = self._parents()
        for n, node in enumerate(self.nodes):
            if isinstance(node, Leaf):
                yield n, node, _way(parents, n)

    def _parents(self) -> list[tuple[int, Decision] | None]:
        """Returns each node's parent, and the decision that leads from there."""
        if not 1 <= len(self.nodes) <= MOST_NODES:
            raise CertificateError(f"nodes: must be 1..{MOST_NODES} nodes, not {len(self.nodes)}")
        parents: list[tuple[int, Decision] | None] = [None] * len(self.nodes)
        for n, node in enumerate(self.nodes):
            if n and parents[n] is None:
                raise CertificateError(f"nodes[{n}]: is not the child of an earlier branch")
            if isinstance(node, Leaf):
                continue
            sides = (
                (node.at_most, Decision(node.resource, "at most", node.robots)),
                (node.at_least, Decision(node.resource, "at least", node.robots + 1)),
            )
            for child, decision in sides:
                if not n < child < len(self.nodes) or parents[child] is not None:
                    raise CertificateError(f"nodes[{n}]: {child} cannot be a child of this node")
                parents[child] = n, decision
        return parents


def _way(parents: list[tuple[int, Decision] | None], n: int) -> tuple[Decision, ...]:
    """Returns the decisions from the root down to a node."""
    decisions = []
    while (parent := parents[n]) is not None:
        n, decision = parent
        decisions.append(decision)
    return tuple(reversed(decisions))


def _check_view_sum(model: Model, t: int, face: int, share: float, field: str) -> None:
    """Raises CertificateError if a cut's view sum does not exist, or its share is wrong."""
    if not (0 <= t <= model.problem.horizon and 0 <= face < model.n_faces):
        raise CertificateError(f"{field}: there is no view sum ({t}, {face})")
    if not 0 <= share <= 1:
        raise CertificateError(f"{field}.share: must be 0..1, not {share}")


@lru_cache(maxsize=4096)  # the leaves of a proof share most of their cuts
def _valid(view_sum: int, curves: tuple[ClassCurve, ...], sizes: tuple[int, ...]) -> Cut:
    """Returns a cut with the constant that makes it valid."""
    functions = {
        curve.class_number: Curve(np.array(curve.roots), np.array(curve.values)) for curve in curves
    }
    return Cut.valid(view_sum, functions, sizes)
