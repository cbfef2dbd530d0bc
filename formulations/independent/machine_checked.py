"""The command lines of `cocap-check-verified`, the checker that is proved correct in Coq.

It reads certificates that `lower.py`, which need not be believed, has made whole numbers of.
"""

import sys
from pathlib import Path
from typing import NamedTuple

_FOLDER = Path(__file__).parents[1] / "certificates" / "coq"


class Commands(NamedTuple):
    """Commands to run one after the other; each has exit code 0 if it has nothing to object to."""

    lower: list[str]
    check: list[str]


def checking(program: Path, instance: Path, claim: Path, lowered: Path, *options: str) -> Commands:
    """Returns the commands that check a certificate or proof.

    Parameters
    ----------
    program : `cocap-check-verified`, as `build.sh` builds it
    instance, claim : files of the instance, and of the certificate or proof
    lowered : file for the whole numbers, which is written
    options : of `lower.py`
    """
    lower = [sys.executable, str(_FOLDER / "lower.py"), str(instance), str(claim)]
    return Commands(
        [*lower, "-o", str(lowered), *options], [str(program), str(instance), str(lowered)]
    )
