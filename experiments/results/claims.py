"""The claims in plan, certificate and proof files, held against a scene by `verify`."""

import math
from collections.abc import Callable

from cocap_opt.experiments.results.judging import ROUNDING, Judged
from cocap_opt.experiments.results.printing import Record
from cocap_opt.files.documents import PlanFile, problem_digest
from cocap_opt.formulations.certificates import (
    CertificateError,
    CertificateFile,
    ProofFile,
    verify,
)
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import Verdict
from cocap_opt.result import relative_gap

_NO_PLAN = "proved: there is no plan"


class Verification:
    """Holds claims against a scene, and keeps what is found.

    Attributes
    ----------
    answer : what `verify` prints, complete after `conclude`
    """

    def __init__(self, problem: Problem, seed: int, about: Record) -> None:
        self._problem = problem
        self.answer: Record = {
            "scene": problem.name, "seed": seed, "valid": True, "violations": [], **about
        }  # fmt: skip

    def verify_plan(self, content: PlanFile | Plan) -> None:
        """Judges a plan afresh, and compares that with what its file claims."""
        claimed = content if isinstance(content, PlanFile) else None
        plan = content.plan if isinstance(content, PlanFile) else content
        judged = Judged.of_plan(self._problem, plan)
        verdict = judged.verdict
        assert verdict is not None
        self.answer["violations"] += [*verdict.violations, *verdict.conflicts]
        self.answer["planner"] = claimed.planner if claimed else None
        self.answer["conflicts"] = len(verdict.conflicts)
        self.answer["reward"] = None
        if not verdict.violations:
            self.answer["reward"] = verdict.reward
            self.answer |= judged.reward_parts | {"reward_per_face": verdict.face_reward}
        if claimed is not None:
            self._compare(claimed, verdict)

    def _compare(self, claimed: PlanFile, verdict: Verdict) -> None:
        if claimed.digest != problem_digest(self._problem):
            other = "scene, seed, rules or objective"
            self._refuse(f"digest: the plan belongs to another {other}")
        if verdict.violations:
            return
        if not math.isclose(claimed.reward, verdict.reward, rel_tol=1e-9):
            self._refuse(f"reward: the plan claims {claimed.reward!r}, it is {verdict.reward!r}")

    def verify_bound(
        self,
        content: CertificateFile | ProofFile,
        name: str,
        progress: Callable[[int, int], None],
    ) -> None:
        """Prices a certificate, or all leaves of a proof, and compares that with the claimed bound.

        The answer has the lowest bound of all that hold.

        Parameters
        ----------
        name : of the file
        progress : told how many leaves are done, and of how many
        """
        answer = self.answer
        answer.setdefault("method", None)
        answer.setdefault("bound", None)
        try:
            verify(self._problem, content, progress)
        except CertificateError as error:
            self._refuse(f"{name}: {error}")
            return
        # What has been proved is what the file claims.
        if answer["bound"] is None or content.proved < answer["bound"]:
            answer["method"], answer["bound"] = content.method, content.bound
        if content.proved < 0:  # J >= 0
            answer["message"] = _NO_PLAN

    def conclude(self) -> None:
        """Compares plan and bound, and says if all claims hold."""
        answer, violations = self.answer, self.answer["violations"]
        reward, bound = answer.get("reward"), answer.get("bound")
        answer["optimal"] = None
        if reward is not None and answer.get("message") == _NO_PLAN and not violations:
            self._refuse("plan: obeys the rules, though it is proved that no plan does")
        if reward is not None and bound is not None and not violations:
            gap = relative_gap(reward, bound)
            answer["gap"] = gap if math.isfinite(gap) else None
            if reward > bound + ROUNDING * abs(bound):
                self._refuse("reward: above the bound, one of the two is wrong")
            answer["optimal"] = gap <= OPTIMALITY and not violations
        answer["valid"] = not violations

    def _refuse(self, words: str) -> None:
        self.answer["violations"].append(words)
