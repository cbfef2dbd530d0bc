"""All kernels of the project, compiled in an empty folder: left alone, and under attack."""

import ast
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np
import psutil
import pytest
from sources import sources

from cocap_opt import compiling
from cocap_opt.cli.scene_commands import kernels

HAS_NUMBA = pytest.mark.skipif(not compiling.is_there(), reason="needs the extra [fast]")
# Loads value iteration, compiled or not, and says how that went and what it finds.
SWEEP = """
import numpy as np
from cocap_opt.graph import value_iteration
from cocap_opt.graph.value_iteration import backward_sweep
from cocap_opt.model import Model
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import never

use = value_iteration.KERNEL
has_taken_over = use.takes_over(never)
graph = Model(load_scene("corridor", 0), use_cache=False).classes[0].graph
reward = graph.no_reward(3)
reward[reward == 0] = np.random.default_rng(0).random(np.count_nonzero(reward == 0))
found = backward_sweep(graph, reward)
use.is_loaded, use.has_failed = False, True
print(has_taken_over, np.array_equal(found, backward_sweep(graph, reward)))
"""
# What Ctrl-C meets in `plan` and `gap` while coverage is compiled.
INTERRUPTED = """
from cocap_opt.stop import Interrupt, LimitReached
from cocap_opt.vision import sights

with Interrupt.caught() as interrupt:
    try:
        sights.KERNEL.prepare(1e9, interrupt)
    except LimitReached as reached:
        print(reached.limit, sights.KERNEL.is_loaded)
"""


def uses_compiled(path: Path) -> bool:
    """True for a module with functions that are compiled, not only into their callers."""
    text = path.read_text("utf-8")
    if "from cocap_opt.compiling import" not in text:
        return False
    names = [
        alias.name
        for node in ast.parse(text).body
        if isinstance(node, ast.ImportFrom) and node.module == "cocap_opt.compiling"
        for alias in node.names
    ]
    rest = text.replace("partial(compiled, kept=False", "")
    return "compiled" in names and any(use in rest for use in ("@compiled", "(compiled,"))


def test_no_module_that_compiles_is_left_out() -> None:
    """`cocap-opt compile` compiles all of them."""
    modules = {name for name, path in sources().items() if uses_compiled(path)}
    assert modules == {kernel.functions for kernel in kernels()}


def test_the_advice_says_what_all_kernels_take() -> None:
    """`cocap-opt compile` compiles all of them, not only the one that would have been of use."""
    assert sum(kernel._compiling for kernel in kernels()) == compiling.ALL_SECONDS


@HAS_NUMBA
@pytest.mark.long
def test_no_compiled_function_is_left_out() -> None:
    """Each is compiled ahead, for one kind of arguments."""
    code = """\
from cocap_opt.cli.scene_commands import kernels
from cocap_opt.compiling import functions
for kernel in kernels():
    kernel.load()
    assert kernel.is_loaded and kernel.is_kept
    every = functions.kept_functions(kernel.functions)
    assert every and all(len(function.signatures) == 1 for function in every)
"""
    # In a process of its own: other tests compile them for arrays of other kinds.
    ended(started(code, os.environ))


@pytest.fixture
def environment(tmp_path: Path) -> Mapping[str, str]:
    """Nothing is kept in it."""
    return {
        **os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "numba"),
        "COCAP_OPT_CACHE": str(tmp_path / "cocap-opt"),
    }  # fmt: skip


def started(code: str, environment: Mapping[str, str]) -> "subprocess.Popen[str]":
    """A process that runs some code."""
    return subprocess.Popen(
        [sys.executable, "-c", code], env=environment, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def ended(process: "subprocess.Popen[str]") -> tuple[str, str]:
    """What it says on standard output and standard error; it ends well."""
    said = process.communicate()
    assert not process.returncode, said
    return said


@HAS_NUMBA
@pytest.mark.long
def test_the_first_ctrl_c_ends_compiling(environment: Mapping[str, str]) -> None:
    """At once, not when it is compiled; nothing is kept, and nobody is left behind."""
    with started(INTERRUPTED, environment) as process:
        assert process.stderr is not None
        assert "is compiled first" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        said, _ = ended(process)
    assert said.split() == ["interrupt", "False"]
    assert not [*Path(environment["NUMBA_CACHE_DIR"]).rglob("*.nbc")]


@HAS_NUMBA
@pytest.mark.long
def test_two_processes_compile_at_once(environment: Mapping[str, str]) -> None:
    """Both have a kernel that finds what NumPy finds, and so has the next, which compiles none."""
    both = [started(SWEEP, environment) for _ in range(2)]
    assert [ended(process)[0].split() for process in both] == [["True", "True"]] * 2
    said, told = ended(started(SWEEP, environment))
    assert said.split() == ["True", "True"] and "compiled" not in told


@HAS_NUMBA
@pytest.mark.long
@pytest.mark.parametrize("after", [None, "*.nbi", "*.nbc"])
def test_a_process_that_is_killed_harms_no_later_one(
    after: str | None, environment: Mapping[str, str]
) -> None:
    """While it compiles: before any file is there, after the first index, or the first code."""
    with started(SWEEP, environment) as process:
        assert process.stderr is not None
        assert "is compiled first" in process.stderr.readline()
        folder, compiling = Path(environment["NUMBA_CACHE_DIR"]), list[psutil.Process]()
        while after and process.poll() is None and not [*folder.rglob(after)]:
            time.sleep(0.001)
        with suppress(psutil.NoSuchProcess):
            compiling = psutil.Process(process.pid).children()
        process.kill()
    assert not psutil.wait_procs(compiling, timeout=20)[1]  # they end with whom they work for
    assert ended(started(SWEEP, environment))[0].split() == ["True", "True"]


@HAS_NUMBA
@pytest.mark.long
@pytest.mark.parametrize(
    ("pattern", "has_mark"), [("*.nbc", True), ("*.nbc", False), ("*.nbi", True)]
)
def test_what_is_damaged_is_compiled_again(
    pattern: str, has_mark: bool, environment: Mapping[str, str]
) -> None:
    """Code and indices, and whether a mark tells of it or not."""
    ended(started(SWEEP, environment))
    folder = Path(environment["NUMBA_CACHE_DIR"])
    for path in folder.rglob(pattern):
        path.write_bytes(np.random.default_rng(0).bytes(path.stat().st_size))
    for path in () if has_mark else [*folder.rglob("*.kept")]:
        path.unlink()
    for is_first in (True, False):
        said, told = ended(started(SWEEP, environment))
        assert said.split() == ["True", "True"]
        assert ("compiled first" in told) == is_first


@HAS_NUMBA
@pytest.mark.long
def test_code_of_another_processor_is_not_compiled_unasked(environment: Mapping[str, str]) -> None:
    """Where a mark says that it is kept, and numba finds nothing: short runs do without."""
    ended(started(SWEEP, environment))
    (mark,) = Path(environment["NUMBA_CACHE_DIR"]).glob("*.kept")
    code = (
        "from cocap_opt.compiling import marks; from cocap_opt.graph import value_iteration; "
        f"marks._made_by = lambda module: {mark.stem.rpartition('-')[2]!r}; "
        "use = value_iteration.KERNEL; print(use.is_kept); "
        "use.spend(10.0); print(use.is_loaded, use.is_kept)"
    )
    said, told = ended(started(code, {**environment, "NUMBA_CPU_NAME": "generic"}))
    assert said.split() == ["True", "False", "False"] and not told
