"""Gaps explained, for the report and the player: the terms of each plan, and their table."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.experiments.tables.tables import Table
from cocap_opt.files.documents import FileError, problem_digest
from cocap_opt.formulations.certificates import CertificateError, CertificateFile, ProofFile
from cocap_opt.formulations.explanation import Kind, explain
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
    """Returns the gaps of plans by their planners, told apart with the folder's certificate.

    Left out are plans without a gap to speak of, and all of them where the certificate is not in
    the folder or the scene `is_too_large`.

    Parameters
    ----------
    rows : of these plans

    Raises
    ------
    FileError
        If the certificate's file is damaged.
    """
    bounded = [row for row in rows if row.certificate and (row.gap or 0.0) >= SHOWN]
    if not bounded or not (folder / bounded[0].certificate).is_file():
        return {}
    path = folder / bounded[0].certificate
    file = PlanReader(problem.name, problem).claim(path)
    if not isinstance(file, CertificateFile | ProofFile) or file.digest != problem_digest(problem):
        return {}
    if is_too_large(problem):
        return {}
    model, found = compiled(problem), {}
    for row in bounded:
        assert row.planner is not None
        assert row.reward is not None
        plan = plans[row.planner]
        try:
            gap = explain(model, plan, row.reward, file)
        except CertificateError as error:
            raise FileError(f"{path}: {error}") from error
        found[row.planner] = Explained(model, plan, gap)
    return found


def parts_table(explained: Mapping[str, Explained]) -> Table:
    """Returns the parts of each gap in % of the bound; they add up to it."""
    return [
        {"planner": planner}
        | {name: _percent(told, told.explanation.total(*kinds)) for name, kinds in _PARTS.items()}
        | {"gap": _percent(told, told.explanation.gap)}
        for planner, told in explained.items()
    ]


def _percent(told: Explained, amount: float) -> str:
    return f"{round(100 * told.explanation.share(amount), 3) + 0.0:.3f}"
