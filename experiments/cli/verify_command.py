"""The command `verify`: claims in files, held against a scene, trusting nobody."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

from cyclopts import Parameter

from cocap_opt.experiments.cli.options import Json, Seed, load
from cocap_opt.experiments.console.options import UsageError
from cocap_opt.experiments.console.progress import Watch
from cocap_opt.experiments.results.claims import Verification
from cocap_opt.experiments.results.files import read_claim
from cocap_opt.experiments.results.printing import Record, path_text, print_result
from cocap_opt.experiments.results.rows import OWN_STARTS
from cocap_opt.files.documents import FileError, PlanFile
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.problem import Plan, Problem
from cocap_opt.scenarios import scene_of_plan


def _verify(
    scene: str,
    /,
    *file: Path,
    seed: Seed = 0,
    free: Annotated[
        bool, Parameter(negative="", help="the scene without inter-robot collisions")
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
    verification = Verification(claims.problem, seed, claims.about)
    if claims.plan is not None:
        verification.verify_plan(claims.plan)
    for path, content in claims.bounds.items():
        with Watch.on_terminal(path_text(path)) as watch:
            verification.verify_bound(content, path_text(path), watch.counter("leaf"))
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
        """Reads all files, in an order of their own, before any is held against the scene."""
        problem = load(scene, seed)
        about: Record = {"free": True} if free else {}
        content: PlanFile | Plan | None = None
        bounds = {}
        for path in sorted(set(files)):
            claim = read_claim(path, problem)
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


COMMANDS = {"verify": _verify}
