"""HTML pages put together from the files in the folder `page`."""

from collections.abc import Mapping
from importlib.resources import files


class PageFile:
    """A file of the folder `page`: a page with places for parts, a style or a script."""

    def __init__(self, name: str) -> None:
        folder = files("cocap_opt.player") / "page"
        self.text = (folder / name).read_text(encoding="utf-8")

    def filled(self, parts: Mapping[str, str]) -> str:
        """Returns the text in which parts have taken the places of their @names@.

        A part may hold anything, @ included.
        """
        return "".join(parts.get(piece, piece) for piece in self.text.split("@"))
