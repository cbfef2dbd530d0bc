"""The code of a third-party planner: its files, and a digest of everything its results depend on.

The code is the planner's module, or the whole package that contains it, with all modules that these
import from their folder or from other folders of the user, and the versions of imported packages.
Comments, layout and docstrings do not count. Anything that a planner reads or imports in other ways
is unknown.
"""

import ast
import hashlib
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.machinery import SourceFileLoader
from importlib.metadata import PackageNotFoundError, packages_distributions, version
from importlib.util import find_spec
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import NamedTuple

from cocap_opt.files.code import normal_form

_PROJECT = "cocap_opt"  # its code has a separate digest
_NATIVE = (".so", ".pyd")  # endings of compiled modules


class OwnPlannerError(ValueError):
    """A planner cannot be found or called, raises, or returns no result; the message is one line.

    An exception raised by the planner is the cause of this error, with its traceback.
    """


class OwnCode(NamedTuple):
    """The code of a module, as it is in its files.

    Attributes
    ----------
    digest : digest of the files and the versions
    roots : folders from which they are imported, that of the planner's module first
    names : modules and packages in them that belong to the planner
    files : content of their Python files, by path below a root; without installed packages
    """

    digest: str
    roots: tuple[str, ...]
    names: frozenset[str]
    files: dict[str, bytes]

    @classmethod
    def of(cls, name: str) -> "OwnCode":
        """Returns the code of an imported module, or of the running script.

        Raises
        ------
        OwnPlannerError
            If it has no file, e.g. because it was typed at a prompt or in a notebook, or if it or
            another user module that it imports has changed since its import.
        """
        module = sys.modules[name]
        if name.partition(".")[0] == _PROJECT:
            return cls(name, (), frozenset(), {})
        file = getattr(module, "__file__", None)
        if file is None or not Path(file).is_file() or Path(file).suffix != ".py":
            raise OwnPlannerError(f"{name} has no file of Python code")
        _require_current(module, Path(file))
        top = Path(file).stem if name == "__main__" else name.partition(".")[0]
        root = Path(file).resolve().parents[0 if name == "__main__" else _depth(module)]
        roots, foreign = _collected(root, top)
        files = {path: content for found in roots.values() for path, content in found.items()}
        for folder, found in roots.items():
            _require_current_files(folder, found)
        digest = hashlib.sha256()
        for path in sorted(files):
            digest.update(f"\n# {path}\n".encode() + counted(path, files[path]))
        for package, number in sorted(foreign.items()):
            digest.update(f"\n# {package} {number}".encode())
        names = frozenset(path.partition("/")[0].removesuffix(".py") for path in files)
        sent = {} if _is_installed(root) else {p: c for p, c in files.items() if p.endswith(".py")}
        return cls(digest.hexdigest(), tuple(map(str, roots)), names, sent)


def _depth(module: ModuleType) -> int:
    """Returns the number of folders between a module's file and the folder from which it is
    imported.
    """
    is_package = hasattr(module, "__path__")
    return module.__name__.count(".") + is_package


def _collected(root: Path, top: str) -> tuple[dict[Path, dict[str, bytes]], dict[str, str]]:
    """Returns the files of a module and of the user modules that it imports, and other packages.

    Returns
    -------
    roots : content of files, by path below each folder from which modules are imported
    foreign : versions of installed packages by name
    """
    roots: dict[Path, dict[str, bytes]] = {root: {}}
    waiting, seen, foreign = [(root, top)], {top, _PROJECT}, set[str]()
    while waiting:
        folder, module = waiting.pop()
        for path in _files_of(folder, module):
            content = roots.setdefault(folder, {})[path.relative_to(folder).as_posix()] = (
                path.read_bytes()
            )
            for name in _imported(content) - seen if path.suffix == ".py" else ():
                seen.add(name)
                home = _home(root, name)
                if home is None:
                    foreign.add(name)
                else:
                    waiting.append((home, name))
    return roots, _versions(foreign - sys.stdlib_module_names)


