"""Tables of a sweep, as Markdown, LaTeX and HTML.

They show planners, the differences between them, the price of collision avoidance, how people are
filmed, and time. Each is a list of rows whose values are already text, so that all formats show the
same.
"""

import math
import re
import textwrap
from collections.abc import Callable, Mapping, Sequence
from html import escape
from statistics import median
from typing import TYPE_CHECKING

from cocap_opt.experiments.tables.gap_table import PROVED
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.experiments.tables.statistics import NONE, Mean
from cocap_opt.output.printing import Listing, markdown_table
from cocap_opt.result import Reason
from cocap_opt.text import printable

if TYPE_CHECKING:
    import pandas as pd

Table = list[dict[str, str]]
_HEADING = 12  # characters per line of a heading in LaTeX
_LARGE = 1000  # means of at least this size have no decimals
AGAINST = "sequential"  # the planner that the paper compares CoCap with
_PLANNERS, _DIFFERENCES, _PRICE, CAMERAS, _TIME = (
    "Planners", "Paired differences", "Price of collision avoidance", "Cameras on people", "Time",
)  # fmt: skip
# Columns that a narrow terminal omits, the least useful first.
_SPARE = {
    _PLANNERS: ("stopped by a limit", "gap to bound without rules (%)", "median (s)", "seeds",
               "proved optimal", "mean J", "largest gap (%)"),
    _DIFFERENCES: ("seeds", "equal", "worse", "better"),
    _PRICE: ("seeds", "at most, worst seed (%)", "optimum known"),
    CAMERAS: ("plans", "seen by three (%)", "median error (mm)"),
    _TIME: ("runs", "longest (s)", "shifted geometric mean (s)", "no valid plan"),
}  # fmt: skip


# Notes on what the columns mean; all formats show them.
_NOTES = {
    _PLANNERS: "J is higher for better plans: mean ± standard deviation over the seeds. Gap: how "
               "far J is below the best certified bound, in % of that bound. Gap to bound without "
               "rules: the same, for the bound of the scene without collision rules. Only plans "
               "that obey the rules count{counted}. In brackets: 95 % bootstrap intervals of "
               "means. Median (s): planning time.",
    _DIFFERENCES: "Against: difference in J from the named planner on the same seed, in % of that "
                  "planner's J. Better, equal, worse: number of seeds. Both plans must obey the "
                  "rules.",
    _PRICE: "Costs: certified limits on how much the collision rules lower the best J of a "
            "scene, in %. Optimum known: seeds on which the optimum is proved.",
    CAMERAS: "Seen by: share of person-steps at which at least so many drones see the person. "
             "Median error: at half of the person-steps, a point in space is located to within "
             "this error (median over plans). Only plans that obey the rules count.",
    _TIME: "Planning time; the shift of geometric means is 10 s. A run without a valid plan "
           "counts as its time limit, unless it proves that there is none; a planner with plans "
           "that break rules has no mean. Times the fastest: ratio of means over the scenes and "
           "seeds that all planners were run on.",
}  # fmt: skip
_COUNT = "(n = "  # starts the number of seeds of a mean that is not over all seeds
# A number, with its spread or interval, its count, the whole or a unit; or "-", for no number.
_NUMBER = re.compile(
    r"(< )?[-+]?[\d.,]+( ± [\d.,]+)?( \([-\d.,]+ to [-\d.,]+\))?( \(n = \d+\))?( of \d+)?( %)?|-"
)


