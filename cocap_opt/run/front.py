"""The trade-off between J and the number of drones that see each person, bounded from both sides.

Let J be the reward of pixels and moves, and V the number of drones that see each person, added up
over steps and people, each counted up to a number of cameras. Every plan is a point (V, J). A bound
B on J + w V, for a weight w >= 0, or on V alone, is a half-plane that contains all plans; so plans,
together with the certificates of a few directions, enclose the whole trade-off. The next direction
is orthogonal to the edge between two plans above which the half-planes leave the largest gap
(sandwich algorithms: Rote, "The convergence rate of the sandwich algorithm for approximating convex
functions", Computing 48, 1992); `front_search` explores it.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.output.told_bounds import told_bound, told_gap
from cocap_opt.problem import Plan, Problem, Views
from cocap_opt.referee import check
from cocap_opt.run.view_share import (
    lagrangian_bound,
    most_views,
    seen_share,
    told_share,
    views_alone,
    views_asked,
    views_of,
    views_to_keep,
)
from cocap_opt.text import rounded_up

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

_SAME = 1e-9  # relative tolerance for equal directions, and for plans on a line


class Direction(NamedTuple):
    """The weights of a sum of J and V: J with some weight of V, or V alone.

    Attributes
    ----------
    reward : weight of J, 1 or 0
    views : weight of V, >= 0; 1 if J has weight 0
    """

    reward: float
    views: float

    def of(self, reward: float, views: float) -> float:
        """Returns the weighted sum."""
        return self.reward * reward + self.views * views


REWARD_ALONE, VIEWS_ALONE = Direction(1.0, 0.0), Direction(0.0, 1.0)


class PlanPoint(NamedTuple):
    """A plan that obeys all rules, with its J and V."""

    plan: Plan
    reward: float  # J of pixels and moves
    views: float  # V


class HalfPlane(NamedTuple):
    """A bound on the weighted sum of J and V, and the file that proves it."""

    direction: Direction
    bound: float
    file: CertificateFile | ProofFile | None

    def __repr__(self) -> str:
        weight = self.direction.views
        left = f"J + {weight:.6g} V" if self.direction.reward else "V"
        return f"HalfPlane({left} <= {told_bound(self.bound)})"


@dataclass(frozen=True, repr=False)
class Front:
    """The plans of a trade-off, and the half-planes that contain all plans.

    Attributes
    ----------
    problem : the scene; J is its reward without views, with pixels of weight 1 if their weight was
        0
    views : the largest number of drones that counts for a person, the visible share of a person
        that is required, the people who count, and the requested share of all views, if any
    base : the problem whose reward is J: without views, or with its own weight of views
    plans : the plans that no other plan dominates in J and V, fewest views first; each has `plan`,
        `reward` (J) and `views` (V)
    half_planes : in the order in which they were proved; each has `bound`, which no plan exceeds,
        on the sum of J and V with the weights `direction`, and `file`, its certificate
    """

    problem: Problem
    views: Views
    base: Problem
    plans: tuple[PlanPoint, ...] = ()
    half_planes: tuple[HalfPlane, ...] = ()

    @classmethod
    def of(
        cls,
        problem: Problem,
        cameras: int | None = None,
        at_least: float | None = None,
        share: float | None = None,
    ) -> Self:
        """Returns a trade-off without plans and half-planes.

        Parameters
        ----------
        cameras, at_least, share : as in `Views`; None: as in the problem's objective, or two
            cameras, 0.3 and no share

        Raises
        ------
        ProblemError
            If a number is out of range; the message names the field.
        """
        views, given = views_asked(problem, cameras, at_least, share), problem.objective
        objective = given.replace(
            pixels=given.pixels or 1.0, views=views.replace(weight=0.0, share=None)
        )
        return cls(problem, views, problem.replace(objective=objective))

    def is_of(self, other: "Front") -> bool:
        """Returns True if both are trade-offs of the same problem with the same views."""
        same = problem_digest(self.problem) == problem_digest(other.problem)
        return same and self.views.replace(share=None) == other.views.replace(share=None)

    def scene(self, direction: Direction) -> Problem:
        """Returns the problem whose objective is the weighted sum of J and V."""
        if not direction.reward:
            return views_alone(self.problem, self.views)
        if not direction.views:
            return self.base
        given, people = self.base.objective, len(self.problem.actors)
        assert given.views is not None
        weights = tuple(
            weight + direction.views * counted
            for weight, counted in zip(
                given.views.weights(people), self.views.weights(people), strict=True
            )
        )
        weight = weights if len(set(weights)) > 1 else max(weights, default=direction.views)
        views = given.views.replace(weight=weight, share=None)
        return self.problem.replace(objective=given.replace(views=views))

    def file(self, plane: HalfPlane) -> CertificateFile | ProofFile | None:
        """Returns the certificate of a half-plane for the original problem, with its own
        objective.
        """
        if plane.file is None or plane.file.digest == problem_digest(self.problem):
            return plane.file
        return plane.file.with_objective(self.scene(plane.direction).objective)

    def point(self, plan: Plan) -> PlanPoint | None:
        """Returns J and V of a plan; None if it breaks a rule."""
        verdict = check(self.base, plan)
        if not verdict.valid:
            return None
        return PlanPoint(plan, verdict.reward, views_of(self.problem, plan, self.views))

    def with_plans(self, plans: Iterable[Plan]) -> Self:
        """Returns the trade-off with more plans, without dominated ones."""
        points = [*self.plans, *filter(None, map(self.point, plans))]
        best: list[PlanPoint] = []
        for point in sorted(points, key=lambda point: (-point.views, -point.reward)):
            if not best or point.reward > best[-1].reward:
                best.append(point)
        return replace(self, plans=tuple(reversed(best)))

    @property
    def most_views(self) -> float:
        """The largest possible V: the full number of drones sees all people at all steps."""
        return most_views(self.problem, self.views.cameras)

    def share(self, views: float) -> float:
        """Returns views as a share of `most_views`; 0 if nobody can be seen."""
        return views / self.most_views if self.most_views else 0.0

    def seen(self, point: PlanPoint) -> float:
        """Returns the share of person-steps that `cameras` drones see, weighted by importance."""
        return seen_share(self.problem, point.plan, self.views)

    def reward_bound(self, views: float) -> float:
        """Returns a J that no plan with at least this many views exceeds; -inf if there is no such
        plan.
        """
        if views > self.views_bound * (1 + _SAME):
            return -math.inf
        return min(
            (
                lagrangian_bound(plane.bound, plane.direction.views, views)
                for plane in self.half_planes
                if plane.direction.reward
            ),
            default=math.inf,
        )

    @property
    def views_bound(self) -> float:
        """A V that no plan exceeds; negative if it is proved that no plan exists."""
        proved = (plane.bound for plane in self.half_planes if not plane.direction.reward)
        return min([self.most_views, *proved])

    def best_with(self, views: float) -> PlanPoint | None:
        """Returns the plan with the largest J among those with at least this many views."""
        enough = (point for point in self.plans if point.views >= views * (1 - _SAME))
        return next(enough, None)

    def best_in(self, direction: Direction) -> PlanPoint | None:
        """Returns the plan with the largest weighted sum."""
        return max(self.plans, key=lambda p: direction.of(p.reward, p.views), default=None)

    def room(self, direction: Direction) -> float:
        """Returns the relative gap between the half-planes and the best plan in a direction."""
        most = max((direction.of(p.reward, p.views) for p in self.plans), default=0.0)
        above = self._outer(direction)
        return math.inf if above == math.inf else (above - most) / max(abs(above), 1e-300)

    @property
    def gap(self) -> float:
        """The largest relative gap between plans and bounds.

        The directions along the axes and across edges are enough. Two neighbouring directions share
        a plan that is best in both. It is also best in all directions between them, where the
        half-planes allow no more than the sum of their bounds in the two directions.
        """
        return max(self.room(direction) for direction in self.directions())

    @property
    def no_plan(self) -> bool:
        """True if it is proved that no plan obeys the rules: a bound is negative although J and V
        cannot be.
        """
        return any(plane.bound < 0 for plane in self.half_planes)

    @property
    def settled(self) -> bool:
        """True if no weighted sum of J and V has a better plan, or if it is proved that no plan
        exists.

        Plans that are better by less than a millionth do not count.
        """
        return self.no_plan if not self.plans else self.gap <= OPTIMALITY

    def directions(self) -> list[Direction]:
        """Returns the directions along the axes, and across the edges between plans."""
        across = [_direction_across(a, b) for a, b in pairwise(self._hull())]
        return [REWARD_ALONE, VIEWS_ALONE, *across]

    def next_direction(self) -> Direction:
        """Returns the direction with the largest gap, preferably one that is not proved yet.

        Directions without a gap are skipped if others have one. If a share of views is requested,
        the direction across the edge at that share comes first.
        """
        edges = [d for d in self.directions() if self.room(d) > OPTIMALITY] or self.directions()
        new = [d for d in edges if not self.tries(d)]
        asked = self.asked_direction()
        return asked if asked in new else max(new or edges, key=self.room)

    def tries(self, direction: Direction) -> int:
        """Returns the number of half-planes in a direction."""
        return sum(_alike(direction, p.direction, self._scale) for p in self.half_planes)

    def asked_direction(self) -> Direction | None:
        """Returns the direction across the edge at the requested share, if there is one.

        Without such an edge, there is nothing to find between two plans.
        """
        if self.views.share is None:
            return None
        views = views_to_keep(self.problem, self.views)
        edges = ((a, b) for a, b in pairwise(self._hull()) if a.views < views <= b.views)
        return next((_direction_across(a, b) for a, b in edges), None)

    @property
    def _scale(self) -> float:
        """The amount of J that counts as much as a view if all views count."""
        most = max((point.reward for point in self.plans), default=1.0)
        return max(most, 1e-9) / (self.most_views or 1.0)

    def _hull(self) -> list[PlanPoint]:
        """Returns the plans that are best in some direction, fewest views first."""
        hull: list[PlanPoint] = []
        for point in self.plans:
            while len(hull) > 1 and _is_below(hull[-2], hull[-1], point):
                hull.pop()
            hull.append(point)
        return hull

    def _outer(self, direction: Direction) -> float:
        """Returns the largest weighted sum within all half-planes; infinite if they do not limit
        it.

        It is attained at an intersection of two of them.
        """
        planes = [(p.direction, p.bound) for p in self.half_planes]
        planes.append((VIEWS_ALONE, self.views_bound))
        if all(not d.reward for d, _ in planes) and direction.reward:
            return math.inf
        planes.append((Direction(0.0, -1.0), 0.0))  # V is not negative
        corners = []
        for k, (first, a) in enumerate(planes):
            for second, b in planes[:k]:
                det = first.reward * second.views - second.reward * first.views
                if det:
                    reward = (a * second.views - b * first.views) / det
                    views = (first.reward * b - second.reward * a) / det
                    inside = all(d.of(reward, views) <= c + _SAME * (1 + abs(c)) for d, c in planes)
                    corners += [direction.of(reward, views)] if inside else []
        return max(corners, default=math.inf)

    def plan_rows(self) -> list[dict[str, float]]:
        """Returns a row for each plan."""
        return [
            {
                "reward": point.reward, "views": point.views, "share": self.share(point.views),
                "seen": self.seen(point), "reward_bound": self.reward_bound(point.views),
            }
            for point in self.plans
        ]  # fmt: skip

    def bound_rows(self) -> list[dict[str, float]]:
        """Returns a row for each half-plane."""
        return [
            {
                "weight_of_reward": plane.direction.reward,
                "weight_of_views": plane.direction.views, "bound": plane.bound,
            }
            for plane in self.half_planes
        ]  # fmt: skip

    def rows(self) -> list[dict[str, float | str]]:
        """Returns all rows, each with its kind."""
        kinds = ("plan", self.plan_rows()), ("bound", self.bound_rows())
        return [{"kind": kind, **row} for kind, rows in kinds for row in rows]

    @property
    def table(self) -> "pd.DataFrame":
        """A table with a row for each plan and each bound (pandas)."""
        from pandas import DataFrame

        return DataFrame(self.rows())

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draws the plans, and the region in which it is proved that there are none.

        Parameters
        ----------
        ax : matplotlib axes (default: those of a new figure)
        """
        from cocap_opt.run.front_figure import draw  # imports matplotlib

        return draw(
            [(100 * self.share(point.views), point.reward) for point in self.plans],
            100 * self.share(self.views_bound),
            lambda percent: self.reward_bound(percent / 100 * self.most_views),
            f"drones that see a person, up to {self.views.cameras} (% of all)",
            ax,
        )

    def sentences(self) -> Iterator[str]:
        """Yields sentences on the definition of views, what is proved, and the requested share."""
        if not self.plans:
            none = "proved: no plan exists that obeys the rules"
            found = (
                "no plan that obeys the rules is known; more directions or a longer time limit may "
                "find one"
            )
            yield none if self.no_plan else found
            return
        yield (
            "views: drones that see each person at each step, counted up to "
            f"{self.views.cameras} per person; their sum is at most {self.most_views:g}"
        )
        if self.views_bound < self.most_views:
            most = rounded_up(100 * self.share(self.views_bound), 1)
            yield f"proved: no plan of these drones reaches more than {most} % of that sum"
        if self.settled:
            words = "no weighting of J and views has a better plan"
            if len(self.plans) == 1:
                words = "one plan is best in both"
            yield f"the trade-off is settled: {words}"
        elif math.isfinite(self.gap):
            yield f"plans and proofs differ by {told_gap(self.gap)}"
        if self.views.share is not None:
            kept = views_to_keep(self.problem, self.views)
            best = self.best_with(kept)
            reward = None if best is None else best.reward
            yield told_share(self.views.share, reward, self.reward_bound(kept))

    def __str__(self) -> str:
        found = [f"{p.views:g} views, J = {p.reward:,.2f}" for p in self.plans]
        return "\n".join([*found, *self.sentences()])

    def __repr__(self) -> str:
        return str(self)


def _alike(a: Direction, b: Direction, scale: float) -> bool:
    """Returns True if two directions are nearly the same, where a view is worth `scale`."""
    x, y = (np.array([d.reward * scale, d.views]) for d in (a, b))
    x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
    return bool(abs(x[0] * y[1] - x[1] * y[0]) < 1e-4)


def _direction_across(a: PlanPoint, b: PlanPoint) -> Direction:
    """Returns the direction in which two plans are equally good; b has more views."""
    return Direction(1.0, (a.reward - b.reward) / (b.views - a.views))


def _is_below(a: PlanPoint, b: PlanPoint, c: PlanPoint) -> bool:
    """Returns True if b, between a and c, is not above the line between them."""
    along = (b.views - a.views) * (c.reward - a.reward)
    return along >= (b.reward - a.reward) * (c.views - a.views)
