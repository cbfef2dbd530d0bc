"""Compiled functions that are kept on disk, and the marks by which a process knows of them."""

import logging
import os
import subprocess
import sys
import time
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

from cocap_opt.compiling import Kernel, apart, functions, kernel, marks
from cocap_opt.compiling.functions import CompilingError
from cocap_opt.stop import FirstOf, Interrupt, Limit, LimitReached, Stop, TimeLimit, never

MODULE = "cocap_opt.graph.sweep_kernel"


def test_what_was_kept_of_an_earlier_source_is_removed(tmp_path: Path) -> None:
    """Of the same function alone: it may name a class that is no longer there."""
    changed = Path(__file__).stat().st_mtime
    stem = __name__.rpartition(".")[2]

    def function() -> None:
        """Stands for one that is compiled."""

    own = f"{stem}.{function.__qualname__}"
    ages = {
        f"{own}-1.py311.nbi": -10.0, f"{own}-1.py311.1.nbc": -10.0,
        f"{own}-2.py311.nbi": 10.0, f"{stem}.other-1.py311.nbi": -10.0,
    }  # fmt: skip
    for name, age in ages.items():
        (tmp_path / name).touch()
        os.utime(tmp_path / name, (changed + age, changed + age))
    functions._forget_what_is_older(tmp_path, function, [Path(__file__)])
    assert {file.name for file in tmp_path.iterdir()} == {
        f"{own}-2.py311.nbi", f"{stem}.other-1.py311.nbi",
    }  # fmt: skip


def test_constants_of_other_modules_count_as_sources() -> None:
    """They are compiled in, and numba looks at the file of the function alone."""
    names = {path.name for path in functions.sources_of("cocap_opt.vision.view_kernel")}
    assert {"view_kernel.py", "candidates.py", "shadows.py", "visibility.py"} <= names


class Kept:
    """A module that is marked as compiled, in a folder of its own.

    Attributes
    ----------
    source, code, index : the module's file, and two of numba's
    """

    def __init__(self, folder: Path, patch: pytest.MonkeyPatch) -> None:
        if not functions.is_there():
            pytest.skip("needs the extra [fast]")
        self.folder, self.source = folder / "kept", folder / "kernel.py"
        self.code, self.index = folder / "kernel.f-1.1.nbc", folder / "kernel.f-1.nbi"
        for path in (self.source, self.code, self.index):
            path.write_text("first")
        patch.setenv("NUMBA_CACHE_DIR", str(self.folder))
        patch.setattr(marks, "sources_of", lambda module: (self.source,))
        self.mark()

    def mark(self) -> None:
        """Marks it as it is now."""
        marks.mark("any.kernel", [self.code, self.index])

    @property
    def is_marked(self) -> bool:
        """A process that begins now would load it."""
        return marks.is_marked("any.kernel")


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Kept:
    """One that has just been marked."""
    found = Kept(tmp_path, monkeypatch)
    assert found.is_marked
    return found


def test_what_is_removed_or_damaged_is_not_kept(kept: Kept) -> None:
    """An index may grow by another machine's code; code may not change."""
    kept.index.write_text("second")
    assert kept.is_marked
    kept.code.write_text("other")
    assert not kept.is_marked
    kept.code.write_text("first")
    assert kept.is_marked
    kept.index.unlink()
    assert not kept.is_marked


