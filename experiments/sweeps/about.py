"""What a run was: its machine, versions and settings, so that it can be made again."""

import os
import platform
import sys
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

import msgspec

from cocap_opt.coverage import usable_cores
from cocap_opt.io import decode, encode, read_bytes
from experiments.files import save_bytes
from experiments.sweeps.cells import code_digest
from experiments.sweeps.run import Settings

PACKAGES = (
    "cocap-opt", "clarabel", "cvxpy", "distributed", "embreex", "highspy", "networkx", "numpy",
    "ortools", "pyscipopt", "scipy", "trimesh",
)  # fmt: skip


class RunFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The file run.json of a sweep's folder; it tells of the last run in it."""

    format: Literal["cocap-opt run"] = "cocap-opt run"
    version: Literal[1] = 1
    command: list[str]
    began: str  # date and time, UTC
    settings: Settings
    scenes: list[str]
    seeds: list[int]
    workers: str
    code: str  # digest
    machine: dict[str, str]
    packages: dict[str, str]


def about_run(settings: Settings, scenes: list[str], seeds: list[int], workers: str) -> RunFile:
    """What the run that begins now is."""
    return RunFile(
        command=[*_program(), *sys.argv[1:]],
        began=datetime.now(UTC).isoformat(timespec="seconds"),
        settings=settings,
        scenes=scenes,
        seeds=seeds,
        workers=workers,
        code=code_digest(),
        machine={
            "system": platform.platform(),
            "processor": _processor(),
            "cores": str(usable_cores()),
            "memory": _memory(),
            "python": platform.python_version(),
        },
        packages={name: found for name in PACKAGES if (found := _version(name))},
    )


def save_run(folder: Path, content: RunFile) -> None:
    """Write run.json."""
    save_bytes(folder / "run.json", encode(content))


def load_run(folder: Path) -> RunFile:
    """Read run.json."""
    path = folder / "run.json"
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
