"""Words of what is shown."""

from cocap_opt.text import number_in_words


def test_small_numbers_are_words() -> None:
    """Figures are read more easily from nine on, and nothing is a figure, too."""
    assert [number_in_words(number) for number in (1, 2, 8)] == ["one", "two", "eight"]
    assert [number_in_words(number) for number in (0, 9, 64)] == ["0", "9", "64"]
