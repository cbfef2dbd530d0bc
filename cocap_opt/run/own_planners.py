"""Planners that are none of this project's: found by name, sent to workers, handed their seed."""

import hashlib
import importlib
import inspect
import platform
import sys
from collections.abc import Callable, Iterator
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
from cocap_opt.method import Method
from cocap_opt.problem import Plan
from cocap_opt.result import Reason, Result, UnsupportedError
from cocap_opt.run.own_code import OwnCode, counted
from cocap_opt.run.own_code import OwnPlannerError as OwnPlannerError
from cocap_opt.stop import LimitReached
from cocap_opt.text import meant, shortened, with_article

_SEED = "seed"  # the parameter of planners that take the scene's seed
_Call = Callable[..., object]
# Digests of the code of modules that this process has imported for others, by the modules' names.
_imported: dict[str, str] = {}
_folders: list[TemporaryDirectory[str]] = []  # that it was written into
_put: list[str] = []  # the folders that it was imported from, put first on the path


@dataclass(frozen=True)
class OwnPlanner:
    """A third-party planner, wherever it runs.

    Attributes
    ----------
    name : in tables
    reference : module:name; empty where it has no such name
    code : of its module; None where that is not known, and its results cannot be kept
    call : the planner; None where this process has not imported it yet
    content : the planner itself, where it is sent
    """

    name: str
    reference: str = ""
    code: OwnCode | None = None
    call: _Call | None = field(default=None, compare=False)
    content: bytes = field(default=b"", compare=False, repr=False)

    @classmethod
    def found(cls, name: str, reference: str) -> "OwnPlanner":
        """Imports a planner by module:name, with the current folder on the path.

        Raises
        ------
        OwnPlannerError
            If there is no such module or planner, or it takes no problem and stop.
        """
        if "" not in sys.path and str(Path.cwd()) not in sys.path:
            sys.path.insert(0, str(Path.cwd()))  # as `python -m` does
        call = _resolved(reference)
        module = reference.partition(":")[0]
        return cls(name, reference, OwnCode.of(module), _checked(call, reference))

    @classmethod
    def of_function(cls, call: _Call, name: str, kept: bool) -> "OwnPlanner":
        """Takes a planner that this process has.

        Parameters
        ----------
        kept : its results are kept, so its code must be known

        Raises
        ------
        OwnPlannerError
            If it takes no problem and stop; or if its results are to be kept, and it is not known
            by its name in a file.
        """
        _checked(call, name)
        module, path = getattr(call, "__module__", ""), getattr(call, "__qualname__", "")
        if not _is_at(call, module, path):
            if kept:
                raise OwnPlannerError(
                    f"{name} cannot be kept in `out`, as it could not be recognised later; "
                    "define it by `def` at the top level of a module or script"
                )
            return cls(name, call=call)
        try:
            code = OwnCode.of(module)
        except OwnPlannerError as error:
            if kept:
                words = "put it into a module, or leave `out` away"
                raise OwnPlannerError(
                    f"{name} cannot be kept in `out`: {error}; {words}"
                ) from error
            return cls(name, call=call)
        return cls(name, f"{module}:{path}", code, call)

    @property
    def digest(self) -> str:
        """Digest of its code and of its name there; empty where these are not known."""
        if self.code is None:
            return ""
        words = f"{self.reference.partition(':')[2]} {self.code.digest}"
        return hashlib.sha256(words.encode()).hexdigest()

    @property
    def _is_imported(self) -> bool:
        """Other processes can import it; a script that runs is theirs under no name."""
        return bool(self.reference) and not self.reference.startswith("__main__:")

    def to_be_sent(self) -> "OwnPlanner":
        """Returns it with what other processes need.

        Raises
        ------
        OwnPlannerError
            If it cannot be sent.
        """
        if self._is_imported:
            return self
        try:
            return replace(self, content=cloudpickle.dumps(self.call))
        except Exception as error:  # whatever cannot be sent
            raise OwnPlannerError(f"{self.name} cannot be sent to workers: {error}") from error

    def __reduce__(self) -> tuple[Any, ...]:
        """Goes to other processes as plain data; what it is made of is not loaded on the way."""
        return OwnPlanner, (self.name, self.reference, self.code, None, self.content)

    def ready(self) -> "OwnPlanner":
        """Returns it as this process can call it.

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
    """Returns a function of somebody's own that raises OwnPlannerError whatever it raises.

    Only UnsupportedError stays what it is: it says which problems the function takes.
    """

    def checked(*placed: Any, **named: Any) -> Any:
        try:
            return call(*placed, **named)
        except SystemExit as error:
            raise OwnPlannerError(f"{name} has ended its process: {error!r}") from error
        except UnsupportedError:
            raise
        except LimitReached as error:
            raise OwnPlannerError(
                f"{name} does not catch LimitReached; it must, and return a Result with "
                "the best plan that it has, or with None"
            ) from error
        except Exception as error:
            raise OwnPlannerError(f"{name} raised {_told(error)}") from error

    return checked


def _told(error: Exception) -> str:
    """Says what was raised, and where."""
    where = extract_tb(error.__traceback__)[-1]
    file = Path(where.filename).name
    return f"{type(error).__name__}: {error} ({file}, line {where.lineno}, in {where.name})"


def usable_result(name: str, result: object) -> Result:
    """Returns a planner's result with a plan of plain states.

    Raises
    ------
    OwnPlannerError
        If it is not a result, or one that holds what it must not, in words.
    """
    makes = "a planner returns a Result, such as Result(plan, J, Reason.FINISHED)"
    if not isinstance(result, Result):
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
    """Returns a plan whose states, which may be tuples or have numbers of NumPy, are states.

    Raises
    ------
    ValueError
        If they are none, in words.
    """
    built = msgspec.to_builtins(plan, enc_hook=_plain_number)
    try:
        return msgspec.convert(built, Plan)
    except msgspec.ValidationError as error:
        raise ValueError(f"plan: {in_words(error, 'plan', Plan, built)}") from None


def _plain_number(value: object) -> object:
    """Returns a number of NumPy as one of Python."""
    if isinstance(value, np.generic):
        return value.item()
    raise msgspec.ValidationError(f"must hold states of whole numbers, not {value!r}")


# -- by name ----------------------------------------------------------------------------------


def _resolved(reference: str) -> _Call:
    """Imports what module:name stands for."""
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
            words = f"there is no module {name!r} in this folder, or among what is installed"
            raise OwnPlannerError(words) from error
        raise OwnPlannerError(f"{name} cannot be imported: {error}") from error
    except (Exception, SystemExit) as error:  # whatever its code does
        words, where = f"{type(error).__name__}: {error}", extract_tb(error.__traceback__)[-1]
        if not isinstance(error, SyntaxError):  # which says where it is
            words += f" ({Path(where.filename).name}, line {where.lineno})"
        raise OwnPlannerError(f"{name} cannot be imported: {words}") from error


def _checked(call: _Call, name: str) -> _Call:
    """Returns a planner that takes a problem and a stop, and perhaps a seed."""
    try:
        signature = inspect.signature(call)
    except (TypeError, ValueError):  # it does not tell
        return call
    try:
        signature.bind(None, None, **({_SEED: 0} if _takes_seed(call) else {}))
    except TypeError as error:
        words = (
            f"must be a function of a problem and a stop, and of a seed if it takes one: {error}"
        )
        raise OwnPlannerError(f"{name} {words}") from error
    return call


def _takes_seed(call: _Call) -> bool:
    try:
        parameter = inspect.signature(call).parameters.get(_SEED)
    except (TypeError, ValueError):
        return False
    return parameter is not None and parameter.kind in (
        inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY,
    )  # fmt: skip


def _is_at(call: _Call, module: str, path: str) -> bool:
    """Returns True if a module has a function under its own name."""
    found: Any = sys.modules.get(module)
    for name in path.split("."):
        found = getattr(found, name, None)
    return found is call


# -- in other processes -----------------------------------------------------------------------


def _received(reference: str, code: OwnCode) -> _Call:
    """Imports a planner from another process, with the code that it has there.

    The folders that it came from are taken if they are here, too, with the same code, as they may
    have more than code; else its files are written into a folder of their own. A worker lives
    longer than a command: modules of other code leave first.
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
    """Yields folders that together have a planner's code."""
    if not code.files:  # it is installed
        yield []
        return
    if all(any(_has(root, *file) for root in code.roots) for file in code.files.items()):
        yield [*code.roots]
    made = TemporaryDirectory(prefix="cocap-opt-planner-")
    _folders.append(made)  # it is there until this process ends
    folder = Path(made.name)
    for path, content in code.files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(content)
    yield [made.name]


def _has(root: str, path: str, content: bytes) -> bool:
    """Returns True if a folder has a file of this code."""
    try:
        return counted(path, Path(root, path).read_bytes()) == counted(path, content)
    except OSError:
        return False


def _put_first(folders: list[str]) -> None:
    """Lets modules be imported from folders before all others; the last such folders leave."""
    while _put:
        sys.path.remove(_put.pop())
    sys.path[:0] = folders
    _put.extend(folders)
    importlib.invalidate_caches()
