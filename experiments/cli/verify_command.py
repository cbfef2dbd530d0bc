"""The command `verify`, which checks what plans and certificates in files claim of a scene."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

from cyclopts import Parameter

from cocap_opt.experiments.cli.options import Json, Seed, load
from cocap_opt.experiments.console.options import UsageError
from cocap_opt.experiments.console.progress import Watch
from cocap_opt.experiments.results.files import PlanReader
from cocap_opt.experiments.results.judging import ROUNDING, Judged
from cocap_opt.experiments.results.printing import Record, print_result
from cocap_opt.experiments.results.rows import OWN_STARTS
from cocap_opt.files.documents import FileError, PlanFile, problem_digest
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
from cocap_opt.scenarios import scene_of_plan
from cocap_opt.text import printable

_NO_PLAN = "proved: there is no plan"


def _verify(
    scene: str,
    /,
    *file: Path,
    seed: Seed = 0,
    free: Annotated[
        bool, Parameter(negative="", help="the scene without collisions between drones")
    ] = False,
    json: Json = False,
) -> int:
    """Check a plan, certificates and proofs, trusting nobody: exit 0 only if all claims hold.

    The plan may also be in a scene format's own plan format. Of several
    bounds the lowest is shown.

    Example: cocap-opt verify corridor plan.json certificate.json --seed 0
    """
    if not file:
        raise UsageError("FILE: name a plan, a certificate or a proof")
    claims = _Claims.read(scene, seed, free, file)
    verification = _Verification(claims.problem, seed, claims.about)
    if claims.plan is not None:
        verification.verify_plan(claims.plan)
    for path, content in claims.bounds.items():
        with Watch.on_terminal(printable(str(path))) as watch:
            verification.verify_bound(content, printable(str(path)), watch.counter("leaf"))
    verification.conclude()
    print_result(verification.answer, json)
    return 0 if verification.answer["valid"] else 1


class _Claims(NamedTuple):
    """The claims to be checked; with a plan, for the variant of the scene that it was made for."""

    problem: Problem
    plan: PlanFile | Plan | None
    bounds: dict[Path, CertificateFile | ProofFile]
    about: Record  # for the answer

    @classmethod
    def read(cls, scene: str, seed: int, free: bool, files: Sequence[Path]) -> "_Claims":
        """Reads all files, in an order of their own, before any is checked."""
        problem = load(scene, seed)
        about: Record = {"free": True} if free else {}
        reader = PlanReader(scene, problem)
        content: PlanFile | Plan | None = None
        bounds = {}
        for path in sorted(set(files)):
            claim = reader.claim(path)
            if isinstance(claim, CertificateFile | ProofFile):
                bounds[path] = claim
            elif content is not None:
                raise FileError(f"{path}: must be a certificate or a proof, not a second plan")
            else:
                content = claim
        if content is not None:
            plan = content.plan if isinstance(content, PlanFile) else content
            fitting = scene_of_plan(scene, problem, plan)
            about |= {"seed": None, "starts": OWN_STARTS} if fitting is not problem else {}
            problem = fitting
        return cls(problem.without_rules() if free else problem, content, bounds, about)


class _Verification:
    """Checks what files claim of a scene, and collects the answer.

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


COMMANDS = {"verify": _verify}
