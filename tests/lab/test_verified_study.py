"""The times of the checker that is proved in Coq: what is measured, and what is refused."""

from pathlib import Path

import pytest

from cocap_opt.experiments.lab.studies.verified import (
    checked,
    stored_claims,
    verified,
    verified_in_markdown,
)
from cocap_opt.files.documents import FileError
from cocap_opt.formulations.column_generation.branch_and_price import column_generation
from cocap_opt.run.options import UsageError
from cocap_opt.scenarios import load_scene

BOUND = "certificate of bound"


def program(folder: Path, code: int) -> Path:
    """A program that says one word and ends with a code, in the checker's place."""
    path = folder / "program"
    path.write_text(f"#!/bin/sh\necho refused\nexit {code}\n")
    path.chmod(0o755)
    return path


def test_a_claim_is_described_and_its_refusal_is_told(tmp_path: Path) -> None:
    """A row has the numbers of the file; no time is stored of a claim that was not accepted."""
    problem = load_scene("tiny-doorway", 0)
    claimed = column_generation(problem).certificate
    assert claimed is not None
    row = checked(program(tmp_path, 0), problem, claimed, BOUND)
    assert (row.scene, row.claim, row.leaves) == ("tiny-doorway", BOUND, 1)
    assert row.lowering > 0
    with pytest.raises(FileError, match="refused"):
        checked(program(tmp_path, 1), problem, claimed, BOUND)
    with pytest.raises(FileError, match="nowhere"):
        checked(tmp_path / "nowhere", problem, claimed, BOUND)


def test_scenes_without_claims_are_refused(tmp_path: Path) -> None:
    """The message names the option and what it may be."""
    with pytest.raises(UsageError, match="--scene: must be among corridor"):
        verified(program=program(tmp_path, 0), scene=["bridge"])


def test_the_table_has_a_row_for_each_stored_claim() -> None:
    """Claims are named once, with what they have."""
    table = verified_in_markdown()
    claims = [f"{run.scene}, {run.claim}" for run in stored_claims()]
    assert len(set(claims)) == len(claims) == len(table.splitlines()) - 2
    assert all(table.count(claim) == 1 for claim in claims)
