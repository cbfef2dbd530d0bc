"""The time-expanded graph, compiled once to arrays that all planners and bounds share.

Constraints and prices close or charge places and moves of this one graph (see `charges`), so it is
never copied. Paths through it are found by `value_iteration`.

States are numbered 0..S-1 in the order [heading, pitch, layer, x, y] and places 0..P-1 in the order
[layer, x, y]. Both numberings cover a window of the map, to which robots are confined, and a closed
border around it, as wide as a move is long, so that every move is a constant shift of place
numbers.
"""

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import product
from typing import TypeVar
from weakref import WeakValueDictionary

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.charges import NO_CHARGES, Charges
from cocap_opt.graph.motion import People, Window, allowed_moves
from cocap_opt.memory import require_memory
from cocap_opt.problem import Motion, State
from cocap_opt.problem.motion import Move
from cocap_opt.world.workspace import HeightMap, Workspace

_Values = TypeVar("_Values", BoolArray, IntArray)
# bytes per place while the graph is built, in addition to those per move: measured
_BYTES_PER_PLACE = 110
CLOSED = -np.inf  # value of a state that must not or cannot be entered
# The n places [n] from which an obstacle closes a move to a free place; the places [K, n] to which
# their moves lead (the place itself for a closed move); and True for the moves that are open [K,
# n].
Irregular = tuple[IntArray, IntArray, BoolArray]


