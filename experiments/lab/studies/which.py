"""Tables for choosing a planner and a bound, with their stored figures."""

from collections.abc import Sequence
from statistics import fmean

from cocap_opt.experiments.lab.results import STORED, in_percent, in_unit, stored_rows
from cocap_opt.experiments.lab.studies.paper.measured import read_rows
from cocap_opt.experiments.lab.studies.paper.planner_table import time_ratio
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.output.printing import markdown_table
from cocap_opt.planners import RECOMMENDED

_PLANNERS = {
    "the best plan": "cocap-prices",
    "a good plan in a fraction of the time": "cocap-lns",
    "a plan that no single drone can improve, at once": "sequential-rounds",
    "any plan that obeys the rules, at once": "sequential",
    "the published planner, for comparison": "cocap",
    "the optimum of one or two drones": "joint",
    "the reward without collision rules": "greedy-rounds",
}
# The user's goal, the method, and the row and figures of its stored measurements.
_BOUNDS: tuple[tuple[str, str, str, Sequence[str]], ...] = (
    ("the proved optimum for a team of the paper's size", "`solve` (branch-and-price)",
     "bottleneck", ("proved optima", "median seconds to proof")),
    ("the same where space is tight", "`solve` (branch-and-price)",
     "passage", ("proved optima", "median seconds to proof")),
    ("a bound on many people over many steps", "`bound` (column-generation)",
     "field-long", ("median gap after 15 s", "median gap after 300 s")),
    ("a bound on a large map", "`bound` (column-generation)",
     "field-large", ("median gap after 60 s", "median gap after 120 s")),
    ("a bound by a cone solver, on a few steps", "`bound --method envelope`",
     "relaxations", ("field, 3 steps: envelope above the optimum, median",)),
    ("the simplest concave bound, on a few steps", "`bound --method concave`",
     "relaxations", ("field, 3 steps: concave above the optimum, median",)),
)  # fmt: skip


def which_planner_in_markdown() -> str:
    """Returns a planner for each goal, with its stored gap and time."""
    rows = read_rows(STORED / "paper.csv")
    base = {row.key: row.seconds for row in rows if row.planner == "sequential"}
    table = []
    for wish, name in _PLANNERS.items():
        of_planner = [row for row in rows if row.planner == name]
        gaps = GapRow.percent([row for row in of_planner if row.valid], "gap")
        table.append({
            "you need": wish,
            "planner": f"`{name}`",
            "below the bound": f"{fmean(gaps):.2f} %",
            "at worst": f"{max(gaps):.2f} %",
            "runs with a plan": f"{len(gaps)} of {len(of_planner)}",
            "time / sequential": time_ratio(of_planner, base),
        })  # fmt: skip
    return markdown_table(table)


def which_bound_in_markdown() -> str:
    """Returns a bound or exact method for each goal, with its stored figures."""
    stored = {(row["row"], row["figure"]): row for row in stored_rows("solver-figures.csv")}
    table = []
    for wish, method, name, figures in _BOUNDS:
        found = [stored[name, figure] for figure in figures]
        said = [f"{_short(f['figure'])}: {in_unit(f['value'], f['unit'])}" for f in found]
        table.append({
            "you need": wish,
            "method": method,
            "measured on": figures[0].partition(":")[0] if name == "relaxations" else name,
            "result": "; ".join(said),
        })  # fmt: skip
    return markdown_table(table)


def _short(figure: str) -> str:
    """Returns the name of a figure without its scene and method."""
    return "above the optimum, median" if "above the optimum" in figure else figure


def proved_in_words() -> str:
    """Returns the number of proved optima of the paper's scenes, and the gaps of larger scenes."""
    best = [row for row in read_rows(STORED / "paper.csv") if row.planner == RECOMMENDED]
    stored = {(row["row"], row["figure"]): row for row in stored_rows("solver-figures.csv")}
    left = {
        scene: float(stored[scene, f"median gap after {seconds} s"]["value"])
        for scene, seconds in (("field-long", 300), ("field-large", 120))
    }
    limit = max(GapRow.values(best, "bound_time_limit"))
    return (
        f"{sum(row.bound_is_proved for row in best)} of {len(best)} optima of scenes of the "
        f"paper's size are proved within {limit:g} s each; {left['field-long']:.2f} % is left "
        f"open on `field-long` after 300 s, and {left['field-large']:.2f} % on `field-large` after "
        "120 s (medians)"
    )


def views_saved_in_words() -> str:
    """Returns the smallest and the largest share of views that lazy planning evaluates."""
    shares = sorted(float(row["views"]) for row in stored_rows("lazy.csv"))
    return f"{in_percent(str(shares[0]))} to {in_percent(str(shares[-1]))}"
