"""Compiled code that replaces computations by NumPy, and when a process uses it."""

import logging
import math
from contextlib import suppress
from functools import cached_property
from importlib import import_module
from threading import Lock
from typing import Any

from cocap_opt.compiling import functions, marks
from cocap_opt.compiling.functions import CompilingError
from cocap_opt.stop import FirstOf, LimitReached, Stop, TimeLimit, never

_log = logging.getLogger(__name__)

ALL_SECONDS = 34.0  # time that `cocap-opt compile` takes for all kernels
_FIRST = "%s is compiled first: about %.0f s, once per machine, not counted by time limits"
_LOADING = 1.0  # s of work with NumPy for which loading saves time
_REPAID = 1.25  # work with NumPy that justifies compiling, relative to the time of compiling
_FASTER = 8.0  # speed of compiled code relative to NumPy, at least
_PATIENT = 10.0  # longest wait on a busy machine, in multiples of the usual time of compiling
_LONG = 5.0  # s of work with NumPy after which the user is advised


class Tally:
    """The numbers of compilations that this process has begun and ended."""

    begun, ended = 0, 0

    @property
    def is_compiling(self) -> bool:
        """True while a kernel is being compiled."""
        return self.begun > self.ended


tally = Tally()


class Kernel:
    """Compiled code that replaces a computation by NumPy, and when this process uses it.

    Parameters
    ----------
    module : full name of the module whose `call_once()` makes numba load the code, or compile and
        store it
    name : the computation, in words
    compiling : time that compiling takes, s
    functions : full name of the module of the compiled functions, if it is another one

    Attributes
    ----------
    is_loaded : True if this process has loaded the compiled code, and uses it
    has_failed : True if this process has given it up, as numba fails or takes too long
    """

    def __init__(
        self, module: str, name: str, compiling: float, functions: str | None = None
    ) -> None:
        self.name, self.is_loaded = name, False
        self.functions = functions or module
        self._module, self._compiling = module, compiling
        self._lock, self.has_failed, self._is_missing = Lock(), False, False
        self._has_advised = False
        self._spent = 0.0  # s of work with NumPy

    def prepare(self, work: float, stop: Stop | None = None) -> None:
        """Loads the code, or compiles it, if that saves time for some work.

        Parameters
        ----------
        work : time that the work would take with NumPy, s
        stop : stopping criterion, which ends compiling; if None, nothing is compiled

        Raises
        ------
        LimitReached
            If a limit is reached before the code is compiled.
        """
        if stop is not None and not self._repays(min(work, stop.seconds_left)):
            stop = None
        self._load_where_worth_it(work, stop)

    def spend(self, seconds: float) -> None:
        """Adds to the time of work with NumPy; once that is long, loads the code if stored."""
        self._spent += seconds
        self._load_where_worth_it(self._spent, None)

    def expected(self, work: float) -> float:
        """Returns the seconds that work is expected to take, including any compilation.

        Parameters
        ----------
        work : time that it takes without further compilation, s
        """
        if self.is_loaded or not self.may_be_loaded or not self._repays(work):
            return work
        return self._compiling + work / _FASTER

    def advise(self, noun: str, seconds: float) -> None:
        """Tells the user, once, how to speed up work that took long with NumPy.

        Processes of a sweep do not, as there are many of them.
        """
        if self.is_loaded or self.has_failed or self._has_advised or seconds < _LONG:
            return
        from multiprocessing import parent_process  # slow to import, and rarely needed

        if parent_process() is not None:
            return
        self._has_advised = True
        ways = "`cocap-opt compile`"
        if not functions.is_there():
            ways = f"`pip install -e '.[fast]'`, which installs numba, and then {ways}"
        _log.warning(
            "%s took %.0f s: run %s (once, about %.0f s) to make it several times as fast",
            noun, seconds, ways, ALL_SECONDS,
        )  # fmt: skip

    @property
    def may_be_loaded(self) -> bool:
        """True if numba is installed, and has not failed in this process."""
        return functions.is_there() and not self.has_failed

    def may_take_over(self, stop: Stop) -> bool:
        """Returns True if `takes_over` is expected to succeed: the code is loaded or stored on
        disk, or enough time remains to compile it.

        Loading stored code takes half a second, which no limit counts.
        """
        if self.is_loaded:
            return True
        has_time = stop.seconds_left > self._compiling
        return self.may_be_loaded and (has_time or self._was_kept)

    @cached_property
    def _was_kept(self) -> bool:
        """True if the code was on disk when that was first asked, as looking takes 2 ms."""
        return self.is_kept

    @property
    def is_kept(self) -> bool:
        """True if the code is on disk, compiled by this version of numba for this machine."""
        return marks.is_marked(self.functions)

    def load(self, stop: Stop = never) -> None:
        """Loads the code, which is compiled first if it is not stored.

        Parameters
        ----------
        stop : stopping criterion, which ends compiling

        Raises
        ------
        CompilingError
            If numba cannot be loaded or cannot compile. The stored code is removed, as it may be
            damaged.
        LimitReached
            If a limit is reached before the code is compiled.
        """
        with self._lock:
            if not (self.is_loaded or self._load_kept()):
                self._compile(stop)

    def takes_over(self, stop: Stop, patience: float = math.inf) -> bool:
        """Loads the code, as `load` does, if numba is there; warns and returns False if that fails.

        Time limits of the stop are paused meanwhile, as compiling happens once per machine.

        Parameters
        ----------
        patience : time after which compiling is given up, s

        Raises
        ------
        LimitReached
            If another limit is reached before the code is compiled, or the patience has run out.
        """
        if not self.is_loaded and self.may_be_loaded:
            try:
                with stop.paused():
                    self.load(FirstOf(stop, TimeLimit(patience)))
            except CompilingError as error:
                self._fail(str(error))
        return self.is_loaded

    def takes_over_in_time(self, stop: Stop) -> bool:
        """Does the same as `takes_over`, if that is expected to succeed; does not raise
        LimitReached.
        """
        with suppress(LimitReached):
            return self.may_take_over(stop) and self.takes_over(stop)
        return False

    def _repays(self, work: float) -> bool:
        """Returns True if compiling saves time for work that takes so long with NumPy (s)."""
        return work > _REPAID * self._compiling

    def _load_where_worth_it(self, work: float, stop: Stop | None) -> None:
        """Loads the code for so much work (s); without a stop, only if it is stored."""
        if self.is_loaded or work < _LOADING or not self.may_be_loaded:
            return
        if self._is_missing and stop is None:  # known; called at every step
            return
        if stop is not None:
            self._take_over_within(work, stop)
            return
        with self._lock:
            self._is_missing = not (self.is_loaded or self._load_kept())

    def _take_over_within(self, work: float, stop: Stop) -> None:
        """Does the same as `takes_over`, but gives up if compiling takes far longer than usual.

        Compiling may take longer than the work itself (s), since it happens once per machine.
        """
        try:
            self.takes_over(stop, patience=max(work, _PATIENT * self._compiling))
        except LimitReached:
            stop.check()
            self._fail("compiling is slow here; run `cocap-opt compile` beforehand")

    def _fail(self, words: str) -> None:
        """Gives the code up in this process, with a warning."""
        self.has_failed = True
        _log.warning("%s is not compiled, and takes longer: %s", self.name, words)

    def _load_kept(self) -> bool:
        """Loads the stored code; returns False if there is none that can be used."""
        if not self.is_kept:
            return False
        try:
            with functions.nothing_compiled(functions.kept_functions(self.functions)):
                import_module(self._module).call_once()
        except functions.NotKeptError:
            marks.unmark(self.functions)
            return False
        except Exception as error:  # whatever goes wrong in a library
            _log.info("%s: the stored code cannot be loaded: %s", self.name, error)
            self._forget()
            return False
        self.is_loaded = True
        return True

    def _compile(self, stop: Stop) -> None:
        """Compiles and loads the code, with a message; after a failure no code is stored."""
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
        """Compiles the code, in another process if possible, and loads it."""
        ours = functions.kept_functions(self.functions)
        if marks.is_damaged(self.functions):  # numba would load the readable part of it
            self._forget()
            if functions.kept_files(ours):
                raise CompilingError("the stored code is damaged, and cannot be removed")
        if functions.can_be_kept(ours):
            self._compile_apart(ours, stop)
        import_module(self._module).call_once()
        if not self.is_kept:
            marks.mark(self.functions, functions.kept_files(ours))

    def _compile_apart(self, ours: list[Any], stop: Stop) -> None:
        """Compiles the functions in another process, if one can be started."""
        from cocap_opt.compiling.apart import compile_apart  # few processes need it

        try:
            try:
                compile_apart(self._module, self.functions, stop)
            except CompilingError:
                if not functions.kept_files(ours):
                    raise
                self._forget()  # it may have failed to load this
                compile_apart(self._module, self.functions, stop)
        except OSError as error:  # then it is compiled in this process, and Ctrl-C has to wait
            _log.info("%s is compiled in this process: %s", self.name, error)

    def _forget(self) -> None:
        """Removes the stored code and its marks."""
        marks.unmark(self.functions)
        try:
            functions.forget(functions.kept_functions(self.functions))
        except Exception as error:  # importing numba may fail
            _log.info("%s: the stored code was not removed: %s", self.name, error)
