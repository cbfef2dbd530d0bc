"""Lines of code on the built site, each in its own element.

The style sheet folds lines that are too long, above all on phones, and indents the rest below the
beginning of the line; if the line is a label and a sentence, below the sentence. Names of options
are never divided, nor separated from short values. Output in three or more columns is not folded,
as its columns would be lost.
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
_GAP = re.compile(r"(?<=\S) {2,}(?=\S)")  # between two columns
_TEXT = re.compile(r"(<[^>]*>)")  # splits HTML into text and tags
_OPTION = re.compile(r"(?<![\w-])--?[a-z][\w-]*")
_VALUED = re.compile(  # an option with its short value, which may be coloured
    r'(<span class="option">[^<]*)</span>(<span class="w"> </span>)'
    r'((?:<span class="mi?">)?[\w./][\w./,:+-]{0,15}(?:</span>)?)(?=\s|<span class="w">|$)'
)
_HANGING = 2  # characters by which the style sheet indents the rest of a line
_INLINE = re.compile(r'<span class="pre">(?=-)')  # an option in inline code


def with_lines(body: str) -> str:
    """Returns the HTML of a page, changed so that each line of code can be folded."""
    return _INLINE.sub('<span class="pre option">', _CODE.sub(_divided, body))


def _divided(found: re.Match[str]) -> str:
    head, language, code, end = found.groups()
    is_output, lines = language in _OUTPUT, code.split("\n")
    if is_output and any(len(_GAP.findall(_plain(line))) > 1 for line in lines):
        return found[0]
    return head + "".join(_line(line, is_output) for line in lines) + end


def _line(line: str, is_output: bool) -> str:
    text = _plain(line)
    depth = len(text) - len(text.lstrip(" "))
    if is_output and (gap := _GAP.search(text)):
        depth = gap.end() - _HANGING
    style = f' style="--depth: {depth}"' if depth and text.strip() else ""
    return f'<span class="line"{style}>{_kept_whole(line)}\n</span>'


def _kept_whole(line: str) -> str:
    """Returns a line that is never folded within an option or before its value.

    It may be folded after an opening bracket.
    """
    parts = _TEXT.split(line)  # text, tag, text, ..
    parts[::2] = [
        _OPTION.sub(r'<span class="option">\g<0></span>', part).replace("(", "(<wbr>")
        for part in parts[::2]
    ]
    return _VALUED.sub(r"\1\2\3</span>", "".join(parts))


def _plain(code: str) -> str:
    return unescape(_TAG.sub("", code))
