"""What the runs in a folder were: machines, versions, settings, so that they can be made again."""

import hashlib
import os
import platform
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

import msgspec

from cocap_opt import scenarios
from cocap_opt.experiments.results.files import save_bytes
from cocap_opt.experiments.sweeps.cells import code_digest
from cocap_opt.experiments.sweeps.run import Settings
from cocap_opt.files.documents import decode, encode, read_bytes
from cocap_opt.vision.coverage import usable_cores

PACKAGES = (
    "cocap-opt", "clarabel", "cvxpy", "distributed", "embreex", "highspy", "networkx", "numpy",
    "ortools", "pyscipopt", "scipy", "trimesh",
)  # fmt: skip

RUN = "run.json"


class Run(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One command, and where it ran."""

    command: list[str]
    began: str  # date and time, UTC
    scenes: list[str]
    seeds: list[int]
    workers: str
    machine: dict[str, str]
    packages: dict[str, str]


class RunFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The file run.json of a sweep's folder: all runs that its results are of.

    They have the same settings and the same code, else their rows would not stand side by side.
    """

    format: Literal["cocap-opt run"] = "cocap-opt run"
    version: Literal[2] = 2
    settings: Settings
    code: str  # digest of what rows depend on, scenes included
    runs: list[Run]


def about_run(scenes: list[str], seeds: list[int], workers: str) -> Run:
    """What the run that begins now is."""
    return Run(
        command=[*_program(), *sys.argv[1:]],
        began=datetime.now(UTC).isoformat(timespec="seconds"),
        scenes=scenes,
        seeds=seeds,
        workers=workers,
        machine={
            "system": platform.platform(),
            "processor": _processor(),
            "cores": str(usable_cores()),
            "memory": _memory(),
            "python": platform.python_version(),
        },
        packages={name: found for name in PACKAGES if (found := _version(name))},
    )


@cache
def rows_digest() -> str:
    """Digest of the code that rows depend on: that of cells, and that of built-in scenes."""
    digest = hashlib.sha256(code_digest().encode())
    for path in sorted(Path(str(scenarios.__file__)).parent.rglob("*.py")):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


def save_run(folder: Path, settings: Settings, before: Sequence[Run], run: Run) -> None:
    """Write run.json. A run that was there already, but for its time, stays as it was."""
    again = any(msgspec.structs.replace(known, began=run.began) == run for known in before)
    runs = [*before] if again else [*before, run]
    content = RunFile(settings=settings, code=rows_digest(), runs=runs)
    save_bytes(folder / RUN, encode(content))


def load_run(folder: Path) -> RunFile:
    """Read run.json."""
    path = folder / RUN
    return decode(read_bytes(path), RunFile, str(path))


def _program() -> list[str]:
    """How this process was called: as a module, or by the command's name."""
    spec = sys.modules["__main__"].__spec__
    if spec is None:
        return ["cocap-opt"]
    return ["python", "-m", spec.name.removesuffix(".__main__")]


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:  # an optional one
        return ""


def _processor() -> str:
    """The processor's name, where the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _memory() -> str:
    if not hasattr(os, "sysconf"):
        return "unknown"
    return f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 1e9:.0f} GB"
