"""Staged certificates: the bound of multipliers, lowered in stages.

A stage replaces prices and constants, and then closes states (`narrowing` has the inequalities).
At the end the paths of all robots together that are left may be explored (`joint_paths`), those of
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
from cocap_opt.formulations.certificates.staged.narrowing import Narrowing
from cocap_opt.formulations.certificates.staged.search import NotEndedError, most_profitable
from cocap_opt.model import Model
from cocap_opt.stop import Stop, never

MOST_STATES = 3000  # of a step: beyond it, the table of conflicts and the search are too large
MOST_NODES = 1_000_000_000  # of all searches of a file: a quarter of an hour
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
    progress : told how many searches of steps are done, and of how many
    plain : use no compiled code, which takes about twenty times as long

    Raises
    ------
    CertificateError
        If a number is out of range, or a state is none.
    UnfinishedError
        If the searches take too long.
    LimitReached
        At a limit.
    """
    narrowing = Narrowing.of(model, certificate.multipliers, certificate.target, stop).closed()
    nodes = MOST_NODES
    searches = count(1)
    total = sum(len(stage.constants) for stage in certificate.stages)
    for n, stage in enumerate(certificate.stages):
        stop.check()
        narrowing, nodes = _after(
            narrowing, stage, f"certificate.stages[{n}]", nodes, stop, plain,
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
        best = best_plan(higher, nodes, stop, plain)
    except NotEndedError as error:
        raise UnfinishedError(
            "certificate.paths_above: not verified: too many joint states are left to go through "
            "them all; the claim may hold all the same"
        ) from error
    return higher.pricing_of(best.value)


def _after(
    narrowing: Narrowing, stage: Stage, field: str, nodes: int, stop: Stop, plain: bool,
    tell: Callable[[], None],
) -> tuple[Narrowing, int]:  # fmt: skip
    """Returns the narrowing after a stage, and how many of the nodes its searches have left.

    The stage replaces prices and constants, and closes states.
    """
    _check(narrowing.model, stage, field)
    narrowing = narrowing.repriced(stage.prices)
    for k, step in enumerate(stage.constants):
        stop.check()
        name = f"{field}.constants[{k}]"
        states = _few_states(narrowing, step.t, name, step.constant)
        joint = narrowing.joint_states_of(step.t, states)
        try:
            found = most_profitable(joint, step.constant, nodes, stop, plain)
        except NotEndedError as error:
            raise UnfinishedError(
                f"{name}: not verified: the searches of the file do not end within {MOST_NODES:,} "
                "nodes in all; the claim may hold all the same"
            ) from error
        nodes -= found.nodes
        narrowing = narrowing.lowered(joint, found.profit)
        tell()
    if not math.isfinite(narrowing.rounding):
        raise CertificateError(f"{field}: a step has payments but no constant, or too large ones")
    return narrowing.closed(), nodes


def _few_states(narrowing: Narrowing, t: int, field: str, above: float) -> list[IntArray]:
    """Returns the states to search at a step, class by class; refuses where too many are left.

    Parameters
    ----------
    field : name of the step's constant in its file, for the message
    above : states are missing that are in no joint state of more profit than this
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
