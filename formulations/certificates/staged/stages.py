"""Staged certificates: the bound of multipliers, lowered in stages.

A stage replaces prices and constants, and then closes states (`narrowing` has the inequalities).
At the end the joint paths of all robots that are left may be explored (`joint_paths`): those of
plans above the target or above a higher one.
"""

from collections.abc import Callable
from dataclasses import dataclass

from cocap_opt.formulations.certificates.format import (
    CertificateError,
    Stage,
    Staged,
    StepConstant,
    UnfinishedError,
)
from cocap_opt.formulations.certificates.pricing import Pricing
from cocap_opt.formulations.certificates.resources import Visit
from cocap_opt.formulations.certificates.staged.joint_paths import best_plan, may_be_used
from cocap_opt.formulations.certificates.staged.joint_states import JointStates
from cocap_opt.formulations.certificates.staged.narrowing import Narrowing
from cocap_opt.formulations.certificates.staged.search import NotEndedError, most_profitable
from cocap_opt.model import Model
from cocap_opt.stop import Stop, never

MOST_STATES = 3000  # of a step: beyond it, the table of conflicts and the search are too large
MOST_NODES = 100_000_000  # of all searches of a file: a quarter of an hour
LARGEST_PRICE = 1e50  # its square is finite


def price_staged(
    model: Model,
    certificate: Staged,
    stop: Stop = never,
    progress: Callable[[int, int], None] = lambda done, total: None,
    plain: bool = False,
) -> Pricing:
    """Returns the bound that a staged certificate proves.

    Parameters
    ----------
    progress : called with the number of searches of steps that are done, and the total
    plain : use no compiled code, which takes about twenty times as long

    Raises
    ------
    CertificateError
        If a number is out of range, or a state does not exist.
    UnfinishedError
        If the searches take too long.
    LimitReached
        At a limit.
    """
    narrowing = Narrowing.of(model, certificate.multipliers, certificate.target, stop).closed()
    total = sum(len(stage.constants) for stage in certificate.stages)
    searches = _Searches(MOST_NODES, total, stop, progress, plain)
    for n, stage in enumerate(certificate.stages):
        stop.check()
        narrowing = searches.after(stage, narrowing, f"certificate.stages[{n}]")
    nodes = MOST_NODES - searches.nodes_left
    if certificate.paths_above is None:
        return narrowing.pricing._replace(nodes=nodes)
    if not may_be_used(model):
        raise CertificateError(
            "certificate.paths_above: moves are rewarded, or views do not count at step 1"
        )
    higher = narrowing.above(certificate.paths_above)
    try:
        best = best_plan(higher, searches.nodes_left, stop, plain)
        return best.pricing._replace(nodes=nodes + best.nodes)
    except NotEndedError as error:
        raise UnfinishedError(
            "certificate.paths_above: not verified: too many joint states are left to go through "
            "them all; the claim may hold all the same"
        ) from error


@dataclass
class _Searches:
    """The searches of a file, which share a number of nodes.

    Attributes
    ----------
    nodes_left : nodes that they may still use
    total : number of searches
    progress : called with the number of searches that are done, and the total
    done : number of searches that are done
    """

    nodes_left: int
    total: int
    stop: Stop
    progress: Callable[[int, int], None]
    plain: bool
    done: int = 0

    def after(self, stage: Stage, narrowing: Narrowing, field: str) -> Narrowing:
        """Returns the narrowing after a stage, which is checked first."""
        _check(narrowing.model, stage, field)

        def most_profit(k: int, joint: JointStates) -> float:
            return self._most_profit(joint, stage.constants[k], f"{field}.constants[{k}]")

        return narrowing.after(stage, most_profit, field, MOST_STATES)

    def _most_profit(self, joint: JointStates, claim: StepConstant, field: str) -> float:
        """Returns the largest profit of joint states, or the claimed constant if it is larger.

        Parameters
        ----------
        field : name of the claim in its file, for the message
        """
        self.stop.check()
        try:
            found = most_profitable(joint, claim.constant, self.nodes_left, self.stop, self.plain)
        except NotEndedError as error:
            raise UnfinishedError(
                f"{field}: not verified: the searches of the file do not end within {MOST_NODES:,} "
                "nodes in all; the claim may hold all the same"
            ) from error
        self.nodes_left -= found.nodes
        self.done += 1
        self.progress(self.done, self.total)
        return found.profit


def _check(model: Model, stage: Stage, field: str) -> None:
    """Refuses steps, classes and states that do not exist, and values that are not numbers."""
    problem = model.problem
    for k, step in enumerate(stage.prices):
        name = f"{field}.payments[{k}]"
        _check_step(model, step.t, name)
        if not 0 <= step.class_number < len(model.classes):
            raise CertificateError(
                f"{name}.robot_class: must be 0..{len(model.classes) - 1}, not {step.class_number}"
            )
        if len(step.prices) != len(step.states):
            raise CertificateError(f"{name}.payments: must hold a number for each state")
        if not all(abs(price) <= LARGEST_PRICE for price in step.prices):
            raise CertificateError(
                f"{name}.payments: must be -{LARGEST_PRICE:g}..{LARGEST_PRICE:g}"
            )
        if not abs(step.others) <= LARGEST_PRICE:
            raise CertificateError(f"{name}.others: must be finite")
        for state in step.states:
            if wrong := Visit(step.t, state, step.class_number).why_absent(model):
                raise CertificateError(f"{name}.{wrong}")
    for k, claim in enumerate(stage.constants):
        _check_step(model, claim.t, f"{field}.constants[{k}]")
        if not abs(claim.constant) <= LARGEST_PRICE * len(problem.robots):
            raise CertificateError(f"{field}.constants[{k}].constant: must be finite")


def _check_step(model: Model, t: int, field: str) -> None:
    """Refuses a step at which no view counts."""
    first, last = model.problem.first_step, model.problem.horizon
    if not first <= t <= last:
        raise CertificateError(f"{field}.t: must be {first}..{last}, not {t}")
