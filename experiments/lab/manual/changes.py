"""The parts of the changelog for users who update: changed numbers, and what they must do."""

import re
from collections.abc import Iterator
from pathlib import Path

from cocap_opt.output.files import read_text

CHANGELOG = Path(__file__).resolve().parents[3] / "CHANGELOG.md"
_SHOWN = ("What changes numbers", "What you must do")


def for_updates() -> str:
    """Returns the summary of each version, and its parts for users who update."""
    _, *versions = re.split(r"(?m)^## ", read_text(CHANGELOG))
    return "\n\n".join(part for version in versions for part in _parts(version))


def _parts(version: str) -> Iterator[str]:
    summary, *sections = re.split(r"(?m)^### ", version)
    title, _, about = summary.partition("\n")
    if sections:
        yield f"## {title}"
        yield about.strip()
    for section in sections:
        if section.startswith(_SHOWN):
            yield f"### {section.strip()}"
