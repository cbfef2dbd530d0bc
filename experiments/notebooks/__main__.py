"""Run all notebooks again and store their outputs: cocap-opt study notebooks."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.experiments.cli.program import program, run_app
from cocap_opt.experiments.console.streams import say
from cocap_opt.files.documents import FileError

app = program(
    "cocap-opt study notebooks",
    "Run the project's notebooks and store them with their outputs.",
)


@app.default
def notebooks(
    *names: Annotated[str, Parameter(help="such as first_tour; all if none is given")],
) -> int:
    """Run notebooks from start to end and store them with their outputs.

    A notebook of which a cell fails is left as it is.

    Example: cocap-opt study notebooks first_tour
    """
    for path in _chosen(names):
        say(path.name)
        _store(path)
    return 0


def _chosen(names: Sequence[str]) -> list[Path]:
    try:
        from cocap_opt.experiments.notebooks.running import notebooks
    except ModuleNotFoundError as error:
        words = f"{error.name} is not installed: pip install -e '.[notebooks]'"
        raise FileError(words) from error

    found = {path.stem: path for path in notebooks()}
    unknown = [name for name in names if name not in found]
    if unknown:
        raise FileError(f"{unknown[0]}: must be one of {', '.join(found)}")
    return [found[name] for name in names or found]


def _store(path: Path) -> None:
    from nbclient.exceptions import CellExecutionError

    from cocap_opt.experiments.notebooks.running import store

    try:
        store(path)
    except CellExecutionError as error:
        raise FileError(f"{path.name}: a cell fails with {error.ename}: {error.evalue}") from error


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns 0, 2 for wrong input, or 130 after Ctrl-C."""
    return run_app(app, arguments)


if __name__ == "__main__":
    sys.exit(main())
