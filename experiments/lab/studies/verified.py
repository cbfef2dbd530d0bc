"""The time that the checker proved in Coq takes for claims of built-in scenes."""

import json
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from cyclopts import Parameter

from cocap_opt.experiments.lab.results import STORED, Results, load_csv, markdown
from cocap_opt.experiments.lab.studies.options import Out
from cocap_opt.experiments.lab.studies.runs import processor_seconds
from cocap_opt.files.documents import Document, FileError
from cocap_opt.formulations.column_generation.branch_and_price import column_generation, searchless
from cocap_opt.formulations.column_generation.parameters import DEFAULTS
from cocap_opt.formulations.independent import instance_of
from cocap_opt.formulations.independent.machine_checked import checking
from cocap_opt.model import compiled
from cocap_opt.output.printing import Listing
from cocap_opt.problem import Problem
from cocap_opt.run.options import UsageError
from cocap_opt.scenarios import load_scene
from cocap_opt.text import counted

_TABLE = "verified.csv"
_PROOF, _MULTIPLIERS = "proof without a search", "multipliers of a staged certificate"
_STAGES, _BOUND = "stages only", "certificate of bound"
_CLAIMS = {
    "corridor": (_PROOF, _BOUND),
    "bottleneck": (_PROOF, _STAGES, _BOUND),
    "passage": (_PROOF, _STAGES, _BOUND),
    "field": (_MULTIPLIERS, _STAGES, _BOUND),
}
# Column generation that explores no tails, of which the program knows nothing.
WITHOUT_TAILS = replace(DEFAULTS, tails=replace(DEFAULTS.tails, times_nodes=0.0, most_nodes=0))
# Column generation that hardly tries paths of all drones together, either.
WITHOUT_PATHS = replace(
    WITHOUT_TAILS,
    trials=replace(
        DEFAULTS.trials,
        fewest_nodes=1,
        fewest_plain_nodes=1,
        times_nodes=0.0,
        plain_times_nodes=0.0,
        most_nodes=1,
    ),
)


class VerifiedClaim(NamedTuple):
    """A claim that the checker accepted: a row of verified.csv.

    Attributes
    ----------
    leaves, stages : numbers of leaves and of stages in the file
    rows, cuts : largest numbers in one leaf, or numbers in the multipliers
    paths : 1 if paths of all drones together are explored
    lowering, check : CPU time in seconds
    """

    scene: str
    claim: str
    leaves: int
    rows: int
    cuts: int
    stages: int
    paths: int
    lowering: float
    check: float


def verified(
    *,
    program: Annotated[Path, Parameter(help="program cocap-check-verified, built by build.sh")],
    scene: Annotated[
        list[str] | None,
        Parameter(
            negative="",
            consume_multiple=True,
            help=f"scenes, of {', '.join(_CLAIMS)} (default: all)",
        ),
    ] = None,
    out: Out = None,
) -> None:
    """Checks claims of scenes, and prints and writes the times (verified.csv)."""
    if unknown := [name for name in scene or () if name not in _CLAIMS]:
        raise UsageError(f"--scene: must be among {', '.join(_CLAIMS)}, not {unknown[0]!r}")
    results = Results.into(out)
    runs = [run for name in scene or _CLAIMS for run in _runs_of(program.absolute(), name)]
    Listing("claims checked by the proved checker", [run._asdict() for run in runs]).print()
    results.save(_TABLE, runs)


def _runs_of(program: Path, scene: str) -> list[VerifiedClaim]:
    problem = load_scene(scene, 0)
    files: dict[str, Callable[[Problem], Any]] = {
        _PROOF: searchless,
        _MULTIPLIERS: column_generation,
        _STAGES: lambda problem: column_generation(problem, parameters=WITHOUT_PATHS),
        _BOUND: lambda problem: column_generation(problem, parameters=WITHOUT_TAILS),
    }
    return [
        checked(program, problem, files[claim](problem).certificate, claim)
        for claim in _CLAIMS[scene]
    ]


def checked(program: Path, problem: Problem, claimed: Document, claim: str) -> VerifiedClaim:
    """Lowers a certificate or proof, and checks it with the program.

    Raises
    ------
    FileError
        If a program is missing, or rejects the claim.
    """
    with tempfile.TemporaryDirectory() as name:
        instance, file, lowered = (
            Path(name) / part for part in ("x.instance", "claim.json", "lowered.txt")
        )
        instance.write_text(instance_of(compiled(problem)), encoding="utf-8")
        claimed.save(file)
        multipliers = ["--multipliers"] * (claim == _MULTIPLIERS)
        commands = checking(program, instance, file, lowered, *multipliers)
        lowering, check = _seconds(commands.lower), _seconds(commands.check)
        numbers = json.loads(file.read_text("utf-8"))
        return _described(problem.name, claim, numbers, lowering, check)


def _seconds(command: Sequence[str]) -> float:
    """Runs a command to its end; returns its CPU time in seconds."""
    before = processor_seconds()
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        raise FileError(f"{command[0]}: {error.strerror}") from error
    if done.returncode:
        raise FileError(f"{command[0]}: {(done.stdout + done.stderr).strip()}")
    return round(processor_seconds() - before, 2)


def _described(
    scene: str, claim: str, file: dict[str, Any], lowering: float, check: float
) -> VerifiedClaim:
    leaves = [n["certificate"] for n in file.get("nodes", ()) if n["type"] == "leaf"]
    numbers = file.get("certificate")
    stages, has_paths = 0, False
    if numbers is not None:
        if numbers["type"] == "staged" and claim != _MULTIPLIERS:
            stages = len(numbers["stages"])
            has_paths = numbers.get("paths_above") is not None
        leaves = [numbers.get("multipliers", numbers)]
    rows, cuts = (max(len(leaf.get(name, ())) for leaf in leaves) for name in ("rows", "cuts"))
    return VerifiedClaim(
        scene, claim, len(leaves), rows, cuts, stages, int(has_paths), lowering, check
    )


def stored_claims() -> list[VerifiedClaim]:
    """Returns the stored rows."""
    return load_csv(STORED / _TABLE, VerifiedClaim, "verified")


def verified_in_markdown() -> str:
    """Returns the stored times in Markdown, in seconds."""
    return markdown([
        {
            "claim": f"{run.scene}, {run.claim}",
            "contents": _parts(run),
            "lowering (Python)": f"{run.lowering:.1f} s",
            "check": _shown(run.check),
        }
        for run in stored_claims()
    ])  # fmt: skip


def _parts(run: VerifiedClaim) -> str:
    """Lists the parts of a claim."""
    if run.stages or run.paths:
        parts = [counted(run.stages, "stage")] if run.stages else []
        return " and ".join([*parts, *["paths of all drones together"] * run.paths])
    numbers = f"{counted(run.rows, 'row')} and {counted(run.cuts, 'cut')}"
    return f"1 leaf, {numbers}" if run.leaves == 1 else f"{run.leaves} leaves, each up to {numbers}"


def _shown(seconds: float) -> str:
    return f"{seconds:.2f} s" if seconds < 1 else f"{seconds:.1f} s"