class TimeGraph:
    """The compiled motion of all robots that share a `Motion` and a number of gimbal pitches.

    Attributes
    ----------
    window : the cells in which robots stay
    shape : (headings, pitches, layers, X, Y) of the numbering, including the border
    n_places, n_states : P and S
    moves : the K cell moves of one step; the first is to stay
    shifts : [K] difference between the place numbers of each move's end and beginning
    closed : places and moves that are closed only at some steps, because people are near
    """

    def __init__(
        self,
        workspace: Workspace,
        motion: Motion,
        pitches: int,
        window: Window | None = None,
        people: People | None = None,
    ) -> None:
        self.window = window or Window.all_of(workspace)
        sizes = (len(motion.layers), *self.window.shape)
        climb = min(motion.climb, len(motion.layers) - 1)
        self.motion = motion
        self.border = (climb, motion.radius, motion.radius)
        # Moves are in a box of as many leaps along each axis, of as many layers or cells each.
        self.leaps = (1, motion.spacing, motion.spacing)
        self.reaches = (climb, motion.radius // motion.spacing, motion.radius // motion.spacing)
        # Layer and cell of place 0.
        self._first = (-climb, self.window.x0 - motion.radius, self.window.y0 - motion.radius)
        padded = tuple(n + 2 * b for n, b in zip(sizes, self.border, strict=True))
        self.shape = (motion.headings, pitches, *padded)
        self.n_orientations = motion.headings * pitches
        self.n_places = int(np.prod(padded))
        self.n_states = self.n_orientations * self.n_places
        self.strides = (padded[1] * padded[2], padded[2], 1)
        self.moves: list[Move] = motion.moves_on(workspace.height_map)
        self.shifts: IntArray = np.array(self.moves, np.int64) @ np.array(self.strides, np.int64)
        self._require_memory()
        self._workspace = workspace
        self.closed = NO_CHARGES if people is None else self._closed(people, workspace.height_map)

    def _require_memory(self) -> None:
        """Raises an error if the graph would be larger than the memory."""
        moves, (x, y) = len(self.moves), self.window.shape
        require_memory(
            self.n_places * (moves + _BYTES_PER_PLACE),
            f"the graph of {x} x {y} cells in {len(self.motion.layers)} layers, with {moves} moves "
            "from each,",
            (x, y),
            self.motion.radius,
            {"layers": len(self.motion.layers), "moves, by a smaller radius": moves},
        )

    @classmethod
    def of(
        cls,
        workspace: Workspace,
        motion: Motion,
        pitches: int,
        window: Window | None = None,
        people: People | None = None,
    ) -> "TimeGraph":
        """Returns the compiled graph of these motions in this workspace, shared as long as it is in
        use.

        Parameters
        ----------
        window : the part of the map to which robots are confined (default: all)
        people : people from whom robots keep a distance
        """
        key = workspace, motion, pitches, window or Window.all_of(workspace), people
        graph = _graphs.get(key)
        if graph is None:
            graph = _graphs[key] = cls(*key)
        if graph not in _last:
            _last.append(graph)
        return graph

    @cached_property
    def allowed(self) -> BoolArray:
        """True for open moves: one row [P] for each move, for the places where it may begin.

        They are compiled on first use, since views of states need only the numbers of places.
        """
        allowed = np.zeros((len(self.moves), self.n_places), dtype=np.bool_)
        moves = allowed_moves(self._workspace, self.motion, self.window)
        for row, (_, starts) in zip(allowed, moves, strict=True):
            self.without_border(row)[...] = starts
        return allowed

    def neighbours(self, places: IntArray) -> IntArray:
        """Returns the places to which each move leads from places [n], as [K, n]; -1 if the move is
        closed.
        """
        heads = places + self.shifts[:, None]
        return np.where(self.allowed[:, places], heads, -1)

    @cached_property
    def rows(self) -> IntArray:
        """Rows of moves along y: [n, 3] largest leap, and layers and cells of x; narrow rows first.

        Empty if the moves are the whole box. A stride leaves out moves that are too long, so that
        those that remain reach equally far to both sides.
        """
        if len(self.moves) == len(self.motion.moves):
            return np.zeros((0, 3), dtype=np.int64)
        widths = dict[tuple[int, int], int]()
        for layer, x, y in self.moves:
            widths[layer, x] = max(widths.get((layer, x), 0), y // self.motion.spacing)
        assert sum(2 * width + 1 for width in widths.values()) == len(self.moves)
        return np.array(sorted((width, layer, x) for (layer, x), width in widths.items()))

    @property
    def free(self) -> BoolArray:
        """True for places [P] where a robot may be; a robot may stay in each of them."""
        free: BoolArray = self.allowed[0]
        return free

    @cached_property
    def irregular(self) -> Irregular:
        """The places from which a move to a free place is closed."""
        hidden = np.zeros(self.n_places, dtype=bool)
        for shift, allowed in zip(self.shifts.tolist(), self.allowed, strict=True):
            # The border is closed and as wide as the moves are long, so nothing wraps around.
            hidden |= np.roll(self.free, -shift) & ~allowed
        places = np.flatnonzero(hidden & self.free)
        # A closed move is listed as staying, which is always allowed.
        heads = self.neighbours(places)
        is_hidden = heads < 0
        return places, np.where(is_hidden, places, heads), is_hidden

    def _closed(self, people: People, height_map: HeightMap) -> Charges:
        """Returns charges that close all places and moves that come too close to somebody."""
        places, moves = [np.zeros((0, 2), np.int64)], [np.zeros((0, 3), np.int64)]
        airspace, resolution = people.airspace, height_map.resolution
        for actor, t in product(people.actors, range(people.horizon + 1)):
            here, there = actor.poses[[t, min(t + 1, len(actor.poses) - 1)], :2]
            x, y = height_map.cell_of(*here.tolist())
            # m, including the person's walk during the step
            aside = airspace.rules_beside(actor).separation + math.hypot(*(there - here))
            aside += airspace.people_stray * self.motion.radius * resolution * math.sqrt(2)
            reach = math.ceil(aside / resolution) + 1
            around = self.places_around(x, y, reach)
            near = around[airspace.near_person(actor, t, self.positions(height_map, around))]
            places.append(np.column_stack([np.full(len(near), t), near]))
            if t < people.horizon:
                ends = self.moves_around(x, y, reach + self.motion.radius)
                way = (self.positions(height_map, end) for end in ends)
                pairs = np.column_stack(ends)[airspace.near_person(actor, t, *way)]
                moves.append(np.column_stack([np.full(len(pairs), t), pairs]))
        return Charges.closing(*(np.unique(np.concatenate(x), axis=0) for x in (places, moves)))

    # -- numbering -----------------------------------------------------------------------

    def place(self, layer: int, x: int, y: int) -> int:
        """Returns the number of the place in this layer and cell, which must be in the window.

        Raises
        ------
        IndexError
            If the cell is not in the window.
        """
        if not self.window.covers(x, y):
            raise IndexError(f"cell ({x}, {y}) is not in {self.window}")
        at = zip((layer, x, y), self._first, self.strides, strict=True)
        return sum((i - first) * stride for i, first, stride in at)

    def index(self, state: State) -> int:
        """Returns the number of a state."""
        place = self.place(state.layer, state.x, state.y)
        return (state.heading * self.shape[1] + state.pitch) * self.n_places + place

    def indices(self, states: IntArray) -> IntArray:
        """Returns the numbers [n] of states [n, 5], which must be in the window."""
        x, y, layer, heading, pitch = states.T
        first = (i - start for i, start in zip((layer, x, y), self._first, strict=True))
        found: IntArray = np.ravel_multi_index((heading, pitch, *first), self.shape)
        return found

    def state(self, index: int) -> State:
        """Returns the state with this number."""
        heading, pitch, *place = (int(i) for i in np.unravel_index(index, self.shape))
        layer, x, y = (i + first for i, first in zip(place, self._first, strict=True))
        return State(x, y, layer, heading, pitch)

    def coordinates(self, places: IntArray) -> IntArray:
        """Returns layer, x and y [3, n] of numbered places [n]."""
        return np.array(np.unravel_index(places, self.shape[2:])) + _column(self._first)

    def without_border(self, values: _Values) -> _Values:
        """Returns values of places [P] as an array [layer, X, Y] of the window."""
        sizes = zip(self.border, self.shape[2:], strict=True)
        inside = tuple(slice(border, size - border) for border, size in sizes)
        return values.reshape(self.shape[2:])[inside]

    def positions(self, height_map: HeightMap, places: IntArray) -> FloatArray:
        """Returns the positions [n, 3] (m) of places: middles of cells, at flight height."""
        layer, x, y = self.coordinates(places)
        ox, oy = height_map.origin
        return np.column_stack(
            [
                ox + (x + 0.5) * height_map.resolution,
                oy + (y + 0.5) * height_map.resolution,
                height_map.altitudes(self.motion.layers)[layer, x, y],
            ]
        )

    def places_around(self, x: int, y: int, reach: int) -> IntArray:
        """Returns the free places at most `reach` cells from a cell along both axes."""
        x0, y0, x1, y1 = self.window
        rows, columns = (
            np.arange(max(middle - reach, low), min(middle + reach + 1, high))
            for middle, low, high in ((x, x0, x1), (y, y0, y1))
        )
        layers = np.arange(len(self.motion.layers))
        cells = zip(np.ix_(layers, rows, columns), self._first, self.strides, strict=True)
        places: IntArray = np.asarray(sum((i - first) * step for i, first, step in cells)).ravel()
        return places[self.free[places]]

    def moves_around(self, x: int, y: int, reach: int) -> tuple[IntArray, IntArray]:
        """Returns tails and heads [n] of the moves that begin in `places_around` a cell."""
        places = self.places_around(x, y, reach)
        move, at = np.nonzero(self.allowed[:, places])
        return places[at], places[at] + self.shifts[move]

    def moves_between(
        self, tail: tuple[int, int], head: tuple[int, int]
    ) -> tuple[IntArray, IntArray]:
        """Returns tails and heads [n] of all moves from one cell to another, in every layer."""
        way = head[0] - tail[0], head[1] - tail[1]
        which = [k for k, (_, *move) in enumerate(self.moves) if tuple(move) == way]
        places = self.places_around(*tail, 0)
        move, at = np.nonzero(self.allowed[which][:, places])
        return places[at], places[at] + self.shifts[which][move]

    def moves_past(
        self, tail: tuple[int, int], head: tuple[int, int], reach: int
    ) -> tuple[IntArray, IntArray]:
        """Returns tails and heads [n] of all moves that may pass near a given move between two
        cells.

        All other moves are always more than `reach` cells away from it along one axis.
        """
        shift = np.array(head) - tail
        places = self.places_around(*tail, reach + self.motion.radius + int(np.abs(shift).max()))
        before = (self.coordinates(places) - _column((0, *tail)))[1:]  # [2, n]
        change = (np.array(self.moves)[:, 1:] - shift)[:, :, None]  # [K, 2, 1] of the way between
        near = (before + np.minimum(change, 0) <= reach) & (
            before + np.maximum(change, 0) >= -reach
        )
        which, at = np.nonzero(near.all(axis=1) & self.allowed[:, places])
        return places[at], places[at] + self.shifts[which]

    # -- edges ---------------------------------------------------------------------------

    @cached_property
    def turns(self) -> list[list[int]]:
        """Orientations reachable in one step from each orientation; pitch runs fastest."""
        headings, pitches = self.shape[:2]
        return [
            sorted(
                h * pitches + p
                for h in self.motion.headings_after(heading)
                for p in self.motion.pitches_after(pitch, pitches)
            )
            for heading in range(headings)
            for pitch in range(pitches)
        ]

    def heads_at(self, t: int, places: IntArray) -> IntArray:
        """Returns the places at t+1 to which each move leads from places [n] at t, as [K, n].

        Entries are -1 if the move is closed, permanently or at that step.
        """
        heads = self.neighbours(places)
        closed, _ = self.closed.places_at(t + 1)
        if len(closed):
            heads[self._among(heads, closed) & (heads >= 0)] = -1
        tails, ends, _ = self.closed.moves_at(t)
        if len(tails):
            (few,) = np.nonzero(self._among(places, tails))
            pairs, reached = tails * self.n_places + ends, heads[:, few]
            reached[np.isin(places[few] * self.n_places + reached, pairs) & (reached >= 0)] = -1
            heads[:, few] = reached
        return heads

    def _among(self, places: IntArray, chosen: IntArray) -> BoolArray:
        """Returns True for places that are among the chosen ones; closed moves, -1, may give
        either.
        """
        if places.size < self.n_places // 16:
            return np.isin(places, chosen)
        is_chosen = np.zeros(self.n_places, dtype=np.bool_)
        is_chosen[chosen] = True
        found: BoolArray = is_chosen[places]
        return found

    def successors(self, t: int, state: int) -> IntArray:
        """Returns the states at t+1 to which one step leads from `state` at t, in order."""
        orientation, place = divmod(state, self.n_places)
        (heads,) = self.heads_at(t, np.array([place])).T
        heads = np.sort(heads[heads >= 0])
        turned_to = np.array(self.turns[orientation], dtype=np.int64)
        successors: IntArray = (turned_to[:, None] * self.n_places + heads[None, :]).ravel()
        return successors

    def reachable(self, starts: Sequence[int] | IntArray, horizon: int) -> BoolArray:
        """Returns an array [T+1, S], True if a state is reachable from a start at a step."""
        seen = np.zeros((horizon + 1, self.n_orientations, self.n_places), dtype=bool)
        orientations, places = np.divmod(np.asarray(starts, dtype=np.int64), self.n_places)
        # orientations that share the same places
        alike: dict[bytes, tuple[IntArray, set[int]]] = {}
        for orientation in np.unique(orientations).tolist():
            from_places = np.unique(places[orientations == orientation])
            key = from_places.tobytes()
            alike.setdefault(key, (from_places, set()))[1].add(orientation)
        for from_places, turned in alike.values():
            # Turns and moves of a step are independent of each other.
            for row, reached in zip(seen, self._reached(from_places, horizon), strict=True):
                for head in turned:  # assigning all at once would copy their rows
                    row[head] |= reached
                turned = {head for tail in turned for head in self.turns[tail]}
        return seen.reshape(horizon + 1, self.n_states)

    def _reached(self, places: IntArray, horizon: int) -> Iterator[BoolArray]:
        """Yields the places [P] that are reached at steps 0..T from given places at step 0."""
        reached = np.zeros(self.n_places, dtype=bool)
        reached[places] = True
        new = places
        yield reached
        for t in range(horizon):
            heads = self.heads_at(t, new)
            ahead = np.zeros(self.n_places, dtype=bool)
            ahead[heads[heads >= 0]] = True
            if self.closed.none:
                # A robot may stay, so a place that was reached once can be reached at all later
                # steps.
                ahead |= reached
                new = np.flatnonzero(ahead & ~reached)
            else:
                new = np.flatnonzero(ahead)
            reached = ahead
            yield reached

    # -- rewards ----------------------------------------------------------------------------

    def no_reward(self, horizon: int) -> FloatArray:
        """Returns a reward array [T+1, S] of zeros, CLOSED outside the free states."""
        step = np.where(np.tile(self.free, self.n_orientations), 0.0, CLOSED)
        reward = np.empty((horizon + 1, self.n_states))
        reward[...] = step
        return reward


def _column(values: Iterable[int]) -> IntArray:
    return np.array(list(values), dtype=np.int64)[:, None]


# Unused graphs are released, since one may be as large as the memory; but the most recent ones are
# kept, for callers that evaluate plan after plan, or robot after robot.
_graphs: WeakValueDictionary[tuple[object, ...], TimeGraph] = WeakValueDictionary()
_last: deque[TimeGraph] = deque(maxlen=2)
