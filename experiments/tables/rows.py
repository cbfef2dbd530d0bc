"""Rows of results: each column is defined here once, with its type, unit, range and meaning.

`plan`, `bound` and `solve` print a `PlanRow`. The gap table, `results.csv` and `gap --json` are
made of `GapRow`s, which join the columns of a plan (`PlannedRow`) with those of its scene and seed
(`BoundColumns`). The referee has checked every plan. Every bound is certified, except the bound of
brute force, whose row says so in `message`.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from statistics import median_low
from typing import Annotated, Any, Self

from msgspec import UNSET, UnsetType

from cocap_opt.experiments.tables.columns import TableColumn
from cocap_opt.footage.summary import cameras_line
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult
from cocap_opt.problem import Problem
from cocap_opt.result import Reason, relative_gap
from cocap_opt.run.engine import BOUND_METHOD
from cocap_opt.run.judged import ROUNDING, Judged, finite
from cocap_opt.stop import NO_LIMIT, Limit
from cocap_opt.vision.faces import FaceGeometry

UNASKED = "unasked"  # the reason of a bound that was not searched for
ERROR = "error"  # the reason of a planner or a bound that ended with an error
_EXACT_COVERAGE, SAMPLED_COVERAGE = "exact", "sampled"
OWN_STARTS = "those in the scene's own file"
_REWARD = "px^0.5/m"
_ANY = {"unit": _REWARD, "least": -(2**63 - 1)}  # a bound below 0 proves that there is no plan
# Planners check the time about once a second, and may have to finish an operation. A planner has
# overrun its limit if it takes more than a quarter of the limit plus one second longer.
_TOLERATED, _TOLERATED_SECONDS = 1.25, 1.0
_PART = {"unit": "1", "most": 1}
_SHARE = {"unit": "1", "least": -ROUNDING, "most": 1 + ROUNDING}

_Bound = Annotated[
    float | None,
    TableColumn("A certified number that no plan's J exceeds under the scene's rules.", **_ANY),
]
_Number = float | None
_Count = int | None


_NOTHING = 1e-9  # J that rounding explains


@dataclass(frozen=True, kw_only=True)
class PlanRow:
    """The row of a plan, with the bound that its method proves, if any."""

    scene: Annotated[str, TableColumn("The scene's name.")]
    seed: Annotated[
        _Count, TableColumn("The seed; empty if the starts are those of the scene's own file.")
    ]
    planner: Annotated[str | None, TableColumn("The planner, or the file of an added plan.")]
    method: Annotated[
        str | None, TableColumn("The method of bound: in the gap table the same as bound_method.")
    ] = None
    reward: Annotated[
        _Number, TableColumn("J of the plan by the referee; empty without a plan.", **_ANY)
    ]
    bound: _Bound = None
    gap: Annotated[
        _Number,
        TableColumn("(bound - reward) / bound, if the plan obeys the rules.", **_SHARE),
    ] = None
    reason: Annotated[
        str,
        TableColumn(
            "Why the planner stopped: finished, optimal, infeasible, failed, unsupported or "
            "stopped; or why its cell has no result: error, exceeded or died."
        ),
    ]
    limit: Annotated[str, TableColumn("The limit that stopped the planner, or none.")]
    seconds: Annotated[
        _Number,
        TableColumn(
            "Wall-clock time of the search, without coverage and checking; includes evaluating "
            "views if the planner evaluates them one by one.",
            unit="s",
        ),
    ]
    coverage_seconds: Annotated[
        _Number,
        TableColumn(
            "Wall-clock time of the coverage of all states. In the gap table, coverage is computed "
            "once per scene and seed, before any planner or bound starts; no limit includes it, "
            "and all rows have the same time. If coverage comes from the disk cache, this is the "
            "time that it took when it was computed. For plan, bound and solve, it is the time "
            "that this process spent, and 0 for planners that evaluate views one by one.",
            unit="s",
        ),
    ] = None
    checking_seconds: Annotated[
        _Number, TableColumn("Wall-clock time in which the referee checked the plan.", unit="s")
    ] = None
    views: Annotated[
        _Count,
        TableColumn(
            "Number of views (a view: one state at one step) that the planner evaluates, or of all "
            "possible views if coverage is computed in advance."
        ),
    ] = None
    conflicts: Annotated[_Count, TableColumn("Collision rules that the plan breaks.")]
    seen_by_two: Annotated[
        _Number,
        TableColumn("Share of person-steps at which two drones or more see the person.", **_PART),
    ] = None
    seen_by_three: Annotated[
        _Number, TableColumn("Share of person-steps at which three or more do.", **_PART)
    ] = None
    median_error: Annotated[
        _Number,
        TableColumn(
            "Median over person-steps of the RMS error of a point that all drones that see it "
            "locate together, not interpolated; empty if more than half have no finite error. "
            "Tables of several plans have the median over the plans.",
            unit="mm",
        ),
    ] = None
    cut_short: Annotated[
        str,
        TableColumn(
            "Effect of a limit on the plan, in words, including how many drones stay at their "
            "starts; empty if no limit stopped the planner."
        ),
    ] = ""
    message: Annotated[str, TableColumn("Further remarks of the planner, and remarks on its plan.")]

    @classmethod
    def of(
        cls, problem: Problem, seed: int | None, planner: str | None, judged: Judged[Any]
    ) -> "PlanRow":
        """Returns the row of a plan, without a bound, as only certified bounds are shown."""
        result, filmed = judged.result, judged.filmed(problem)
        return PlanRow(
            scene=problem.name,
            seed=seed,
            planner=planner,
            reward=finite(judged.reward),
            reason=str(judged.reason),
            limit=Limit.written(result.limit),
            seconds=finite(result.seconds),
            coverage_seconds=judged.coverage_seconds,
            checking_seconds=judged.checking_seconds,
            views=judged.views,
            conflicts=judged.conflicts if judged.verdict else None,
            seen_by_two=finite(filmed.by_two) if filmed else None,
            seen_by_three=finite(filmed.by_three) if filmed else None,
            median_error=finite(filmed.median) if filmed else None,
            cut_short=result.cut_short,
            message="; ".join(judged.remarks(problem)),
        )

    @classmethod
    def certified(
        cls, problem: Problem, seed: int | None, method: str, judged: Judged[CertifiedResult]
    ) -> "PlanRow":
        """Returns the row of a bound, with a plan if its method found one."""
        result = judged.result
        row = PlanRow.of(problem, seed, method if result.plan else None, judged)
        messages = [row.message] if row.message else []
        of_share = result.certificate is not None and result.certificate.objective is not UNSET
        if not of_share and result.reason is Reason.INFEASIBLE and result.bound < 0:
            messages.append("proved: no plan exists that obeys the rules")
        if result.certificate is None and math.isfinite(result.bound):
            messages.append(f"no certificate: the bound is what {method} proves by itself")
        return replace(
            row,
            method=method,
            bound=finite(result.bound),
            gap=finite(judged.gap),
            views=None,  # for the views of all states
            message="; ".join(messages),
        )

    @property
    def cameras(self) -> str:
        """The line on cameras that see people; empty if unknown."""
        return cameras_line(self.seen_by_two, self.seen_by_three, self.median_error)

    @property
    def valid(self) -> bool:
        """There is a plan, and it obeys the rules."""
        return self.reward is not None and not self.conflicts


@dataclass(frozen=True, kw_only=True)
class PlannedRow(PlanRow):
    """The columns of the gap table that depend only on the plan."""

    colliding: Annotated[_Count, TableColumn("Drones that take part in a conflict.")]
    robots: Annotated[int, TableColumn("Drones of the scene.")]
    actors: Annotated[int, TableColumn("People of the scene.")]
    steps: Annotated[int, TableColumn("Steps after the start.")]
    coverage: Annotated[
        str,
        TableColumn(
            "exact, or sampled: behind meshes that are not convex, rays sample the visible part."
        ),
    ] = _EXACT_COVERAGE
    time_limit: Annotated[
        _Number,
        TableColumn("Time limit of the planner, which starts once coverage is computed.", unit="s"),
    ] = None
    overrun: Annotated[
        _Number,
        TableColumn(
            "Time that the planner took beyond its limit, if this is more than a quarter of the "
            "limit plus one second; otherwise empty.",
            unit="s",
        ),
    ] = None
    work_limit: Annotated[
        _Count,
        TableColumn("Work limit of the planner; empty without such a limit."),
    ] = None
    planner_digest: Annotated[
        str | UnsetType,
        TableColumn(
            "Digest of the code of a planner that is not part of this project; only in tables with "
            "such planners."
        ),
    ] = UNSET
    reward_rendered: Annotated[
        _Number | UnsetType,
        TableColumn("J of the rendered pixels; only with --rendered.", **_ANY),
    ] = UNSET

    @classmethod
    def of_planner(
        cls, problem: Problem, seed: int, planner: str, judged: Judged[Any], **more: Any
    ) -> "PlannedRow":
        """Returns the row of a plan of the gap table, with more columns by their names."""
        row = PlanRow.of(problem, seed, planner, judged)
        return PlannedRow(**{
            **_fields(row),
            "overrun": _overrun(row.seconds, more.get("time_limit")),
            "colliding": judged.colliding(problem),
            "robots": len(problem.robots),
            "actors": len(problem.actors),
            "steps": problem.horizon,
            "coverage": SAMPLED_COVERAGE if FaceGeometry.is_sampled(problem) else _EXACT_COVERAGE,
            **more,
        })  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class BoundColumns:
    """The columns that all rows of one scene and seed share: bounds, and the best known plans."""

    bound: _Bound = None
    bound_method: Annotated[str, TableColumn("The method whose certificate proves bound.")] = (
        BOUND_METHOD
    )
    bound_reason: Annotated[
        str,
        TableColumn(
            "Why the search for the bound stopped: optimal means that a plan's J attains it."
        ),
    ]
    bound_limit: Annotated[str, TableColumn("The limit that stopped this search, or none.")] = (
        NO_LIMIT
    )
    bound_seconds: Annotated[_Number, TableColumn("Wall-clock time of this search.", unit="s")] = (
        None
    )
    bound_time_limit: Annotated[
        _Number,
        TableColumn(
            "Time limit of each of the two searches, for bound and for bound_free; it starts once "
            "coverage is computed.",
            unit="s",
        ),
    ] = None
    bound_work_limit: Annotated[
        _Count,
        TableColumn("Work limit of each of these two searches; empty without such a limit."),
    ] = None
    certificate: Annotated[str, TableColumn("The file that proves bound.")] = ""
    optimum: Annotated[
        _Number, TableColumn("The largest known J of a plan that obeys the rules.", **_ANY)
    ] = None
    optimum_free: Annotated[_Number, TableColumn("The largest known J of any plan.", **_ANY)] = None
    bound_free: Annotated[
        _Number,
        TableColumn("A certified number that no plan's J exceeds without collision rules.", **_ANY),
    ] = None
    bound_free_reason: Annotated[
        str, TableColumn("Why the search for bound_free stopped; unasked without such a search.")
    ]
    bound_free_limit: Annotated[
        str, TableColumn("The limit that stopped that search, or none.")
    ] = NO_LIMIT
    bound_free_seconds: Annotated[
        _Number, TableColumn("Wall-clock time of that search.", unit="s")
    ] = None
    certificate_free: Annotated[str, TableColumn("The file that proves bound_free.")] = ""

    @classmethod
    def of_bounds(
        cls, under: Judged[CertifiedResult], free: Judged[CertifiedResult], **more: Any
    ) -> "BoundColumns":
        """Returns the columns of the best plan and bound under the rules, and without any.

        Parameters
        ----------
        more : further columns by their names
        """
        bound, bound_free = under.result, free.result
        return BoundColumns(
            bound=finite(bound.bound),
            bound_method=bound.certificate.method if bound.certificate else BOUND_METHOD,
            bound_reason=str(bound.reason),
            bound_limit=Limit.written(bound.limit),
            bound_seconds=bound.seconds,
            optimum=finite(under.reward),
            optimum_free=finite(free.reward),
            bound_free=finite(bound_free.bound),
            bound_free_reason=str(bound_free.reason),
            bound_free_limit=Limit.written(bound_free.limit),
            bound_free_seconds=bound_free.seconds,
            **more,
        )

    @classmethod
    def self_proved(cls, row: PlannedRow, proof: CertificateFile | ProofFile | None) -> Self:
        """Returns the columns with an exact method's own plan and bound, only under the rules.

        Parameters
        ----------
        proof : of the bound; None if nothing is proved
        """
        return cls(
            bound=finite(math.inf if proof is None else proof.proved),
            bound_method=BOUND_METHOD if proof is None else proof.method,
            bound_reason=row.reason,
            bound_limit=row.limit,
            bound_seconds=row.seconds,
            bound_time_limit=row.time_limit,
            bound_work_limit=row.work_limit,
            optimum=row.reward if row.valid else None,
            bound_free_reason=UNASKED,
        )


@dataclass(frozen=True, kw_only=True)
class GapRow(BoundColumns, PlannedRow):
    """A row of the gap table: a plan, and the bounds on all plans of its scene and seed."""

    gap_free: Annotated[
        _Number,
        TableColumn(
            "(bound_free - reward) / bound_free, if the plan obeys the rules.",
            **_SHARE,
        ),
    ]
    digest: Annotated[str, TableColumn("Digest of the scene.")]
    starts: Annotated[
        str | UnsetType,
        TableColumn("The choice of starts; only in tables that compare such choices."),
    ] = UNSET

    @classmethod
    def joined(cls, plan: PlannedRow, bound: BoundColumns, digest: str) -> "GapRow":
        """Returns the row of a plan and its bounds. Only a plan that obeys the rules has gaps.

        Parameters
        ----------
        digest : of the problem
        """
        return GapRow(**{
            **_fields(plan),
            **_fields(bound),
            "method": bound.bound_method,
            "gap": _gap(plan, bound.bound),
            "gap_free": _gap(plan, bound.bound_free),
            "digest": digest,
        })  # fmt: skip

    @staticmethod
    def records(rows: "Sequence[GapRow]") -> list[dict[str, Any]]:
        """Returns rows as plain data, with all columns that at least one of them has."""
        names = [
            name
            for name, column in COLUMNS.items()
            if not column.is_extra or any(getattr(row, name) is not UNSET for row in rows)
        ]
        return [{name: row._plain(name) for name in names} for row in rows]

    @staticmethod
    def grouped(rows: "Iterable[GapRow]", *names: str) -> "dict[tuple[Any, ...], list[GapRow]]":
        """Returns rows grouped by the values of some columns, in the order in which they occur."""
        found: dict[tuple[Any, ...], list[GapRow]] = {}
        for row in rows:
            found.setdefault(tuple(getattr(row, name) for name in names), []).append(row)
        return found

    @staticmethod
    def values(rows: "Sequence[GapRow]", name: str) -> list[float]:
        """Returns the numbers in a column of rows; rows without one are skipped."""
        return [value for row in rows if (value := getattr(row, name)) is not None]

    @staticmethod
    def percent(rows: "Sequence[GapRow]", name: str) -> list[float]:
        """Returns the shares in a column of rows, in %."""
        return [100 * value for value in GapRow.values(rows, name)]

    @staticmethod
    def middle_error(rows: "Sequence[GapRow]") -> float | None:
        """Returns the median error (mm) of one or more plans; None if it is infinite.

        All tables show the median instead of the mean, as the error of a plan is infinite if more
        than half of its person-steps have no finite error.
        """
        error = median_low(
            math.inf if row.median_error is None else row.median_error for row in rows
        )
        return finite(error)

    def _plain(self, name: str) -> object:
        value = getattr(self, name)
        if value is not UNSET:
            return value
        return "" if COLUMNS[name].kind is str else None

    @property
    def key(self) -> tuple[str, int | None]:
        """Scene and seed."""
        return self.scene, self.seed

    @property
    def bound_is_proved(self) -> bool:
        """The bound is proved to be the optimum."""
        return self.bound_reason == Reason.OPTIMAL

    @property
    def is_optimal(self) -> bool:
        """The plan is proved to be the best."""
        return self.valid and self.gap is not None and self.gap <= OPTIMALITY

    @property
    def has_error(self) -> bool:
        """The planner or the bound ended with an error, which is not a result."""
        return ERROR in (self.reason, self.bound_reason)

    @property
    def price(self) -> tuple[float, float] | None:
        """Least and largest price of collision avoidance, as shares of the bound without rules."""
        known = (self.bound, self.optimum, self.bound_free, self.optimum_free)
        bound, optimum, bound_free, optimum_free = known
        if bound is None or optimum is None or bound_free is None or optimum_free is None:
            return None
        if bound_free <= _NOTHING:  # nobody is seen by any plan, with rules or without
            return 0.0, 0.0
        return max(optimum_free - bound, 0.0) / bound_free, (bound_free - optimum) / bound_free


COLUMNS = TableColumn.all_of(GapRow)


def _fields(row: PlanRow | BoundColumns) -> dict[str, Any]:
    return {name: getattr(row, name) for name in row.__dataclass_fields__}


def _gap(plan: PlanRow, bound: float | None) -> float | None:
    if plan.reward is None or bound is None or not plan.valid:
        return None
    return finite(relative_gap(plan.reward, bound))


def _overrun(seconds: float | None, limit: float | None) -> float | None:
    """Returns the seconds beyond a limit, if they are more than is tolerated."""
    if seconds is None or limit is None or seconds <= _TOLERATED * limit + _TOLERATED_SECONDS:
        return None
    return seconds - limit
