"""The pages of the documentation: where they are, and their blocks of code."""

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
BLOCK = r"(?ms)^```(\w+)\n(.*?)^```$"  # of code: its language and text


def pages() -> list[Path]:
    """Returns all pages that people write, notebooks aside."""
    return sorted(path for path in DOCS.rglob("*.md"))


def blocks(page: str) -> Iterator[tuple[str, str]]:
    """Yields language and text of each block of code of a page, continued commands on one line."""
    for found in re.finditer(BLOCK, page):
        yield found[1], re.sub(r" \\\n +", " ", found[2])


def words(page: str) -> int:
    """Returns how many words and numbers of a page are to be read.

    Code, comments and the alternative texts of pictures are left out.
    """
    prose = re.sub(r"(?ms)^```.*?^```$|<!--.*?-->|!\[.*?\]", "", page)
    return sum(any(map(str.isalnum, word)) for word in prose.split())
