"""The trade-off between J and the drones that see each person, enclosed from both sides.

Let J be the objective without views, and V the number of drones that see each person, added up
over steps and people, each counted up to a number of cameras. Every plan is a point (V, J). For
weights a, b >= 0 a bound B on a J + b V is a half-plane in which all plans are; so plans, and the
certificates of a few directions (a, b), enclose the whole trade-off. The next direction is across
the edge, between two plans, that half-planes leave the most room above (sandwich algorithms: Rote,
"The convergence rate of the sandwich algorithm for approximating convex functions", Computing 48,
1992).
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from cocap_opt.console.progress import Watch
from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.model import compiled
from cocap_opt.planners import RECOMMENDED
from cocap_opt.problem import Plan, Problem, Views
from cocap_opt.referee import check
from cocap_opt.run.engine import BOUND_METHOD, run
from cocap_opt.run.view_share import most_views, views_alone
from cocap_opt.stop import Clock, FirstOf, Stop, TimeLimit, never

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

_SAME = 1e-9  # relative, by which two directions, or a plan and a line, may differ
_SHARE = 0.25  # of a direction's time that the planner has
_CLOSED = 1e-6  # relative room that is none


class Direction(NamedTuple):
    """The weights of a sum of J and V, of which one may be 0."""

    reward: float
    views: float

    @property
    def unit(self) -> float:
        """The factor by which J of the direction's scene becomes the sum."""
        return self.reward or self.views

    def of(self, reward: float, views: float) -> float:
        """Returns the weighted sum."""
        return self.reward * reward + self.views * views


class PlanPoint(NamedTuple):
    """A plan that obeys all rules, and where it stands."""

    plan: Plan
    reward: float  # J without views
    views: float  # V


class HalfPlane(NamedTuple):
    """A bound on the weighted sum of J and V, and the file that proves it."""

    direction: Direction
    bound: float
    file: CertificateFile | ProofFile | None


