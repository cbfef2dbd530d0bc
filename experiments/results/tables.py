"""Tables of a sweep: planners, differences between them, collision avoidance, and time.

Each is a list of rows whose values are already text, so that all formats show the same.
"""

import math
from collections.abc import Iterable, Sequence
from statistics import median
from typing import Any

from cocap_opt.experiments.results.rows import Row
from cocap_opt.experiments.results.statistics import Mean, shifted_geometric_mean
from cocap_opt.result import Reason

Table = list[dict[str, str]]
NONE = "-"
_LARGE = 1000  # rewards from which on no decimals are shown
AGAINST = "sequential"  # what the paper compares itself with


def _planner_table(rows: Sequence[Row]) -> Table:
    """Returns reward, gap, and numbers of plans that obey the rules and are best, by planner.

    Rewards are of all plans. Only plans that obey the rules have gaps; where not all of them do,
    the mean is over fewer seeds than others', and their number is said.
    """
    table = []
    for (scene, planner), some in grouped(rows, "scene", "planner").items():
        valid = [row for row in some if row.valid]
        gaps = percent(valid, "gap")
        table.append(
            {
                "scene": scene,
                "planner": planner,
                "seeds": str(len(some)),
                "obeys the rules": _share(len(valid), len(some)),
                "reward, all plans": _spread(values(some, "reward")),
                "gap (%)": _of(interval(gaps), len(gaps), len(some)),
                "largest gap (%)": _number(max(gaps, default=None), 3),
                "gap to free (%)": interval(percent(valid, "gap_free")),
                "proved optimal": _share(sum(row.is_optimal for row in valid), len(some)),
                "stopped by a limit": str(sum(row.reason == Reason.STOPPED for row in some)),
                "seconds, median": _median(values(some, "seconds")),
            }
        )
    return table


def _difference_table(rows: Sequence[Row], against: str = AGAINST) -> Table:
    """Returns J minus J of another planner on the same seeds, in % of the latter, by planner.

    Only seeds are compared on which both plans obey the rules.
    """
    table = []
    for (scene,), some in grouped(rows, "scene").items():
        reference = {row.seed: row.reward for row in some if row.planner == against and row.valid}
        for (planner,), own in grouped(some, "planner").items():
            if planner == against:
                continue
            pairs = [
                (row.reward, other)
                for row in own
                if row.valid and row.reward is not None
                if (other := reference.get(row.seed)) is not None
            ]
            shares = [100 * (a - b) / b for a, b in pairs if b > 0]
            table.append(
                {
                    "scene": scene,
                    "planner": planner,
                    f"against {against} (%)": interval(shares),
                    "better": str(sum(a > b for a, b in pairs)),
                    "equal": str(sum(a == b for a, b in pairs)),
                    "worse": str(sum(a < b for a, b in pairs)),
                    "seeds": str(len(pairs)),
                }
            )
    return table


def _price_table(rows: Sequence[Row]) -> Table:
    """Returns what collision avoidance costs at least and at most, by scene; both are certified.

    At least it costs what the best free plan has more than the bound under the rules, at most
    what the free bound has more than the best plan that obeys them, in % of the free optimum.
    """
    table = []
    for (scene,), some in grouped(rows, "scene").items():
        first = {row.seed: row for row in some}.values()
        ends = [end for row in first if (end := row.price) is not None]
        table.append(
            {
                "scene": scene,
                "at least (%)": interval([100 * low for low, _ in ends]),
                "at most (%)": interval([100 * high for _, high in ends]),
                "largest (%)": _number(max((100 * high for _, high in ends), default=None), 3),
                "bound proved best": _share(sum(row.bound_is_proved for row in first), len(first)),
                "seeds": str(len(ends)),
            }
        )
    return table


def _time_table(rows: Sequence[Row]) -> Table:
    """Returns shifted geometric means of seconds by scene and planner, at the end over all scenes.

    A run without a plan that obeys the rules counts as one that took the time it was allowed.
    Over all scenes only planners are compared that were run on every scene and seed.
    """
    timed = [row for row in rows if _is_timed(row)]
    scenes = grouped(timed, "scene")
    table = [row for (scene,), some in scenes.items() for row in _times(scene, some)]
    if len(scenes) < 2:
        return table
    instances = {row.key for row in timed}
    everywhere = [
        row
        for some in grouped(timed, "planner").values()
        if {row.key for row in some} == instances
        for row in some
    ]
    return table + _times("all", everywhere)


