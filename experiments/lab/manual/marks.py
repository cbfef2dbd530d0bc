"""Marks in Markdown: places where a page contains text that is made from code or stored results.

A block is between `<!-- quote: name -->` and `<!-- end of quote -->`, each on its own line; a few
words within a sentence are between marks such as `<!-- n: name -->12<!-- /n -->`. Readers of the
page do not see the marks. Directives that only the built site can show are between the lines
`<!-- on the site` and `-->`; the text that replaces them elsewhere is between
`<!-- off the site -->` and `<!-- end -->`.
"""

import re
from collections.abc import Callable

from cocap_opt.files.documents import FileError

_BLOCK = re.compile(r"(<!-- quote: (\S+) -->\n).*?(<!-- end of quote -->)", re.DOTALL)
_WORDS = re.compile(r"(<!-- n: (\S+) -->).*?(<!-- /n -->)", re.DOTALL)
_BEGINS = re.compile(r"^ *<!-- n: (\S+) -->", re.MULTILINE)
_FOR_SITE = re.compile(r"^<!-- on the site\n(.*?)^-->$", re.DOTALL | re.MULTILINE)
_ELSEWHERE = re.compile(r"^<!-- off the site -->\n.*?^<!-- end -->\n", re.DOTALL | re.MULTILINE)
_MARK = re.compile(r"<!-- (?:quote: \S+|end of quote) -->\n*|<!-- (?:n: \S+|/n) -->")
_ANY = re.compile(
    r"<!-- (?:quote: \S+|n: \S+|off the site) -->|^<!-- on the site$"
    r"|<!-- (?:end of quote|/n|end) -->|^-->$",
    re.MULTILINE,
)
_OF_BLOCK = r"<!-- (?:quote: \S+|end of quote) -->"
_SHARED = re.compile(rf"(?!^){_OF_BLOCK}|{_OF_BLOCK}(?!$)", re.MULTILINE)
_ENDS = {  # end marks, by the beginning of the mark
    "<!-- quote": "<!-- end of quote -->",
    "<!-- n": "<!-- /n -->",
    "<!-- off": "<!-- end -->",
    "<!-- on": "-->",
}


def names_in(text: str) -> list[str]:
    """Returns the names of the marks: first those of blocks, then those of words, in order."""
    return [found[2] for marked in (_BLOCK, _WORDS) for found in marked.finditer(text)]


def filled(text: str, entry: Callable[[str], str]) -> str:
    """Returns a page in which each mark contains the entry of its name.

    Raises
    ------
    FileError
        If a mark has no end before the next mark, an end has no mark, a block's mark shares its
        line, words' mark begins a line (Markdown would read it as HTML), or the entry for words has
        more than one line.
    """
    _check_pairs(text)
    if wrong := _BEGINS.search(text):
        raise FileError(f"n: {wrong[1]}: must not begin a line, or Markdown reads it as HTML")

    def block(found: re.Match[str]) -> str:
        return f"{found[1]}\n{entry(found[2])}\n\n{found[3]}"

    def words(found: re.Match[str]) -> str:
        content = entry(found[2])
        if "\n" in content:
            raise FileError(f"n: {found[2]}: has several lines; use <!-- quote: {found[2]} -->")
        return f"{found[1]}{content}{found[3]}"

    return _WORDS.sub(words, _BLOCK.sub(block, text))


def without_marks(text: str) -> str:
    """Returns a page without its marks, but with the text in them."""
    return _MARK.sub("", text)


def on_the_site(text: str) -> str:
    """Returns a page without its marks, and with the parts that only the built site shows.

    Raises
    ------
    FileError
        If a mark has no end before the next mark, or an end has no mark.
    """
    _check_pairs(text)
    return _FOR_SITE.sub(r"\1", _ELSEWHERE.sub("", without_marks(text)))


def _check_pairs(text: str) -> None:
    """Raises a FileError unless each mark has its end, so that no text beyond it is lost."""
    opened = end = ""
    for found in _ANY.finditer(text):
        mark = found[0]
        if mark not in _ENDS.values():
            if opened:
                raise FileError(f"{opened}: must end with {end} before {mark}")
            opened = mark
            end = next(_ENDS[kind] for kind in _ENDS if mark.startswith(kind))
        elif mark != end:
            raise FileError(f"{mark}: has no opening mark; delete it, or insert the opening mark")
        else:
            opened = end = ""
    if opened:
        raise FileError(f"{opened}: must end with {end}")
    if shared := _SHARED.search(text):
        raise FileError(f"{shared[0]}: must be alone on its line")
