"""The index of the pages: sections with links. The site's menu and llms.txt are made from it.

`docs/index.md` lists each page once, as `- [Title](page.md): what it is about`, below the heading
of its section.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, Self

from cocap_opt.experiments.lab.manual.marks import without_marks
from cocap_opt.output.files import read_text

_SECTION = re.compile(r"(?ms)^## (.+?)\n(.*?)(?=^## |\Z)")
_LINK = re.compile(r"^- \[([^\]]+)\]\((\S+?)\.(md|ipynb)\)(?:: (.+))?$", re.MULTILINE)
_COMMENT = re.compile(r"<!--.*?-->\n?", re.DOTALL)


class _Entry(NamedTuple):
    title: str
    page: str  # without its suffix
    ending: str
    about: str


class Section(NamedTuple):
    """A section of the index, and the pages in it."""

    title: str
    entries: tuple[_Entry, ...]

    @classmethod
    def all_of(cls, index: str) -> list[Self]:
        """Returns the sections of the index that list pages."""
        found = []
        for title, text in _SECTION.findall(index):
            entries = tuple(_Entry(*fields) for fields in _LINK.findall(text))
            if entries:
                found.append(cls(title, entries))
        return found

    @property
    def menu(self) -> str:
        """The section of the site's menu, as a directive."""
        pages = "\n".join(entry.page for entry in self.entries)
        return f"```{{toctree}}\n:caption: {self.title}\n:maxdepth: 1\n:hidden:\n\n{pages}\n```"


def with_menu(index: str) -> str:
    """Returns the index with the menu of the site."""
    return "\n\n".join([index, *(section.menu for section in Section.all_of(index))])


def llms_in_short(index: str) -> str:
    """Returns llms.txt: what the project is, and a link to the Markdown of each page."""
    title, about = (without_marks(index).split("\n\n")[k].strip() for k in (0, 1))
    return "\n".join([title, "", f"> {' '.join(about.split())}", "", *_lines(index)]) + "\n"


def _lines(index: str) -> Iterator[str]:
    for section in Section.all_of(index):
        yield f"## {section.title}\n"
        for title, page, ending, about in section.entries:
            yield f"- [{title}](_sources/{page}.{ending})" + (f": {about}" if about else "")
        yield ""


def llms_in_full(folder: Path) -> str:
    """Returns llms-full.txt: the text of all pages in the order of the index."""
    index = read_text(folder / "index.md")
    every = [entry for section in Section.all_of(index) for entry in section.entries]
    pages = [folder / f"{entry.page}.md" for entry in every if entry.ending == "md"]
    texts = (_COMMENT.sub("", without_marks(read_text(page))) for page in pages)
    return "\n\n".join(text.strip() for text in texts) + "\n"
