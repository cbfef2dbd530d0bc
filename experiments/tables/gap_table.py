"""The printed gap table, with notes on its bounds, and means over seeds."""

import math
from collections.abc import Iterator, Sequence

from msgspec import UNSET

from cocap_opt.experiments.tables.rows import SAMPLED_COVERAGE, GapRow
from cocap_opt.output.printing import Listing, Marked, Record
from cocap_opt.problem.plan import NO_PLAN
from cocap_opt.result import Reason
from cocap_opt.stop import NO_LIMIT
from cocap_opt.text import counted, shortened

_CUT = "!"  # marks a planner whose plan is cut short by a limit
_OPEN = "*"  # marks a bound whose search was stopped by a limit
_LATE = "!"  # marks the seconds of a planner that overran its time limit
PROVED = ("optimal", "infeasible")
_MISSING = {  # why there is no bound
    "stopped": "a limit stopped its search before there was one",
    "error": "its search ended in an error",
    "exceeded": "its search exceeded the time limit of a cell",
    "died": "the process of its search died",
}
_DONE = (Reason.FINISHED, Reason.OPTIMAL)
_UNFINISHED = (Reason.UNSUPPORTED, Reason.FAILED, Reason.INFEASIBLE, Reason.STOPPED)
_NAMED = 3  # most cases that a note names
GAP_FREE = "gap without\nrules"
# Headings of columns that differ from their keys; JSON and results.csv have the keys.
_LABELS = {"reward": "J", "reward_rendered": "J rendered", "gap_free": GAP_FREE}
_GAPS = (
    "Gap: the plan's J is at most this percentage below the J of the best plan under the scene's "
    "rules. Gap without rules: the same for the best plan of drones that may collide."
)
# Columns that a narrow terminal omits, the least useful first.
_SPARE = (
    "coverage_seconds", GAP_FREE, "seconds", "reason", "bound", "seed", "limit", "J rendered", "J",
)  # fmt: skip
_SPARE_MEANS = (GAP_FREE, "seconds", "bound", "bounds proved", "J")
_SPARE_CAMERAS = ("plans", "by three (%)", "median error (mm)")
_SEEN = (
    "By two, by three: share of person-steps at which at least two or three drones see the person. "
    "Median error: at half of the person-steps, a point in space is located to within this error "
    "(median over plans). For details of one plan, run `cocap-opt quality`.",
)
_MEANS = ("gap", "reward", "bound", "gap_free", "seconds")


def print_gap_table(rows: Sequence[GapRow], verbose: bool = False) -> None:
    """Prints the gap table and, if there are several seeds, means over them.

    Parameters
    ----------
    verbose : also print the seconds of coverage, and why planners stopped, even if all of them
        finished
    """
    _print_rows(rows, verbose)
    means = _means(rows)
    if len(rows) > len(means):
        Listing("means over seeds", means).fitted(_SPARE_MEANS).print()
    if cameras := _cameras(rows):
        listing = Listing("cameras on people: mean shares and median error of plans", cameras)
        listing = listing.fitted(_SPARE_CAMERAS, "--json or --out DIR")
        listing._replace(notes=[*listing.notes, *_SEEN]).print()


def _print_rows(rows: Sequence[GapRow], verbose: bool) -> None:
    keys = ["scene", "seed", "planner", "gap", "reward"]
    keys += ["reward_rendered"] if any(r.reward_rendered is not UNSET for r in rows) else []
    keys += ["bound", "gap_free", "conflicts"]
    if verbose or any(row.reason not in _DONE for row in rows):
        keys.append("reason")
    if any(row.limit != NO_LIMIT for row in rows):
        keys.append("limit")
    keys.append("seconds")
    if verbose and any(row.coverage_seconds is not None for row in rows):
        keys.append("coverage_seconds")
    table: list[Record] = [
        {_LABELS.get(key, key): _shown(row, key) for key in keys} for row in rows
    ]
    listing = Listing(_title(rows), table).fitted(_spare(rows, table), "--json or --out DIR")
    listing._replace(notes=[*listing.notes, *_notes(rows, listing.rows)]).print()


