"""Value iteration that evaluates only the views on good paths, and finds the same path.

     1  R(t, s) <- an upper bound on the reward of state s at step t: hardly anything hides anybody
     2  forever
     3      V <- one backward sweep over R
     4      path <- the best path by V
     5      if all of its views are evaluated: return it
     6      evaluate the views on the path, and those on paths nearly as good
     7      R of these states <- their true rewards

A path that is best by an upper bound is the best of all if its own rewards are exact. It is also
the path that value iteration on all views finds: any path that ties with it by the true rewards
also ties by R, and both methods break ties in the same way.

Source: LazySP (Dellin and Srinivasa 2016, arXiv 1603.03490); the numbers in the code are those of
this listing. Many views are evaluated at once, since a sweep takes as long as evaluating hundreds
of views, and evaluating a view among many takes a tenth of the time of evaluating it alone.
"""

import numpy as np

from cocap_opt.coordination.low_level import SingleRobotPath, SingleRobotTask
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.graph.frames import Frame
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.timegraph import CLOSED, TimeGraph
from cocap_opt.graph.value_iteration import backward_sweep, best_path
from cocap_opt.model import Model, Path
from cocap_opt.planners.optimistic_coverage import OptimisticCoverage
from cocap_opt.stop import Limit, Stop

# Measured with cocap on bridge, bridge with seven layers and four pitches, corridor, and field and
# town with 120 x 120 cells: widths of first rounds that are halved or doubled, wider later rounds,
# and a growth of 2 take 0.95 to 1.4 times the CPU time and 0.7 to 1.7 times the views.
_WIDTH = 8  # largest number of states of a step that are evaluated in the first round
_GROWTH = 4  # factor on that number from round to round
_MOST = 32  # largest number in any round
_MANY = 8  # factor for the number of moves to examine, since several moves lead to one state
_HURRIED = 1.2e-7  # s per state and step for planning past a limit; measured, and rounded up


class LazyValueIteration:
    """Lazy value iteration as a low level. Each instance caches the views it has evaluated.

    It reserves enough time to plan every robot once from the views evaluated by then, but at most
    half of the available time. A path found in this time is the best by these views, and its
    `limit` names the limit that was near.
    """

    is_lazy = True

    def __init__(self) -> None:
        self._coverage: dict[tuple[Model, int], OptimisticCoverage] = {}  # by model and class
        self._reserves: dict[tuple[Model, Stop], float] = {}  # s

    def __call__(self, task: SingleRobotTask) -> SingleRobotPath:
        """Finds the path that value iteration on all views finds, or raises LimitReached."""
        task.stop.check()
        reserve = self._reserve_of(task)
        coverage = self._coverage_of(task)
        before = coverage.evaluated
        coverage.put_on_top_of(task.pixels)  # 1
        path, limit = _Search(task, coverage).best_path(task.stop.before(reserve))
        evaluated = coverage.evaluated - before
        if path is None:
            return SingleRobotPath(None, task.model.problem.no_pixels(), evaluated)
        return SingleRobotPath(path, coverage.pixels_along(path), evaluated, limit)

    def _reserve_of(self, task: SingleRobotTask) -> float:
        """Returns the seconds to reserve, given the time left at the first task of a model."""
        key = task.model, task.stop
        if key not in self._reserves:
            self._reserves[key] = min(_seconds_in_a_hurry(task.model), task.stop.seconds_left / 2)
        return self._reserves[key]

    def _coverage_of(self, task: SingleRobotTask) -> OptimisticCoverage:
        robot_class = task.model.class_of[task.robot]
        key = task.model, robot_class.number
        if key not in self._coverage:
            self._coverage[key] = OptimisticCoverage(task.model, robot_class, task.stop)
        return self._coverage[key]


def _seconds_in_a_hurry(model: Model) -> float:
    """Returns the approximate time in s to plan every robot once without further rounds."""
    states = sum(len(c.robots) * c.graph.n_states for c in model.classes)
    return states * (model.problem.horizon + 1) * _HURRIED


