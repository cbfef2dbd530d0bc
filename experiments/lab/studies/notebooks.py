"""The project's notebooks, run from start to end and stored with their outputs."""

import base64
import hashlib
import io
import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any, Self

from cyclopts import Parameter
from PIL import Image

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.studies.options import of_extra
from cocap_opt.files.atomic_write import write_atomically
from cocap_opt.files.documents import FileError

if TYPE_CHECKING:
    from nbformat import NotebookNode

_FOLDER = Path(__file__).resolve().parents[3] / "docs" / "notebooks"
_MOST_SECONDS = 120  # time limit of a cell
_PNG, _HTML, _COLOURS = "image/png", "text/html", 256  # colours of a stored picture
_INLINE = re.compile(r'(src="data:image/png;base64,)([^"]+)')
# Who ran them last and the versions of packages are omitted.
_METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}


def notebooks(
    *names: Annotated[str, Parameter(help="names, e.g. first_tour (default: all)")],
) -> None:
    """Runs notebooks and stores them; if a cell fails, its notebook is not changed.

    Raises
    ------
    FileError
        If there is no such notebook, or one of its cells fails.
    """
    with of_extra("notebooks"):
        from nbclient.exceptions import CellExecutionError

    found = {notebook.path.stem: notebook for notebook in Notebook.all()}
    if unknown := [name for name in names if name not in found]:
        raise FileError(f"{unknown[0]}: must be one of {', '.join(found)}")
    for name in names or found:
        say(name)
        try:
            found[name].store()
        except CellExecutionError as error:
            words = f"a cell fails with {error.ename}: {error.evalue}"
            raise FileError(f"{found[name].path.name}: {words}") from error


class Notebook:
    """A notebook and its file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @classmethod
    def all(cls) -> list[Self]:
        """Returns all notebooks of the project."""
        return [cls(path) for path in sorted(_FOLDER.glob("*.ipynb"))]

    def content(self) -> "NotebookNode":
        """Reads the notebook."""
        import nbformat

        notebook: NotebookNode = nbformat.read(self.path, as_version=4)
        return notebook

    def executed(self) -> "NotebookNode":
        """Runs the notebook in its own process, in a folder that is removed afterwards.

        Raises
        ------
        nbclient.exceptions.CellExecutionError
            If a cell fails.
        """
        from nbclient import NotebookClient
        from traitlets.config import Config

        notebook = self.content()
        with TemporaryDirectory() as folder:
            # Sockets are files of that folder: TCP would be open to others on this machine.
            sockets = {"transport": "ipc", "connection_file": f"{folder}/kernel.json"}
            client = NotebookClient(
                notebook, timeout=_MOST_SECONDS, kernel_name="python3", record_timing=False,
                extra_arguments=["--InlineBackend.figure_formats=retina"],
                config=Config({"KernelManager": sockets}), resources={"metadata": {"path": folder}},
            )  # fmt: skip
            client.execute()
        return notebook

    def store(self) -> None:
        """Runs the notebook and writes it with its outputs."""
        import nbformat

        notebook = self.executed()
        notebook.metadata = nbformat.from_dict({**_METADATA, "ran": self.digest(notebook)})
        for cell in notebook.cells:
            for output in cell.get("outputs", ()):
                data = output.get("data", {})
                if _PNG in data:
                    data[_PNG] = _smaller(data[_PNG])
                if _HTML in data:
                    data[_HTML] = _with_smaller_pictures(data[_HTML])
            cell.metadata = nbformat.from_dict(_with_alt_text(cell.metadata.get("alt")))
        write_atomically({self.path: (nbformat.writes(notebook) + "\n").encode()})

    @staticmethod
    def digest(content: "NotebookNode") -> str:
        """Returns a digest of the code that outputs come from."""
        code = [cell.source for cell in content.cells if cell.cell_type == "code"]
        return hashlib.sha256("\0".join(code).encode()).hexdigest()[:12]


def _with_alt_text(words: str | None) -> dict[str, Any]:
    """Returns the metadata of a cell with the alt text of its picture.

    It is there twice, under the names that Jupyter and the site's builder read.
    """
    return {"alt": words, "mystnb": {"image": {"alt": words}}} if words else {}


def _smaller(encoded: str) -> str:
    """Converts a PNG file, in base64, to one with a palette, which has a third of the size."""
    content = io.BytesIO()
    drawn = Image.open(io.BytesIO(base64.b64decode(encoded))).convert("RGB")
    drawn.quantize(_COLOURS, dither=Image.Dither.NONE).save(content, format="PNG", optimize=True)
    return base64.b64encode(content.getvalue()).decode()


def _with_smaller_pictures(page: str) -> str:
    """Returns HTML with smaller PNG files; the player, which is a whole page, is unchanged."""
    if page.startswith("<iframe"):
        return page
    return _INLINE.sub(lambda found: found[1] + _smaller(found[2]), page)