def _spare(rows: Sequence[GapRow], table: Sequence[Record]) -> list[str]:
    """Returns the columns that can be omitted.

    Marked bounds, seconds over a limit and seeds that differ are always shown.
    """
    kept = {"bound"} if any(shown["bound"].mark == _OPEN for shown in table) else set()
    kept |= {"seconds"} if any(row.overrun is not None for row in rows) else set()
    kept |= {"seed"} if len({row.seed for row in rows}) > 1 else set()
    return [key for key in _SPARE if key not in kept]


def _notes(rows: Sequence[GapRow], table: Sequence[Record]) -> Iterator[str]:
    """Yields notes that explain the table."""
    values = (value for shown in table for value in shown.values())
    if any(isinstance(value, Marked) and value.mark == _OPEN for value in values):
        yield (
            f"{_OPEN} A limit stopped the search for this bound: it is certified, but the optimum "
            "may be lower."
        )
    late = [
        f"{row.planner} on {_name(row)} ({row.seconds:.1f} s of {row.time_limit:g} s)"
        for row in rows
        if row.overrun is not None
    ]
    if late:
        yield f"{_LATE} Longer than the time limit allows: {_first(late)}."
    if any("coverage_seconds" in shown for shown in table):
        yield (
            "Coverage was computed once per scene and seed, before any time limit started; the "
            "planners' seconds do not include it."
        )
    if any(shown.get(GAP_FREE) is not None for shown in table):
        yield _GAPS
    yield from _missing_bounds(rows)
    sampled = [_name(row) for row in rows if row.coverage == SAMPLED_COVERAGE]
    if sampled:
        yield (
            f"Coverage behind the meshes of {_first(list(dict.fromkeys(sampled)))} is sampled "
            "with rays; the gaps do not include the sampling error."
        )
    yield from _cut_short(rows)
    remarked = [row for row in rows if row.reason in _UNFINISHED and row.message]
    told = dict.fromkeys(f"{row.planner} on {_name(row)}: {row.message}." for row in remarked)
    yield from list(told)[:_NAMED]
    if any(row.conflicts for row in rows):
        yield (
            "A plan with conflicts breaks the scene's rules: its J may exceed the bound, "
            "and it has no gap."
        )


def _cut_short(rows: Sequence[GapRow]) -> Iterator[str]:
    """Yields notes on plans that limits have cut short; planners without any plan come first."""
    cut = [row for row in rows if row.cut_short]
    cut.sort(key=lambda row: not row.cut_short.startswith(NO_PLAN))
    for row in cut[:_NAMED]:
        yield f"{_CUT} {row.planner} on {_case(row)}: {row.cut_short}."
    if len(cut) > _NAMED:
        others = counted(len(cut) - _NAMED, "more plan")
        yield f"{_CUT} A limit cut short {others}; --json or --out DIR lists all."


def _shown(row: GapRow, key: str) -> object:
    """Returns the value of a column, with a mark if a note below the table explains it."""
    value = getattr(row, key)
    if value is UNSET:
        return None
    if key == "planner" and row.cut_short:
        return f"{value} {_CUT}"
    reasons = {"bound": row.bound_reason, "gap_free": row.bound_free_reason}
    if key == "seconds":
        return value if row.overrun is None else Marked(value, _LATE)
    if key not in reasons:
        return value
    if key == "bound" and reasons[key] == Reason.INFEASIBLE:
        return Marked("no plan", " ")
    is_open = value is not None and reasons[key] not in PROVED
    return Marked(value, _OPEN if is_open else " ")


# Methods whose bounds are left if a limit stops the search early; `verify` shows their names.
_SIMPLE = dict.fromkeys(("step-multipliers", "optimistic"), "simple")


