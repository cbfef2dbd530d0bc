"""The audit of built-in scenes: what is stored of it, and that it comes out again."""

import re
from pathlib import Path

import pytest

from cocap_opt.experiments.lab.results import STORED, load_csv
from cocap_opt.experiments.lab.studies.app import app
from cocap_opt.experiments.lab.studies.audit import (
    AuditedScene,
    audits_in_markdown,
    audits_in_words,
)
from cocap_opt.scenarios import SCENES


def stored() -> list[AuditedScene]:
    """The rows of the stored table."""
    return load_csv(STORED / "audit.csv", AuditedScene, "audit")


def test_all_built_in_scenes_are_stored_and_agree() -> None:
    """Pages say that nothing differs, so that must be stored; and little is undecided."""
    rows = stored()
    assert [row.scene for row in rows] == [*SCENES]
    assert {row.different for row in rows} == {0}
    assert {row.scene for row in rows if row.undecided} == {"delft"}
    assert all(row.undecided <= row.numbers / 100 for row in rows)
    assert all(row.enclosed <= row.reached for row in rows)
    assert {row.scene for row in rows if row.numbers == 0} == {"tiny-hidden", "tiny-give-way"}


def test_pages_quote_the_stored_audits() -> None:
    """The table has all numbers, small scenes together; the sentence their sum."""
    rows = stored()
    total = sum(row.numbers for row in rows)
    assert audits_in_words().startswith(f"Of {total:,} numbers of {len(rows)} scenes, 0 are")
    cells = re.findall(r"\| *([\d,]+) *\| *0 *\| *[\d,]+ *\| *\d", audits_in_markdown())
    assert sum(int(cell.replace(",", "")) for cell in cells) == total


@pytest.mark.slow
def test_an_audit_comes_out_again(tmp_path: Path) -> None:
    """All but the seconds, and the last digits of widths, which depend on the library."""
    pytest.importorskip("flint", reason="python-flint, of the extra audit, is not installed")
    app(["audit", "--scene", "tiny-trap", "--out", str(tmp_path)], result_action="return_value")
    (again,) = load_csv(tmp_path / "audit.csv", AuditedScene, "audit")
    (before,) = (row for row in stored() if row.scene == "tiny-trap")
    assert again[:8] == before[:8]
    assert again.wide_share == pytest.approx(before.wide_share, rel=1e-3)
