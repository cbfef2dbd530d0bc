"""The format of certificate and proof files, and the checks of cuts and trees.

Both are documents (`cocap_opt.files.documents`): JSON with a `format` and a `version`, read
strictly. A certificate holds one set of numbers that bounds J. A proof holds a tree of
decisions, and such numbers at each of its leaves.
"""

import math
from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise
from typing import Literal

import msgspec
import numpy as np
from msgspec import UNSET, UnsetType

from cocap_opt.files.documents import SAMPLED, Document
from cocap_opt.formulations.certificates.envelope import Curve, Cut
from cocap_opt.formulations.certificates.resources import Resource
from cocap_opt.model import Model
from cocap_opt.problem import State

MOST_NODES = 1_000_000
MOST_WORK = 256  # breakpoints of all classes, each counted once per robot of its class
OPTIMISTIC: Literal["optimistic"] = "optimistic"
LARGEST_ROOT = 1e50  # of a curve, far beyond any camera's, and its square is finite

# The numbers of classes in a file count the classes of robots that differ only in their start
# ("alike"), or robots, each of which is a class of its own ("single").
Classes = Literal["alike", "single"]
Table = tuple[tuple[float, ...], ...]  # [T+1][F], or [1][F] where pixels add up over time


class CertificateError(ValueError):
    """A certificate does not fit its problem or is not valid; the message names the field."""


