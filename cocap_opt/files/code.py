"""The digest of code, by which results are known that were computed by code that does the same.

Files of results and of coverage name the code that made them. A comment that is mended, or a line
that is broken elsewhere, changes no result; so the digest is not of the files' bytes but of their
syntax trees, without comments, layout and docstrings. Any other change counts, even one that
computes the same in the end, such as another name of a variable. Versions of Python may write a
tree in different ways, so digests are the same under one version, and need not be under two.
"""

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

_PACKAGE = "cocap_opt"
_FOLDER = Path(__file__).parents[1]
# Folders that are no part of the core: linked into it, or above it.
_BESIDE = (
    "formulations", "scenarios", "experiments",
    "console", "output", "run", "pictures", "missions", "player", "api", "cli",
)  # fmt: skip
_DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def code_digest(*modules: str) -> str:
    """Returns the digest of modules by their full names; a package stands for all that it holds.

    The package `cocap_opt` stands for the core alone, without formulations, scenarios and
    experiments. Modules are known by the names under which they are imported, wherever their
    files are, so a checkout and an installed package have the same digest.

    Raises
    ------
    ValueError
        If there is no such module.
    """
    digest = hashlib.sha256()
    for module in sorted({inner for name in modules for inner in _modules(name)}):
        digest.update(f"\n# module {module}\n{normal_form(_text(module))}".encode())
    return digest.hexdigest()


def _modules(name: str) -> Iterator[str]:
    """Yields the full names of a module, or of all modules of a package."""
    path = _path(name)
    if path.is_file():
        yield name
        return
    if not path.is_dir():
        raise ValueError(f"{name}: there is no such module")
    for inner in sorted(path.iterdir()):
        if inner.is_dir() and not (name == _PACKAGE and inner.name in _BESIDE):
            yield from _modules(f"{name}.{inner.name}")
        elif inner.suffix == ".py":
            yield f"{name}.{inner.stem}"


def _path(name: str) -> Path:
    """Returns the file of a module, or the folder of a package."""
    path = _FOLDER.joinpath(*name.removeprefix(_PACKAGE).split("."))
    return path if path.is_dir() else path.with_suffix(".py")


def _text(module: str) -> str:
    return _path(module).read_text(encoding="utf-8")


@cache  # coverage and results each have a digest, of modules that are largely the same
def normal_form(text: str) -> str:
    """Returns code without docstrings, comments and its own layout."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, _DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            node.body = node.body[1:] or [ast.Pass()]
    return ast.unparse(tree)
