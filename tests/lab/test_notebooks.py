import ast
from pathlib import Path

import nbformat
import pytest
from nbformat import NotebookNode
from nbformat.v4 import new_code_cell, new_notebook
from studies import study

import cocap_opt as co
from cocap_opt.experiments.lab.studies.notebooks import Notebook

NOTEBOOKS = Notebook.all()
LARGEST = 400_000  # bytes of a stored notebook; a player has half of them
FACE = {"cocap_opt", "pandas", "matplotlib.pyplot"}  # all that a notebook may import
LOGIC = (
    ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.Lambda, ast.For, ast.AsyncFor,
    ast.While, ast.If, ast.IfExp, ast.Match, ast.Try, ast.With, ast.BinOp, ast.AugAssign,
    ast.Compare, ast.BoolOp,
)  # fmt: skip


def code(notebook: NotebookNode) -> list[NotebookNode]:
    """Its code cells."""
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def nodes(notebook: Notebook, *kinds: type[ast.AST]) -> list[ast.AST]:
    """Syntax of some kinds in the cells of a notebook."""
    trees = [ast.parse(cell.source) for cell in code(notebook.content())]
    return [node for tree in trees for node in ast.walk(tree) if isinstance(node, kinds)]


def names(some: list[Notebook]) -> list[str]:
    """The names of notebooks."""
    return [notebook.path.stem for notebook in some]


each = pytest.mark.parametrize("notebook", NOTEBOOKS, ids=names(NOTEBOOKS))


def test_the_notebooks_are_found() -> None:
    """These tests look at the real files."""
    assert names(NOTEBOOKS) == [
        "bounds_compared", "first_tour", "solvers_compared", "what_cocap_loses",
    ]  # fmt: skip


@pytest.mark.slow(seconds=30)
def test_notebooks_run(tmp_path: Path) -> None:
    """Each runs from start to end, and nothing is said on standard error, not even a warning.

    All run in one process, which imports once; none finds the names of the one before.
    """
    joined = new_notebook()
    for notebook in NOTEBOOKS:
        joined.cells += [*code(notebook.content()), new_code_cell("%reset -f")]
    nbformat.write(joined, tmp_path / "joined.ipynb")
    cells = code(Notebook(tmp_path / "joined.ipynb").executed())
    outputs = [output for cell in cells for output in cell.outputs]
    assert outputs
    assert not [output.text for output in outputs if output.get("name") == "stderr"]


@each
def test_notebooks_hold_no_logic(notebook: Notebook) -> None:
    """Tested functions compute: cells define, decide and repeat nothing."""
    found = nodes(notebook, *LOGIC)
    assert not found, ast.unparse(found[0])


@each
def test_notebooks_live_on_the_face(notebook: Notebook) -> None:
    """It imports the face, pandas, matplotlib, the lab's results; and uses names that exist."""
    imports = nodes(notebook, ast.Import)
    assert {alias.name for node in imports for alias in node.names} <= FACE  # type: ignore[attr-defined]
    stored = {ast.unparse(node) for node in nodes(notebook, ast.ImportFrom)}
    assert stored <= {"from cocap_opt.experiments.lab.benchmark import Benchmark"}
    used = {
        node.attr
        for node in nodes(notebook, ast.Attribute)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "co"
    }
    assert used and used <= set(co.__all__)


@each
def test_stored_outputs_are_those_of_the_cells(notebook: Notebook) -> None:
    """What one reads on a web page comes from one run of the code that stands there."""
    content = notebook.content()
    cells = code(content)
    assert content.metadata.get("ran") == Notebook.digest(content), "run cocap-opt study notebooks"
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    kinds = [output.output_type for cell in cells for output in cell.outputs]
    assert kinds and "error" not in kinds
    shown = [set(output.get("data", {})) for cell in cells for output in cell.outputs]
    assert {"image/png", "text/plain"} in shown
    assert notebook.path.stat().st_size < LARGEST


@each
def test_figures_are_shown_as_figures(notebook: Notebook) -> None:
    """No figure is stored as its name, as those are that come before any of pyplot's own."""
    for cell in code(notebook.content()):
        for output in cell.outputs:
            data = output.get("data", {})
            named = "Figure" in data.get("text/plain", "") or "Axes" in data.get("text/plain", "")
            assert "image/png" in data or not named


@each
def test_figures_say_what_they_show(notebook: Notebook) -> None:
    """Each has an alternative text, where Jupyter and the site look for it."""
    for cell in code(notebook.content()):
        kinds = {kind for output in cell.outputs for kind in output.get("data", {})}
        if "image/png" in kinds:
            words = cell.metadata.get("alt", "")
            assert len(words) > 40, cell.source
            assert cell.metadata["mystnb"] == {"image": {"alt": words}}
        for output in cell.outputs:
            page = output.get("data", {}).get("text/html", "")
            assert page.startswith("<iframe") or page.count("<img ") == page.count("<img alt=")


@pytest.mark.slow
def test_a_notebook_whose_cell_fails_is_left_as_it_is(tmp_path: Path) -> None:
    """Its file is not written, and the error names the cell's exception."""
    from nbclient.exceptions import CellExecutionError

    path = tmp_path / "wrong.ipynb"
    text = NOTEBOOKS[0].path.read_text(encoding="utf-8")
    path.write_text(text.replace("import cocap_opt as co", "raise ValueError"), encoding="utf-8")
    before = path.read_bytes()
    with pytest.raises(CellExecutionError, match="ValueError"):
        Notebook(path).store()
    assert path.read_bytes() == before


def test_an_unknown_notebook_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """A name that no notebook has is one line that says which there are."""
    assert study("notebooks", "last_tour") == 2
    assert capsys.readouterr().err.splitlines() == [
        f"cocap-opt: last_tour: must be one of {', '.join(names(NOTEBOOKS))}"
    ]
