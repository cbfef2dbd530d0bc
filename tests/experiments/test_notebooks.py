import ast
from pathlib import Path

import pytest
from cocap_opt.experiments.notebooks.__main__ import main
from cocap_opt.experiments.notebooks.running import digest, executed, load, notebooks
from cocap_opt.experiments.studies.benchmarks.runs import scene
from nbformat import NotebookNode

from cocap_opt.experiments.notebooks.tables import (
    check_table,
    differences,
    differences_by_person,
    outcomes,
    side_table,
)
from cocap_opt.formulations import EXACT
from cocap_opt.planners import PLANNERS
from cocap_opt.referee import check
from cocap_opt.stop import never

FILES = notebooks()
LARGEST = 300_000  # bytes of a stored notebook
LOGIC = (
    ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.Lambda, ast.For, ast.AsyncFor,
    ast.While, ast.If, ast.IfExp, ast.Match, ast.Try, ast.With, ast.BinOp, ast.AugAssign,
    ast.Compare, ast.BoolOp,
)  # fmt: skip


def code(notebook: NotebookNode) -> list[NotebookNode]:
    """Its code cells."""
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def names(files: list[Path]) -> list[str]:
    """What tests of files are called."""
    return [path.stem for path in files]


def test_the_notebooks_are_found() -> None:
    """These tests look at the real files."""
    assert names(FILES) == [
        "bounds_compared", "first_tour", "solvers_compared", "what_cocap_loses",
    ]  # fmt: skip


@pytest.mark.parametrize("path", FILES, ids=names(FILES))
def test_notebooks_run(path: Path) -> None:
    """Each runs from start to end, and nothing is said on standard error, not even a warning."""
    outputs = [output for cell in code(executed(path)) for output in cell.outputs]
    assert outputs
    assert not [output.text for output in outputs if output.get("name") == "stderr"]


@pytest.mark.parametrize("path", FILES, ids=names(FILES))
def test_notebooks_hold_no_logic(path: Path) -> None:
    """What is computed is computed by tested functions: cells define, decide and repeat nothing."""
    for number, cell in enumerate(code(load(path))):
        found = [node for node in ast.walk(ast.parse(cell.source)) if isinstance(node, LOGIC)]
        assert not found, f"code cell {number}: {ast.unparse(found[0])}"


@pytest.mark.parametrize("path", FILES, ids=names(FILES))
def test_stored_outputs_are_those_of_the_cells(path: Path) -> None:
    """What one reads on a web page comes from one run of the code that stands there."""
    notebook = load(path)
    cells = code(notebook)
    assert notebook.metadata.get("ran") == digest(notebook), "run cocap-opt study notebooks"
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    kinds = [output.output_type for cell in cells for output in cell.outputs]
    assert kinds and "error" not in kinds
    shown = [set(output.get("data", {})) for cell in cells for output in cell.outputs]
    assert {"image/png", "text/plain"} in shown
    assert path.stat().st_size < LARGEST


@pytest.mark.parametrize("path", FILES, ids=names(FILES))
def test_figures_are_shown_as_figures(path: Path) -> None:
    """No figure is stored as its name, as those are that come before any of pyplot's own."""
    for cell in code(load(path)):
        for output in cell.outputs:
            data = output.get("data", {})
            assert "image/png" in data or "Figure" not in data.get("text/plain", "")


def test_an_unknown_notebook_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """A name that no notebook has is one line that says which there are."""
    assert main(["last_tour"]) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"cocap-opt: last_tour: must be one of {', '.join(names(FILES))}"
    ]


def test_differences_add_up_to_the_gap() -> None:
    """What a plan has less by face, person and side is in all what its J is below the other's."""
    problem = scene("bottleneck", 0, 3)
    plan = PLANNERS["cocap-vs"](problem, never).plan
    best = EXACT["branch-and-price"](problem, never).plan
    assert plan is not None and best is not None
    j, best_j = (check(problem, some).reward for some in (plan, best))
    assert j < best_j
    assert differences(problem, plan, best).sum() == pytest.approx(j - best_j)
    assert differences_by_person(problem, plan, best).sum() == pytest.approx(j - best_j)
    last = side_table(problem, plan, best)[-1]
    assert float(last["all sides"]) == pytest.approx(100 * (j - best_j) / best_j, abs=0.005)


def test_recomputed_bounds_are_the_claimed_ones() -> None:
    """The table of checks has what certificates prove; methods without one are left out."""
    problem = scene("corridor", 0, 2)
    methods = {name: EXACT[name] for name in ("branch-and-price", "brute-force")}
    found = outcomes(problem.replace(robots=problem.robots[:1]), methods, 60)
    (row,) = check_table(problem.replace(robots=problem.robots[:1]), found)
    assert row["method"] == "branch-and-price" and row["claimed bound"] == row["recomputed"]
