"""Coverage tables of a problem, one for each motion and camera of its robots."""

import math
from collections.abc import Iterator
from copy import copy
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray, read_only
from cocap_opt.graph.motion import People, Window
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.memory import fits, require_memory
from cocap_opt.model.coverage_estimate import BYTES_PER_ENTRY, CoverageEstimate, room_of
from cocap_opt.problem import AnyCamera, Motion, Problem, Robot, StartSet
from cocap_opt.stop import Clock, Limit, LimitReached, Stop, never
from cocap_opt.vision.coverage import CoverageTable, GrowingTable, Progress
from cocap_opt.vision.faces import FaceGeometry, Reach
from cocap_opt.vision.views import StateViews

if TYPE_CHECKING:
    from cocap_opt.vision.cache import TableCache

    _Kept = tuple[TableCache, str]

Path = tuple[int, ...]  # T+1 state numbers of one robot
Sight = tuple[Motion, AnyCamera]  # everything that a robot's coverage depends on, except its start

# Seconds per state of value iteration, and per actor and state of a ceiling: measured, and rounded
# up.
SWEEPING, _BOUNDING = 6e-8, 4e-8

# Bytes per state and step in the arrays of value iteration, and in that of reachable states:
# measured.
BYTES_PER_STATE = 18
_KEPT_SUMS = 128  # paths whose view sums are cached: planners often keep the same robots' paths


def tell_nobody(done: int, total: int) -> None:
    """Ignores progress reports."""