def _is_timed(row: Row) -> bool:
    """Returns True for a run: plans of others are not timed, nor scenes that are not taken."""
    ran = row.reward is None and row.reason != Reason.UNSUPPORTED
    return ran or row.seconds is not None


def _times(scene: str, rows: Sequence[Row]) -> Table:
    """Returns rows of a table of times; ratios are over what all of its planners were run on."""
    planners = {planner: some for (planner,), some in grouped(rows, "planner").items()}
    instances = [{row.key for row in some} for some in planners.values()]
    common = set.intersection(*instances) if instances else set()
    means = {planner: _mean_seconds(some) for planner, some in planners.items()}
    alike = {
        planner: _mean_seconds([row for row in some if row.key in common])
        for planner, some in planners.items()
        if common
    }
    least = min(alike.values(), default=0.0)
    return [
        {
            "scene": scene,
            "planner": planner,
            "runs": str(len(some)),
            "no valid plan": str(sum(not row.valid for row in some)),
            "shifted geometric mean (s)": _number(means[planner], 3),
            "of the fastest": _number(alike[planner] / least if least > 0 else None, 1),
            "median (s)": _median(values(some, "seconds")),
            "longest (s)": _number(max(values(some, "seconds"), default=None), 3),
        }
        for planner, some in planners.items()
    ]


def _mean_seconds(rows: Sequence[Row]) -> float:
    taken = (row.seconds if row.valid else row.time_limit for row in rows)
    return shifted_geometric_mean([seconds or 0.0 for seconds in taken])


def all_tables(rows: Sequence[Row], against: str = AGAINST) -> dict[str, Table]:
    """Returns all tables by their titles; those that have no rows are left out."""
    planners = {row.planner for row in rows}
    tables = {
        "Planners": _planner_table(rows),
        "Paired differences": _difference_table(rows, against) if against in planners else [],
        "Price of collision avoidance": _price_table(rows),
        "Time": _time_table(rows),
    }
    return {title: table for title, table in tables.items() if table}


def grouped(rows: Iterable[Row], *keys: str) -> dict[tuple[Any, ...], list[Row]]:
    """Returns rows by the values of some columns, in the order in which these first occur."""
    found: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        found.setdefault(tuple(getattr(row, key) for key in keys), []).append(row)
    return found


def values(rows: Sequence[Row], key: str) -> list[float]:
    """Returns the numbers that rows have in a column, where they have one."""
    return [value for row in rows if (value := getattr(row, key)) is not None]


def percent(rows: Sequence[Row], key: str) -> list[float]:
    """Returns the shares that rows have in a column, in %."""
    return [100 * value for value in values(rows, key)]


def _of(text: str, part: int, whole: int) -> str:
    """Returns a mean, with the number of seeds that it is over if not over all."""
    return text if part in (0, whole) else f"{text} (n = {part})"


def _spread(sample: Sequence[float]) -> str:
    """Returns mean and standard deviation."""
    if not sample:
        return NONE
    found = Mean.of(sample)
    digits = 0 if abs(found.value) >= _LARGE else 2
    spread = "" if math.isnan(found.spread) else f" ± {_number(found.spread, digits)}"
    return _number(found.value, digits) + spread


def _median(sample: Sequence[float]) -> str:
    return _number(median(sample), 3) if sample else NONE


def interval(sample: Sequence[float], digits: int = 3) -> str:
    """Returns mean and confidence interval, if there are values."""
    if not sample:
        return NONE
    found = Mean.of(sample)
    if math.isnan(found.low):
        return _number(found.value, digits)
    low, high = _number(found.low, digits), _number(found.high, digits)
    return f"{_number(found.value, digits)} [{low}, {high}]"


def _number(value: float | None, digits: int) -> str:
    """Returns a number with so many digits, if there is one."""
    if value is None or not math.isfinite(value):
        return NONE
    return f"{round(value, digits) + 0.0:,.{digits}f}"  # never -0


def _share(part: int, whole: int) -> str:
    return f"{part} of {whole}"