# Characters that LaTeX does not print as they are.
_LATEX = str.maketrans(
    {c: f"\\{c}" for c in "&%$#_{}"}
    | {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
    | {"<": r"\textless{}", ">": r"\textgreater{}", "±": r"$\pm$"}
)


class Tables(dict[str, Table]):
    """Tables by their titles.

    Parameters
    ----------
    tables : by title
    notes : what the columns mean, by title; not every table needs a note
    """

    def __init__(self, tables: Mapping[str, Table], notes: Mapping[str, str] | None = None) -> None:
        super().__init__(tables)
        self._notes = {title: words for title, words in (notes or {}).items() if title in tables}

    @classmethod
    def of(cls, rows: Sequence[GapRow], against: str = AGAINST) -> "Tables":
        """Returns all tables of a sweep; tables without rows are omitted.

        Parameters
        ----------
        against : the planner that others are compared with
        """
        planners = {row.planner for row in rows}
        tables = {
            _PLANNERS: _planner_table(rows),
            _DIFFERENCES: _difference_table(rows, against) if against in planners else [],
            _PRICE: _price_table(rows),
            CAMERAS: _camera_table(rows),
            _TIME: _time_table(rows),
        }
        has_counts = any(_COUNT in text for row in tables[_PLANNERS] for text in row.values())
        counted = " (n: their number)" if has_counts else ""
        notes = _NOTES | {_PLANNERS: _NOTES[_PLANNERS].format(counted=counted)}
        return cls({title: table for title, table in tables.items() if table}, notes)

    def print(self) -> None:
        """Prints the tables for a terminal; a narrow one omits the least useful columns."""
        for title, table in self.items():
            notes = [self._notes[title]] if title in self._notes else []
            Listing(title, table, notes).fitted(_SPARE.get(title, ()), "-o FILE").print()

    def markdown(self) -> str:
        """Returns the tables in Markdown under headings, each with its note below it.

        Special characters in cells are escaped.
        """
        return "\n".join(
            f"## {title}\n\n{markdown_table(_escaped(table))}\n"
            + (f"\n{self._notes[title]}\n" if title in self._notes else "")
            for title, table in self.items()
        )

    def latex(self) -> str:
        """Returns the tables in LaTeX (package booktabs), each across two columns of text.

        Captions contain the notes; the list of tables has only the titles.
        """
        return "% \\usepackage{booktabs}\n" + "\n".join(
            _latex_table(title, self._notes.get(title, ""), table) for title, table in self.items()
        )

    def html(self, level: int = 2) -> str:
        """Returns the tables for an HTML page, with their titles as headings, and their notes.

        Parameters
        ----------
        level : of the headings
        """
        heading = f"h{level}"
        return "\n".join(
            f"<{heading}>{escape(title)}</{heading}>\n"
            + (f"<p>{escape(self._notes[title])}</p>\n" if title in self._notes else "")
            + html_table(title, table)
            for title, table in self.items()
        )


DOCUMENTS: Mapping[str, Callable[[Tables], str]] = {
    "markdown": Tables.markdown,
    "latex": Tables.latex,
    "html": Tables.html,
}


def html_table(title: str, table: Table) -> str:
    """Returns a table for an HTML page; it scrolls on its own, and numbers are right-aligned.

    Parameters
    ----------
    title : for screen readers
    """
    shown = [{key: printable(text) for key, text in row.items()} for row in table]
    marks = {
        key: ' class="n"' if all(_NUMBER.fullmatch(row[key]) for row in shown) else ""
        for key in shown[0]
    }
    head = "".join(f'<th scope="col"{mark}>{escape(key)}</th>' for key, mark in marks.items())
    lines = [
        "".join(f"<td{mark}>{escape(row[key])}</td>" for key, mark in marks.items())
        for row in shown
    ]
    body = "\n".join(f"<tr>{line}</tr>" for line in lines)
    return (
        f'<table tabindex="0" aria-label="{escape(title)}">\n<thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{body}\n</tbody>\n</table>\n"
    )


def _latex_table(title: str, note: str, table: Table) -> str:
    """Returns a table in small type whose headings are stacked, so that it fits across a page."""
    frame, name = _frame(table), _in_latex(title)
    text: str = frame.to_latex(
        index=False,
        escape=False,  # by `_frame`
        caption=(f"{name}. {_in_latex(note)}", name) if note else name,
        label="tab:" + re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-"),
        position="ht",
        column_format="ll" + "r" * (len(frame.columns) - 2),
    )
    header = text.split("\\toprule\n")[1].splitlines()[0]
    cells = header.removesuffix(" \\\\").split(" & ")
    text = text.replace(header, " & ".join(map(_stacked, cells)) + " \\\\", 1)
    small = "\\begin{table*}[ht]\n\\centering\\footnotesize\\setlength{\\tabcolsep}{3pt}"
    return text.replace("\\begin{table}[ht]", small).replace("\\end{table}", "\\end{table*}")


def _stacked(heading: str) -> str:
    """Returns a heading that is broken into short lines."""
    lines = textwrap.wrap(heading, _HEADING, break_long_words=False)
    return heading if len(lines) < 2 else "\\shortstack{" + r"\\".join(lines) + "}"


def _frame(table: Table) -> "pd.DataFrame":
    """Returns a table whose headings and cells are escaped for LaTeX."""
    import pandas as pd  # slow to import

    return pd.DataFrame(
        [{_in_latex(key): _in_latex(text) for key, text in row.items()} for row in table]
    )


def _in_latex(text: str) -> str:
    """Returns text whose special characters are escaped for LaTeX."""
    return printable(text).translate(_LATEX)


def _escaped(table: Table) -> Table:
    return [{key: Listing.cell(text) for key, text in row.items()} for row in table]


def _planner_table(rows: Sequence[GapRow]) -> Table:
    """Returns reward, gap, and the numbers of valid and of proved optimal plans, by planner.

    Only plans that obey the rules count in means of J and of gaps; if only some plans do, the means
    are over fewer seeds, and their number is shown.
    """
    table = []
    for (scene, planner), group in GapRow.grouped(rows, "scene", "planner").items():
        valid = [row for row in group if row.valid]
        gaps = GapRow.percent(valid, "gap")
        table.append(
            {
                "scene": scene,
                "planner": planner,
                "seeds": str(len(group)),
                "obeys the rules": _share(len(valid), len(group)),
                "mean J": _of(_spread(GapRow.values(valid, "reward")), len(valid), len(group)),
                "gap (%)": _of(Mean.in_words(gaps), len(gaps), len(group)),
                "largest gap (%)": Mean.rounded(max(gaps, default=None), 3),
                "gap to bound without rules (%)": Mean.in_words(GapRow.percent(valid, "gap_free")),
                "proved optimal": _share(sum(row.is_optimal for row in valid), len(group)),
                "stopped by a limit": str(sum(row.reason == Reason.STOPPED for row in group)),
                "median (s)": _median(GapRow.values(group, "seconds")),
            }
        )
    return table


def _difference_table(rows: Sequence[GapRow], against: str = AGAINST) -> Table:
    """Returns each planner's difference in J from another one, in % of the other's J.

    Only seeds on which both plans obey the rules count.
    """
    table = []
    for (scene,), group in GapRow.grouped(rows, "scene").items():
        reference = {row.seed: row.reward for row in group if row.planner == against and row.valid}
        for (planner,), runs in GapRow.grouped(group, "planner").items():
            if planner == against:
                continue
            pairs = [
                (row.reward, other)
                for row in runs
                if row.valid and row.reward is not None
                if (other := reference.get(row.seed)) is not None
            ]
            shares = [100 * (a - b) / b for a, b in pairs if b > 0]
            table.append(
                {
                    "scene": scene,
                    "planner": planner,
                    f"against {against} (%)": Mean.in_words(shares),
                    "better": str(sum(a > b for a, b in pairs)),
                    "equal": str(sum(a == b for a, b in pairs)),
                    "worse": str(sum(a < b for a, b in pairs)),
                    "seeds": str(len(pairs)),
                }
            )
    return table


def _price_table(rows: Sequence[GapRow]) -> Table:
    """Returns certified limits on the cost of collision avoidance, by scene.

    The lower limit is J of the best plan without rules minus the bound under the rules; the upper
    limit is the bound without rules minus J of the best plan that obeys the rules. Both are in % of
    the bound without rules.
    """
    table = []
    for (scene,), group in GapRow.grouped(rows, "scene").items():
        first = {row.seed: row for row in group}.values()
        ends = [end for row in first if (end := row.price) is not None]
        table.append(
            {
                "scene": scene,
                "costs at least (%)": Mean.in_words([100 * low for low, _ in ends]),
                "costs at most (%)": Mean.in_words([100 * high for _, high in ends]),
                "at most, worst seed (%)": Mean.rounded(
                    max((100 * high for _, high in ends), default=None), 3
                ),
                "optimum known": _share(
                    sum(row.bound_reason in PROVED for row in first), len(first)
                ),
                "seeds": str(len(ends)),
            }
        )
    return table


def _camera_table(rows: Sequence[GapRow]) -> Table:
    """Returns the share of person-steps that several drones see, and the error, by planner.

    Only plans that obey the rules count. The error is the median over plans.
    """
    table = []
    for (scene, planner), group in GapRow.grouped(rows, "scene", "planner").items():
        filmed = [row for row in group if row.valid and row.seen_by_two is not None]
        if filmed:
            error = GapRow.middle_error(filmed)
            table.append(
                {
                    "scene": scene,
                    "planner": planner,
                    "seen by two (%)": Mean.in_words(GapRow.percent(filmed, "seen_by_two"), 1),
                    "seen by three (%)": Mean.in_words(GapRow.percent(filmed, "seen_by_three"), 1),
                    "median error (mm)": NONE if error is None else f"{error:,.0f}",
                    "plans": str(len(filmed)),
                }
            )
    return table


def _time_table(rows: Sequence[GapRow]) -> Table:
    """Returns shifted geometric means of seconds by scene and planner, and last over all scenes.

    A run without a valid plan counts as its time limit, unless it proves that there is none. A
    planner with plans that break rules solves an easier problem: it has no mean, and no other
    planner is compared with it. The rows over all scenes have only planners that were run on every
    scene and seed.
    """
    timed = [row for row in rows if _is_timed(row)]
    scenes = GapRow.grouped(timed, "scene")
    table = [row for (scene,), group in scenes.items() for row in _times(scene, group)]
    if len(scenes) < 2:
        return table
    instances = {row.key for row in timed}
    everywhere = [
        row
        for group in GapRow.grouped(timed, "planner").values()
        if {row.key for row in group} == instances
        for row in group
    ]
    return table + _times("all", everywhere)


def _is_timed(row: GapRow) -> bool:
    """Returns True if a planner was run, False for plans from files and unsupported scenes."""
    ran = row.reward is None and row.reason != Reason.UNSUPPORTED
    return ran or row.seconds is not None


def _times(scene: str, rows: Sequence[GapRow]) -> Table:
    """Returns rows of a table of times; ratios are over the runs that all planners share."""
    planners = {planner: group for (planner,), group in GapRow.grouped(rows, "planner").items()}
    instances = [{row.key for row in group} for group in planners.values()]
    common = set.intersection(*instances) if instances else set()
    obedient = {
        planner: group
        for planner, group in planners.items()
        if all(row.valid or row.reward is None for row in group)
    }
    means = {planner: _mean_seconds(group) for planner, group in obedient.items()}
    alike = {
        planner: _mean_seconds([row for row in group if row.key in common])
        for planner, group in obedient.items()
        if common
    }
    least = min(alike.values(), default=0.0)
    return [
        {
            "scene": scene,
            "planner": planner,
            "runs": str(len(group)),
            "no valid plan": str(sum(not row.valid for row in group)),
            "shifted geometric mean (s)": Mean.rounded(means.get(planner), 3),
            "times the fastest": Mean.rounded(
                alike[planner] / least if least > 0 and planner in alike else None, 1
            ),
            "median (s)": _median(GapRow.values(group, "seconds")),
            "longest (s)": Mean.rounded(max(GapRow.values(group, "seconds"), default=None), 3),
        }
        for planner, group in planners.items()
    ]


def _mean_seconds(rows: Sequence[GapRow]) -> float:
    settled = (row.valid or row.reason == Reason.INFEASIBLE for row in rows)
    taken = (r.seconds if done else r.time_limit for r, done in zip(rows, settled, strict=True))
    return Mean.shifted_geometric([seconds or 0.0 for seconds in taken])


def _of(text: str, part: int, whole: int) -> str:
    """Returns a mean, with the number of its seeds if it is not over all seeds."""
    return text if part in (0, whole) else f"{text} {_COUNT}{part})"


def _spread(sample: Sequence[float]) -> str:
    """Returns mean and standard deviation."""
    if not sample:
        return NONE
    found = Mean.of(sample)
    digits = 0 if abs(found.value) >= _LARGE else 2
    spread = "" if math.isnan(found.spread) else f" ± {Mean.rounded(found.spread, digits)}"
    return Mean.rounded(found.value, digits) + spread


def _median(sample: Sequence[float]) -> str:
    return Mean.rounded(median(sample), 3) if sample else NONE


def _share(part: int, whole: int) -> str:
    return f"{part} of {whole}"
