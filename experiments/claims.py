"""What `verify` says of the claims in plan and certificate files."""

import math

from cocap_opt.check import check
from cocap_opt.io import PlanFile, problem_digest
from cocap_opt.plan import Plan
from cocap_opt.problem import Problem
from cocap_opt.result import relative_gap
from experiments.report import Row, finite
from formulations.certificate import CertificateError, CertificateFile, verify


def verify_plan(problem: Problem, content: PlanFile | Plan, answer: Row) -> None:
    """Judge a plan afresh and hold it against what its file claims."""
    claimed = content if isinstance(content, PlanFile) else None
    verdict = check(problem, content.plan if isinstance(content, PlanFile) else content)
    answer["violations"] += [*verdict.violations, *verdict.conflicts]
    answer["planner"] = claimed.planner if claimed else None
    answer["conflicts"] = len(verdict.conflicts)
    answer["reward"] = None if verdict.violations else verdict.reward
    answer["reward_at_start"] = None if verdict.violations else verdict.reward_at_start
    answer["reward_per_step"] = verdict.reward_per_step
    answer["reward_per_face"] = verdict.face_reward
    if claimed is None:
        return
    if claimed.digest != problem_digest(problem):
        answer["violations"].append("digest: the plan belongs to another scene or seed")
    if verdict.violations:
        return
    if not math.isclose(claimed.reward, verdict.reward, rel_tol=1e-9):
        answer["violations"].append(
            f"reward: the plan claims {claimed.reward!r}, it is {verdict.reward!r}"
        )


def verify_certificate(problem: Problem, content: CertificateFile, answer: Row) -> None:
    """Price a certificate afresh and hold it against the bound it claims."""
    answer["method"], answer["bound"] = content.method, None
    try:
        verify(problem, content)
    except CertificateError as error:
        answer["violations"].append(f"certificate: {error}")
        return
    # What has been proved is what the file claims.
    answer["bound"] = content.bound
    if content.bound is None:
        answer["message"] = "proved: there is no plan"


def conclude(answer: Row) -> None:
    """Hold plan and bound against each other, and say whether all claims hold."""
    reward, bound = answer.get("reward"), answer.get("bound")
    if reward is not None and bound is not None and not answer["violations"]:
        answer["gap"] = finite(relative_gap(reward, bound))
        # The referee's J and the bound are both rounded sums.
        if reward > bound + 1e-9 * abs(bound):
            answer["violations"].append("reward: above the bound, one of the two is wrong")
    answer["valid"] = not answer["violations"]
