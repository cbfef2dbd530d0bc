"""The description of the package on PyPI: the README, whose links PyPI could not follow.

Everything else is in pyproject.toml. Links and pictures of the README are files of this repository.
They become links to the release at `Repository` of `[project.urls]`. As long as there is no such
address, PyPI's page shows the words of links without a link, and no pictures.
"""

import re
import tomllib
from collections.abc import Callable
from pathlib import Path

from setuptools import setup

ROOT = Path(__file__).resolve().parent
_FILE = r"\((?![a-z]+:|#)([^)\s]+)\)"  # the address of a link to a file
_PICTURE = re.compile(rf"!\[([^\]]*)\]{_FILE}")
_LINK = re.compile(rf"(?<!!)\[((?:[^\[\]]|!\[[^\]]*\]\([^)]*\))+)\]{_FILE}")


def described(readme: str, repository: str | None, version: str) -> str:
    """Returns the README with absolute links and pictures only.

    Parameters
    ----------
    readme : Markdown whose links to files are relative to the root of the repository
    repository : its address, such as that of a project on GitHub; None: unknown
    version : the release whose files are linked, by its tag
    """
    if repository is None:
        return _PICTURE.sub("", _LINK.sub(r"\1", readme))

    def at(kind: str, before: str) -> Callable[[re.Match[str]], str]:
        address = f"{repository.rstrip('/')}/{kind}/v{version}"
        return lambda found: f"{before}[{found[1]}]({address}/{found[2]})"

    return _LINK.sub(at("blob", ""), _PICTURE.sub(at("raw", "!"), readme))


def _description() -> str:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    return described(readme, project.get("urls", {}).get("Repository"), project["version"])


if __name__ == "__main__":  # as setuptools runs it
    setup(long_description=_description(), long_description_content_type="text/markdown")
