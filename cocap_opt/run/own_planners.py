"""Third-party planners: finds them by name, sends them to workers, passes them their seed."""

import hashlib
import importlib
import inspect
import platform
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from numbers import Real
from pathlib import Path
from tempfile import TemporaryDirectory
from traceback import extract_tb
from typing import Any

import cloudpickle
import msgspec
import numpy as np

from cocap_opt.files.messages import in_words
from cocap_opt.formulations.result import CertifiedResult
from cocap_opt.method import START_AND_REPORT, Method
from cocap_opt.problem import Plan
from cocap_opt.result import Reason, Result, UnsupportedError
from cocap_opt.run.own_code import OwnCode, counted
from cocap_opt.run.own_code import OwnPlannerError as OwnPlannerError
from cocap_opt.stop import LimitReached
from cocap_opt.text import meant, on_a_line, shortened, with_article

_SEED = "seed"  # the parameter of planners that take the scene's seed
_Call = Callable[..., object]
# Digests of the code of modules that this process has imported from other processes, by module
# name.
_imported: dict[str, str] = {}
_folders: list[TemporaryDirectory[str]] = []  # folders into which their code was written
_put: list[str] = []  # folders from which they were imported, first on the path


@dataclass(frozen=True)
class OwnPlanner:
    """A third-party planner, in whatever process it runs.

    Attributes
    ----------
    name : name in tables
    reference : module:name; empty if it has none
    code : code of its module; None if unknown, and then its results cannot be stored
    call : the planner; None if this process has not imported it yet
    content : the planner itself, if it is sent
    """

    name: str
    reference: str = ""
    code: OwnCode | None = None
    call: _Call | None = field(default=None, compare=False)
    content: bytes = field(default=b"", compare=False, repr=False)

    @classmethod
    def found(cls, name: str, reference: str) -> "OwnPlanner":
        """Imports a planner named by module:name, with the current folder on the path.

        Raises
        ------
        OwnPlannerError
            If the module or planner does not exist, or does not take a problem and a stopping
            criterion.
        """
        if "" not in sys.path and str(Path.cwd()) not in sys.path:
            sys.path.insert(0, str(Path.cwd()))  # like `python -m`
        call = _resolved(reference)
        module = reference.partition(":")[0]
        return cls(name, reference, OwnCode.of(module), _checked(call, reference))

    @classmethod
    def of_function(cls, call: _Call, name: str, kept: bool) -> "OwnPlanner":
        """Wraps a planner that exists in this process.

        Parameters
        ----------
        kept : True: its results are stored, so its code must be known

        Raises
        ------
        OwnPlannerError
            If it does not take a problem and a stopping criterion; or if its results are to be
            stored and it has no name in a file.
        """
        _checked(call, name)
        module, path = getattr(call, "__module__", ""), getattr(call, "__qualname__", "")
        if not _is_at(call, module, path):
            if kept:
                raise OwnPlannerError(
                    f"{name} cannot be stored in `out`, as it could not be recognised later; "
                    "define it with `def` at the top level of a module or script"
                )
            return cls(name, call=call)
        try:
            code = OwnCode.of(module)
        except OwnPlannerError as error:
            if kept:
                words = "put it into a module, or omit `out`"
                raise OwnPlannerError(
                    f"{name} cannot be stored in `out`: {error}; {words}"
                ) from error
            return cls(name, call=call)
        return cls(name, f"{module}:{path}", code, call)

    @property
    def digest(self) -> str:
        """Digest of its code and of its name; empty if these are unknown."""
        if self.code is None:
            return ""
        words = f"{self.reference.partition(':')[2]} {self.code.digest}"
        return hashlib.sha256(words.encode()).hexdigest()

    @property
    def _is_imported(self) -> bool:
        """True if other processes can import it; they cannot import the running script by name."""
        return bool(self.reference) and not self.reference.startswith("__main__:")

    def to_be_sent(self) -> "OwnPlanner":
        """Returns the planner with everything that other processes need.

        Raises
        ------
        OwnPlannerError
            If it cannot be sent.
        """
        if self._is_imported:
            return self
        try:
            return replace(self, content=cloudpickle.dumps(self.call))
        except Exception as error:  # importing may fail for any reason
            raise OwnPlannerError(f"{self.name} cannot be sent to workers: {error}") from error

    def __reduce__(self) -> tuple[Any, ...]:
        """Sends the planner to other processes as plain data, without importing its module on the
        way.
        """
        return OwnPlanner, (self.name, self.reference, self.code, None, self.content)

    def ready(self) -> "OwnPlanner":
        """Returns the planner so that this process can call it.

        Raises
        ------
        OwnPlannerError
            If this process cannot import it, or has other code.
        """
        if self.call is not None:
            return self
        if self.content:
            call = cloudpickle.loads(self.content)
        else:
            assert self.code is not None
            call = _received(self.reference, self.code)
        return OwnPlanner(self.name, self.reference, self.code, call)

    @property
    def method(self) -> Method[Result]:
        """The record of the planner, which raises OwnPlannerError if the planner raises."""
        call = self.ready().call
        assert call is not None
        takes = frozenset({_SEED} if _takes_seed(call) else ())
        return Method(guarded(call, self.name), takes=takes, foreign=True)