def _title(rows: Sequence[GapRow]) -> str:
    """Returns the title, which states how good the bounds are."""
    if not rows:
        return "no rows"
    proved = [row for row in rows if row.bound_is_proved]
    others = [r for r in rows if r.bound is not None and r.bound_reason not in PROVED]
    methods = ", ".join(
        dict.fromkeys(_SIMPLE.get(row.bound_method, row.bound_method) for row in (*proved, *others))
    )
    if not others:
        no_gaps = "no bounds" if all(row.bound is None for row in rows) else "no plan exists"
        return f"gap to the proved optimum ({methods})" if proved else no_gaps
    if proved:
        return (
            f"gap to the proved optimum, or where marked {_OPEN} to a certified bound ({methods})"
        )
    return f"gap to a certified bound ({methods})"


def _missing_bounds(rows: Sequence[GapRow]) -> list[str]:
    """Returns notes on missing bounds, with the reasons."""
    found: dict[tuple[str, str], dict[str, None]] = {}
    for row in rows:
        words, value, reason = "No bound", row.bound, row.bound_reason
        if value is not None:
            words, value, reason = "No bound without rules", row.bound_free, row.bound_free_reason
        if value is None and reason not in PROVED:
            found.setdefault((words, reason), {})[_case(row)] = None
    return [
        f"{words} for {_first(list(cases))}: {_MISSING.get(reason, reason)}."
        for (words, reason), cases in found.items()
    ]


def _name(row: GapRow) -> str:
    """Returns the name of a row's scene for notes."""
    return shortened(row.scene)


def _case(row: GapRow) -> str:
    """Returns the name of a row's scene and its seed, if it has one."""
    return _name(row) if row.seed is None else f"{_name(row)} seed {row.seed}"


def _first(names: Sequence[str]) -> str:
    """Returns the first names, and the number of the others."""
    more = len(names) - _NAMED
    return ", ".join(names[:_NAMED]) + (f" and {more} more" if more > 0 else "")


def _means(rows: Sequence[GapRow]) -> list[Record]:
    """Returns means over seeds, the number of plans that obey the rules, and of proved optima.

    A mean exists only if all seeds have a value, as means over different seeds are misleading.
    """
    table = []
    for (scene, planner), group in GapRow.grouped(rows, "scene", "planner").items():
        table.append(
            {
                "scene": scene,
                "planner": planner,
                "seeds": len(group),
                "feasible": sum(row.valid for row in group),
                "bounds proved": sum(row.bound_reason in PROVED for row in group),
                **{_LABELS.get(key, key): _mean_of(group, key) for key in _MEANS},
            }
        )
    return table


def _mean_of(rows: Sequence[GapRow], key: str) -> object:
    """Returns the mean of a column; of J only if all plans obey the rules."""
    if key == "bound" and rows and all(row.bound_reason == Reason.INFEASIBLE for row in rows):
        return "no plan"
    is_known = key != "reward" or all(row.valid for row in rows)
    return _mean(rows, key) if is_known else None


def _cameras(rows: Sequence[GapRow]) -> list[Record]:
    """Returns mean shares and the median error of plans, for each scene and planner with plans."""
    table = []
    for (scene, planner), group in GapRow.grouped(rows, "scene", "planner").items():
        filmed = [row for row in group if row.valid and row.seen_by_two is not None]
        if filmed:
            table.append(
                {
                    "scene": scene,
                    "planner": planner,
                    "plans": len(filmed),
                    "by two (%)": _rounded(_mean(filmed, "seen_by_two"), 100),
                    "by three (%)": _rounded(_mean(filmed, "seen_by_three"), 100),
                    "median error (mm)": _rounded(GapRow.middle_error(filmed)),
                }
            )
    return table


def _rounded(value: float | None, factor: float = 1) -> str | None:
    return None if value is None else f"{factor * value:,.0f}"


def _mean(rows: Sequence[GapRow], key: str) -> float | None:
    values = [getattr(row, key) for row in rows]
    return None if None in values else math.fsum(values) / len(values)
