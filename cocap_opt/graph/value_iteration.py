"""Value iteration over the time-expanded graph: one backward sweep, and the best path from it.

A step's moves and turns are independent, so a sweep is a few shifted maxima over one array
[heading, pitch, layer, x, y] at every step, instead of a loop over edges.
"""

from collections.abc import Sequence
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from cocap_opt.compiling import Kernel
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.charges import NO_CHARGES, Charges
from cocap_opt.graph.frames import Frame
from cocap_opt.graph.move_rewards import NO_BONUSES, Bonuses
from cocap_opt.graph.timegraph import CLOSED, TimeGraph
from cocap_opt.problem import AnyGoal, goal_cells
from cocap_opt.stop import Stop, never

KERNEL = Kernel("cocap_opt.graph.sweep_kernel", "value iteration", compiling=4.0)
_EACH = 5e-9  # s per state and step with NumPy: measured
_SHORT = 10_000_000  # values of a sweep that is so short that limits need not be checked
_AT_ONCE = 2_000_000  # values of moves, which limits memory
_Ends = tuple[int, AnyGoal | None]  # horizon and goal
_leads: WeakKeyDictionary[TimeGraph, dict[_Ends, BoolArray]] = WeakKeyDictionary()


def backward_sweep(
    graph: TimeGraph,
    reward: FloatArray,
    bonuses: Bonuses = NO_BONUSES,
    charges: Charges = NO_CHARGES,
    goal: AnyGoal | None = None,
    stop: Stop = never,
    earlier: tuple[FloatArray, int] | None = None,
    frames: Sequence[Frame] | None = None,
) -> FloatArray:
    """Returns the best reward-to-go of every state at every step.

    Parameters
    ----------
    graph : the compiled graph of one robot's motion
    reward : [T+1, S] reward of each state at step t, CLOSED (-inf) outside the free states, as from
        `TimeGraph.no_reward`
    bonuses : rewards for the moves themselves
    charges : costs of places, moves and states; infinity closes them
    goal : cell (x, y) in which the path must end, or several cells, one of which it must reach
    stop : stopping criterion, checked at every step
    earlier : result [T+1, S] of a sweep with the same arguments except for some rewards, which is
        overwritten, and the last step at which a reward has changed since
    frames : frames of all steps before the last, if only states that can be reached from some
        starts matter (`Frame.all_from`); all other values are then meaningless

    Returns
    -------
    [T+1, S] reward at t plus the best rewards of the steps after it; CLOSED if the state is not
    free or cannot reach the goal.

    Raises
    ------
    LimitReached
        If a limit is reached before the sweep reaches step 0.
    """
    if not graph.closed.none:
        charges = Charges.joined([graph.closed, charges])
    last = len(reward) - 1
    value, changed = (np.zeros(reward.shape), last) if earlier is None else earlier
    if changed == last:
        value[last] = reward[last]
        if goal is not None:
            _close_elsewhere(graph, value[last], goal)
        _charge(graph, value[last], charges, last)
    first = min(changed, last - 1)
    is_plain = frames is None and bonuses.none and charges.none
    if KERNEL.is_loaded and is_plain and reward.size < _SHORT:
        stop.check()
        _sweep_at_once(graph, value[: first + 2], reward[: first + 2])
        return value
    frames = [Frame.whole(graph)] * last if frames is None else frames
    room = np.full((3, max((frame.n_states for frame in frames), default=0)), CLOSED)
    step = None
    for t in range(first, -1, -1):
        stop.check()
        frame = frames[t]
        if step is None or step.frame is not frame:
            step = _BackwardStep(frame, bonuses, room)
        best = step.best(frame.of(value[t + 1]), *charges.moves_at(t))
        np.add(best, frame.of(reward[t]), out=frame.of(value[t]))
        _charge(graph, value[t], charges, t)
    return value


def _sweep_at_once(graph: TimeGraph, value: FloatArray, reward: FloatArray) -> None:
    """Sweeps over all states with the compiled kernel, if there are no rewards except those for
    states.
    """
    from cocap_opt.graph.sweep_kernel import sweep

    shape = (len(value), *graph.shape[:2], graph.n_places)
    places, heads, _ = graph.irregular
    sweep(
        value.reshape(shape), reward.reshape(shape), np.empty((4, graph.n_places)),
        *_limits_of(graph), _leaps_of(graph, graph.strides), *_rows_of(graph, graph.strides),
        places, heads,
    )  # fmt: skip


