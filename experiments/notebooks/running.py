"""Notebooks run from start to end, and stored with what came out."""

import hashlib
from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat
from nbclient import NotebookClient
from nbformat import NotebookNode
from traitlets.config import Config

from cocap_opt.files.atomic_write import write_atomically

FOLDER = Path(__file__).parent
MOST_SECONDS = 120  # for a cell
# Who ran them last, and with which versions, is nobody's business.
METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}


def notebooks() -> list[Path]:
    """Files of all notebooks."""
    return sorted(FOLDER.glob("*.ipynb"))


def load(path: Path) -> NotebookNode:
    """Read a notebook."""
    notebook: NotebookNode = nbformat.read(path, as_version=4)
    return notebook


def executed(path: Path) -> NotebookNode:
    """Run a notebook in a process of its own, in a folder that is gone afterwards.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        If a cell fails.
    """
    notebook = load(path)
    with TemporaryDirectory() as folder:
        # Sockets are files of that folder: TCP would be open to others on this machine.
        sockets = {"transport": "ipc", "connection_file": f"{folder}/kernel.json"}
        client = NotebookClient(
            notebook, timeout=MOST_SECONDS, kernel_name="python3", record_timing=False,
            config=Config({"KernelManager": sockets}), resources={"metadata": {"path": folder}},
        )  # fmt: skip
        client.execute()
    return notebook


def store(path: Path) -> None:
    """Run a notebook and write it with its outputs."""
    notebook = executed(path)
    notebook.metadata = nbformat.from_dict({**METADATA, "ran": digest(notebook)})
    for cell in notebook.cells:
        cell.metadata = nbformat.from_dict({})
    write_atomically(path, (nbformat.writes(notebook) + "\n").encode())


def digest(notebook: NotebookNode) -> str:
    """Which code the outputs come from."""
    code = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    return hashlib.sha256("\0".join(code).encode()).hexdigest()[:12]
