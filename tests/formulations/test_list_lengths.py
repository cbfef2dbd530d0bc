"""Lists of states are as long as searches can bear."""

import pytest

from cocap_opt.formulations.column_generation.parameters import ListParameters
from cocap_opt.formulations.column_generation.step_envelopes.list_lengths import ListLengths

LISTS = ListParameters(of_all_steps=4_000, most_first=200)


@pytest.mark.parametrize(("steps", "first"), [(5, 200), (20, 200), (40, 100), (60, 66), (200, 60)])
def test_first_lists_share_out_what_all_steps_may_have(steps: int, first: int) -> None:
    """Within the least and the most of one step."""
    lengths = ListLengths(steps, LISTS)
    assert lengths.first == lengths.most(3) == first


def test_the_list_after_a_long_search_is_shorter_and_after_a_short_one_longer() -> None:
    """Each step by itself; neither a middling search nor another step's changes a list."""
    lengths = ListLengths(20, LISTS)
    lengths.note(1, 200, 2 * int(LISTS.long_search))
    lengths.note(2, 200, 32 * int(LISTS.long_search))
    lengths.note(3, 200, None)  # it has not ended
    lengths.note(4, 200, int(LISTS.long_search) // 2)
    lengths.note(5, 200, int(LISTS.long_search) // 100)
    assert lengths.most(2) == 100  # half of it: 32 to the power -0.2
    assert 100 < lengths.most(3) < lengths.most(1) < 200
    assert lengths.most(4) == lengths.most(6) == 200
    assert lengths.most(5) == 240


def test_lists_stay_within_their_limits() -> None:
    """However short or long searches are."""
    lengths = ListLengths(20, LISTS)
    for _ in range(50):
        lengths.note(1, lengths.most(1), None)
        lengths.note(2, lengths.most(2), 0)
    assert lengths.most(1) == LISTS.fewest
    assert lengths.most(2) == LISTS.most


def test_lists_grow_until_searches_may_be_no_longer() -> None:
    """Slack, lists that were short and what counts as long grow together."""
    lengths = ListLengths(20, LISTS)
    lengths.note(1, 200, None)
    before, rounds = lengths.most(1), 0
    while lengths.can_grow:
        nodes, slack = lengths.long_search, lengths.slack(1.0, lambda _: 10**6)
        lengths.grow()
        rounds += 1
        assert lengths.long_search > nodes
        assert lengths.slack(1.0, lambda _: 10**6) > slack
    assert 1 < rounds < 10
    assert lengths.most(1) > before
    lengths.note(2, 200, 2 * int(LISTS.long_search))  # no longer a long search
    assert lengths.most(2) == 200


def test_slack_grows_until_enough_states_are_listed_or_it_is_the_most() -> None:
    """Of 20 steps, 120 states each on the mean are enough; slack is as large as that gap."""
    per_unit = 1000.0  # states per unit of slack
    lengths = ListLengths(20, LISTS)
    slack = lengths.slack(10.0, lambda most: int(most * per_unit))
    assert 2400 <= slack * per_unit < 2400 * 1.15
    assert lengths.slack(20.0, lambda most: int(most * per_unit)) == pytest.approx(2 * slack)
    none = ListLengths(20, LISTS).slack(10.0, lambda most: 0)
    assert none == pytest.approx(0.7 * LISTS.most_slack, rel=0.15)
    assert ListLengths(20, LISTS).slack(10.0, lambda most: 10**6) == pytest.approx(0.7)
