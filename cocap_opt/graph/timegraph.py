"""The time-expanded graph, compiled once to arrays that all planners and bounds share.

A step's moves and turns are independent, so the backward sweep of value iteration is a few
shifted maxima over one array instead of a loop over edges. Constraints and prices hide or
charge places and moves of this one graph; nobody copies it.

States are numbered 0..S-1 in the order [heading, pitch, layer, x, y] and places 0..P-1 in
the order [layer, x, y]. Both numberings include a closed border around the map, as wide as
a move is long, which makes every move one flat shift.
"""

from collections.abc import Collection, Iterable, Mapping
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.motion import Move, Place, moves, place_graph, turned
from cocap_opt.graph.move_rewards import NO_BONUSES, Bonuses
from cocap_opt.problem import Motion, State
from cocap_opt.world.workspace import Workspace

CLOSED = -np.inf  # value of what must not or cannot be entered


class Charges(NamedTuple):
    """What places, moves and states cost; infinity closes them, a negative cost attracts.

    `places` maps (t, place) to the cost of being there at t; `moves` maps (t, place, place)
    to the cost of leaving the first at t for the second at t+1; `states` maps (t, state) to
    the cost of being in it at t. Staying is never charged as a move.
    """

    places: Mapping[tuple[int, int], float] = {}
    moves: Mapping[tuple[int, int, int], float] = {}
    states: Mapping[tuple[int, int], float] = {}


NO_CHARGES = Charges()


