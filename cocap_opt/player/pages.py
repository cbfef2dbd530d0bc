"""HTML pages put together from the files in the folder `page`."""

import json
import re
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

# In a style: comments, and spaces around braces and after declarations.
_SPARE = re.compile(r"/\*.*?\*/|(?<=[{};])\s+|\s+(?=[{}])", re.DOTALL)


def page_text(name: str, parts: Mapping[str, str] | None = None) -> str:
    """Returns the text of a file of the folder `page`: a page, a style or a script.

    Parameters
    ----------
    parts : replacements of the @names@ of a page; a part may contain any text, including @
    """
    text = (files("cocap_opt.player") / "page" / name).read_text(encoding="utf-8")
    return text if parts is None else "".join(parts.get(piece, piece) for piece in text.split("@"))


def style_text(name: str) -> str:
    """Returns a style of the folder `page` without comments and superfluous spaces."""
    return _SPARE.sub("", page_text(name))


def inert(data: Mapping[str, Any]) -> str:
    """Returns JSON that cannot begin or end an HTML element, whatever names it contains."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
