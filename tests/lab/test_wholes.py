"""Parts of sentences that the built site never divides at the end of a line."""

import pytest

from cocap_opt.experiments.lab.manual.wholes import with_wholes

WHOLE = {
    "it loses 0.35 % at most": ["0.35 %"],
    "1.00 (-0.96 to 1.06)": ["(-0.96 to 1.06)"],
    "1,792 ± 135": ["1,792 ± 135"],
    "10 of 10, since 2026-11-28": ["10 of 10", "2026-11-28"],
    "< 0.0001 % after 5 m/s": ["< 0.0001 %", "5 m/s"],
    "30 x 30 cells of 1 m": ["1 m"],
    "3.43 x, 96.8 % *": ["3.43 x", "96.8 % *"],
    "seed 0 of version 1.0.0 and 4 scenes": [],
}


@pytest.mark.parametrize(("words", "wholes"), WHOLE.items())
def test_numbers_stay_with_their_units(words: str, wholes: list[str]) -> None:
    """Each of these parts is a piece of its own; together the pieces are the words."""
    pieces = [*with_wholes(words)]
    assert "".join(piece for piece, _ in pieces) == words
    assert [piece for piece, is_whole in pieces if is_whole] == wholes
