import re
import subprocess
import sys
from pathlib import Path

import pytest
from studies import rows_of, study

from cocap_opt.experiments.studies.app import app

ROOT = Path(__file__).parents[2]
SLOW = {"matplotlib", "pandas", "scipy", "cvxpy", "highspy", "ortools", "distributed"}


def test_commands_load_their_work_late() -> None:
    """The help of `cocap-opt study` waits for no solver and no plotting."""
    code = "import sys, cocap_opt.experiments.studies.app; "
    code += f"print(*({SLOW!r} & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_every_study_that_is_named_exists() -> None:
    """Texts, docstrings and notebooks name commands of `cocap-opt study` that there are."""
    files = [ROOT / name for name in ("README.md", "CONTRIBUTING.md")]
    for folder in ("cocap_opt", "formulations", "scenarios", "experiments", "docs"):
        files += [
            path for path in (ROOT / folder).rglob("*") if path.suffix in (".py", ".md", ".ipynb")
        ]
    named = {
        name
        for path in files
        if path.is_file()
        for name in re.findall(r"cocap-opt study ([a-z][a-z-]*)", path.read_text(encoding="utf-8"))
    }
    assert "paper" in named
    assert named <= set(app)


def test_gamma_is_measured(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each gamma has a row for each order of view search; rewards are shares of CoCap's."""
    assert study("gamma", "--scene", "tiny-turn", "--seeds", "0", "--out", tmp_path) == 0
    rows = rows_of(tmp_path / "gamma.csv")
    assert len({(row["planner"], row["gamma"]) for row in rows}) == len(rows)
    assert all(0 < float(row["views"]) <= 1 and float(row["reward"]) > 0 for row in rows)
    assert "cocap-vs" in capsys.readouterr().out


@pytest.mark.slow
def test_views_are_measured(tmp_path: Path) -> None:
    """Each number of samples has a row with errors, and the figure is a picture."""
    options = ("--scene", "corridor", "--poses", 4, "--samples", "1-2", "--out", tmp_path)
    assert study("views", *options) == 0
    assert [row["samples"] for row in rows_of(tmp_path / "views.csv")] == ["1", "2"]
    assert (tmp_path / "views.png").read_bytes().startswith(b"\x89PNG")


def test_pictures_say_where_they_cannot_be_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file in place of the folder is one line that names it."""
    path = tmp_path / "file"
    path.write_text("")
    assert study("pictures", path) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
