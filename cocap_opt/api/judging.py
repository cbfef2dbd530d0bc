"""Public functions that check plans, certificates and proofs independently of what made them."""

from collections.abc import Sequence
from math import inf

from cocap_opt.api.arguments import (
    Bound,
    bound_in,
    plan_for,
    plan_of,
    require,
    require_flag,
    require_made_for,
    require_number,
    require_problem,
)
from cocap_opt.formulations.certificates.format import CertificateFile, ProofFile
from cocap_opt.model import Model
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import Verdict
from cocap_opt.referee import check as judge_plan
from cocap_opt.result import Reason, Result
from cocap_opt.run.judged import below_certificate
from cocap_opt.run.verified import ProvedBound, Verified
from cocap_opt.run.view_share import proved_in


def check(problem: Problem, plan: Plan | Result | None) -> Verdict:
    """Check a plan with the referee: whether it can be flown, which rules it breaks, and its J.

    The referee trusts no planner: it recomputes everything in slow, simple loops.

    Parameters
    ----------
    problem : the problem that the plan is for
    plan : a plan, or a result that has one; None, the plan of a result without one, is refused

    Returns
    -------
    Verdict
        With `valid`, `violations` and `conflicts` in words, and J in `reward`.

    Raises
    ------
    ValueError
        If the result has no plan, or the plan's file says that it is for another problem.

    Examples
    --------
    >>> co.check(problem, result).conflicts
    """
    return judge_plan(problem, plan_for(problem, plan, "checked"))


def verify(
    problem: Problem,
    *claims: Plan | Result | Bound | None,
    second_opinion: bool = False,
    plain: bool = False,
) -> Verified:
    """Independently verify plans, certificates and proofs, without a solver.

    Parameters
    ----------
    problem : the problem that the claims are about
    claims : plans, certificates, proofs or results to check, with at most one plan among them; of a
        result, its plan, value, bound and certificate are checked
    second_opinion : compute bounds a second time with independent code, which takes much longer:
        with networkx, or with cocap-check if a certificate is staged
    plain : use no code that is compiled by numba; staged certificates then take about twenty times
        as long, other files the same time

    Returns
    -------
    Verified
        With J in `reward`, the lowest proved `bound`, the `gap` between them, `is_optimal`, and
        `plain`, true if no compiled code was used.

    Raises
    ------
    CertificateError
        If a certificate belongs to another problem, is not valid, or claims a lower bound than its
        numbers prove, or if the second opinion is a different bound.
    TooLargeError
        If the second opinion would take more than a few minutes.
    ValueError
        If a plan or a result is for another problem; if a plan breaks a rule or cannot be flown, or
        its J is not the one claimed or is above the bound; if a result claims a lower bound than
        its certificate; if there are two plans, or nothing to check; if a claim is None, as the
        plan of a result without one; or if a result has a bound, such as that of brute force, and
        no certificate is among the claims. In that case its plan alone, `result.plan`, can be
        checked.

    Examples
    --------
    >>> co.verify(problem, result.plan, best.certificate).gap
    """
    require_problem(problem)
    require_flag(second_opinion, "second_opinion")
    require_flag(plain, "plain")
    given = [_claim(claim, problem) for claim in claims]
    plans = [p for p in map(_plan_in, given) if p is not None]
    bounds = [b for b in map(bound_in, given) if b is not None]
    if len(plans) > 1:
        raise ValueError("claims: name at most one plan")
    if not bounds:
        _require_checkable(given, plans)
    model = Model(problem, plain=True) if bounds else None
    proved = [
        ProvedBound.of(model, file, second_opinion, plain=plain)
        for file in bounds
        if model is not None
    ]
    for claim in given:
        if isinstance(claim, Result):
            _require_consistent(problem, claim)
    values = [
        claim.value for claim in given if isinstance(claim, Result) and claim.plan is not None
    ]
    verified = Verified.of(
        problem, plans[0] if plans else None, values=values, bounds=proved, plain=plain
    )
    if verified.violations:
        raise ValueError(verified.violations[0])
    return verified


def _claim(claim: Plan | Result | Bound | None, problem: Problem) -> Plan | Result | Bound:
    """Returns a claim that can be checked; refuses all others, and claims about another problem."""
    if claim is None:
        words = "a result without a plan or a certificate has nothing to check"
        raise ValueError(f"claims: must not be None; {words}")
    words = "a plan, a result, a certificate or a proof; `read` reads files of them"
    require(claim, "claims", words, Plan, Result, CertificateFile, ProofFile)
    require_made_for("plan", claim, problem)
    return claim


def _require_consistent(problem: Problem, claim: Result) -> None:
    """Checks what a result says about its plan and bound, besides J."""
    bound = bound_in(claim)
    for name in ("value", "bound"):
        require_number(getattr(claim, name), name)
    if claim.reason is Reason.INFEASIBLE and bound is not None and proved_in(problem, bound) >= 0:
        raise ValueError("reason: the result claims that no plan exists; its file does not")
    if claim.plan is None and claim.value != -inf:
        raise ValueError(f"reward: the result claims {claim.value!r} and has no plan")
    if words := below_certificate(problem, claim):
        raise ValueError(words)


def _require_checkable(claims: Sequence[Plan | Result | Bound], plans: Sequence[Plan]) -> None:
    """Rejects claims that cannot be checked completely because a certificate is missing."""
    for claim in claims:
        if isinstance(claim, Result) and claim.bound != inf:
            whose = f"{claim.method}'s" if claim.method else "a result's"
            raise ValueError(f"claims: {whose} bound has no certificate; name its plan alone")
    if not plans:
        raise ValueError("claims: must hold a plan, a certificate or a proof")


def _plan_in(claim: Plan | Result | Bound) -> Plan | None:
    return plan_of(claim) if isinstance(claim, Plan | Result) else None
