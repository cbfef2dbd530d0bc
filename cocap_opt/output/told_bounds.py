"""Words for bounds on J and the remaining gap: one rule for tables and sentences."""

import math

from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.text import rounded_up

_LITTLE = 1e-4  # relative gap below which no digits are given


def is_attained(bound: float, reward: float | None) -> bool:
    """Returns True if J of a plan attains a bound: no plan is better by more than a millionth."""
    return reward is not None and abs(bound - reward) <= OPTIMALITY * abs(bound) < math.inf


def told_bound(bound: float, reward: float | None = None) -> str:
    """Returns a bound on J rounded up to the decimals of J, or J of a plan that attains it.

    Parameters
    ----------
    reward : J of the best known plan; None if there is none
    """
    if reward is not None and is_attained(bound, reward):
        return f"{reward:,.2f}"
    return rounded_up(bound, 2) if math.isfinite(bound) else f"{bound:,.2f}"


def told_gap(share: float, digits: int = 2) -> str:
    """Returns words for the largest share of J that may be missing, by a bound."""
    if share < _LITTLE:
        return f"less than {100 * _LITTLE:g} %, if at all"
    return f"at most {rounded_up(100 * share, digits)} %"
