"""Docstrings of this project as numpydoc wants them: what stands behind a colon is no type."""

import re
from collections.abc import Iterator, Sequence

_FIELD = re.compile(r"( *)([*\w][*\w, ]*) : (.+)")  # of Parameters and Attributes
_SECTIONS = ("Parameters", "Attributes")


def with_meanings(lines: Sequence[str]) -> list[str]:
    """Returns lines in which the meaning of a parameter stands below its name."""
    return list(_moved(lines))


def _moved(lines: Sequence[str]) -> Iterator[str]:
    section = ""
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if re.fullmatch(r" *-{3,}", below):
            section = line.strip()
        found = _FIELD.fullmatch(line)
        if found and section in _SECTIONS:
            indent, name, meaning = found.groups()
            yield from (f"{indent}{name}", f"{indent}    {meaning}")
        else:
            yield line
