"""The description of the package on PyPI: the README, whose links PyPI could not follow.

Everything else is in pyproject.toml. Links and pictures of the README are files of this repository.
They become links to the release at `Repository` of `[project.urls]`; code stays as it is. As long
as there is no such address, PyPI's page shows the words of links without a link, and no pictures,
and says so below its title.
"""

import re
import tomllib
from pathlib import Path

from setuptools import setup

ROOT = Path(__file__).resolve().parent
_BLOCK = r"^ {0,3}(?P<fence>```+|~~~+)[^\n]*\n.*?^ {0,3}(?P=fence)"  # of code
_SPAN = r"(?P<ticks>`+)[^`](?s:.*?)(?<!`)(?P=ticks)(?!`)"
_FILE = r"\((?![a-z]+:|#)(?P<{}>[^)\s]+)\)"  # the address of a link to a file
_PICTURE = rf"!\[(?P<alt>[^\]]*)\]{_FILE.format('source')}"
_WORDS = r"(?:[^\[\]`]|`[^`]*`|!\[[^\]]*\]\([^)]*\))+"  # of a link, which may be a picture
_LINK = rf"\[(?P<words>{_WORDS})\]{_FILE.format('target')}"
_PARTS = re.compile(rf"(?ms:{_BLOCK})|(?m:{_SPAN})|{_PICTURE}|{_LINK}")
_LEFT_OUT = (
    "*This page lacks pictures and links to files: they are in the repository, which has no public "
    "address yet.*"
)


def described(readme: str, repository: str | None, version: str) -> str:
    """Returns the README with absolute links and pictures only, and code as it is.

    Parameters
    ----------
    readme : Markdown that begins with a title, and whose links to files are relative to the root of
        the repository
    repository : its address, such as that of a project on GitHub; None: unknown
    version : the release whose files are linked, by its tag
    """

    def absolute(part: re.Match[str]) -> str:
        words, target, alt, source = part.group("words", "target", "alt", "source")
        if repository is None:
            return part[0] if not (source or target) else _PARTS.sub(absolute, words or "")
        address = repository.rstrip("/")
        if source:
            return f"![{alt}]({address}/raw/v{version}/{source})"
        if target:
            return f"[{_PARTS.sub(absolute, words)}]({address}/blob/v{version}/{target})"
        return part[0]

    found = _PARTS.sub(absolute, readme)
    if repository is None:
        title, _, rest = found.partition("\n")
        return f"{title}\n\n{_LEFT_OUT}\n{rest}"
    return found


def _description() -> str:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    return described(readme, project.get("urls", {}).get("Repository"), project["version"])


if __name__ == "__main__":  # as setuptools runs it
    setup(long_description=_description(), long_description_content_type="text/markdown")
