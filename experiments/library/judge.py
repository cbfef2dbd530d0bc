"""Statements that files prove, as `cocap-check` or `cocap-check-verified` print them.

The checkers are run as their pages describe: as commands with files, whose exit code and output
line give the answer. They have their own processes, so a time limit ends them even if a malicious
file keeps them busy.
"""

import math
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Literal, NamedTuple

from cocap_opt.files.documents import FileError
from cocap_opt.formulations.independent import cocap_check
from cocap_opt.formulations.independent.machine_checked import checking

PLAN, BOUND = "plan", "bound"
TIME_LIMIT = 3600.0  # seconds for a file
BRANCHES = 10**12  # branches of searches: so many that only the time limit ends them
NO_PLAN = -math.inf  # the bound if the checker states that no plan exists

_NUMBER = r"(-?\d+\.\d+)"
_SAYS = (
    (PLAN, re.compile(rf"J of this plan is at least {_NUMBER}")),
    (BOUND, re.compile(rf"no plan has more than {_NUMBER}")),
    (BOUND, re.compile(rf"no plan exists: J would be at most {_NUMBER}, but no J is below 0")),
    (BOUND, re.compile("no plan exists: a drone has no path left")),
)
_SAYS_VERIFIED = re.compile(r"no plan has more than (-?\d+) / (\d+), that is .*")
_HOLDS, _REFUSED, _WRONG_CALL, _BY_SEARCH = 0, 1, 2, 3
_CHECKER = Path(cocap_check.__file__)
_NAME, _VERIFIED = "`cocap-check`", "`cocap-check-verified`"


class Proved(NamedTuple):
    """The statement that a file proves.

    Attributes
    ----------
    kind : `plan`: J of the plan is at least `value`; `bound`: no plan's J exceeds `value`
    value : in units of J; as no J is below 0, a bound below 0 means that there is no plan
    """

    kind: Literal["plan", "bound"]
    value: float


class _Answer(NamedTuple):
    """Exit code and lines of a checker, and the last line of its errors."""

    code: int
    lines: list[str]
    error: str


def proved(
    instance: Path,
    content: bytes,
    name: str,
    time_limit: float = TIME_LIMIT,
    verified: Path | None = None,
) -> Proved:
    """Runs a checker on a plan, a certificate or a proof, and returns what it proves.

    Parameters
    ----------
    instance : file of the instance
    content : of the plan, certificate or proof
    name : name of that file, for messages
    time_limit : seconds; inf for none
    verified : the program `cocap-check-verified`, for certificates and proofs, which proves the
        bound that the file claims; None: `cocap-check`, which computes the bound

    Raises
    ------
    FileError
        If the checker rejects the file, does not finish a search that its claim needs, or exceeds
        the time limit; one line.
    """
    with tempfile.TemporaryDirectory() as folder:
        claim = Path(folder) / "claim"
        claim.write_bytes(content)
        if verified is not None:
            return _proved_in_coq(verified, instance, claim, name, time_limit)
        command = [sys.executable, str(_CHECKER), "--branches", str(BRANCHES)]
        code, lines, error = _run([*command, str(instance), str(claim)], _NAME, name, time_limit)
        words = "".join(line.removeprefix(f"{claim}: ") for line in lines[1:])
    if code < 0 or not lines:
        raise FileError(f"{name}: not judged: {_NAME} ended with code {code}: {error}")
    if code == _WRONG_CALL:
        words = lines[0].removeprefix(f"{claim}: ").removeprefix(f"{instance}: ")
    if code == _BY_SEARCH:
        raise FileError(f"{name}: refused: its claim needs a search that is too large for {_NAME}")
    if code == _HOLDS:
        for kind, pattern in _SAYS:
            if found := pattern.fullmatch(words):
                value = float(found[1]) if found.groups() else NO_PLAN
                if words.startswith("no plan exists") and value >= 0:  # a bound rounded up to 0
                    value = NO_PLAN
                return Proved("plan" if kind == PLAN else "bound", value)
    reason = " ".join(words.removeprefix("refused: ").split()) or "the instance cannot be read"
    raise FileError(f"{name}: refused: {reason[:200]}")


def _proved_in_coq(
    program: Path, instance: Path, claim: Path, name: str, time_limit: float
) -> Proved:
    """Runs the verified checker on a certificate or proof; raises FileError as `proved` does."""
    commands = checking(program, instance, claim, claim.with_name("lowered"))
    until = time.monotonic() + time_limit
    for command in commands:
        left = max(until - time.monotonic(), 0.0)
        code, lines, error = _run(command, _VERIFIED, name, left, time_limit)
        reason = " ".join(" ".join([*lines, error]).replace(f"{claim}: ", "").split())[:200]
        if code not in (_HOLDS, _REFUSED, _BY_SEARCH) or "cocap-lowered" in reason:
            program_name = Path(command[1] if command is commands.lower else command[0]).name
            raise FileError(f"{name}: not judged: {program_name} ended with code {code}: {reason}")
        if code != _HOLDS:
            raise FileError(f"{name}: refused: {reason.removeprefix('refused: ')}")
    found = _SAYS_VERIFIED.fullmatch("".join(lines))
    if found is None:
        raise FileError(f"{name}: not judged: {_VERIFIED} answered {''.join(lines)[:200]!r}")
    value = math.ceil(10**6 * Fraction(int(found[1]), int(found[2]))) / 10**6
    return Proved("bound", NO_PLAN if int(found[1]) < 0 else value)


def _run(
    command: Sequence[str], checker: str, name: str, left: float, time_limit: float | None = None
) -> _Answer:
    """Runs a command for as many seconds as are left of a time limit."""
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False,
            timeout=None if left == math.inf else left,
        )  # fmt: skip
    except subprocess.TimeoutExpired as error:
        limit = left if time_limit is None else time_limit
        words = f"refused: {checker} did not end within {limit:g} s"
        raise FileError(f"{name}: {words}; --time-limit allows more") from error
    except OSError as error:
        raise FileError(f"{command[0]}: cannot be run: {error.strerror}") from error
    last = "".join(done.stderr.splitlines()[-1:])[:200]
    return _Answer(done.returncode, done.stdout.splitlines(), last)
