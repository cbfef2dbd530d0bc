"""Listings of algorithms: each line has its number beside the code, and pages have the same."""

import importlib
import inspect
import re
from pathlib import Path
from types import ModuleType

import pytest

PAGES = [
    Path(__file__).parents[2] / "docs" / "concepts" / name
    for name in ("cocap.md", "view-search.md")
]
ALG_1, TREE, ALG_2, LAZY = (
    importlib.import_module(f"cocap_opt.planners.{name}")
    for name in ("cocap", "constraint_tree", "view_search", "lazy_value_iteration")
)
_LINE = re.compile(r"^ *(\d+)  (.*\S)$", re.MULTILINE)
_NUMBERS = re.compile(r"  # (\d+)(?:-(\d+))?$", re.MULTILINE)


def listing(module: ModuleType) -> list[tuple[str, str]]:
    """Numbers and words of the listing in a module's docstring."""
    return _LINE.findall(module.__doc__ or "")


def numbered(code: str) -> list[int]:
    """Numbers of lines that stand beside code, in its order."""
    ends = [(int(a), int(b or a)) for a, b in _NUMBERS.findall(code)]
    return [number for first, last in ends for number in range(first, last + 1)]


@pytest.mark.parametrize("module", [ALG_1, ALG_2, LAZY])
def test_each_line_stands_in_the_code_and_no_other(module: ModuleType) -> None:
    """Line 9 is one line: what the listing numbers is numbered in the code, in that order."""
    numbers = [int(number) for number, _ in listing(module)]
    assert numbers == list(range(1, len(numbers) + 1)) != []
    assert numbered(inspect.getsource(module)) == numbers


def test_the_tree_does_what_the_algorithm_leaves_to_it() -> None:
    """Lines that Alg. 1 hands to its tree have the same numbers there, and no others have one."""
    lines = inspect.getsource(ALG_1.algorithm_1).splitlines()
    handed = numbered("\n".join(line for line in lines if "tree." in line))
    assert sorted(numbered(inspect.getsource(TREE))) == sorted(handed) != []


def test_the_pages_have_the_listings_of_the_code() -> None:
    """Alg. 1 and Alg. 2 have the same words and numbers wherever they are read."""
    texts = [page.read_text(encoding="utf-8") for page in PAGES]
    blocks = [block for text in texts for block in re.findall(r"(?s)```text\n(.*?)```", text)]
    assert [_LINE.findall(block) for block in blocks] == [listing(ALG_1), listing(ALG_2)]