def _home(root: Path, name: str) -> Path | None:
    """Returns the folder that contains a user module; None for installed or unknown modules.

    It is the planner's folder, or elsewhere on the path, e.g. for packages in development.
    """
    if not _is_installed(root) and any(_files_of(root, name)):
        return root
    if name in sys.stdlib_module_names:
        return None
    try:
        spec = find_spec(name)
    except (ImportError, ValueError):  # the module says that it has no spec
        return None
    places = [] if spec is None else [*(spec.submodule_search_locations or ()), spec.origin or ""]
    home = Path(places[0]).resolve().parent if places and places[0] else None
    return None if home is None or _is_installed(home) or not any(_files_of(home, name)) else home


def _files_of(root: Path, name: str) -> Iterator[Path]:
    """Yields the files of a module or package in a folder."""
    if (root / f"{name}.py").is_file():
        yield root / f"{name}.py"
    for path in sorted(root.glob(f"{name}.*")):
        if path.suffix in _NATIVE:
            yield path
    if (root / name).is_dir():
        for path in sorted((root / name).rglob("*")):
            if path.suffix in (".py", *_NATIVE) and path.is_file():
                yield path


def _imported(content: bytes) -> set[str]:
    """Returns the top-level names of all modules that code imports, without relative imports."""
    found = set()
    for node in ast.walk(_parsed(content)):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
            found.add(node.module.partition(".")[0])
    return found


def _parsed(content: bytes) -> ast.Module:
    try:
        return ast.parse(content)
    except (SyntaxError, ValueError):  # a file of a package that nobody imports
        return ast.Module(body=[], type_ignores=[])


def counted(path: str, content: bytes) -> bytes:
    """Returns the part of a file of code that its digest depends on."""
    if not path.endswith(".py"):
        return content
    try:
        return normal_form(content.decode()).encode()
    except (SyntaxError, ValueError):
        return content


def _is_installed(root: Path) -> bool:
    """Returns True for the folders of Python and of packages installed by pip, whose versions are
    known.
    """
    paths = sysconfig.get_paths()
    places = {Path(paths[key]).resolve() for key in ("purelib", "platlib", "stdlib")}
    return root in places or root.name in ("site-packages", "dist-packages")


def _versions(names: set[str]) -> dict[str, str]:
    found, packages = {}, _packages() if names else {}
    for name in names:
        for package in packages.get(name, ()):
            try:
                found[package] = version(package)
            except PackageNotFoundError:  # its record is damaged
                found[package] = ""
    return found


_packages = cache(packages_distributions)  # reads the records of all installed packages


def _require_current_files(root: Path, paths: Iterable[str]) -> None:
    """Raises OwnPlannerError if the files of imported modules have changed."""
    for path in paths:
        name = path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        module, file = sys.modules.get(name), root / path
        home = getattr(module, "__file__", None)
        if module is not None and home is not None and Path(home).resolve() == file.resolve():
            _require_current(module, file)


def _require_current(module: ModuleType, file: Path) -> None:
    """Raises OwnPlannerError if the functions of a module differ from those in its file."""
    if type(module.__loader__) is not SourceFileLoader:  # another loader may have changed the code
        return
    try:
        known = set(_codes(compile(file.read_bytes(), str(file), "exec", dont_inherit=True)))
    except (SyntaxError, ValueError):
        known = set()
    for function in _functions(module):
        is_from_it = Path(function.__code__.co_filename).resolve() == file.resolve()
        if is_from_it and function.__code__ not in known:
            raise OwnPlannerError(
                f"{file} has changed since it was imported ({function.__name__} differs); "
                "restart Python, or reload the module"
            )


def _functions(module: ModuleType) -> Iterator[FunctionType]:
    """Yields the functions of a module and of its classes."""
    members = [value for value in vars(module).values() if _is_of(value, module)]
    for holder in (module, *(value for value in members if isinstance(value, type))):
        for value in vars(holder).values():
            function = getattr(value, "__func__", value)  # also of class methods and static methods
            if isinstance(function, FunctionType) and _is_of(function, module):
                yield function


def _is_of(value: object, module: ModuleType) -> bool:
    """Returns True if an object is defined in a module."""
    return getattr(value, "__module__", None) == module.__name__


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Yields a code object and all code objects inside it."""
    yield code
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _codes(inner)
