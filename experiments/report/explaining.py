"""Gaps explained, for the report and the player: the terms of each plan, and their table."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.experiments.tables.tables import Table
from cocap_opt.files.documents import FileError, problem_digest
from cocap_opt.formulations.certificates import CertificateError, CertificateFile, ProofFile
from cocap_opt.formulations.explanation import Explanation, Kind, explain
from cocap_opt.model import compiled
from cocap_opt.output.files import PlanReader
from cocap_opt.problem import Plan, Problem
from cocap_opt.run.explained import SHOWN, Explained, is_too_large

_PARTS: dict[str, tuple[Kind, ...]] = {
    "paths": ("path",),
    "faces": ("face", "views"),
    "rules": ("row", "decision"),
    "other leaves": ("leaves",),
    "stages": ("stages",),
    "rounding": ("claim", "rounding"),
}


def explained_plans(
    folder: Path, rows: Sequence[GapRow], problem: Problem, plans: Mapping[str, Plan]
) -> dict[str, Explained]:
    """Returns the explained gaps of plans, by planner.

    The certificate in the folder splits a gap into terms. A gap has no terms if that file is
    missing or belongs to the scene without rules, or if the scene `is_too_large`. Plans without a
    bound are omitted.

    Parameters
    ----------
    rows : of these plans

    Raises
    ------
    FileError
        If the certificate's file is damaged.
    """
    model, found = compiled(problem), {}
    for row in rows:
        if row.bound is None or row.bound < 0:  # a bound below 0 proves that there is no plan
            continue
        assert row.planner is not None
        assert row.reward is not None
        plan, file = plans[row.planner], _bound_file(folder / row.certificate, problem)
        try:
            gap = explanation(problem, plan, row.reward, file) if file else None
        except CertificateError as error:
            raise FileError(f"{folder / row.certificate}: {error}") from error
        found[row.planner] = Explained(model, plan, gap or Explanation(row.bound, row.reward, ()))
    return found


def _bound_file(path: Path, problem: Problem) -> CertificateFile | ProofFile | None:
    """Returns the certificate or the proof of a problem; None if there is no such file."""
    if not path.is_file():
        return None
    file = PlanReader(problem.name, problem).claim(path)
    if not isinstance(file, CertificateFile | ProofFile) or file.digest != problem_digest(problem):
        return None
    return file


def explanation(
    problem: Problem, plan: Plan, reward: float, file: CertificateFile | ProofFile
) -> Explanation:
    """Explains a gap with a file that was verified; without terms if the scene `is_too_large`.

    Raises
    ------
    CertificateError
        If the file's numbers are not valid.
    """
    if is_too_large(problem):
        return Explanation(file.proved, reward, ())
    return explain(compiled(problem), plan, reward, file)


def worth_telling(explained: Mapping[str, Explained]) -> dict[str, Explained]:
    """Returns the gaps that are large enough to mention, of plans that obey the rules."""
    return {
        planner: told
        for planner, told in explained.items()
        if told.explanation.share(told.explanation.gap) >= SHOWN
        and not any(told.plan.conflicts(told.problem))
    }


def parts_table(explained: Mapping[str, Explained]) -> Table:
    """Returns the parts of each gap in % of the bound; they add up to the gap."""
    return [
        {"planner": planner}
        | {name: _percent(told, told.explanation.total(*kinds)) for name, kinds in _PARTS.items()}
        | {"gap": _percent(told, told.explanation.gap)}
        for planner, told in explained.items()
    ]


def _percent(told: Explained, amount: float) -> str:
    return f"{round(100 * told.explanation.share(amount), 3) + 0.0:.3f}"