@dataclass(frozen=True)
class Front:
    """The plans of a trade-off, and the half-planes that all plans are in.

    Attributes
    ----------
    problem : the scene, without views in its objective
    views : the cameras from which on more drones add nothing, and the share that must be visible
    plans : those that no other plan is better than in both, the fewest views first; each has
        `plan`, `reward` (J without views) and `views` (V)
    half_planes : in the order in which they were proved; each has `bound`, which no plan exceeds,
        on the sum of J and V with the weights `direction`, and `file`, its certificate
    """

    problem: Problem
    views: Views
    plans: tuple[PlanPoint, ...] = ()
    half_planes: tuple[HalfPlane, ...] = ()

    @classmethod
    def of(cls, problem: Problem, cameras: int = 2, at_least: float = 0.3) -> Self:
        """Returns a trade-off of which nothing is known yet."""
        objective = problem.objective.replace(views=None, pixels=1.0)
        views = Views(cameras=cameras, weight=1.0, at_least=at_least)
        return cls(problem.replace(objective=objective), views)

    def is_of(self, other: "Front") -> bool:
        """Returns True for two trade-offs of one problem, under one notion of views."""
        same = problem_digest(self.problem) == problem_digest(other.problem)
        return same and self.views == other.views

    @property
    def table(self) -> "pd.DataFrame":
        """A row for each plan, and for each bound (pandas)."""
        from pandas import DataFrame

        return DataFrame(as_rows(self))

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draws plans, and where it is proved that none is.

        Parameters
        ----------
        ax : matplotlib axes; a figure of its own if not given
        """
        from cocap_opt.run.front_figure import draw  # matplotlib

        return draw(
            [(100 * self.share(point.views), point.reward) for point in self.plans],
            100 * self.share(self.views_bound),
            lambda percent: self.reward_bound(percent / 100 * self.most_views),
            f"drones that see a person, up to {self.views.cameras} (% of all)",
            ax,
        )

    @property
    def most_views(self) -> float:
        """The most that V could be, if all people were seen by so many drones at all steps."""
        return most_views(self.problem, self.views.cameras)

    def share(self, views: float) -> float:
        """Returns views as a share of `most_views`; 0 where nobody can be seen."""
        return views / self.most_views if self.most_views else 0.0

    def scene(self, direction: Direction) -> Problem:
        """Returns the problem whose objective is the weighted sum of J and V."""
        if not direction.reward:
            return views_alone(self.problem, self.views)
        views = self.views.replace(weight=direction.views / direction.reward)
        return self.problem.replace(objective=self.problem.objective.replace(views=views))

    def point(self, plan: Plan) -> PlanPoint | None:
        """Returns where a plan stands; None if it breaks a rule."""
        verdict = check(self.scene(Direction(1.0, 1.0)), plan)
        if not verdict.valid:
            return None
        views = math.fsum(verdict.count_reward)
        return PlanPoint(plan, verdict.reward - views, views)

    def with_plans(self, plans: Iterable[Plan]) -> Self:
        """Returns the trade-off with more plans; those that another is better than are left out."""
        points = [*self.plans, *filter(None, map(self.point, plans))]
        best: list[PlanPoint] = []
        for point in sorted(points, key=lambda point: (-point.views, -point.reward)):
            if not best or point.reward > best[-1].reward:
                best.append(point)
        return replace(self, plans=tuple(reversed(best)))

    def reward_bound(self, views: float) -> float:
        """Returns the J that no plan of at least so many views exceeds; -inf: there is no plan."""
        if views > self.views_bound * (1 + _SAME):
            return -math.inf
        return min(
            (
                (plane.bound - plane.direction.views * views) / plane.direction.reward
                for plane in self.half_planes
                if plane.direction.reward
            ),
            default=math.inf,
        )

    @property
    def views_bound(self) -> float:
        """The V that no plan exceeds."""
        proved = (p.bound / p.direction.views for p in self.half_planes if not p.direction.reward)
        return min([self.most_views, *proved])

    def best_with(self, views: float) -> PlanPoint | None:
        """Returns the plan of largest J among those of at least so many views."""
        enough = (point for point in self.plans if point.views >= views * (1 - _SAME))
        return next(enough, None)

    def room(self, direction: Direction) -> float:
        """Returns by how much the half-planes are above all plans in a direction, relatively."""
        most = max((direction.of(p.reward, p.views) for p in self.plans), default=0.0)
        above = self._outer(direction)
        return math.inf if above == math.inf else (above - most) / max(abs(above), 1e-300)

    @property
    def gap(self) -> float:
        """The largest room above all plans, of the directions across edges and along the axes."""
        return max(self.room(direction) for direction in self._edges())

    @property
    def settled(self) -> bool:
        """True if no weighted sum of J and V has a better plan, or if there is proved to be none.

        Better by more than a millionth does not count.
        """
        if not self.plans:
            return any(plane.bound == -math.inf for plane in self.half_planes)
        return self.gap <= _CLOSED

    def next_direction(self, wanted: float | None = None) -> Direction:
        """Returns the direction in which there is the most room, of those not proved if any is.

        Directions without room are left aside where others have some. With views that are wanted,
        the direction across the edge above them comes before others.
        """
        edges = [d for d in self._edges() if self.room(d) > _CLOSED] or self._edges()
        new = [d for d in edges if not self._tries(d)]
        across = self._across(wanted)
        return across if across in new else max(new or edges, key=self.room)

    def _tries(self, direction: Direction) -> int:
        """Returns the number of half-planes that there are of a direction."""
        return sum(_alike(direction, p.direction, self._scale) for p in self.half_planes)

    def explored(
        self,
        stop: Stop = never,
        seconds: float = 10.0,
        directions: int = 6,
        planner: str = RECOMMENDED,
        bound: str = BOUND_METHOD,
        watch: Watch | None = None,
        wanted: float | None = None,
    ) -> Self:
        """Returns the trade-off after some directions more, or fewer if it is settled by then.

        Parameters
        ----------
        stop : ends all of them; what is found until then counts
        seconds : of each direction, coverage not included; each time that one is tried again it has
            twice as many as before
        directions : how many at most
        planner, bound : the methods
        wanted : views around which the trade-off is to be known first
        """
        front, watch = self, watch or Watch()
        for number in range(directions):
            if front.settled or (number and stop.reached() is not None):
                break
            watch.show(f"direction {number + 1} of {directions}")
            direction = front.next_direction(wanted)
            time = seconds * 2 ** front._tries(direction)
            front = front._towards(direction, stop, time, planner, bound, watch)
        return front

    def _towards(
        self, direction: Direction, stop: Stop, seconds: float, planner: str, bound: str,
        watch: Watch,
    ) -> Self:  # fmt: skip
        """Returns the trade-off with a plan and a half-plane of a direction."""
        scene = self.scene(direction)
        self._share_coverage(scene, stop)
        clock = Clock()
        made = run(scene, planner, FirstOf(stop, TimeLimit(_SHARE * seconds)), watch=watch).result
        front = self.with_plans([made.plan] if made.plan is not None else [])
        start = front._best(direction)
        left = TimeLimit(max(seconds - clock.seconds, 0.1))
        result = run(
            scene, bound, FirstOf(stop, left), watch=watch,
            start=None if start is None else start.plan,
        ).result  # fmt: skip
        plane = HalfPlane(direction, result.bound * direction.unit, result.certificate)
        front = replace(front, half_planes=(*front.half_planes, plane))
        return front.with_plans([result.plan] if result.plan is not None else [])

    def _share_coverage(self, scene: Problem, stop: Stop) -> None:
        """Takes the coverage of the first direction, which no weight changes."""
        first = compiled(self.scene(Direction(1.0, 1.0)).without_rules())
        compiled(scene.without_rules()).tables.take(first.tables)

    def _best(self, direction: Direction) -> PlanPoint | None:
        return max(self.plans, key=lambda p: direction.of(p.reward, p.views), default=None)

    @property
    def _scale(self) -> float:
        """J that counts as much as a view where all count."""
        most = max((point.reward for point in self.plans), default=1.0)
        return max(most, 1e-9) / max(self.most_views, 1.0)

    def _edges(self) -> list[Direction]:
        """Returns the directions along the axes, and across the edges between plans."""
        across = [_direction_across(a, b) for a, b in pairwise(self._hull())]
        return [Direction(1.0, 0.0), Direction(0.0, 1.0), *across]

    def _across(self, views: float | None) -> Direction | None:
        """Returns the direction across the edge that has so many views; None if there is none."""
        for a, b in pairwise(self._hull()):
            if views is not None and a.views < views <= b.views:
                return _direction_across(a, b)
        return None

    def _hull(self) -> list[PlanPoint]:
        """Returns the plans that are best in some direction, the fewest views first."""
        hull: list[PlanPoint] = []
        for point in self.plans:
            while len(hull) > 1 and _is_below(hull[-2], hull[-1], point):
                hull.pop()
            hull.append(point)
        return hull

    def _outer(self, direction: Direction) -> float:
        """Returns the largest weighted sum in all half-planes; infinite where they leave it open.

        It is at a corner of two of them.
        """
        planes = [(p.direction, p.bound) for p in self.half_planes]
        planes.append((Direction(0.0, 1.0), self.views_bound))
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


def _alike(a: Direction, b: Direction, scale: float) -> bool:
    """Returns True for directions that are nearly the same, where a view is worth `scale`."""
    x, y = (np.array([d.reward * scale, d.views]) for d in (a, b))
    x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
    return bool(abs(x[0] * y[1] - x[1] * y[0]) < 1e-4)


def _direction_across(a: PlanPoint, b: PlanPoint) -> Direction:
    """Returns the direction in which two plans are alike, of which b has more views."""
    return Direction(1.0, (a.reward - b.reward) / (b.views - a.views))


def _is_below(a: PlanPoint, b: PlanPoint, c: PlanPoint) -> bool:
    """Returns True if b, between a and c, is not above the line between them."""
    along = (b.views - a.views) * (c.reward - a.reward)
    return along >= (b.reward - a.reward) * (c.views - a.views)


def as_rows(front: Front) -> list[dict[str, float | str]]:
    """Returns a row for each plan, and for each half-plane, of a table."""
    rows: list[dict[str, float | str]] = [
        {
            "kind": "plan", "reward": point.reward, "views": point.views,
            "share": front.share(point.views), "no more than": front.reward_bound(point.views),
        }
        for point in front.plans
    ]  # fmt: skip
    rows += [
        {
            "kind": "bound", "weight of J": plane.direction.reward,
            "weight of views": plane.direction.views, "no more than": plane.bound,
        }
        for plane in front.half_planes
    ]  # fmt: skip
    return rows