def test_what_was_compiled_under_other_circumstances_is_not_kept(
    kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By another numba, on another processor, with other settings, or of another source."""
    for change in (
        lambda patch: patch.setattr(marks, "version", lambda name: "0"),
        lambda patch: patch.setattr(marks, "_processor", lambda: "another"),
        lambda patch: patch.setenv("NUMBA_CPU_NAME", "generic"),
        lambda patch: patch.setattr(sys, "version", "4.0"),
    ):
        with monkeypatch.context() as patch:
            change(patch)
            assert not kept.is_marked
        assert kept.is_marked
    kept.source.write_text("second")
    assert not kept.is_marked


def test_without_a_version_or_a_source_nothing_is_kept(
    kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where numba was copied without what pip writes about it: NumPy's way goes on."""

    def fails(name: str) -> str:
        raise PackageNotFoundError(name)

    with monkeypatch.context() as patch:
        patch.setattr(marks, "version", fails)
        patch.setattr(functions, "kept_functions", lambda module: [])
        assert not kept.is_marked
        use = Kernel("any.kernel", "anything", 4.0)
        assert not use.is_kept
        use.spend(10.0)
        assert not use.is_loaded
        with pytest.raises(CompilingError, match="PackageNotFoundError"):
            use.load()
    assert kept.is_marked
    kept.source.unlink()
    assert not kept.is_marked


def test_one_mark_is_left_of_a_source_that_changes(
    kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Others stay: of the same source on another machine, and of other installations."""
    with monkeypatch.context() as patch:
        patch.setattr(marks, "_processor", lambda: "another")
        kept.mark()
        kept.source.write_text("second")
        kept.mark()  # the two of the first source are gone
        assert len([*kept.folder.iterdir()]) == 1
    kept.mark()
    assert len([*kept.folder.iterdir()]) == 2
    other = kept.source.with_name("elsewhere.py")
    other.write_text("third")
    monkeypatch.setattr(marks, "sources_of", lambda module: (other,))
    kept.mark()
    assert len([*kept.folder.iterdir()]) == 3


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"sources": {}, "kept": 3}', b"\xff"])
def test_a_damaged_mark_marks_nothing(kept: Kept, content: bytes) -> None:
    """It is a file that anything may happen to."""
    (mark,) = kept.folder.iterdir()
    mark.write_bytes(content)
    assert not kept.is_marked
    kept.mark()
    assert kept.is_marked


def test_marks_are_beside_the_source_where_no_folder_can_be_written(
    kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file is no folder."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(kept.source))
    assert not kept.is_marked
    kept.mark()
    assert kept.is_marked
    assert [*(kept.source.parent / "__pycache__").glob("kernel-*.kept")]


@pytest.mark.slow
def test_processes_know_without_numba_that_nothing_is_kept(tmp_path: Path) -> None:
    """Importing it takes half a second, and short runs have no use for it."""
    code = (
        "import sys; from cocap_opt.vision import sights; sights.KERNEL.spend(10.0); "
        "print(sights.KERNEL.is_loaded, 'numba' in sys.modules)"
    )
    environment = {
        **os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_CPU_NAME": "none such",
    }  # fmt: skip
    found = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert found.stdout.split() == ["False", "False"]


class Held(Stop):
    """Reached when asked a second time."""

    asked = 0

    def reached(self) -> Limit | None:
        """As Ctrl-C would."""
        self.asked += 1
        return Limit.INTERRUPT if self.asked > 1 else None


def slow(code: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets the other process do something else than compile."""
    monkeypatch.setattr(apart, "_CODE", code)
    monkeypatch.setattr(apart, "_LOOK", 0.01)


def test_a_limit_ends_the_other_process(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """However long a call of the compiler takes; and nobody is left behind."""
    ended = tmp_path / "ended"
    slow(f"import time; time.sleep(60); open({str(ended)!r}, 'w')", monkeypatch)
    with pytest.raises(LimitReached):
        apart.compile_apart(MODULE, MODULE, Held())
    assert not ended.exists()


def test_the_last_words_of_the_other_process_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there are none, its exit code."""
    slow("raise ImportError('numba needs NumPy 1.26 or less')", monkeypatch)
    with pytest.raises(CompilingError, match=r"\(ImportError: numba needs NumPy 1.26 or less\)"):
        apart.compile_apart(MODULE, MODULE, never)
    slow("import os; os._exit(3)", monkeypatch)
    with pytest.raises(CompilingError, match="exit code 3"):
        apart.compile_apart(MODULE, MODULE, never)


def test_without_python_to_start_it_is_compiled_here(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """As where the program is one file that has Python in it."""
    caplog.set_level("INFO")
    monkeypatch.setattr(sys, "executable", "")
    Kernel(MODULE, "value iteration", 4.0)._compile_apart([], never)
    assert "value iteration is compiled in this process" in caplog.text


def test_what_is_damaged_and_cannot_be_removed_is_not_used(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As in a folder that others have filled; numba would load what can be read of it."""
    monkeypatch.setattr(functions, "kept_functions", lambda module: [])
    monkeypatch.setattr(functions, "kept_files", lambda ours: [Path("any.nbc")])
    monkeypatch.setattr(marks, "is_marked", lambda module: False)
    monkeypatch.setattr(marks, "is_damaged", lambda module: True)
    monkeypatch.setattr(marks, "unmark", lambda module: None)
    with pytest.raises(CompilingError, match="cannot be removed"):
        Kernel(MODULE, "value iteration", 4.0).load()


@pytest.mark.skipif(not functions.is_there(), reason="needs the extra [fast]")
def test_stored_code_takes_over_at_once_and_other_code_takes_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What is stored is looked up once, and only if there is no time to compile."""
    asked: list[str] = []
    for is_kept in (True, False):
        monkeypatch.setattr(
            marks, "is_marked", lambda module, is_kept=is_kept: asked.append(module) or is_kept
        )
        use = Kernel(MODULE, "value iteration", 4.0)
        assert use.may_take_over(TimeLimit(4.5)) and not asked
        for seconds in (0.0, 3.5):
            assert use.may_take_over(TimeLimit(seconds)) == is_kept
        assert asked == [MODULE]
        asked.clear()
    use.is_loaded = True
    assert use.may_take_over(TimeLimit(0.0)) and not asked
    use.is_loaded, use.has_failed = False, True
    assert not use.may_take_over(never) and not use.takes_over_in_time(never)


def test_a_limit_ends_taking_over_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is not raised, as what asks has another way, which looks at the limit itself."""
    monkeypatch.setattr(functions, "is_there", lambda: True)
    monkeypatch.setattr(marks, "is_marked", lambda module: False)

    def stopped(self: Kernel, stop: Stop) -> None:
        raise LimitReached(Limit.TIME)

    monkeypatch.setattr(Kernel, "load", stopped)
    use = Kernel(MODULE, "value iteration", 4.0)
    with pytest.raises(LimitReached):
        use.takes_over(never)
    assert not use.takes_over_in_time(never)


@pytest.mark.parametrize(
    ("has_numba", "words"),
    [(True, "run `cocap-opt compile` (once"), (False, "run `pip install -e '.[fast]'`, which")],
)
def test_advice_is_given_once(
    has_numba: bool, words: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Where it is worth it, and not where the kernel is loaded."""
    monkeypatch.setattr(functions, "is_there", lambda: has_numba)
    monkeypatch.setattr("multiprocessing.parent_process", lambda: None)
    use = Kernel(MODULE, "coverage", 13.0)
    with caplog.at_level(logging.WARNING):
        use.advise("coverage", 1.0)
        assert not caplog.text
        for _ in range(2):
            use.advise("coverage", 7.3)
        loaded = Kernel(MODULE, "coverage", 13.0)
        loaded.is_loaded = True
        loaded.advise("coverage", 70.0)
    assert caplog.text.count("coverage took 7 s") == caplog.text.count(words) == 1


def test_processes_of_a_sweep_give_no_advice(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """There may be hundreds of them."""
    monkeypatch.setattr("multiprocessing.parent_process", lambda: object())
    with caplog.at_level(logging.WARNING):
        Kernel(MODULE, "coverage", 13.0).advise("coverage", 100.0)
    assert not caplog.text


def compiles_for_ever(use: Kernel, patch: pytest.MonkeyPatch) -> None:
    """Lets a kernel wait for a limit."""
    patch.setattr(functions, "is_there", lambda: True)
    patch.setattr(marks, "is_marked", lambda module: False)
    patch.setattr(kernel, "_LOADING", 0.0)

    def compile_(stop: Stop) -> None:
        while True:
            stop.check()

    patch.setattr(use, "_made", compile_)


def test_compiling_is_given_up_at_last(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Machines with much else to do compile several times as long, but not for ever."""
    use = Kernel(MODULE, "value iteration", 0.0)
    compiles_for_ever(use, monkeypatch)
    with caplog.at_level(logging.WARNING):
        for _ in range(2):
            use.prepare(0.01, never)
    assert use.has_failed and not use.is_loaded
    assert caplog.text.count("compiling is slow here; run `cocap-opt compile` beforehand") == 1


def test_time_limits_do_not_count_compiling(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a machine with much else to do it may take longer than the limit of a plan."""
    use, limit = Kernel(MODULE, "value iteration", 0.0), TimeLimit(5.0)
    compiles_for_ever(use, monkeypatch)
    monkeypatch.setattr(use, "_made", lambda stop: time.sleep(0.3))
    left = limit.seconds_left
    use.prepare(100.0, FirstOf(never, limit).before(0.1))
    assert use.is_loaded and left - limit.seconds_left < 0.2


def test_a_paused_limit_goes_on_where_it_was() -> None:
    """Inside it is not reached; pauses may lie in each other, and an interrupt is none of them."""
    limit, interrupt = TimeLimit(0.05), Interrupt()
    both = FirstOf(limit, interrupt)
    with both.paused(), limit.paused():
        time.sleep(0.06)
        assert both.reached() is None
        interrupt.pressed = True
        assert both.reached() is Limit.INTERRUPT
    assert limit.reached() is None
    time.sleep(0.06)
    assert limit.reached() is Limit.TIME


def test_an_interrupted_kernel_has_not_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C is passed on; what is compiled may be so another time."""
    use = Kernel(MODULE, "value iteration", 4.0)
    compiles_for_ever(use, monkeypatch)
    interrupt = Interrupt()
    interrupt.pressed = True
    with pytest.raises(LimitReached):
        use.prepare(100.0, interrupt)
    assert not use.has_failed and not use.is_loaded
