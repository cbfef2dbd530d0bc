"""The stored pool of random problems: it is of today's strategies, and its optima are true."""

import hypothesis
import pytest
from brute_force import search
from pool import COMMAND, STORED, digest, drawn_elsewhere, head, line_of, stored
from strategies import number_of_plans

EVERY = 16  # of these problems one is tried without slow tests


@pytest.mark.slow
def test_the_pool_is_of_these_strategies() -> None:
    """Stored problems are those that the strategies and brute force of today would store."""
    assert head().digest == digest(), f"draw the pool of random problems anew: `{COMMAND}`"
    numbers = [(kind, number) for kind, count in STORED.items() for number in range(count)]
    assert [(drawn.kind, drawn.number) for drawn in stored()] == numbers


@pytest.mark.parametrize(
    "every", [EVERY, pytest.param(1, marks=pytest.mark.long(seconds=8))], ids=["some", "all"]
)
def test_stored_optima_are_those_of_brute_force(every: int) -> None:
    """Stored optima are found again, with their plans, to the last bit; nobody believes a file."""
    for drawn in stored()[::every]:
        again = search(drawn.problem)
        assert again == drawn.optimum, f"{drawn.kind} {drawn.number}: `{COMMAND}`"
        assert number_of_plans(drawn.problem) == drawn.plans


@pytest.mark.long(seconds=2)
@pytest.mark.skipif(
    head().hypothesis != hypothesis.__version__, reason="another hypothesis draws others"
)
def test_stored_problems_are_drawn_again() -> None:
    """Drawing a few of each kind gives what is stored, so the command is what has stored them."""
    for drawn, again in zip(stored()[::EVERY], drawn_elsewhere(EVERY), strict=True):
        assert again == line_of(drawn), f"{drawn.kind} {drawn.number}: `{COMMAND}`"
