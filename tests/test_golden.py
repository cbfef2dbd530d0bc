"""Results that no change of the code's shape may change."""

import json

import pytest
from golden import MADE_WITH, compare, stored, versions


def test_what_is_stored_has_every_method() -> None:
    """Each stored scene has its planners, bounds and proofs."""
    records = stored()
    assert {"cocap", "sequential", "column-generation", "branch-and-price-free"} <= {
        r["method"] for r in records
    }
    assert len({(r["scene"], r["seed"]) for r in records}) == 23


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "seed"), [("corridor-tight", 2), ("corridor", 0)])
def test_results_are_the_stored_ones(scene: str, seed: int) -> None:
    """Rewards, bounds, reasons, statistics, plans and certificates are the same, bit by bit.

    `python tests/support/golden.py compare` compares all scenes, which takes ten minutes.
    """
    if (made_with := json.loads(MADE_WITH.read_text())) != versions():
        pytest.skip(f"stored with {made_with}, here is {versions()}: last bits differ")
    assert compare(scene, seed) == []
