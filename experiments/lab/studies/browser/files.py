"""Files for the page on which visitors check certificates: the checker, examples, a Python.

The Python is Pyodide, CPython as WebAssembly. The site serves it itself, from npm's package, and
not from a CDN. So the page sends no request to any other server, as it promises, and works wherever
its folder is served. Only the core is needed, as the checker imports only the standard library.
"""

import hashlib
import json
import shutil
import subprocess
import tarfile
from base64 import b64decode
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import msgspec

from cocap_opt.files.documents import encode
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.formulations.independent import cocap_check, instance_of
from cocap_opt.model import compiled
from cocap_opt.output.files import make_folder, save_files
from cocap_opt.planners import RECOMMENDED
from cocap_opt.problem import Plan, Problem
from cocap_opt.run.engine import run
from cocap_opt.scenarios import load_scene

PYODIDE = "314.0.7"
# Of npm's tarball, as in npm's registry.
_SHA512 = "0YvXxEhfEdpLfb/XkM2BFAeMROq0iMUX2bzzH9pOttyMcWkwq+HbE5uyuGD82LN7y2q+SNvi/6V5JEsOlD2R1A=="
# Scripts end in .js on the site, as servers that do not know .mjs do not serve it as a script.
_CORE = {
    "pyodide.mjs": "pyodide.js",
    "pyodide.asm.mjs": "pyodide.asm.js",
    "pyodide.asm.wasm": "pyodide.asm.wasm",
    "python_stdlib.zip": "python_stdlib.zip",
    "pyodide-lock.json": "pyodide-lock.json",
}
_FETCHED = ("pyodide.asm.wasm", "python_stdlib.zip", "pyodide-lock.json")  # for Pyodide
EXAMPLE = "corridor"
_ALTERED = 0.99  # the altered certificate claims this times the bound
_PATIENCE = 120.0  # s, for npm


class Certified(NamedTuple):
    """A built-in scene with seed 0, a plan, and the certificate of a bound that starts from it.

    Attributes
    ----------
    plan_content, content : the files of the plan and of the certificate
    """

    problem: Problem
    plan: Plan
    plan_content: bytes
    certificate: CertificateFile | ProofFile
    content: bytes


@cache
def certified(scene: str) -> Certified:
    """Plans a scene and bounds it as `plan` and `bound --start` do by default."""
    problem = load_scene(scene, 0)
    planned = run(problem, RECOMMENDED)
    plan, file = planned.result.plan, planned.plan_file(problem, RECOMMENDED)
    bounded = run(problem, "column-generation", start=plan)
    certificate = bounded.result.certificate
    assert plan is not None
    assert file is not None
    assert certificate is not None
    return Certified(problem, plan, encode(file), certificate, encode(certificate))


def instance(problem: Problem) -> bytes:
    """Returns the instance of a problem, as `export` writes it."""
    return instance_of(compiled(problem)).encode()


def examples() -> dict[str, bytes]:
    """Returns the files that the page can load: those of one scene, and an altered certificate.

    The altered certificate claims a bound 1 % below the bound that its numbers prove.
    """
    found = certified(EXAMPLE)
    bound = found.certificate.bound
    assert bound is not None
    altered = msgspec.structs.replace(found.certificate, bound=_ALTERED * bound)
    return {
        f"{EXAMPLE}.instance": instance(found.problem),
        f"{EXAMPLE}-plan.json": found.plan_content,
        f"{EXAMPLE}.json": found.content,
        f"{EXAMPLE}-altered.json": encode(altered),
    }


def checker() -> bytes:
    """Returns the file `cocap_check.py`."""
    return Path(cocap_check.__file__).read_bytes()


def copied_in_words() -> str:
    """Returns a sentence with the SHA-256 of `cocap_check.py`, as the site has a copy."""
    return f"Its SHA-256 is `{hashlib.sha256(checker()).hexdigest()}`."


@cache
def pyodide() -> dict[str, bytes] | None:
    """Returns the core of Pyodide by its file names on the site, from npm or its cache.

    It is None if npm is not installed, or finds the package neither in its cache nor online.

    Raises
    ------
    ValueError
        If npm's file does not have the known SHA-512.
    """
    npm = shutil.which("npm")
    if npm is None:
        return None
    with TemporaryDirectory() as folder:
        command = [
            npm, "pack", f"pyodide@{PYODIDE}", "--prefer-offline", "--fetch-retries=0", "--silent",
            "--pack-destination", folder,
        ]  # fmt: skip
        try:
            done = subprocess.run(command, capture_output=True, timeout=_PATIENCE, check=False)
        except subprocess.TimeoutExpired:
            return None
        tarballs = list(Path(folder).glob("*.tgz"))
        if done.returncode or not tarballs:
            return None
        return _core(tarballs[0])


def _core(tarball: Path) -> dict[str, bytes]:
    """Returns the files of npm's tarball that the site needs."""
    if hashlib.sha512(tarball.read_bytes()).digest() != b64decode(_SHA512):
        raise ValueError(f"pyodide {PYODIDE} of npm: its SHA-512 is not {_SHA512}")
    core = {}
    with tarfile.open(tarball) as archive:
        for name, ours in _CORE.items():
            member = archive.extractfile(f"package/{name}")
            assert member is not None
            core[ours] = member.read()
    return core


def write_check(folder: Path) -> bool:
    """Writes all files of the page into a folder; returns True if Python is among them."""
    core = pyodide()
    contents = {folder / "cocap_check.py": checker()}
    contents |= {folder / name: content for name, content in examples().items()}
    if core is not None:
        about = {"pyodide": PYODIDE, "bytes": sum(len(core[name]) for name in _FETCHED)}
        contents |= {folder / "pyodide" / name: content for name, content in core.items()}
        contents[folder / "files.json"] = json.dumps(about).encode()
    make_folder(folder, *([] if core is None else ["pyodide"]))
    save_files(contents)
    return core is not None