def _leaps_of(graph: TimeGraph, strides: Sequence[int]) -> IntArray:
    """Returns the differences [3] of the numbers of places that a leap along each axis joins."""
    leaps: IntArray = np.array(strides) * np.array(graph.leaps)
    return leaps


def _rows_of(graph: TimeGraph, strides: Sequence[int]) -> tuple[IntArray, IntArray]:
    """Returns the largest leaps [n] along y in rows of moves, and the differences [n] between the
    numbers of a place and of that to which the middle of a row leads; empty for a whole box.
    """
    widths, layers, cells = graph.rows.T
    return widths.copy(), layers * strides[0] + cells * strides[1]


def _limits_of(graph: TimeGraph) -> tuple[int, int, IntArray]:
    """Returns the largest turns of heading and pitch in a step, and the leaps of a move."""
    motion, headings = graph.motion, graph.shape[0]
    # At most all headings, each once.
    turn = motion.turn if 2 * motion.turn + 1 <= headings else headings // 2
    return turn, motion.pitch_turn, np.array(graph.reaches)


def best_path(
    graph: TimeGraph,
    value: FloatArray,
    starts: int | IntArray,
    bonuses: Bonuses = NO_BONUSES,
    charges: Charges = NO_CHARGES,
    first: int = 0,
) -> list[int] | None:
    """Returns a path of T+1 states from the best start that attains `value`; None if there is none.

    Ties go to the shortest move, then to the smallest turn, which are the same in a turned
    or mirrored copy of a scene; last to the lowest state number, so that the path is the
    same in every process.

    Parameters
    ----------
    graph, bonuses, charges : as in `backward_sweep`
    value : [T+1, S] result of `backward_sweep`
    starts : number of the first state, or numbers [n] of the states to choose from, increasing
    first : step of the first row of `value`
    """
    open_ = np.atleast_1d(starts)
    start = int(open_[np.argmax(value[0, open_])])
    if value[0, start] == CLOSED:
        return None
    path = [start]
    for t in range(first, first + len(value) - 1):
        heads = graph.successors(t, path[-1])
        ahead = value[t + 1 - first, heads]
        if not bonuses.none:
            ahead = ahead + bonuses.of_edges(graph.shape, path[-1], heads)
        place = path[-1] % graph.n_places
        ahead = ahead - charges.cost_of_moves(t, place, heads % graph.n_places)
        path.append(_calmest(graph, path[-1], heads[ahead == ahead.max()]))
    return path


def leads_to_goal(graph: TimeGraph, horizon: int, goal: AnyGoal | None) -> BoolArray:
    """Returns True for states [T+1, S] from which a robot that is alone can reach the goal cell at
    T.

    Without a goal, all states qualify, unless people close places and moves. Results are cached as
    long as the graph is in use.
    """
    if goal is None and graph.closed.none:
        return np.broadcast_to(np.True_, (horizon + 1, graph.n_states))
    known = _leads.setdefault(graph, {})
    if (horizon, goal) not in known:
        to_goal = backward_sweep(graph, graph.no_reward(horizon), goal=goal)
        known[horizon, goal] = to_goal > CLOSED
    return known[horizon, goal]