class CoverageTables:
    """Coverage tables of a problem, one for each motion and camera, computed on first use.

    Parameters
    ----------
    use_cache : read tables from the user's cache, and write them there
    plain : True: use no compiled code, and therefore no cache

    Attributes
    ----------
    seconds : time spent on coverage so far
    """

    def __init__(self, problem: Problem, use_cache: bool, plain: bool = False) -> None:
        self.problem = problem
        self.seconds = 0.0
        self.along = lru_cache(maxsize=_KEPT_SUMS)(self._along)
        # Tables in the cache may have been computed by compiled code.
        self._use_cache, self._plain = use_cache and not plain, plain
        self._geometry = FaceGeometry(problem)
        self._tables: dict[Sight, CoverageTable] = {}
        self._reachable: dict[Sight, BoolArray] = {}
        self._growing: dict[Sight, GrowingTable] = {}
        self._estimates: dict[tuple[Sight, int], CoverageEstimate] = {}  # also by step
        self._spent: dict[Sight, float] = {}  # s for computing each table
        # The stopping criterion that ended coverage early, and its limit.
        self._ended: tuple[Stop, Limit] | None = None

    def views(self, spec: Robot) -> StateViews:
        """Returns the views of a robot's motion and camera, which are evaluated on demand."""
        graph = graph_of(self.problem, spec)
        reach = self._reach(spec)
        return StateViews.of(self._geometry, self.problem, graph, spec.camera, self._plain, reach)

    def _reach(self, spec: Robot) -> Reach:
        """Returns the places that robots like this one can reach."""
        ground = self.problem.height_map
        most = np.array(ground.shape) - 1
        cells = np.clip(_start_cells(self.problem, spec), 0, most)
        middles = ground.origin + (cells + 0.5) * ground.resolution - self._geometry.origin[:2]
        return Reach.around(middles, spec.motion.radius * ground.resolution)

    def _along(self, spec: Robot, path: Path) -> FloatArray:
        """Returns the view sums [Z] along a path, evaluating each view anew."""
        pixels, first = self.problem.no_pixels(), self.problem.first_step
        views = self.views(spec).along(first, np.array(path[first:]))
        for t, coverage in enumerate(views, start=first):
            pixels[self.problem.view_sums_at(t)] += coverage
        return read_only(pixels)

    def reachable(self, spec: Robot) -> BoolArray:
        """Returns an array [T+1, S], True for states that a robot like this one can reach."""
        if _sight(spec) not in self._reachable:
            graph = graph_of(self.problem, spec)
            self._reachable[_sight(spec)] = graph.reachable(
                self._starts(spec), self.problem.horizon
            )
        return self._reachable[_sight(spec)]

    def _starts(self, spec: Robot) -> IntArray:
        """Returns the possible start states of robots with this motion and camera, increasing."""
        graph = graph_of(self.problem, spec)
        alike = _starts_of(self.problem, spec)
        return np.sort(np.concatenate([graph.indices(states.array) for states in alike]))

    def table(self, spec: Robot) -> CoverageTable:
        """Returns the table of this robot's motion and camera; computes it if necessary.

        Raises
        ------
        ProblemError
            If the table is larger than the memory.
        """
        if _sight(spec) not in self._tables:
            self.prepare(spec, never, tell_nobody, 0.0)
        return self._tables[_sight(spec)]

    def require_memory(self, spec: Robot, table: float = 0.0) -> None:
        """Raises an error if coverage and sweeps would be larger than the memory.

        Parameters
        ----------
        table : estimated bytes of the tables; 0: count only the bytes that are certain

        Raises
        ------
        ProblemError
            If they would be larger than the memory.
        """
        graph = graph_of(self.problem, spec)
        steps, faces = self.problem.horizon + 1, len(self.problem.face_weights)
        width, depth = graph.window.shape
        require_memory(
            table + self._sweeps(spec),
            f"coverage and value iteration of {width} x {depth} cells in {len(spec.motion.layers)} "
            f"layers, {graph.n_orientations} orientations, {steps} steps and {faces} faces",
            (width, depth),
            spec.motion.radius,
            {
                "layers": len(spec.motion.layers),
                "orientations (headings times pitches)": graph.n_orientations,
                "steps, the start included": steps,
            },
        )

    def _sweeps(self, spec: Robot) -> float:
        """Returns the bytes that value iteration needs."""
        states = (self.problem.horizon + 1) * graph_of(self.problem, spec).n_states
        return states * BYTES_PER_STATE

    def _require_room(self, spec: Robot) -> None:
        """Raises an error if a table would be larger than the memory, which is sampled in case of
        doubt.

        Raises
        ------
        ProblemError
            If it would be larger than the memory.
        """
        sizes = np.count_nonzero(self.reachable(spec), axis=1)
        sizes[: self.steps(spec)] = 0
        most = int(sizes.sum()) * self.problem.step_width * BYTES_PER_ENTRY
        if not fits(most + room_of(self.views(spec), sizes) + self._sweeps(spec)):
            self.require_memory(spec, self._sampled(spec).memory)

    def _sampled(self, spec: Robot) -> CoverageEstimate:
        """Returns the estimate for the missing part of a table, made once."""
        key = _sight(spec), self.steps(spec)
        if key not in self._estimates:
            reachable = self.reachable(spec).copy()
            reachable[: self.steps(spec)] = False
            n_places = graph_of(self.problem, spec).n_places
            self._estimates[key] = CoverageEstimate.of(self.views(spec), n_places, reachable)
        return self._estimates[key]

    def prepare(self, spec: Robot, stop: Stop, progress: Progress, reserve: float) -> None:
        """Computes the table of this robot's motion and camera, if it is not known.

        A stopping criterion that has ended coverage once ends it at once when coverage is requested
        again: its remaining time is reserved for what follows coverage.

        Parameters
        ----------
        reserve : time in s that must remain afterwards

        Raises
        ------
        LimitReached
            If the time is over. The part computed so far is kept, and not computed again.
        ProblemError
            If the table is larger than the memory.
        """
        if _sight(spec) in self._tables:
            return
        if self._ended is not None and stop is self._ended[0]:
            raise LimitReached(self._ended[1])
        self.require_memory(spec)
        # the digest of the code is computed once per process, and does not count as coverage
        with stop.paused():
            kept = self._kept(spec)
        clock = Clock()
        if math.isfinite(stop.seconds_left):
            reserve = max(reserve, self._seconds_to_bound(spec))
        try:
            self._tables[_sight(spec)] = self._made(spec, kept, stop.before(reserve), progress)
            self._growing.pop(_sight(spec), None)
        except LimitReached as reached:
            self._ended = stop, reached.limit
            raise
        finally:
            self.seconds += clock.seconds

    def is_there(self, spec: Robot) -> bool:
        """Returns True if nothing must be computed: the coverage is in memory or in the cache."""
        if _sight(spec) in self._tables:
            return True
        kept = self._kept(spec)
        return kept is not None and kept[0].has(kept[1])

    def estimate(self) -> CoverageEstimate:
        """Estimates the cost of the missing coverage from a sample.

        Its memory includes the arrays of value iteration.

        Raises
        ------
        ProblemError
            If coverage and sweeps are certain to be larger than the memory, or are so by the
            sample.
        """
        total, tables = CoverageEstimate(), 0.0
        for spec in {_sight(robot): robot for robot in self.problem.robots}.values():
            if self.is_there(spec):
                continue
            self.require_memory(spec)
            found = self._sampled(spec)
            tables += found.memory
            self.require_memory(spec, tables)
            total += found._replace(memory=found.memory + self._sweeps(spec))
        return total

    def _made(
        self, spec: Robot, kept: "_Kept | None", stop: Stop, progress: Progress
    ) -> CoverageTable:
        def make() -> tuple[CoverageTable, float]:
            self._require_room(spec)
            table, clock, before = self._table_of(spec), Clock(), self._spent.get(_sight(spec), 0.0)
            try:
                table.grow(stop, progress)
            finally:  # continues where a limit has ended it
                self._spent[_sight(spec)] = before + clock.seconds
            return table.table(), self._spent[_sight(spec)]

        if kept is None:
            return self._by_view_sum(make()[0])
        cache, key = kept
        table, self._spent[_sight(spec)] = cache.table(key, make)
        return self._by_view_sum(table)

    def _kept(self, spec: Robot) -> "_Kept | None":
        """Returns the user's cache and the table's key in it; None if the cache is not used.

        The key is the digest of everything on which the coverage of a robot like this one depends.
        """
        if not self._use_cache:
            return None
        # imported here, so that checkers of bounds do not load it
        from cocap_opt.vision.cache import TableCache

        problem = self.problem
        views = problem.objective.views
        at_least = None if views is None else views.at_least
        poses = [actor.poses[: problem.horizon + 1] for actor in problem.actors]
        shapes = [actor.shape for actor in problem.actors]
        solid = problem.workspace._replace(height_map=problem.height_map.replace(bare=None))
        key = TableCache.key(
            __name__, solid, problem.airspace, spec.motion, spec.camera,
            graph_of(problem, spec).window,
            self._starts(spec), problem.horizon, problem.face_samples, problem.first_step, poses,
            shapes, at_least, problem.take_of,
        )  # fmt: skip
        return TableCache.of_user(), key

    def _by_view_sum(self, table: CoverageTable) -> CoverageTable:
        """Returns a table with the problem's view sums: summed over time, or extended by people, if
        required.
        """
        problem = self.problem
        if not problem.objective.over_time and problem.objective.views is None:
            return table
        view_sums = problem.step_view_sums.ravel()[table.view_sums]
        counts = np.flatnonzero(view_sums >= problem.returns.n_roots)
        return table._replace(view_sums=view_sums, counts=counts)

    def _table_of(self, spec: Robot) -> GrowingTable:
        if _sight(spec) not in self._growing:
            self._growing[_sight(spec)] = GrowingTable(
                self.views(spec), graph_of(self.problem, spec).n_places, self.reachable(spec),
                self.problem.first_step,
            )  # fmt: skip
        return self._growing[_sight(spec)]

    def _seconds_to_bound(self, spec: Robot) -> float:
        """Returns the approximate seconds for ceilings and some sweeps at steps without known
        coverage.
        """
        reachable = self.reachable(spec)
        unknown = int(np.count_nonzero(reachable[self.steps(spec) :]))
        return unknown * len(self.problem.actors) * _BOUNDING + 2.5 * reachable.size * SWEEPING

    def steps(self, spec: Robot) -> int:
        """Returns the number of steps, from 0 on, for which the known coverage is complete."""
        whole = self.problem.horizon + 1
        return whole if _sight(spec) in self._tables else self._table_of(spec).steps

    def known(self, spec: Robot) -> CoverageTable:
        """Returns the known part of the table."""
        found = self._tables.get(_sight(spec))
        return self._by_view_sum(self._table_of(spec).table()) if found is None else found

    @property
    def cost(self) -> float | None:
        """Seconds in which all tables were computed, in this process or elsewhere; None if one is
        missing.
        """
        sights = {_sight(robot) for robot in self.problem.robots}
        if not sights <= self._tables.keys():
            return None
        return sum(self._spent[sight] for sight in sights)

    def take(self, other: "CoverageTables") -> None:
        """Takes over the known tables of the same problem, and nothing else."""
        self._tables, self._growing, self._spent = other._tables, other._growing, other._spent

    def so_far(self) -> "CoverageTables":
        """Returns a copy in which nobody sees anything at steps without known coverage."""
        part = copy(self)
        part._tables = {_sight(spec): self.known(spec) for spec in self.problem.robots}
        return part


def _sight(spec: Robot) -> Sight:
    return spec.motion, spec.camera


def _starts_of(problem: Problem, spec: Robot) -> Iterator[StartSet]:
    """Yields the starts of each robot with the same motion and camera, skipping duplicates."""
    both = zip(problem.robots, problem.starts, strict=True)
    yield from dict.fromkeys(states for robot, states in both if _sight(robot) == _sight(spec))


def _start_cells(problem: Problem, spec: Robot) -> IntArray:
    """Returns the cells (x, y) [n, 2] of the possible starts of robots with this motion and
    camera.
    """
    return np.concatenate([states.columns for states in _starts_of(problem, spec)])


def graph_of(problem: Problem, spec: Robot) -> TimeGraph:
    """Returns the graph of the cells that robots with the same motion and camera can reach."""
    reach = spec.motion.radius * problem.horizon
    window = Window.around(_start_cells(problem, spec), reach, problem.workspace)
    people = None
    if problem.airspace.people_aside:
        people = People(problem.distinct_people, problem.airspace, problem.horizon)
    return TimeGraph.of(problem.workspace, spec.motion, len(spec.camera.tilts), window, people)