class TimeGraph:
    """Compiled motion of all robots that share a `Motion` and a number of gimbal pitches.

    Attributes
    ----------
    shape : (headings, pitches, layers, X, Y) of the numbering, border included
    n_places, n_states : P and S
    moves : the K cell moves of one step, the first is to stay
    neighbours : [K, P] place that each move leads to; -1 where the move is hidden
    """

    def __init__(self, workspace: Workspace, motion: Motion, pitches: int) -> None:
        sizes = (len(motion.layers), *workspace.height_map.shape)
        climb = min(motion.climb, len(motion.layers) - 1)
        self.motion = motion
        self.border = (climb, motion.radius, motion.radius)
        padded = tuple(n + 2 * b for n, b in zip(sizes, self.border, strict=True))
        self.shape = (motion.headings, pitches, *padded)
        self.n_orientations = motion.headings * pitches
        self.n_places = int(np.prod(padded))
        self.n_states = self.n_orientations * self.n_places
        self.strides = (padded[1] * padded[2], padded[2], 1)
        self.moves: list[Move] = moves(motion)
        self.neighbours = self._compile(place_graph(workspace, motion).adj)
        self._compile_sweep()

    def _compile(self, ahead: Mapping[Place, Collection[Place]]) -> IntArray:
        """Turn the edges of the networkx place graph into one row of targets per move."""
        neighbours = np.full((len(self.moves), self.n_places), -1, dtype=np.int64)
        number = {place: self.place(*place) for place in ahead}
        tails = np.array([number[tail] for tail, row in ahead.items() for _ in row], dtype=np.int64)
        heads = np.array([number[head] for row in ahead.values() for head in row], dtype=np.int64)
        neighbours[self._move_between(tails, heads), tails] = heads
        return neighbours

    def _move_between(self, tails: IntArray, heads: IntArray) -> IntArray:
        """Index of the move that leads from each place to its head; any where none does."""
        # The border makes the difference of the places' numbers another one for every move.
        shifts = np.array(self.moves) @ self.strides
        order = np.argsort(shifts)
        at = np.searchsorted(shifts, heads - tails, sorter=order)
        return order[np.minimum(at, len(order) - 1)]

    def _compile_sweep(self) -> None:
        """Find the places that a plain window maximum gets wrong: a free target is hidden."""
        self.free: BoolArray = self.neighbours[0] >= 0  # [P] every free place may be stayed in
        shifts = np.array(self.moves) @ self.strides
        targets = np.arange(self.n_places)[None, :] + shifts[:, None]
        target_free = self.free[np.clip(targets, 0, self.n_places - 1)]
        hidden = self.free & target_free & (self.neighbours < 0)
        self._irregular = np.flatnonzero(hidden.any(axis=0))
        # A hidden move is listed as staying, which is always allowed.
        heads = self.neighbours[:, self._irregular]
        heads = np.where(heads < 0, self._irregular, heads)
        self._irregular_states = self._all_orientations(self._irregular)
        self._irregular_heads = np.stack([self._all_orientations(row) for row in heads])
        self._irregular_hidden = self._irregular_heads == self._irregular_states
        self._irregular_hidden[0] = False

    def _all_orientations(self, places: IntArray) -> IntArray:
        """States of numbered places in every orientation, orientation by orientation."""
        origins = np.arange(self.n_orientations) * self.n_places
        return (origins[:, None] + places[None, :]).ravel()

    # -- numbering -----------------------------------------------------------------------

    def place(self, layer: int, x: int, y: int) -> int:
        """Number of the place at this layer and cell."""
        at = zip((layer, x, y), self.border, self.strides, strict=True)
        return sum((i + b) * stride for i, b, stride in at)

    def index(self, state: State) -> int:
        """Number of a state."""
        place = self.place(state.layer, state.x, state.y)
        return (state.heading * self.shape[1] + state.pitch) * self.n_places + place

    def state(self, index: int) -> State:
        """State with this number."""
        heading, pitch, *place = (int(i) for i in np.unravel_index(index, self.shape))
        layer, x, y = (i - b for i, b in zip(place, self.border, strict=True))
        return State(x, y, layer, heading, pitch)

    def coordinates(self, places: IntArray) -> IntArray:
        """Layer, x and y of numbered places [3, n]."""
        return np.array(np.unravel_index(places, self.shape[2:])) - _column(self.border)

    # -- edges ---------------------------------------------------------------------------

    @cached_property
    def turns(self) -> list[list[int]]:
        """Orientations reachable in one step from each orientation; pitch runs fastest."""
        headings, pitches = self.shape[:2]
        return [
            sorted(
                h * pitches + p
                for h in turned(heading, self.motion.turn, headings, cyclic=True)
                for p in turned(pitch, self.motion.pitch_turn, pitches, cyclic=False)
            )
            for heading in range(headings)
            for pitch in range(pitches)
        ]

    def successors(self, state: int) -> IntArray:
        """States reachable from `state` in one step, in increasing order."""
        orientation, place = divmod(state, self.n_places)
        heads = self.neighbours[:, place]
        heads = np.sort(heads[heads >= 0])
        turned_to = np.array(self.turns[orientation], dtype=np.int64)
        return (turned_to[:, None] * self.n_places + heads[None, :]).ravel()

    def adjacent(self, tails: IntArray, heads: IntArray) -> BoolArray:
        """Whether a move leads from each place [n] to its head [n]."""
        result: BoolArray = self.neighbours[self._move_between(tails, heads), tails] == heads
        return result

    def reachable(self, starts: Iterable[int], horizon: int) -> BoolArray:
        """Which states [T+1, S] can be reached from one of the start states at each step."""
        seen = np.zeros((horizon + 1, self.n_orientations, self.n_places), dtype=bool)
        seen[0].reshape(-1)[list(starts)] = True
        for t in range(horizon):
            occupied = np.flatnonzero(seen[t].any(axis=0))
            spread = np.zeros_like(seen[t])
            for heads in self.neighbours[:, occupied]:
                open_ = heads >= 0
                spread[:, heads[open_]] |= seen[t][:, occupied[open_]]
            for orientation, targets in enumerate(self.turns):
                seen[t + 1][targets] |= spread[orientation]
        return seen.reshape(horizon + 1, self.n_states)

    # -- value iteration -----------------------------------------------------------------

    def no_reward(self, horizon: int) -> FloatArray:
        """Reward array [T+1, S] of zeros, CLOSED outside the free states."""
        one = np.where(np.tile(self.free, self.n_orientations), 0.0, CLOSED)
        return np.tile(one, (horizon + 1, 1))

    def backward_sweep(
        self,
        reward: FloatArray,
        bonuses: Bonuses = NO_BONUSES,
        charges: Charges = NO_CHARGES,
        goal: tuple[int, int] | None = None,
    ) -> FloatArray:
        """Best reward to go of every state at every step, by value iteration.

        Parameters
        ----------
        reward : [T+1, S] reward for being in a state at step t, CLOSED (-inf) outside the
            free states, as `no_reward` makes it
        bonuses : rewards for the moves themselves
        charges : what places, moves and states cost; infinity closes them
        goal : cell (x, y) in which the path must end

        Returns
        -------
        [T+1, S] reward at t itself plus the best of the steps after it; CLOSED where the
        state is not free or cannot reach the goal.
        """
        value = np.empty_like(reward)
        value[-1] = reward[-1]
        if goal is not None:
            elsewhere = np.ones(self.shape[2:], dtype=bool)
            elsewhere[:, goal[0] + self.border[1], goal[1] + self.border[2]] = False
            value[-1].reshape(self.shape)[:, :, elsewhere] = CLOSED
        places, leaving = _by_step(charges.places), self._leaving_by_step(charges)
        states = _by_step(charges.states)
        rates = self._rates(bonuses)
        after_turn, best, pair = np.full((3, self.n_states), CLOSED)  # reused at every step
        self._charge(value[-1], places.get(len(reward) - 1, {}), states.get(len(reward) - 1, {}))
        for t in range(len(reward) - 2, -1, -1):
            self._turn(value[t + 1], pair, after_turn)
            if bonuses.keep_heading:
                self._keep_heading(value[t + 1], bonuses.keep_heading, pair, after_turn)
            self._window(after_turn, pair, best)
            if rates is not None:
                self._reward_moves(after_turn, rates, pair, best)
            if self._irregular.size:
                best[self._irregular_states] = self._best_irregular(after_turn, rates)
            for tail, costs in leaving.get(t, {}).items():
                self._charge_moves(best, after_turn, rates, tail, costs)
            if bonuses.stationarity:
                np.maximum(best, value[t + 1] + bonuses.stay, out=best)
            np.add(best, reward[t], out=value[t])
            self._charge(value[t], places.get(t, {}), states.get(t, {}))
        return value

    def _rates(self, bonuses: Bonuses) -> FloatArray | None:
        """Rewards of the cell moves [K]; None where none has any."""
        if bonuses.keep_cell or bonuses.balanced:
            return bonuses.of_moves(np.array(self.moves))
        return None

    def _turn(self, ahead: FloatArray, pair: FloatArray, out: FloatArray) -> None:
        """Maximum over the orientations that one step can turn to [S], in `out`."""
        headings = self.shape[0]
        step = self.n_states // headings  # states of one heading are contiguous
        if 2 * self.motion.turn + 1 >= headings:
            out.reshape(headings, -1)[:] = ahead.reshape(headings, -1).max(axis=0)
        elif not self.motion.turn:
            np.copyto(out, ahead)
        else:
            source = ahead
            for _ in range(self.motion.turn):
                np.maximum(source[:-step], source[step:], out=pair[:-step])
                np.maximum(source[-step:], source[:step], out=pair[-step:])
                np.maximum(pair[step:], pair[:-step], out=out[step:])
                np.maximum(pair[:step], pair[-step:], out=out[:step])
                source = out
        self._pitch(out)

    def _pitch(self, values: FloatArray) -> None:
        """Maximum over the pitches that one step can turn to [S], in place."""
        headings, pitches = self.shape[:2]
        by_pitch = values.reshape(headings, pitches, -1)
        for _ in range(min(self.motion.pitch_turn, pitches - 1)):
            narrow = by_pitch.copy()
            np.maximum(narrow[:, 1:], narrow[:, :-1], out=by_pitch[:, 1:])
            np.maximum(by_pitch[:, :-1], narrow[:, 1:], out=by_pitch[:, :-1])

    def _keep_heading(
        self, ahead: FloatArray, bonus: float, pair: FloatArray, out: FloatArray
    ) -> None:
        """Raise the maximum over turns [S], in `out`, where to keep the heading pays more."""
        np.add(ahead, bonus, out=pair)
        self._pitch(pair)
        np.maximum(out, pair, out=out)

    def _window(self, values: FloatArray, pair: FloatArray, out: FloatArray) -> None:
        """Maximum over the box of cell moves [S], in `out`.

        Each pass widens the window by one cell along one axis. What a pass leaves over at
        both ends lies in the border, and no later pass carries it out of there.
        """
        source = values
        for reach, stride in zip(self.border, self.strides, strict=True):
            for _ in range(reach):
                np.maximum(source[:-stride], source[stride:], out=pair[:-stride])
                np.maximum(pair[: -2 * stride], pair[stride:-stride], out=out[stride:-stride])
                source = out
        if source is values:
            np.copyto(out, values)

    def _reward_moves(
        self, values: FloatArray, rates: FloatArray, pair: FloatArray, out: FloatArray
    ) -> None:
        """Raise the maximum over moves [S], in `out`, where one with a reward is better.

        Where a move leads out of the map or is hidden by what is solid at its end, `values`
        are CLOSED; other hidden moves are irregular.
        """
        n = self.n_states
        for rate, move in zip(rates.tolist(), self.moves, strict=True):
            if rate:
                shift = sum(i * stride for i, stride in zip(move, self.strides, strict=True))
                tails, heads = (slice(max(0, s), n + min(0, s)) for s in (-shift, shift))
                np.add(values[heads], rate, out=pair[tails])
                np.maximum(out[tails], pair[tails], out=out[tails])

    def _best_irregular(self, after_turn: FloatArray, rates: FloatArray | None) -> FloatArray:
        """Maximum over the moves that irregular places have, with their rewards."""
        ahead = after_turn[self._irregular_heads]
        if rates is not None:
            ahead += np.where(self._irregular_hidden, 0.0, rates[:, None])
        best: FloatArray = ahead.max(axis=0)
        return best

    def _charge_moves(
        self,
        best: FloatArray,
        after_turn: FloatArray,
        rates: FloatArray | None,
        tail: int,
        costs: Mapping[int, float],
    ) -> None:
        """Recompute one place, of which some moves are charged or closed."""
        origins = np.arange(self.n_orientations) * self.n_places
        heads = self.neighbours[:, tail]
        open_ = heads >= 0
        heads = heads[open_]
        cost = np.array([costs.get(int(head), 0.0) for head in heads])
        cost[heads == tail] = 0.0  # staying is not a move
        if rates is not None:
            cost -= rates[open_]
        best[origins + tail] = (after_turn[origins[:, None] + heads] - cost).max(axis=1)

    def _charge(
        self, value: FloatArray, places: Mapping[int, float], states: Mapping[int, float]
    ) -> None:
        for place, cost in places.items():
            value[place :: self.n_places] -= cost
        for state, cost in states.items():
            value[state] -= cost

    @staticmethod
    def _leaving_by_step(charges: Charges) -> dict[int, dict[int, dict[int, float]]]:
        leaving: dict[int, dict[int, dict[int, float]]] = {}
        for (t, tail, head), cost in charges.moves.items():
            leaving.setdefault(t, {}).setdefault(tail, {})[head] = cost
        return leaving

    def best_path(
        self,
        value: FloatArray,
        start: int,
        bonuses: Bonuses = NO_BONUSES,
        charges: Charges = NO_CHARGES,
    ) -> list[int] | None:
        """Path of T+1 states from `start` that attains `value`; None where there is none.

        Ties go to the shortest move, then to the smallest turn, which are the same in a turned
        or mirrored copy of a scene; last to the lowest state number, so that the path is the
        same in every process.
        """
        if value[0, start] == CLOSED:
            return None
        path = [start]
        for t in range(len(value) - 1):
            heads = self.successors(path[-1])
            ahead = value[t + 1, heads]
            if not bonuses.none:
                ahead = ahead + bonuses.of_edges(self.shape, path[-1], heads)
            if charges.moves:
                tail = path[-1] % self.n_places
                ahead = ahead - np.array(
                    [
                        charges.moves.get((t, tail, head), 0.0) if head != tail else 0.0
                        for head in (heads % self.n_places).tolist()
                    ]
                )
            path.append(self._calmest(path[-1], heads[ahead == ahead.max()]))
        return path

    def _calmest(self, tail: int, heads: IntArray) -> int:
        """The head that is nearest to the tail in place, then in orientation."""
        if len(heads) == 1:
            return int(heads[0])
        before, after = np.unravel_index(tail, self.shape), np.unravel_index(heads, self.shape)
        turn, pitch, *move = (b - a for a, b in zip(before, after, strict=True))
        far = sum(step**2 for step in move)
        turn = np.minimum(turn % self.shape[0], -turn % self.shape[0])
        return int(heads[np.lexsort([heads, np.abs(pitch), turn, far])[0]])


def _by_step(costs: Mapping[tuple[int, int], float]) -> dict[int, dict[int, float]]:
    steps: dict[int, dict[int, float]] = {}
    for (t, at), cost in costs.items():
        steps.setdefault(t, {})[at] = cost
    return steps


def _column(values: Iterable[int]) -> IntArray:
    return np.array(list(values), dtype=np.int64)[:, None]


@lru_cache(maxsize=16)
def time_graph(workspace: Workspace, motion: Motion, pitches: int) -> TimeGraph:
    """Compiled graph of these motions in this workspace, made once and shared."""
    return TimeGraph(workspace, motion, pitches)
