"""Staged certificates: the bound of multipliers, lowered in stages.

A stage replaces payments and constants, and then closes states (`narrowing` has the inequalities).
At the end the paths of all robots together that are left may be tried (`joint_paths`), those of
plans above the target or a higher one.
"""

import math
from collections.abc import Callable
from itertools import count

from cocap_opt.data import IntArray
from cocap_opt.formulations.certificates.format import (
    CertificateError,
    Stage,
    Staged,
    UnfinishedError,
)
from cocap_opt.formulations.certificates.pricing import Pricing
from cocap_opt.formulations.certificates.resources import Visit
from cocap_opt.formulations.certificates.staged.joint_paths import best_plan, may_be_used
from cocap_opt.formulations.certificates.staged.joint_states import NotEndedError, Wanted
from cocap_opt.formulations.certificates.staged.narrowing import Narrowing
from cocap_opt.model import Model
from cocap_opt.stop import Stop, never

MOST_STATES = 3000  # of a step: beyond it, the table of conflicts and the search are too large
MOST_NODES = 1_000_000_000  # of all searches of a file: a quarter of an hour
LARGEST_PAYMENT = 1e50  # its square is finite


def price_staged(
    model: Model,
    certificate: Staged,
    stop: Stop = never,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Pricing:
    """Returns the bound that a staged certificate proves.

    Parameters
    ----------
    progress : told how many searches of steps are done, and of how many

    Raises
    ------
    CertificateError
        If a number is out of range, or a state is none.
    UnfinishedError
        If the searches take too long.
    LimitReached
        At a limit.
    """
    narrowing = Narrowing(model, certificate.multipliers, certificate.target, stop)
    narrowing.close_states()
    nodes = MOST_NODES
    searches = count(1)
    total = sum(len(stage.constants) for stage in certificate.stages)
    for n, stage in enumerate(certificate.stages):
        stop.check()
        nodes = _apply(
            narrowing, stage, f"certificate.stages[{n}]", nodes, stop,
            lambda: progress(next(searches), total),
        )  # fmt: skip
    if certificate.paths_above is None:
        return narrowing.pricing
    if not may_be_used(model):
        raise CertificateError(
            "certificate.paths_above: moves are rewarded, or views do not count at step 1"
        )
    higher = narrowing.above(certificate.paths_above)
    try:
        best = best_plan(higher, nodes, stop)
    except NotEndedError as error:
        raise UnfinishedError(
            "certificate.paths_above: not verified: too many joint states are left to go through "
            "them all; the claim may hold all the same"
        ) from error
    return higher.pricing_of(best.value)


def _apply(
    narrowing: Narrowing, stage: Stage, field: str, nodes: int, stop: Stop, tell: Callable[[], None]
) -> int:
    """Replaces the payments and constants of a stage, and closes states.

    Returns how many nodes searches may still go through, of those there were.
    """
    _check(narrowing.model, stage, field)
    for payments in stage.payments:
        narrowing.pay(payments)
    if stage.payments:
        narrowing.price()
    for k, step in enumerate(stage.constants):
        stop.check()
        name = f"{field}.constants[{k}]"
        states = _few_states(narrowing, step.t, name, step.constant)
        joint = narrowing.joint_states_of(step.t, states)
        try:
            nodes -= narrowing.lower(joint, Wanted(step.constant, nodes), stop).nodes
        except NotEndedError as error:
            raise UnfinishedError(
                f"{name}: not verified: the searches of the file do not end within {MOST_NODES:,} "
                "nodes in all; the claim may hold all the same"
            ) from error
        tell()
    if not math.isfinite(narrowing.rounding):
        raise CertificateError(f"{field}: a step has payments but no constant, or too large ones")
    narrowing.close_states()
    return nodes


def _few_states(narrowing: Narrowing, t: int, field: str, above: float) -> list[IntArray]:
    """Returns the states to search at a step, class by class; refuses where too many are left.

    Parameters
    ----------
    field : name of the step's constant in its file, for the message
    above : states are missing that are in no joint state higher than this
    """
    states = narrowing.states_of_joint(t, above)
    if (left := sum(map(len, states))) > MOST_STATES:
        raise CertificateError(
            f"{field}: {left:,} states are left at step {t}; "
            f"at most {MOST_STATES:,} can be searched"
        )
    return states


def _check(model: Model, stage: Stage, field: str) -> None:
    """Refuses steps, classes and states that do not exist, and numbers that are none."""
    problem = model.problem
    for k, payments in enumerate(stage.payments):
        name = f"{field}.payments[{k}]"
        _check_step(model, payments.t, name)
        if not 0 <= payments.class_number < len(model.classes):
            raise CertificateError(
                f"{name}.robot_class: must be 0..{len(model.classes) - 1}, "
                f"not {payments.class_number}"
            )
        if len(payments.payments) != len(payments.states):
            raise CertificateError(f"{name}.payments: must hold a number for each state")
        if not all(abs(payment) <= LARGEST_PAYMENT for payment in payments.payments):
            raise CertificateError(
                f"{name}.payments: must be -{LARGEST_PAYMENT:g}..{LARGEST_PAYMENT:g}"
            )
        if not abs(payments.others) <= LARGEST_PAYMENT:
            raise CertificateError(f"{name}.others: must be finite")
        for state in payments.states:
            if wrong := Visit(payments.t, state, payments.class_number).why_absent(model):
                raise CertificateError(f"{name}.{wrong}")
    for k, step in enumerate(stage.constants):
        _check_step(model, step.t, f"{field}.constants[{k}]")
        if not abs(step.constant) <= LARGEST_PAYMENT * len(problem.robots):
            raise CertificateError(f"{field}.constants[{k}].constant: must be finite")


def _check_step(model: Model, t: int, field: str) -> None:
    """Refuses a step at which no view counts."""
    first, last = model.problem.first_step, model.problem.horizon
    if not first <= t <= last:
        raise CertificateError(f"{field}.t: must be {first}..{last}, not {t}")
