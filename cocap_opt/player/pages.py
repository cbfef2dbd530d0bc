"""HTML pages put together from the files in the folder `page`."""

import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Any


def page_text(name: str, parts: Mapping[str, str] | None = None) -> str:
    """Returns the text of a file of the folder `page`: a page, a style or a script.

    Parameters
    ----------
    parts : what takes the places of the @names@ of a page; a part may hold anything, @ included
    """
    text = (files("cocap_opt.player") / "page" / name).read_text(encoding="utf-8")
    return text if parts is None else "".join(parts.get(piece, piece) for piece in text.split("@"))


def inert(data: Mapping[str, Any]) -> str:
    """Returns JSON that neither ends nor begins an HTML element, whatever names are in it."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
