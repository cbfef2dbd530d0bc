"""Rows of the gap table for tests that need no sweep."""

from typing import Any

from cocap_opt.experiments.tables.rows import GapRow


def row(planner: str, seed: int, reward: float | None, **more: Any) -> GapRow:
    """A row of a scene whose optimum is 100 with rules and whose bound without any is 110."""
    fields = {
        "scene": "a|b & c", "seed": seed, "planner": planner, "reward": reward, "bound": 100.0,
        "gap": None if reward is None else 1 - reward / 100,
        "gap_free": None if reward is None else 1 - reward / 110, "conflicts": 0,
        "colliding": 0, "robots": 2, "actors": 1, "steps": 8, "message": "", "limit": "none",
        "seconds": 1.0, "reason": "finished", "bound_reason": "optimal", "digest": "",
        "optimum": 100.0, "optimum_free": 109.0, "bound_free": 110.0,
        "bound_free_reason": "optimal", "time_limit": 60.0, "bound_time_limit": 60.0,
    }  # fmt: skip
    return GapRow(**(fields | more))
