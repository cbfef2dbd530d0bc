"""HTML pages put together from the files in the folder `page`."""

from collections.abc import Mapping
from importlib.resources import files


def page_text(name: str, parts: Mapping[str, str] | None = None) -> str:
    """Returns the text of a file of the folder `page`: a page, a style or a script.

    Parameters
    ----------
    parts : what takes the places of the @names@ of a page; a part may hold anything, @ included
    """
    text = (files("cocap_opt.player") / "page" / name).read_text(encoding="utf-8")
    return text if parts is None else "".join(parts.get(piece, piece) for piece in text.split("@"))
