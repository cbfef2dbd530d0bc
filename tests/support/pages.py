"""The pages of the documentation: where they are, and their blocks of code."""

import re
from collections.abc import Iterator
from html import unescape
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
    """Returns how many words and numbers of a page in Markdown are to be read, code included.

    Comments, addresses and the alternative texts of pictures are left out.
    """
    marks = r"<!--.*?-->|!\[[^\]]*\]\([^)]*\)|(?<=\])\([^)]*\)|^```\w*$"
    return counted(re.sub(marks, " ", page, flags=re.DOTALL | re.MULTILINE))


def words_built(html: str) -> int:
    """Returns how many words and numbers the article of a built page shows, code included."""
    article = re.search(r"(?s)<article.*</article>", html)
    assert article is not None
    hidden = r"(?s)<script.*?</script>|<style.*?</style>|<a class=\"headerlink\".*?</a>|<[^>]*>"
    return counted(unescape(re.sub(hidden, "", article[0])))


def counted(text: str) -> int:
    """Returns the number of words that have a letter or a digit."""
    return sum(any(map(str.isalnum, word)) for word in text.split())
