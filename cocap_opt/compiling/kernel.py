"""Compiled code that does what NumPy does as well, and when a process uses it."""

import logging
import math
from importlib import import_module
from threading import Lock
from typing import Any

from cocap_opt.compiling import functions, marks
from cocap_opt.compiling.functions import CompilingError
from cocap_opt.stop import FirstOf, LimitReached, Stop, TimeLimit, never

_log = logging.getLogger(__name__)

ALL_SECONDS = 28.0  # that `cocap-opt compile` takes, the sum over all kernels
_FIRST = "%s is compiled first, once on this machine: some %.0f s, which no time limit counts"
_LOADING = 1.0  # s of NumPy's way that make loading worth it
_REPAID = 1.25  # times as long as compiling NumPy's way must take
_FASTER = 8.0  # times, at least
_PATIENT = 10.0  # times the seconds of compiling, on a machine that has much else to do
_LONG = 5.0  # s of NumPy's way, after which advice is wanted


class Tally:
    """Numbers of kernels that this process has begun to compile, and is done with."""

    begun, ended = 0, 0

    @property
    def is_compiling(self) -> bool:
        """A kernel is being compiled."""
        return self.begun > self.ended


tally = Tally()


class Kernel:
    """Compiled code that does what NumPy does as well, and when this process uses it.

    Parameters
    ----------
    module : full name of the one whose `call_once()` makes numba load it, or compile and keep it
    name : what it finds, in words
    compiling : s that compiling takes
    functions : full name of the module of its compiled functions, if it is another one

    Attributes
    ----------
    is_loaded : this process has the compiled code in memory and uses it
    has_failed : it is given up in this process, as numba fails or takes too long
    """

    def __init__(
        self, module: str, name: str, compiling: float, functions: str | None = None
    ) -> None:
        self.name, self.is_loaded = name, False
        self.functions = functions or module
        self._module, self._compiling = module, compiling
        self._lock, self.has_failed, self._is_missing = Lock(), False, False
        self._has_advised = False
        self._spent = 0.0  # s, by NumPy's way

    def prepare(self, work: float, stop: Stop | None = None) -> None:
        """Loads it if what is to be done soon repays that, or compiles it if that is repaid.

        Parameters
        ----------
        work : s that it would take by NumPy's way
        stop : stopping criterion, which ends compiling; if None, nothing is compiled

        Raises
        ------
        LimitReached
            If a limit is reached before it is compiled.
        """
        if stop is not None and not self._repays(min(work, stop.seconds_left)):
            stop = None
        self._load_where_worth_it(work, stop)

    def spend(self, seconds: float) -> None:
        """Notes what was done by NumPy's way; loads the kernel, if it is kept, once it is much."""
        self._spent += seconds
        self._load_where_worth_it(self._spent, None)

    def expected(self, work: float) -> float:
        """Returns the seconds that work is expected to take, once it is begun.

        Parameters
        ----------
        work : s that it takes now
        """
        if self.is_loaded or not self.may_be_loaded or not self._repays(work):
            return work
        return self._compiling + work / _FASTER

    def advise(self, noun: str, seconds: float) -> None:
        """Says, once, how that is done faster from then on which took long by NumPy's way.

        Processes of a sweep say nothing: there are many of them.
        """
        if self.is_loaded or self.has_failed or self._has_advised or seconds < _LONG:
            return
        from multiprocessing import parent_process  # few processes come this far

        if parent_process() is not None:
            return
        self._has_advised = True
        ways = "`cocap-opt compile`"
        if not functions.is_there():
            ways = f"`pip install -e '.[fast]'`, which installs numba, and then {ways}"
        _log.warning(
            "%s took %.0f s: %s (%.0f s, once) makes it several times as fast from then on",
            noun, seconds, ways, ALL_SECONDS,
        )  # fmt: skip

    @property
    def may_be_loaded(self) -> bool:
        """numba is installed, and has not failed in this process."""
        return functions.is_there() and not self.has_failed

    @property
    def is_kept(self) -> bool:
        """It is on disk, compiled by this numba for this machine."""
        return marks.is_marked(self.functions)

    def load(self, stop: Stop = never) -> None:
        """Loads it, and compiles it before if it is not kept.

        Parameters
        ----------
        stop : stopping criterion, which ends compiling

        Raises
        ------
        CompilingError
            If numba cannot be loaded, or compiles nothing. What it has kept is removed: it may be
            damaged.
        LimitReached
            If a limit is reached before it is compiled.
        """
        with self._lock:
            if not (self.is_loaded or self._load_kept()):
                self._compile(stop)

    def takes_over(self, stop: Stop, patience: float = math.inf) -> bool:
        """Loads it, as `load` does, where numba is; returns False, which is said, if that fails.

        Time limits of the stop do not count meanwhile: it is done once on a machine.

        Parameters
        ----------
        patience : s, after which it is given up

        Raises
        ------
        LimitReached
            If another limit is reached before it is compiled, or the patience is at its end.
        """
        if not self.is_loaded and self.may_be_loaded:
            try:
                with stop.paused():
                    self.load(FirstOf(stop, TimeLimit(patience)))
            except CompilingError as error:
                self._fail(str(error))
        return self.is_loaded

    def _repays(self, work: float) -> bool:
        """Returns True for work (s, by NumPy's way) that compiling makes shorter."""
        return work > _REPAID * self._compiling

    def _load_where_worth_it(self, work: float, stop: Stop | None) -> None:
        """Loads it for so much work (s); without a stop only if it is kept."""
        if self.is_loaded or work < _LOADING or not self.may_be_loaded:
            return
        if self._is_missing and stop is None:  # known, and asked at every step of a sweep
            return
        if stop is not None:
            self._take_over_within(work, stop)
            return
        with self._lock:
            self._is_missing = not (self.is_loaded or self._load_kept())

    def _take_over_within(self, work: float, stop: Stop) -> None:
        """Does as `takes_over` does, but gives it up where it takes far longer than elsewhere.

        It may take longer than the work (s) does without it, since it is done once on a machine.
        """
        try:
            self.takes_over(stop, patience=max(work, _PATIENT * self._compiling))
        except LimitReached:
            stop.check()
            self._fail("compiling takes long here; `cocap-opt compile` does it ahead")

    def _fail(self, words: str) -> None:
        """Gives it up in this process."""
        self.has_failed = True
        _log.warning("%s is not compiled, and takes longer: %s", self.name, words)

    def _load_kept(self) -> bool:
        """Loads what is kept; returns False if nothing is, or nothing that can be used."""
        if not self.is_kept:
            return False
        try:
            with functions.nothing_compiled(functions.kept_functions(self.functions)):
                import_module(self._module).call_once()
        except functions.NotKeptError:
            marks.unmark(self.functions)
            return False
        except Exception as error:  # whatever goes wrong in a library
            _log.info("%s: what was kept cannot be loaded: %s", self.name, error)
            self._forget()
            return False
        self.is_loaded = True
        return True

    def _compile(self, stop: Stop) -> None:
        """Compiles and loads it, which is said; what fails leaves nothing kept."""
        _log.warning(_FIRST, self.name, self._compiling)
        tally.begun += 1
        try:
            self._made(stop)
        except LimitReached:
            raise
        except Exception as error:  # whatever goes wrong in a library
            self._forget()
            if isinstance(error, CompilingError):
                raise
            raise CompilingError(f"numba fails ({type(error).__name__}: {error})") from error
        finally:
            tally.ended += 1
        self.is_loaded = True

    def _made(self, stop: Stop) -> None:
        """Compiles it wherever that can be done, and loads it."""
        ours = functions.kept_functions(self.functions)
        if marks.is_damaged(self.functions):  # numba would load what can be read of it
            self._forget()
            if functions.kept_files(ours):
                raise CompilingError("what is kept is damaged, and cannot be removed")
        if functions.can_be_kept(ours):
            self._compile_apart(ours, stop)
        import_module(self._module).call_once()
        if not self.is_kept:
            marks.mark(self.functions, functions.kept_files(ours))

    def _compile_apart(self, ours: list[Any], stop: Stop) -> None:
        """Compiles its functions in another process, where there can be one."""
        from cocap_opt.compiling.apart import compile_apart  # few processes compile

        try:
            try:
                compile_apart(self._module, self.functions, stop)
            except CompilingError:
                if not functions.kept_files(ours):
                    raise
                self._forget()  # what it has tried to load
                compile_apart(self._module, self.functions, stop)
        except OSError as error:  # then it is compiled here, where Ctrl-C waits for it
            _log.info("%s is compiled in this process: %s", self.name, error)

    def _forget(self) -> None:
        """Removes all that is kept of it."""
        marks.unmark(self.functions)
        try:
            functions.forget(functions.kept_functions(self.functions))
        except Exception as error:  # as numba is imported
            _log.info("%s: nothing is removed: %s", self.name, error)
