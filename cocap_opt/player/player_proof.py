"""The certificate that the page offers: its file, and the commands that check it again."""

import hashlib
import shlex
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path
from typing import Any, NamedTuple

from cocap_opt.files.documents import problem_digest
from cocap_opt.output.files import GivenPlan
from cocap_opt.problem import Problem

MOST_BYTES = 1_000_000  # largest file that a page contains
CHECK_PAGE = "how-to/check-in-the-browser"  # page of the documentation that checks files


class Proof(NamedTuple):
    """The file of a certificate or a proof that was verified.

    Attributes
    ----------
    name : of the file
    content : of the file
    verify : for each plan, the command that verifies it and the file
    check : for each plan, the commands that check it with `cocap-check`; empty if it cannot
    page : address of the page that checks files; None if unknown
    """

    name: str
    content: bytes
    verify: Sequence[str]
    check: Sequence[Sequence[str]]
    page: str | None

    @classmethod
    def of(
        cls, path: Path, content: bytes, scene: str, seed: int, loaded: Problem,
        plans: Sequence[Path], given: Sequence[GivenPlan],
    ) -> "Proof":  # fmt: skip
        """Returns the proof of plans of a scene, with commands that run in the current folder.

        Parameters
        ----------
        path, content : of the file
        scene : its name or file, as typed
        loaded : the scene without a plan. A plan whose drones start elsewhere has a variant of the
            scene, which `export` does not write without more options
        """
        digest = problem_digest(loaded)
        place = ["--seed", str(seed)] if seed else []
        instance = f"{Path(scene).stem}.instance"
        verify, check = [], list[Sequence[str]]()
        for plan, found in zip(plans, given, strict=True):
            is_ours = found.file is not None
            is_of_it = found.file is None or found.file.digest == problem_digest(found.problem)
            known = [str(plan)] if is_of_it else []  # else it was made for another objective
            verify.append(shlex.join(["cocap-opt", "verify", scene, *known, str(path), *place]))
            claims = [*(known if is_ours else []), str(path)]
            lines = [
                shlex.join(["cocap-opt", "export", scene, *place, "-o", instance]),
                shlex.join(["cocap-check", instance, *claims]),
            ]
            check.append(lines if problem_digest(found.problem) == digest else [])
        return cls(path.name, content, verify, check, _page_online())

    def data(self) -> dict[str, Any]:
        """Returns the page's data of the proof; `text` is None if the file is too large."""
        is_small = len(self.content) <= MOST_BYTES
        return {
            "name": self.name,
            "bytes": len(self.content),
            "sha256": hashlib.sha256(self.content).hexdigest(),
            "text": self.content.decode() if is_small else None,
            "verify": list(self.verify),
            "check": [list(lines) for lines in self.check],
            "page": self.page,
        }


def _page_online() -> str | None:
    """Returns the address of the page that checks files; None if the package does not state it."""
    try:
        addresses = metadata("cocap-opt").get_all("Project-URL") or []
    except PackageNotFoundError:
        return None
    known = dict(address.split(", ", 1) for address in addresses)
    site = known.get("Documentation")
    return None if site is None else f"{site.rstrip('/')}/{CHECK_PAGE}.html"
