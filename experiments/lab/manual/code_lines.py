"""Lines of code on the built site, each an element of its own.

The style sheet folds a line that is too long, on phones above all, and indents the rest of it below
its beginning. Output in columns stays as it is: folded, its columns would be lost.
"""

import re
from html import unescape

_CODE = re.compile(
    r'(<div class="highlight-([\w-]+) notranslate"><div class="highlight"><pre>'
    r"(?:<span></span>)?)(.*?)\n?(</pre>)",
    re.DOTALL,
)
_TAG = re.compile(r"<[^>]*>")
_OUTPUT = ("text", "none", "default")  # languages of what programs print
_COLUMNS = re.compile(r"\S {2,}\S")


def with_lines(body: str) -> str:
    """Returns the HTML of a page in which each line of code can be folded."""
    return _CODE.sub(_divided, body)


def _divided(found: re.Match[str]) -> str:
    head, language, code, end = found.groups()
    if language in _OUTPUT and _COLUMNS.search(_plain(code)):
        return found[0]
    return head + "".join(map(_line, code.split("\n"))) + end


def _line(line: str) -> str:
    text = _plain(line)
    depth = len(text) - len(text.lstrip(" "))
    style = f' style="--depth: {depth}"' if depth and text.strip() else ""
    return f'<span class="line"{style}>{line}\n</span>'


def _plain(code: str) -> str:
    return unescape(_TAG.sub("", code))
