"""The digest of code, which identifies results that equivalent code has computed.

Files of results and of coverage record the digest of the code that made them. Changes of comments
and line breaks do not affect results; so the digest is not of the files' bytes but of their syntax
trees, without comments, layout and docstrings. Any other change counts, even one that does not
change results, such as a renamed variable. Versions of Python may write a tree in different ways,
so digests may differ between versions.
"""

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

_PACKAGE = "cocap_opt"
_FOLDER = Path(__file__).parents[1]
_DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def code_digest(*modules: str) -> str:
    """Returns the digest of modules, given by full names; a package means all its modules.

    Modules are identified by their import names, not by their files, so a checkout and an installed
    package have the same digest.

    Raises
    ------
    ValueError
        If there is no such module.
    """
    digest = hashlib.sha256()
    for module in sorted({inner for name in modules for inner in _modules(name)}):
        digest.update(f"\n# module {module}\n{normal_form(text_of(module))}".encode())
    return digest.hexdigest()


def with_imports(*modules: str) -> frozenset[str]:
    """Returns the full names of modules and of all project modules that they import, at any depth.

    The `__init__` of each package on the way is included, except that of `cocap_opt`, which imports
    names only when they are used. Imports for type checkers are not included.

    Raises
    ------
    ValueError
        If there is no such module.
    """
    found: set[str] = set()
    todo = [inner for name in modules for inner in _modules(name)]
    while todo:
        module = todo.pop()
        if module not in found:
            found.add(module)
            todo += _imports(module) - found
    return frozenset(found)


def files_with_imports(module: str) -> tuple[Path, ...]:
    """Returns the file of a module, and those of all modules that it imports at run time.

    Raises
    ------
    ValueError
        If there is no such module.
    """
    (found,) = _modules(module)
    others = sorted(name for name in _imports(found) if not name.endswith(".__init__"))
    return tuple(_path(name) for name in (found, *others))


def text_of(module: str) -> str:
    """Returns the text of a module, given by its full name."""
    return _path(module).read_text(encoding="utf-8")


def _imports(module: str) -> set[str]:
    """Returns the project modules that a module imports, and the `__init__` of their packages."""
    names = [name.split(".") for name in _imported_names(text_of(module))]
    rooms = {".".join(parts[:end]) for parts in names for end in range(2, len(parts) + 1)}
    fronts = {room for room in rooms if _path(room).is_dir()}
    # A name that is neither a package nor a module is defined in a module.
    modules = {room for room in rooms - fronts if _path(room).is_file()}
    return modules | {f"{room}.__init__" for room in fronts}


@cache
def _imported_names(text: str) -> frozenset[str]:
    """Returns the full names that a module imports from this project at run time."""
    names: set[str] = set()
    for node in _statements(_tree(text)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return frozenset(name for name in names if name.startswith(f"{_PACKAGE}."))


def _modules(name: str) -> Iterator[str]:
    """Yields the full names of a module, or of all modules of a package."""
    path = _path(name)
    if path.is_file():
        yield name
        return
    if not path.is_dir():
        raise ValueError(f"{name}: there is no such module")
    for inner in sorted(path.iterdir()):
        if (inner / "__init__.py").is_file():
            yield from _modules(f"{name}.{inner.name}")
        elif inner.suffix == ".py":
            yield f"{name}.{inner.stem}"


def _path(name: str) -> Path:
    """Returns the file of a module, or the folder of a package."""
    path = _FOLDER.joinpath(*name.removeprefix(_PACKAGE).split("."))
    # A folder without an `__init__` is left over from a removed package, with compiled files.
    return path if (path / "__init__.py").is_file() else path.with_suffix(".py")


@cache  # the digests of coverage and of results include mostly the same modules
def normal_form(text: str) -> str:
    """Returns code without docstrings, comments and its own layout."""
    return ast.unparse(_tree(text))


@cache
def _tree(text: str) -> ast.Module:
    """Returns the syntax tree of code without docstrings."""
    tree = ast.parse(text)
    for node in (tree, *_statements(tree)):
        if isinstance(node, _DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            node.body = node.body[1:] or [ast.Pass()]
    return tree


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    """Yields the statements in a tree at any depth, without those for type checkers alone.

    Expressions contain no statements; walking them, too, would take five times as long.
    """
    for block in ("body", "handlers", "orelse", "finalbody", "cases"):
        for inner in getattr(node, block, ()):
            yield inner
            if not (isinstance(inner, ast.If) and ast.unparse(inner.test) == "TYPE_CHECKING"):
                yield from _statements(inner)
