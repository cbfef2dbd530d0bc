"""When views are found by the compiled kernel: where numba is installed, and it pays.

To compile the kernel takes a quarter of a minute, once on a machine; to load what is kept half a
second, once in a process. NumPy's way takes about half a microsecond for a view of a person. So the
kernel is loaded once so much is to be done that loading is soon repaid, and compiled if the work at
hand repays that within the same run; `cocap-opt compile` does so ahead.
"""

import logging
from threading import Lock

from cocap_opt.compiling import is_there

_log = logging.getLogger(__name__)

_EACH = 5e-7  # s, of NumPy's way for a view of a person: measured
_LOADING = 1.0  # s of NumPy's way, from which on loading is worth it
_COMPILING = 15.0  # s
_REPAID = 2.0  # times as long as compiling NumPy's way must take


class KernelUse:
    """The state of a process: whether the kernel is loaded, and what was done without it.

    Attributes
    ----------
    is_loaded : the kernel is loaded, so that it is used
    """

    def __init__(self) -> None:
        self.is_loaded = False
        self._lock = Lock()
        self._spent = 0.0  # s, by NumPy's way

    def prepare(self, views: int, people: int, seconds: float) -> None:
        """Loads or compiles the kernel if so many views of people, to be found soon, repay it.

        Parameters
        ----------
        seconds : s, that are left
        """
        work = _EACH * views * people
        self._load(work, min(work, seconds) > _REPAID * _COMPILING)

    def spend(self, views: int, people: int) -> None:
        """Notes views that NumPy has found; loads the kernel, if it is kept, once they are many."""
        self._spent += _EACH * views * people
        self._load(self._spent, False)

    def load(self) -> None:
        """Loads the kernel, and compiles it if it is not kept."""
        from cocap_opt.vision.compiled_sight import call_once

        call_once()
        self.is_loaded = True

    def _load(self, work: float, may_compile: bool) -> None:
        if self.is_loaded or work < _LOADING or not is_there():
            return
        with self._lock:
            if self.is_loaded:
                return
            from cocap_opt.vision.compiled_sight import is_kept

            if not is_kept():
                if not may_compile:
                    return
                _log.warning("coverage is compiled first, once on this machine: some 15 s")
            self.load()


KERNEL = KernelUse()