def guarded(call: _Call, name: str) -> Callable[..., Any]:
    """Returns a function that raises OwnPlannerError whatever the third-party function raises.

    Only UnsupportedError is passed on, as it says which problems the function supports.
    """

    def checked(*placed: Any, **named: Any) -> Any:
        try:
            return call(*placed, **named)
        except SystemExit as error:
            raise OwnPlannerError(f"{name} tried to end the process: {error!r}") from error
        except UnsupportedError:
            raise
        except LimitReached as error:
            raise OwnPlannerError(
                f"{name} does not catch LimitReached; it must, and return a Result with the best "
                "plan found, or with None"
            ) from error
        except Exception as error:
            raise OwnPlannerError(f"{name} raised {_told(error)}") from error

    return checked


def _told(error: Exception) -> str:
    """Returns a message on the raised exception and its place."""
    where = extract_tb(error.__traceback__)[-1]
    file = Path(where.filename).name
    return f"{type(error).__name__}: {error} ({file}, line {where.lineno}, in {where.name})"


def usable_result(name: str, result: object, bounds: bool = False) -> Result:
    """Returns a method's result with a plan of built-in types.

    Parameters
    ----------
    bounds : True for bounds and exact methods, False for planners

    Raises
    ------
    OwnPlannerError
        If it is not a result, or contains invalid values; the message describes them.
    """
    if bounds:
        of_kind: type[Result] = CertifiedResult
        makes = "a bound must return a CertifiedResult, as CertifiedResult.bounded makes it"
    else:
        of_kind = Result
        makes = "a planner must return a Result, such as co.Result(plan, J, co.Reason.FINISHED)"
    if not isinstance(result, of_kind):
        what = "nothing (None)" if result is None else with_article(type(result).__name__)
        raise OwnPlannerError(f"{name} returned {what}; {makes}")
    for field_name, value, kind, allowed in (
        ("plan", result.plan, Plan | None, "Plan"),
        ("value", result.value, Real, "number"),
        ("bound", result.bound, Real, "number"),
        ("reason", result.reason, Reason, "Reason"),
    ):
        if not isinstance(value, kind):
            what = with_article(type(value).__name__)
            raise OwnPlannerError(
                f"{name} returned a Result whose {field_name} is {what}, not a {allowed}; {makes}"
            )
    if result.plan is None:
        return result
    try:
        return replace(result, plan=plain_plan(result.plan))
    except ValueError as error:
        raise OwnPlannerError(f"{name} returned a Result with a wrong plan: {error}") from error


def plain_plan(plan: Plan) -> Plan:
    """Returns a plan whose states, which may be tuples or contain NumPy numbers, are of built-in
    types.

    Raises
    ------
    ValueError
        If they are not states; the message describes them.
    """
    built = msgspec.to_builtins(plan, enc_hook=_plain_number)
    try:
        return msgspec.convert(built, Plan)
    except msgspec.ValidationError as error:
        raise ValueError(f"plan: {in_words(error, 'plan', Plan, built)}") from None


def _plain_number(value: object) -> object:
    """Returns a NumPy number as a Python number."""
    if isinstance(value, np.generic):
        return value.item()
    raise msgspec.ValidationError(f"must hold states of whole numbers, not {on_a_line(value)}")


# -- by name ----------------------------------------------------------------------------------


def _resolved(reference: str) -> _Call:
    """Imports the object that module:name refers to."""
    module, _, path = reference.partition(":")
    found: Any = _module(module)
    for name in path.split("."):
        known = [word for word in dir(found) if not word.startswith("_")]
        if not hasattr(found, name):
            raise OwnPlannerError(f"{module} has no {name!r}{meant(name, known)}")
        found = getattr(found, name)
    if not callable(found):
        raise OwnPlannerError(f"{reference} must be a function, not {shortened(repr(found))}")
    call: _Call = found
    return call