class _BackwardStep:
    """One step of value iteration, within a frame.

    Parameters
    ----------
    room : [3, n] working memory, which later steps reuse

    Attributes
    ----------
    frame : the frame
    """

    def __init__(self, frame: Frame, bonuses: Bonuses, room: FloatArray) -> None:
        self.frame, self._graph, self._bonuses = frame, frame.graph, bonuses
        self._after_turn, self._best, self._pair = room[:, : frame.n_states]

    @property
    def _by_place(self) -> tuple[int, int]:
        return self._graph.n_orientations, self.frame.n_places

    @cached_property
    def _rates(self) -> FloatArray | None:
        """Rewards of the cell moves [K]; None if no move has any."""
        if self._bonuses.keep_cell or self._bonuses.balanced:
            return self._bonuses.of_moves(np.array(self._graph.moves))
        return None

    def best(
        self, ahead: FloatArray, tails: IntArray, heads: IntArray, costs: FloatArray
    ) -> FloatArray:
        """Returns the best of all edges, as [heading, pitch, layer, x, y] of the frame.

        Parameters
        ----------
        ahead : values ahead, in the same form
        tails, heads, costs : [n] of the charged moves between places of the graph
        """
        ahead = ahead.reshape(-1)
        if KERNEL.is_loaded and self._rates is None and not self._bonuses.keep_heading:
            self._by_kernel(ahead)
        else:
            KERNEL.spend(_EACH * len(ahead))
            self._turn(ahead)
            if self._bonuses.keep_heading:
                self._keep_heading(ahead)
            self._window()
            if self._rates is not None:
                self._reward_moves(self._rates)
            if self.frame.irregular[0].size:
                self._redo_irregular()
        if len(tails):
            self._charge_moves(tails, heads, costs)
        if self._bonuses.stationarity:
            stay = ahead + self._bonuses.stay
            stays = np.flatnonzero(tails == heads)
            stays = stays[self.frame.holds(tails[stays])]
            _take_from_places(
                stay.reshape(self._by_place), self.frame.places(tails[stays]), costs[stays]
            )
            np.maximum(self._best, stay, out=self._best)
        best: FloatArray = self._best.reshape(self.frame.shape)
        return best

    def _by_kernel(self, ahead: FloatArray) -> None:
        """Finds the maxima over turns and moves with the kernel, like the following NumPy
        passes.
        """
        from cocap_opt.graph.sweep_kernel import best_of_moves

        places = self.frame.n_places
        shape = (*self._graph.shape[:2], places)
        irregular, heads, _ = self.frame.irregular
        best_of_moves(
            ahead.reshape(shape), self._after_turn.reshape(shape), self._best.reshape(shape),
            np.empty((4, places)), *self._limits, self._leaps, *self._rows, irregular, heads,
        )  # fmt: skip

    @cached_property
    def _limits(self) -> tuple[int, int, IntArray]:
        return _limits_of(self._graph)

    @cached_property
    def _leaps(self) -> IntArray:
        return _leaps_of(self._graph, self.frame.strides)

    @cached_property
    def _rows(self) -> tuple[IntArray, IntArray]:
        return _rows_of(self._graph, self.frame.strides)

    def _turn(self, ahead: FloatArray) -> None:
        """Finds the maximum over the orientations to which one step can turn."""
        headings, turn = self._graph.shape[0], self._graph.motion.turn
        out, pair = self._after_turn, self._pair
        step = self.frame.n_states // headings  # states with the same heading are contiguous
        if 2 * turn + 1 >= headings:
            out.reshape(headings, -1)[:] = ahead.reshape(headings, -1).max(axis=0)
        elif not turn:
            np.copyto(out, ahead)
        else:
            source = ahead
            for _ in range(turn):
                np.maximum(source[:-step], source[step:], out=pair[:-step])
                np.maximum(source[-step:], source[:step], out=pair[-step:])
                np.maximum(pair[step:], pair[:-step], out=out[step:])
                np.maximum(pair[:step], pair[-step:], out=out[:step])
                source = out
        self._pitch(out)

    def _pitch(self, values: FloatArray) -> None:
        """Finds the maximum over the pitches to which one step can turn [S], in place."""
        headings, pitches = self._graph.shape[:2]
        by_pitch = values.reshape(headings, pitches, -1)
        for _ in range(min(self._graph.motion.pitch_turn, pitches - 1)):
            narrow = by_pitch.copy()
            np.maximum(narrow[:, 1:], narrow[:, :-1], out=by_pitch[:, 1:])
            np.maximum(by_pitch[:, :-1], narrow[:, 1:], out=by_pitch[:, :-1])

    def _keep_heading(self, ahead: FloatArray) -> None:
        """Raises the maximum over turns where keeping the heading is worth more."""
        np.add(ahead, self._bonuses.keep_heading, out=self._pair)
        self._pitch(self._pair)
        np.maximum(self._after_turn, self._pair, out=self._after_turn)

    def _window(self) -> None:
        """Finds the maximum over the box of cell moves, or over rows of it.

        Each pass widens the window by one leap along one axis. Values that a pass leaves at both
        ends lie in the border, and no later pass carries them out of it.
        """
        if len(self._graph.rows):
            self._window_of_rows()
            return
        out, source = self._best, self._after_turn
        for reach, stride in zip(self._graph.reaches, self._leaps.tolist(), strict=True):
            for _ in range(reach):
                self._widen(source, stride, out)
                source = out
        if source is self._after_turn:
            np.copyto(out, source)

    def _widen(self, source: FloatArray, stride: int, out: FloatArray) -> None:
        """Finds the maximum over a leap to either side; `out` may be the source."""
        np.maximum(source[:-stride], source[stride:], out=self._pair[:-stride])
        np.maximum(self._pair[: -2 * stride], self._pair[stride:-stride], out=out[stride:-stride])

    def _window_of_rows(self) -> None:
        """Finds the maximum over rows of moves along y."""
        out, wide, done = self._best, self._after_turn.copy(), 0
        out[:] = CLOSED
        for width, shift in zip(*map(np.ndarray.tolist, self._rows), strict=True):
            for _ in range(width - done):
                self._widen(wide, int(self._leaps[2]), wide)
            done, n = width, len(out)
            tails, heads = (slice(max(0, s), n + min(0, s)) for s in (-shift, shift))
            np.maximum(out[tails], wide[heads], out=out[tails])

    def _reward_moves(self, rates: FloatArray) -> None:
        """Raises the maximum over moves where a move with a reward is better.

        If a move leads out of the map, or its end is not free, the value ahead is CLOSED; other
        closed moves are irregular.
        """
        n, out, pair = self.frame.n_states, self._best, self._pair
        for rate, move in zip(rates.tolist(), self._graph.moves, strict=True):
            if rate:
                strides = zip(move, self.frame.strides, strict=True)
                shift = sum(i * stride for i, stride in strides)
                tails, heads = (slice(max(0, s), n + min(0, s)) for s in (-shift, shift))
                np.add(self._after_turn[heads], rate, out=pair[tails])
                np.maximum(out[tails], pair[tails], out=out[tails])

    def _redo_irregular(self) -> None:
        """Recomputes the maximum over the moves of irregular places, with their rewards."""
        places, heads, hidden = self.frame.irregular
        after, best = (part.reshape(self._by_place) for part in (self._after_turn, self._best))
        size = max(1, _AT_ONCE // (heads.shape[0] * len(after)))
        for first in range(0, len(places), size):
            part = slice(first, first + size)
            ahead = after.take(heads[:, part], axis=1)
            if self._rates is not None:
                ahead += np.where(hidden[:, part], 0.0, self._rates[:, None])
            best[:, places[part]] = np.maximum.reduce(ahead, axis=1)

    def _charge_moves(self, tails: IntArray, heads: IntArray, costs: FloatArray) -> None:
        """Recomputes the places from which some moves are charged or closed."""
        inside = self.frame.holds(tails)
        heads, costs = heads[inside], costs[inside]
        places, at = np.unique(tails[inside], return_inverse=True)
        targets = self._graph.neighbours(places)  # [K, n]
        cost = np.where(targets >= 0, 0.0, np.inf)
        move, entry = np.nonzero(targets[:, at] == heads)
        np.add.at(cost, (move, at[entry]), costs[entry])
        if self._rates is not None:
            cost -= self._rates[:, None]
        after, best = (part.reshape(self._by_place) for part in (self._after_turn, self._best))
        # Moves out of the frame may have any value, since the values where they begin are
        # meaningless.
        ahead = after.take(self.frame.places(np.maximum(targets, 0)), axis=1, mode="clip") - cost
        best[:, self.frame.places(places)] = ahead.max(axis=1)


def _close_elsewhere(graph: TimeGraph, value: FloatArray, goal: AnyGoal) -> None:
    """Closes the states [S] that are not in a cell of the goal."""
    elsewhere, window = np.ones(graph.shape[2:], dtype=bool), graph.window
    x, y = (goal_cells(goal) - (window.x0, window.y0)).T
    width, depth = window.shape
    inside = (x >= 0) & (y >= 0) & (x < width) & (y < depth)
    graph.without_border(elsewhere)[:, x[inside], y[inside]] = False
    value.reshape(graph.shape)[:, :, elsewhere] = CLOSED


def _charge(graph: TimeGraph, value: FloatArray, charges: Charges, t: int) -> None:
    """Subtracts the costs of step t from its values [S]."""
    by_place = value.reshape(graph.n_orientations, graph.n_places)
    _take_from_places(by_place, *charges.places_at(t))
    states, costs = charges.states_at(t)
    if len(states):
        np.subtract.at(value, states, costs)


def _take_from_places(value: FloatArray, places: IntArray, costs: FloatArray) -> None:
    """Subtracts the costs [n] of places [n] from the values [O, P] of all their states."""
    if len(places):
        np.subtract.at(value.T, places, costs[:, None])


def _calmest(graph: TimeGraph, tail: int, heads: IntArray) -> int:
    """Returns the head that is nearest to the tail in place, then in orientation."""
    if len(heads) == 1:
        return int(heads[0])
    before, after = np.unravel_index(tail, graph.shape), np.unravel_index(heads, graph.shape)
    turn, pitch, *move = (b - a for a, b in zip(before, after, strict=True))
    far = sum(step**2 for step in move)
    turn = np.minimum(turn % graph.shape[0], -turn % graph.shape[0])
    return int(heads[np.lexsort([heads, np.abs(pitch), turn, far])[0]])