class _Search:
    """The search for the best path of one task."""

    def __init__(self, task: SingleRobotTask, coverage: OptimisticCoverage) -> None:
        self._task, self._coverage = task, coverage
        self._class, self._starts = task.model.class_of[task.robot], task.model.starts(task.robot)
        self._graph = self._class.graph
        self._bonuses = Bonuses.of(task.model.problem.objective)
        self._frames = Frame.all_from(self._graph, self._starts, task.model.problem.horizon)

    def best_path(self, enough: Stop) -> tuple[Path | None, Limit | None]:
        """Returns the best path, whose views have all been evaluated; None if there is no path.

        Parameters
        ----------
        enough : a limit; once it is reached, the best path by the views evaluated so far is
            returned together with the limit
        """
        width, best, least, earlier = _WIDTH, None, CLOSED, None
        while True:  # 2
            value = self._sweep(self._coverage.rewards, earlier)  # 3
            path = self._path_of(value)  # 4
            if path is None:
                return None, None
            nodes = self._nodes(path)
            if not len(self._coverage.unknown(nodes)):  # 5
                return path, None
            limit = enough.reached()
            near = _near_best(self._graph, value, self._starts, self._bonuses, width, least)
            changed = self._evaluate(np.concatenate([nodes, near]))  # 6-7
            if limit:
                known = self._path_of(self._sweep(self._coverage.known_rewards()))
                paths = [candidate for candidate in (best, path, known) if candidate is not None]
                return max(paths, key=self._worth), limit
            if (worth := self._worth(path)) > least:
                best, least = path, worth
            earlier, width = (value, changed), min(_GROWTH * width, _MOST)

    def _sweep(
        self, rewards: FloatArray, earlier: tuple[FloatArray, int] | None = None
    ) -> FloatArray:
        """Returns the best reward-to-go [T+1, S] of every state."""
        return backward_sweep(
            self._graph, rewards, self._bonuses, self._task.charges, self._class.goal,
            self._task.stop, earlier, self._frames,
        )  # fmt: skip

    def _path_of(self, value: FloatArray) -> Path | None:
        """Returns the best path, given the result of a sweep."""
        path = best_path(self._graph, value, self._starts, self._bonuses, self._task.charges)
        return None if path is None else tuple(path)

    def _nodes(self, path: Path) -> IntArray:
        nodes: IntArray = np.arange(len(path)) * self._graph.n_states + np.array(path)
        return nodes

    def _evaluate(self, nodes: IntArray) -> int:
        """Evaluates nodes among [n] that are not evaluated yet; returns the last step of any of
        them, or 0.
        """
        unknown = self._coverage.unknown(nodes)
        self._coverage.evaluate(unknown, self._task.stop)
        return int(unknown.max(initial=0)) // self._graph.n_states

    def _worth(self, path: Path) -> float:
        """Evaluates the views of a path, and returns the path's worth."""
        nodes = self._nodes(path)
        self._evaluate(nodes)
        views = float(self._coverage.rewards.reshape(-1)[nodes].sum())
        return views + self._bonuses.of_path(self._graph.shape, path)


def _near_best(
    graph: TimeGraph,
    value: FloatArray,
    starts: IntArray,
    bonuses: Bonuses,
    width: int,
    least: float,
) -> IntArray:
    """Returns nodes [n] of nearly best paths from starts: at each step, those that lose least.

    Parameters
    ----------
    value : [T+1, S] result of a backward sweep
    width : largest number of nodes per step
    least : smallest value of a path through such a node
    """
    turns = _turns(graph)
    best = value[0, starts]
    most = best.max() - least
    kept = np.flatnonzero((best.max() - best <= most) & (best > CLOSED))
    kept = kept[np.argsort(-best[kept], kind="stable")[:width]]
    states, lost = starts[kept], best.max() - best[kept]
    found = [states]
    for t, ahead in enumerate(value[1:]):
        orientations, places = np.divmod(states, graph.n_places)
        to = graph.heads_at(t, places)  # [K, n]
        heads = turns[orientations] * graph.n_places + np.maximum(to, 0)[..., None]  # [K, n, W]
        best = np.where((to < 0)[..., None], CLOSED, ahead[heads])
        if not bonuses.none:
            tails = np.broadcast_to(states[:, None], heads.shape).ravel()
            best += bonuses.of_edges(graph.shape, tails, heads.ravel()).reshape(heads.shape)
        losses = (lost + best.max(axis=(0, 2)))[:, None] - best
        kept = np.flatnonzero((losses <= most) & (best > CLOSED))
        heads, losses = heads.ravel()[kept], losses.ravel()[kept]
        if len(losses) > _MANY * width:
            few = np.argpartition(losses, _MANY * width)[: _MANY * width]
            heads, losses = heads[few], losses[few]
        order = np.lexsort([heads, losses])
        first = np.sort(np.unique(heads[order], return_index=True)[1])[:width]
        states, lost = heads[order][first], losses[order][first]
        found.append((t + 1) * graph.n_states + states)
    return np.concatenate(found)


def _turns(graph: TimeGraph) -> IntArray:
    """Returns the orientations [O, W] that can follow each orientation, some of them repeated."""
    most = max(map(len, graph.turns))
    return np.array([heads + heads[:1] * (most - len(heads)) for heads in graph.turns])