class _Part(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of the parts of a file."""


class Row(_Part, frozen=True):
    """A row "at most one robot uses this resource", by the scene's collision rules."""

    resource: Resource
    multiplier: float  # mu >= 0


class Decision(_Part, frozen=True):
    """A decision: at most, or at least, so many robots use this resource."""

    resource: Resource
    sense: Literal["at most", "at least"]
    robots: int

    @property
    def closes(self) -> bool:
        """True where nobody may use the resource."""
        return self.sense == "at most" and self.robots <= 0

    @property
    def sign(self) -> int:
        """1 where the resource is to be used less, -1 where more."""
        return 1 if self.sense == "at most" else -1


class ClassCurve(_Part, frozen=True):
    """The function phi of one class: linear between breakpoints, of slope 1 after the last."""

    class_number: int = msgspec.field(name="robot_class")
    roots: tuple[float, ...]  # [K] breakpoints > 0, increasing, px^0.5/m
    values: tuple[float, ...]  # [K] phi at them, >= 0

    def check(self, field: str) -> None:
        """Raises CertificateError, which names the field, if the curve is no function."""
        points = (0.0, *self.roots)
        if len(points) < 2 or not all(a < b <= LARGEST_ROOT for a, b in pairwise(points)):
            raise CertificateError(
                f"{field}.roots: must be > 0, <= {LARGEST_ROOT:g} and increasing"
            )
        if len(self.values) != len(self.roots) or not all(
            0 <= value <= LARGEST_ROOT for value in self.values
        ):
            raise CertificateError(
                f"{field}.values: must hold a number 0..{LARGEST_ROOT:g} per root"
            )


class EnvelopeCut(_Part, frozen=True):
    """Functions phi that bound the root of view sum (t, face); the constant is recomputed."""

    t: int
    face: int
    curves: tuple[ClassCurve, ...]  # of classes in increasing order; the others have phi(s) = s
    share: float  # theta, the share of the root that this cut bounds, 0..1

    def check(self, model: Model, field: str) -> None:
        """Raises CertificateError if it has no view sum or class, or its constant takes too long.

        Parameters
        ----------
        field : name of the cut in its file, for the message
        """
        sizes = model.class_sizes
        if not (0 <= self.t <= model.problem.horizon and 0 <= self.face < model.n_faces):
            raise CertificateError(f"{field}: there is no view sum ({self.t}, {self.face})")
        if not 0 <= self.share <= 1:
            raise CertificateError(f"{field}.share: must be 0..1, not {self.share}")
        numbers = (-1, *(curve.class_number for curve in self.curves), len(sizes))
        if not all(a < b for a, b in pairwise(numbers)):
            raise CertificateError(
                f"{field}.curves: robot_class must be increasing, 0..{len(sizes) - 1}"
            )
        for k, curve in enumerate(self.curves):
            curve.check(f"{field}.curves[{k}]")
        if sum(sizes[curve.class_number] * len(curve.roots) for curve in self.curves) > MOST_WORK:
            raise CertificateError(f"{field}.curves: too many roots for so many drones")

    def valid(self, model: Model) -> Cut:
        """Returns the cut with the constant that makes it valid."""
        view_sum = self.t * model.n_faces + self.face
        return _valid(view_sum, self.curves, model.class_sizes)


class Multipliers(_Part, frozen=True, tag="multipliers", omit_defaults=True):
    """Multipliers of view sums, conflict rows, envelope cuts and decisions."""

    alpha: Table
    beta: Table  # m/px^0.5
    rows: tuple[Row, ...] = ()
    cuts: tuple[EnvelopeCut, ...] = ()
    decisions: tuple[float, ...] = ()  # nu >= 0, one per decision on the way to the leaf

    def usable_cuts(self, model: Model) -> list[tuple[Cut, float]]:
        """Returns the cuts with the constants that make them valid, and their shares.

        Raises
        ------
        CertificateError
            If a cut belongs to no view sum, is no function, or its constant takes too long.
        """
        if self.cuts and model.problem.objective.over_time:
            raise CertificateError("certificate.cuts: must be empty where pixels add up over time")
        found = []
        for n, cut in enumerate(self.cuts):
            cut.check(model, f"certificate.cuts[{n}]")
            found.append((cut.valid(model), cut.share))
        return found


class ReferencePixels(_Part, frozen=True, tag="reference"):
    """Pixels at which marginal gains are taken; those of a plan give the online bound."""

    pixels: Table  # px/m2


class StepPayments(_Part, frozen=True, omit_defaults=True):
    """Payments to robots of a class for being in some states at a step, whatever they see."""

    t: int
    class_number: int = msgspec.field(name="robot_class")
    states: tuple[State, ...]
    payments: tuple[float, ...]  # one for each state, in units of J
    others: float = 0.0  # what all other states of the class are paid more than before


class StepConstant(_Part, frozen=True):
    """A claim: no joint state that is left at a step is worth more than its payments and this.

    It takes the place of the sum of the constants of the step's faces, and is checked by search.
    """

    t: int
    constant: float


class Stage(_Part, frozen=True, omit_defaults=True):
    """A stage of a staged certificate; at its end states are closed once more."""

    payments: tuple[StepPayments, ...] = ()  # instead of those by multipliers, from now on
    constants: tuple[StepConstant, ...] = ()


class Staged(_Part, frozen=True, tag="staged", omit_defaults=True):
    """Multipliers, and the stages in which the states of better plans are narrowed down.

    It proves that no plan's J is above the target, or the bound of the plans that are left.
    """

    multipliers: Multipliers
    target: float  # J: plans that are not above it need not be bounded
    stages: tuple[Stage, ...]
    joint_paths: bool = False  # at the end, all sequences of joint states that are left are tried


Certificate = Multipliers | ReferencePixels


class _Claim(Document, frozen=True, kw_only=True):
    """The claim of a file that proves a bound, and the scene that it belongs to."""

    scene: str
    digest: str  # of the problem
    method: str
    classes: Classes = "alike"
    bound: float | None  # None: -infinity, there is no plan

    @property
    def proved(self) -> float:
        """The claimed bound as a number."""
        return -math.inf if self.bound is None else self.bound


class CertificateFile(_Claim, frozen=True, kw_only=True):
    """A certificate with the bound it claims and the digest of its scene."""

    older = SAMPLED
    format: Literal["cocap-opt certificate"] = "cocap-opt certificate"
    version: Literal[4] = 4
    # The coverage that the bound was computed with, where it was not the true one: at the steps
    # that a limit left open, nothing hid anybody. The claim is checked on the true one.
    coverage: Literal["optimistic"] | UnsetType = UNSET
    certificate: Certificate | Staged


class Branch(_Part, frozen=True, tag="branch"):
    """A node of a proof: at most `robots` robots use the resource, or at least one more."""

    resource: Resource
    robots: int
    at_most: int  # number of the node in which at most `robots` use it
    at_least: int  # number of the node in which more do


class Leaf(_Part, frozen=True, tag="leaf"):
    """Multipliers that bound the plans of a leaf."""

    certificate: Multipliers


class ProofFile(_Claim, frozen=True, kw_only=True):
    """A proof with the bound it claims and the digest of its scene."""

    older = SAMPLED
    format: Literal["cocap-opt proof"] = "cocap-opt proof"
    version: Literal[3] = 3
    nodes: tuple[Branch | Leaf, ...]  # the first is the root; children come after their parent

    def leaves(self) -> Iterator[tuple[int, Leaf, tuple[Decision, ...]]]:
        """Yields number and content of each leaf, and the decisions on the way to it.

        Raises
        ------
        CertificateError
            If the nodes are no tree: every node but the first must be the child of exactly
            one branch before it.
        """
        parents = self._parents()
        for n, node in enumerate(self.nodes):
            if isinstance(node, Leaf):
                yield n, node, _way(parents, n)

    def _parents(self) -> list[tuple[int, Decision] | None]:
        """Returns each node's parent, and the decision that leads from there."""
        if not 1 <= len(self.nodes) <= MOST_NODES:
            raise CertificateError(f"nodes: must be 1..{MOST_NODES} nodes")
        parents: list[tuple[int, Decision] | None] = [None] * len(self.nodes)
        for n, node in enumerate(self.nodes):
            if n and parents[n] is None:
                raise CertificateError(f"nodes[{n}]: is the child of no branch before it")
            if isinstance(node, Leaf):
                continue
            sides = (
                (node.at_most, Decision(node.resource, "at most", node.robots)),
                (node.at_least, Decision(node.resource, "at least", node.robots + 1)),
            )
            for child, decision in sides:
                if not n < child < len(self.nodes) or parents[child] is not None:
                    raise CertificateError(f"nodes[{n}]: {child} cannot be its child")
                parents[child] = n, decision
        return parents


def _way(parents: list[tuple[int, Decision] | None], n: int) -> tuple[Decision, ...]:
    """Returns the decisions from the root down to a node."""
    decisions = []
    while (parent := parents[n]) is not None:
        n, decision = parent
        decisions.append(decision)
    return tuple(reversed(decisions))


@lru_cache(maxsize=4096)  # the leaves of a proof share most of their cuts
def _valid(view_sum: int, curves: tuple[ClassCurve, ...], sizes: tuple[int, ...]) -> Cut:
    """Returns a cut with the constant that makes it valid."""
    functions = {
        curve.class_number: Curve(np.array(curve.roots), np.array(curve.values)) for curve in curves
    }
    return Cut.valid(view_sum, functions, sizes)
