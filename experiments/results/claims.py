"""What `verify` says of the claims in plan, certificate and proof files."""

import math
from collections.abc import Callable

from cocap_opt.check import Verdict, check
from cocap_opt.experiments.results.rows import ROUNDING, Row, finite
from cocap_opt.files.documents import PlanFile, problem_digest
from cocap_opt.formulations.certificates.certificate import (
    CertificateError,
    CertificateFile,
    verify,
)
from cocap_opt.formulations.certificates.proof import ProofFile, verify_proof
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Problem
from cocap_opt.result import relative_gap

NO_PLAN = "proved: there is no plan"


def reward_parts(verdict: Verdict) -> Row:
    """What J is made of; the last only where a scene rewards it."""
    parts: Row = {
        "reward_at_start": verdict.reward_at_start,
        "reward_per_step": verdict.reward_per_step,
    }
    if verdict.reward_moves:
        parts["reward_moves"] = verdict.reward_moves
    return parts


def verify_plan(problem: Problem, content: PlanFile | Plan, answer: Row) -> None:
    """Judge a plan afresh and hold it against what its file claims."""
    claimed = content if isinstance(content, PlanFile) else None
    verdict = check(problem, content.plan if isinstance(content, PlanFile) else content)
    answer["violations"] += [*verdict.violations, *verdict.conflicts]
    answer["planner"] = claimed.planner if claimed else None
    answer["conflicts"] = len(verdict.conflicts)
    answer["reward"] = None
    if not verdict.violations:
        answer["reward"] = verdict.reward
        answer |= reward_parts(verdict) | {"reward_per_face": verdict.face_reward}
    if claimed is None:
        return
    if claimed.digest != problem_digest(problem):
        what = "scene, seed, rules or objective"
        answer["violations"].append(f"digest: the plan belongs to another {what}")
    if verdict.violations:
        return
    if not math.isclose(claimed.reward, verdict.reward, rel_tol=1e-9):
        answer["violations"].append(
            f"reward: the plan claims {claimed.reward!r}, it is {verdict.reward!r}"
        )


def verify_bound(
    problem: Problem,
    content: CertificateFile | ProofFile,
    name: str,
    answer: Row,
    progress: Callable[[int, int], None],
) -> None:
    """Price a certificate, or all leaves of a proof, and hold that against the claimed bound.

    The answer has the lowest bound of all that hold.

    Parameters
    ----------
    name : of the file
    progress : told how many leaves are done, and of how many
    """
    answer.setdefault("method", None)
    answer.setdefault("bound", None)
    try:
        if isinstance(content, ProofFile):
            verify_proof(problem, content, progress)
        else:
            verify(problem, content)
    except CertificateError as error:
        answer["violations"].append(f"{name}: {error}")
        return
    # What has been proved is what the file claims.
    if answer["bound"] is None or content.proved < answer["bound"]:
        answer["method"], answer["bound"] = content.method, content.bound
    if content.proved < 0:  # J >= 0
        answer["message"] = NO_PLAN


def conclude(answer: Row) -> None:
    """Hold plan and bound against each other, and say whether all claims hold."""
    reward, bound, violations = answer.get("reward"), answer.get("bound"), answer["violations"]
    answer["optimal"] = None
    if reward is not None and answer.get("message") == NO_PLAN and not violations:
        violations.append("plan: obeys the rules, though it is proved that no plan does")
    if reward is not None and bound is not None and not violations:
        gap = relative_gap(reward, bound)
        answer["gap"] = finite(gap)
        if reward > bound + ROUNDING * abs(bound):
            violations.append("reward: above the bound, one of the two is wrong")
        answer["optimal"] = gap <= OPTIMALITY and not violations
    answer["valid"] = not violations
