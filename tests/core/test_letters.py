"""The width of text on a terminal, and text folded into lines of a width."""

import unicodedata
from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len

from cocap_opt.letters import columns_of, folded


@pytest.mark.parametrize(
    ("text", "columns"),
    [("", 0), ("abc", 3), ("廣場", 4), ("한글", 4), ("cafe\u0301", 4), ("\u1112\u1161\u11ab", 2)],
)
def test_wide_letters_take_two_columns_and_accents_none(text: str, columns: int) -> None:
    """A terminal does not count letters."""
    assert columns_of(text) == columns


@given(
    st.lists(st.text("ab廣\u0301é", min_size=1, max_size=12)), st.integers(6, 40),
    st.sampled_from(["", "on: "]), st.sampled_from(["", "    "]),
)  # fmt: skip
def test_folded_lines_fit_and_have_all_letters(
    words: list[str], width: int, first: str, indent: str
) -> None:
    """Lines are full: the next word had no room in the line before it."""
    lines = folded(" ".join(words), width, first, indent).split("\n")
    assert all(columns_of(line) <= width for line in lines)
    assert lines[0].startswith(first) and all(line.startswith(indent) for line in lines[1:])
    bare = [lines[0][len(first) :], *(line[len(indent) :] for line in lines[1:])]
    assert "".join(bare).replace(" ", "") == "".join(words)
    assert all(bare) or not words
    word_at = dict(zip(accumulate(map(len, words), initial=0), words, strict=False))
    ends = accumulate(len(part.replace(" ", "")) for part in bare)
    for line, end in zip(lines[:-1], ends, strict=False):
        # A word that is wider than a line may begin a line of its own and be parted there.
        assert end not in word_at or columns_of(f"{line} {word_at[end]}") > width


def test_a_terminal_may_be_too_narrow_for_a_letter() -> None:
    """Then lines are longer than it, and end all the same."""
    assert folded("廣場", 3, "", "  ") == "廣\n  場"


def test_letters_are_as_wide_as_in_tables() -> None:
    """The library that draws tables (rich) counts the letters of all living scripts alike."""
    letters = [chr(k) for k in range(32, 0xD7A4) if unicodedata.category(chr(k))[0] in "LMN"]
    differ = [c for c in letters if columns_of(c) != cell_len(c)]
    assert len(letters) > 45_000 and differ in ([], ["\u3164"])  # a filler of Hangul
