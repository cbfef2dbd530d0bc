"""Statements that files prove, as `cocap-check` prints them.

The checker is run as its page describes: as a command with files, whose exit code and output line
give the answer. It has its own process, so a time limit ends it even if a malicious file keeps it
busy.
"""

import math
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Literal, NamedTuple

from cocap_opt.files.documents import FileError
from cocap_opt.formulations.independent import cocap_check

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
_HOLDS, _WRONG_CALL, _BY_SEARCH = 0, 2, 3
_CHECKER = Path(cocap_check.__file__)


class Proved(NamedTuple):
    """The statement that a file proves.

    Attributes
    ----------
    kind : `plan`: J of the plan is at least `value`; `bound`: no plan's J exceeds `value`
    value : in units of J; as no J is below 0, a bound below 0 means that there is no plan
    """

    kind: Literal["plan", "bound"]
    value: float


def proved(instance: Path, content: bytes, name: str, time_limit: float = TIME_LIMIT) -> Proved:
    """Runs `cocap-check` on a plan, a certificate or a proof, and returns what it proves.

    Parameters
    ----------
    instance : file of the instance
    content : of the plan, certificate or proof
    name : name of that file, for messages
    time_limit : seconds; inf for none

    Raises
    ------
    FileError
        If the checker rejects the file, does not finish a search that its claim needs, or exceeds
        the time limit; one line.
    """
    with tempfile.TemporaryDirectory() as folder:
        claim = Path(folder) / "claim"
        claim.write_bytes(content)
        command = [sys.executable, str(_CHECKER), "--branches", str(BRANCHES)]
        command += [str(instance), str(claim)]
        limit = None if time_limit == math.inf else time_limit
        try:
            said = subprocess.run(
                command, capture_output=True, text=True, timeout=limit, check=False
            )
        except subprocess.TimeoutExpired as error:
            words = f"refused: `cocap-check` did not end within {time_limit:g} s"
            raise FileError(f"{name}: {words}; --time-limit allows more") from error
        code, lines = said.returncode, said.stdout.splitlines()
        words = "".join(line.removeprefix(f"{claim}: ") for line in lines[1:])
    if code < 0 or not lines:
        last = "".join(said.stderr.splitlines()[-1:])[:200]
        raise FileError(f"{name}: not judged: `cocap-check` ended with code {code}: {last}")
    if code == _WRONG_CALL:
        words = lines[0].removeprefix(f"{claim}: ").removeprefix(f"{instance}: ")
    if code == _BY_SEARCH:
        raise FileError(
            f"{name}: refused: its claim needs a search that is too large for `cocap-check`"
        )
    if code == _HOLDS:
        for kind, pattern in _SAYS:
            if found := pattern.fullmatch(words):
                value = float(found[1]) if found.groups() else NO_PLAN
                if words.startswith("no plan exists") and value >= 0:  # a bound rounded up to 0
                    value = NO_PLAN
                return Proved("plan" if kind == PLAN else "bound", value)
    reason = " ".join(words.removeprefix("refused: ").split()) or "the instance cannot be read"
    raise FileError(f"{name}: refused: {reason[:200]}")
