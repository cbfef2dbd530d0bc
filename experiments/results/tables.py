"""Tables of a sweep: planners, differences between them, collision avoidance, and time.

Each is a list of rows whose values are already text, so that all formats show the same.
"""

import math
from collections.abc import Iterable, Sequence
from statistics import median

from cocap_opt.experiments.results.rows import Row, bound_is_proved, obeys
from cocap_opt.experiments.results.statistics import mean, shifted_geometric_mean
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.result import Reason

Table = list[dict[str, str]]
NONE = "-"
LARGE = 1000  # rewards from which on no decimals are shown
AGAINST = "sequential"  # what the paper compares itself with


def planner_table(rows: Sequence[Row]) -> Table:
    """Per scene and planner: reward, gap, and how often the rules hold and the plan is best.

    Rewards are of all plans. Only plans that obey the rules have gaps; where not all of them do,
    the mean is over fewer seeds than others', and their number is said.
    """
    table = []
    for (scene, planner), some in grouped(rows, "scene", "planner").items():
        valid = [row for row in some if obeys(row)]
        gaps = percent(valid, "gap")
        table.append(
            {
                "scene": scene,
                "planner": planner,
                "seeds": str(len(some)),
                "obeys the rules": _share(len(valid), len(some)),
                "reward, all plans": _spread(values(some, "reward")),
                "gap (%)": _of(interval(gaps), len(gaps), len(some)),
                "largest gap (%)": number(max(gaps, default=None), 3),
                "gap to free (%)": interval(percent(valid, "gap_free")),
                "proved optimal": _share(sum(map(is_optimal, valid)), len(some)),
                "stopped by a limit": str(sum(row["reason"] == Reason.STOPPED for row in some)),
                "seconds, median": _median(values(some, "seconds")),
            }
        )
    return table


