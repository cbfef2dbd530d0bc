"""Marks in Markdown: places where a page holds text that is made from code or stored results.

A block is between lines of its own, `<!-- quote: name -->` and `<!-- end of quote -->`; a few
words are in a sentence, `<!-- n: name -->12<!-- /n -->`. Nobody who reads the page sees a mark.
Directives that only the built site can show are between lines `<!-- on the site` and `-->`, and
what takes their place elsewhere between `<!-- off the site -->` and `<!-- end -->`.
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
_ENDS = {  # of marks that begin so
    "<!-- quote": "<!-- end of quote -->",
    "<!-- n": "<!-- /n -->",
    "<!-- off": "<!-- end -->",
    "<!-- on": "-->",
}


def names_in(text: str) -> list[str]:
    """Returns the name of each mark, in the order of the text, blocks first."""
    return [found[2] for marked in (_BLOCK, _WORDS) for found in marked.finditer(text)]


def filled(text: str, entry: Callable[[str], str]) -> str:
    """Returns a page whose marks hold the entries of their names.

    Raises
    ------
    FileError
        If a mark has no end before another begins, or an end no mark, or if a mark of a block
        shares its line; if a mark of words begins a line, which Markdown then takes for HTML, or
        its entry has more than one line.
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
    """Returns a page without its marks, and with all that they hold."""
    return _MARK.sub("", text)


def on_the_site(text: str) -> str:
    """Returns a page without its marks, and with the parts that only the built site shows.

    Raises
    ------
    FileError
        If a mark has no end before another begins, or an end no mark.
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
            raise FileError(f"{mark}: ends no mark; delete it, or insert the mark that it ends")
        else:
            opened = end = ""
    if opened:
        raise FileError(f"{opened}: must end with {end}")
    if shared := _SHARED.search(text):
        raise FileError(f"{shared[0]}: must be alone on its line")
