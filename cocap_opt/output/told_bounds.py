"""Bounds on J and what they leave open, as people read them: one rule for tables and sentences."""

import math

from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.text import rounded_up

_LITTLE = 1e-4  # relative gap below which no figures are told


def is_attained(bound: float, reward: float | None) -> bool:
    """Returns True for a bound that is J of a plan: none is better by more than a millionth."""
    return reward is not None and abs(bound - reward) <= OPTIMALITY * abs(bound) < math.inf


def told_bound(bound: float, reward: float | None = None) -> str:
    """Returns a bound on J rounded up to the decimals of J, or J of a plan that attains it.

    Parameters
    ----------
    reward : J of the best plan that is known; None if none is
    """
    if reward is not None and is_attained(bound, reward):
        return f"{reward:,.2f}"
    return rounded_up(bound, 2) if math.isfinite(bound) else f"{bound:,.2f}"


def told_gap(share: float, digits: int = 2) -> str:
    """Returns the largest part of J that may be missing, which a bound leaves open, in words."""
    if share < _LITTLE:
        return f"less than {100 * _LITTLE:g} %, if at all"
    return f"at most {rounded_up(100 * share, digits)} %"