def difference_table(rows: Sequence[Row], against: str = AGAINST) -> Table:
    """Per scene and planner: J minus J of another planner on the same seeds, in % of the latter.

    Only seeds are compared on which both plans obey the rules.
    """
    table = []
    for (scene,), some in grouped(rows, "scene").items():
        reference = {row["seed"]: row for row in some if row["planner"] == against}
        for (planner,), own in grouped(some, "planner").items():
            if planner == against:
                continue
            pairs = [
                (row["reward"], reference[row["seed"]]["reward"])
                for row in own
                if obeys(row) and row["seed"] in reference and obeys(reference[row["seed"]])
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


def price_table(rows: Sequence[Row]) -> Table:
    """Per scene: what collision avoidance costs at least and at most, both ends certified.

    At least it costs what the best free plan has more than the bound under the rules, at most
    what the free bound has more than the best plan that obeys them, in % of the free optimum.
    """
    table = []
    for (scene,), some in grouped(rows, "scene").items():
        first = {row["seed"]: row for row in some}.values()
        ends = [end for row in first if (end := price(row)) is not None]
        table.append(
            {
                "scene": scene,
                "at least (%)": interval([100 * low for low, _ in ends]),
                "at most (%)": interval([100 * high for _, high in ends]),
                "largest (%)": number(max((100 * high for _, high in ends), default=None), 3),
                "bound proved best": _share(sum(map(bound_is_proved, first)), len(first)),
                "seeds": str(len(ends)),
            }
        )
    return table


def price(row: Row) -> tuple[float, float] | None:
    """Least and largest price of collision avoidance of a scene and seed, as shares."""
    known = [row[key] for key in ("bound", "optimum", "bound_free", "optimum_free")]
    if None in known or row["bound_free"] <= 0:
        return None
    bound, optimum, bound_free, optimum_free = known
    return max(optimum_free - bound, 0.0) / bound_free, (bound_free - optimum) / bound_free


def time_table(rows: Sequence[Row], limit: float) -> Table:
    """Per scene and planner: shifted geometric means of seconds, at the end over all scenes.

    A run without a plan that obeys the rules counts as one that took the whole limit. Over all
    scenes only planners are compared that were run on every scene and seed.

    Parameters
    ----------
    limit : s, that planners had
    """
    timed = [row for row in rows if _is_timed(row)]
    scenes = grouped(timed, "scene")
    table = [row for (scene,), some in scenes.items() for row in _times(scene, some, limit)]
    if len(scenes) < 2:
        return table
    instances = {(row["scene"], row["seed"]) for row in timed}
    everywhere = [
        row
        for some in grouped(timed, "planner").values()
        if {(row["scene"], row["seed"]) for row in some} == instances
        for row in some
    ]
    return table + _times("all", everywhere, limit)


def _is_timed(row: Row) -> bool:
    """Whether a row is of a run: nobody times plans of others, or scenes that are not taken."""
    ran = row["reward"] is None and row["reason"] != Reason.UNSUPPORTED
    return ran or row["seconds"] is not None


def _times(scene: str, rows: Sequence[Row], limit: float) -> Table:
    """The rows of a table of times; ratios are over what all of its planners were run on."""
    planners = {planner: some for (planner,), some in grouped(rows, "planner").items()}
    instances = [{(row["scene"], row["seed"]) for row in some} for some in planners.values()]
    common = set.intersection(*instances) if instances else set()
    means = {planner: _mean_seconds(some, limit) for planner, some in planners.items()}
    alike = {
        planner: _mean_seconds([r for r in some if (r["scene"], r["seed"]) in common], limit)
        for planner, some in planners.items()
        if common
    }
    least = min(alike.values(), default=0.0)
    return [
        {
            "scene": scene,
            "planner": planner,
            "runs": str(len(some)),
            "no valid plan": str(sum(not obeys(row) for row in some)),
            "shifted geometric mean (s)": number(means[planner], 3),
            "of the fastest": number(alike[planner] / least if least > 0 else None, 1),
            "median (s)": _median(values(some, "seconds")),
            "longest (s)": number(max(values(some, "seconds"), default=None), 3),
        }
        for planner, some in planners.items()
    ]


def _mean_seconds(rows: Sequence[Row], limit: float) -> float:
    return shifted_geometric_mean([row["seconds"] if obeys(row) else limit for row in rows])


def is_optimal(row: Row) -> bool:
    """Whether a plan is proved to be the best."""
    return obeys(row) and row["gap"] is not None and row["gap"] <= OPTIMALITY


def all_tables(rows: Sequence[Row], limit: float, against: str = AGAINST) -> dict[str, Table]:
    """All tables by their titles; those that have no rows are left out."""
    planners = {row["planner"] for row in rows}
    tables = {
        "Planners": planner_table(rows),
        "Paired differences": difference_table(rows, against) if against in planners else [],
        "Price of collision avoidance": price_table(rows),
        "Time": time_table(rows, limit),
    }
    return {title: table for title, table in tables.items() if table}


def grouped(rows: Iterable[Row], *keys: str) -> dict[tuple[str, ...], list[Row]]:
    """Rows by the values of some keys, in the order in which these first occur."""
    view_sums: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        view_sums.setdefault(tuple(row[key] for key in keys), []).append(row)
    return view_sums


def values(rows: Sequence[Row], key: str) -> list[float]:
    """What rows have under a key, where they have something."""
    return [row[key] for row in rows if row[key] is not None]


def percent(rows: Sequence[Row], key: str) -> list[float]:
    """Shares that rows have under a key, in %."""
    return [100 * value for value in values(rows, key)]


def _of(text: str, part: int, whole: int) -> str:
    """A mean, and over how many seeds it is if not over all."""
    return text if part in (0, whole) else f"{text} (n = {part})"


def _spread(sample: Sequence[float]) -> str:
    """Mean and standard deviation."""
    if not sample:
        return NONE
    found = mean(sample)
    digits = 0 if abs(found.value) >= LARGE else 2
    spread = "" if math.isnan(found.spread) else f" ± {number(found.spread, digits)}"
    return number(found.value, digits) + spread


def _median(sample: Sequence[float]) -> str:
    return number(median(sample), 3) if sample else NONE


def interval(sample: Sequence[float], digits: int = 3) -> str:
    """Mean and confidence interval, if there are values."""
    if not sample:
        return NONE
    found = mean(sample)
    if math.isnan(found.low):
        return number(found.value, digits)
    low, high = number(found.low, digits), number(found.high, digits)
    return f"{number(found.value, digits)} [{low}, {high}]"


def number(value: float | None, digits: int) -> str:
    """A number with so many digits, if there is one."""
    if value is None or not math.isfinite(value):
        return NONE
    return f"{round(value, digits) + 0.0:,.{digits}f}"  # never -0


def _share(part: int, whole: int) -> str:
    return f"{part} of {whole}"
