"""Words of what is shown."""

from cocap_opt.text import distance, in_digits, number_in_words, pair, plain, span


def test_small_numbers_are_words() -> None:
    """Figures are read more easily from nine on, and nothing is a figure, too."""
    assert [number_in_words(number) for number in (1, 2, 8)] == ["one", "two", "eight"]
    assert [number_in_words(number) for number in (0, 9, 64)] == ["0", "9", "64"]


def test_places_and_distances_have_no_exponents() -> None:
    """A place in a reference system is read digit by digit, and a long way in kilometres."""
    assert pair(5050180.33, 4790010) == "(5050180.33, 4790010)"
    assert span(0.1 + 0.2, 2.5e10) == "0.3..25000000000"
    assert [in_digits(x) for x in (1e-17, -0.5, 123456789.25)] == ["0", "-0.5", "123456789"]
    assert [distance(x) for x in (0.5, 1.41421, 999.99, 1000, 9999.6, 4.816e6)] == [
        "0.5 m", "1.414 m", "1000 m", "1,000 m", "10,000 m", "4,816 km",
    ]  # fmt: skip
    assert [plain(x) for x in (1e-4, 100, 1e9)] == ["0.0001", "100", "1,000,000,000"]