def _module(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is not None and (name == error.name or name.startswith(f"{error.name}.")):
            words = f"there is no module {name!r} in this folder or among the installed packages"
            raise OwnPlannerError(words) from error
        raise OwnPlannerError(f"{name} cannot be imported: {error}") from error
    except (Exception, SystemExit) as error:  # whatever its code raises
        words, where = f"{type(error).__name__}: {error}", extract_tb(error.__traceback__)[-1]
        if not isinstance(error, SyntaxError):  # a syntax error gives its own position
            words += f" ({Path(where.filename).name}, line {where.lineno})"
        raise OwnPlannerError(f"{name} cannot be imported: {words}") from error


def _checked(call: _Call, name: str) -> _Call:
    """Returns a planner that takes a problem and a stopping criterion, and possibly a seed."""
    words = "a problem and a stopping criterion, and of a seed if it takes one"
    _require_takes(call, f"{name} must be a function of {words}", 2, [_SEED] * _takes_seed(call))
    return call


def bounding(call: _Call, name: str, takes: frozenset[str]) -> Method[Any]:
    """Returns the record of a third-party bound or exact method.

    Parameters
    ----------
    takes : its arguments besides a problem and a stopping criterion, as in `Method.takes`

    Raises
    ------
    OwnPlannerError
        If it does not take these arguments.
    """
    words = "a problem, a stopping criterion, a start and a function to report to"
    keywords = sorted(takes - START_AND_REPORT)
    more = "".join(f", and of `{keyword}` by keyword" for keyword in keywords)
    _require_takes(call, f"{name} must be a function of {words}{more}", 4, keywords)
    return Method(guarded(call, name), takes=takes, bounds=True, foreign=True)


def _require_takes(call: _Call, must: str, placed: int, keywords: Iterable[str]) -> None:
    """Raises OwnPlannerError if a function does not take so many arguments by position, and these
    by keyword.

    Parameters
    ----------
    must : the beginning of the message
    """
    try:
        signature = inspect.signature(call)
    except (TypeError, ValueError):  # the signature is not available
        return
    try:
        signature.bind(*[None] * placed, **dict.fromkeys(keywords))
    except TypeError as error:
        raise OwnPlannerError(f"{must}: {error}") from error


def _takes_seed(call: _Call) -> bool:
    try:
        parameter = inspect.signature(call).parameters.get(_SEED)
    except (TypeError, ValueError):
        return False
    return parameter is not None and parameter.kind in (
        inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY,
    )  # fmt: skip


def _is_at(call: _Call, module: str, path: str) -> bool:
    """Returns True if a module contains a function under this name."""
    found: Any = sys.modules.get(module)
    for name in path.split("."):
        found = getattr(found, name, None)
    return found is call


# -- in other processes -----------------------------------------------------------------------


def _received(reference: str, code: OwnCode) -> _Call:
    """Imports a planner from another process, with the same code.

    The original folders are used if they exist here with the same code, as they may contain more;
    otherwise its files are written to a new folder. A worker outlives a command, so modules with
    other code are unloaded first.
    """
    module = reference.partition(":")[0]
    if all(_imported.get(name) == code.digest for name in code.names):
        return _resolved(reference)
    for roots in _roots(code):
        for known in [n for n in sys.modules if n.partition(".")[0] in code.names]:
            del sys.modules[known]
        if code.files:
            _put_first(roots)
        call = _resolved(reference)
        with suppress(OwnPlannerError):
            if OwnCode.of(module).digest == code.digest:
                _imported.update(dict.fromkeys(code.names, code.digest))
                return call
    raise OwnPlannerError(f"{platform.node()} has another version of {module} than this process")


def _roots(code: OwnCode) -> Iterator[list[str]]:
    """Yields lists of folders that together contain a planner's code."""
    if not code.files:  # it is installed
        yield []
        return
    if all(any(_has(root, *file) for root in code.roots) for file in code.files.items()):
        yield [*code.roots]
    made = TemporaryDirectory(prefix="cocap-opt-planner-")
    _folders.append(made)  # keeps the folder until this process ends
    folder = Path(made.name)
    for path, content in code.files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(content)
    yield [made.name]


def _has(root: str, path: str, content: bytes) -> bool:
    """Returns True if a folder contains a file with this content."""
    try:
        return counted(path, Path(root, path).read_bytes()) == counted(path, content)
    except OSError:
        return False


def _put_first(folders: list[str]) -> None:
    """Puts folders first on the import path, replacing the previous ones."""
    while _put:
        sys.path.remove(_put.pop())
    sys.path[:0] = folders
    _put.extend(folders)
    importlib.invalidate_caches()
