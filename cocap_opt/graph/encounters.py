"""Finds the places from which a robot can come near somebody, and where it makes sense to start.

"Near" means within some metres, seen from above, with nothing solid on the straight line to the
middle of the person. No reward or bound depends on it; columns are treated approximately, cell by
cell.
"""

import math
from functools import cached_property

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.motion import Window
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.problem import Actor, Motion, State
from cocap_opt.world.workspace import Workspace

NEAR = 15.0  # m
_MOST = 100  # people at steps that are examined, evenly spread, to limit the time
_MOST_MOVES = 30_000_000  # moves that are examined from one start, in a second or two
_PER_CELL, _MOST_POINTS = 2, 200  # points of a line of sight


class Encounters:
    """The places of one motion from which somebody is near now or can be reached later.

    Parameters
    ----------
    actors, horizon : the people, and the last step that counts
    near : largest distance that counts as near, in m
    window : the part of the map to examine (default: all)

    Attributes
    ----------
    graph : the graph of the motion, whose places are numbered [P]
    """

    def __init__(
        self,
        workspace: Workspace,
        motion: Motion,
        actors: tuple[Actor, ...],
        horizon: int,
        near: float = NEAR,
        window: Window | None = None,
    ) -> None:
        # A separate graph, which is freed afterwards: the team's graph has another window.
        self.graph = TimeGraph(workspace, motion, 1, window)
        self._workspace, self._actors, self._horizon = workspace, actors, horizon
        self._near = near

    def outing(self, start: State) -> tuple[int, bool, bool]:
        """Explores the places that a robot can reach from a state by the last step.

        Returns
        -------
        size, closed, meets : number of places; True if it could never reach more; True if it can
            come near somebody. If there are very many moves, the exploration stops early: the size
            is then a lower bound, and closed is False
        """
        place = self.graph.place(start.layer, start.x, start.y)
        near = self._near_by_step
        reached = np.zeros(self.graph.n_places, dtype=bool)
        new, size, meets = np.array([place]), 0, False
        for t in range(self._horizon + 1):
            if (size + len(new)) * len(self.graph.shifts) > _MOST_MOVES:
                return size + len(new), False, meets
            reached[new] = True
            size += len(new)
            meets = meets or (t in near and bool(reached[near[t]].any()))
            found = self.graph.neighbours(new).ravel()
            new = np.unique(found[(found >= 0) & ~reached[found]])
        closed = not len(new) and not self._leaves(np.flatnonzero(reached))
        return size, closed, meets

    def _leaves(self, places: IntArray) -> bool:
        """Returns True if a move from one of some places [n] might leave the window."""
        _, x, y = self.graph.coordinates(places)
        x0, y0, x1, y1 = self.graph.window
        width, depth = self._workspace.height_map.shape
        far = self.graph.motion.radius
        out = ((x - far < x0) & (x0 > 0)) | ((x + far >= x1) & (x1 < width))
        out |= ((y - far < y0) & (y0 > 0)) | ((y + far >= y1) & (y1 < depth))
        return bool(out.any())

    def can_meet(self) -> BoolArray:
        """Returns True for the places [P] from which a robot can come near somebody by the last
        step.
        """
        near = self._near_by_step
        good = np.zeros(self.graph.n_places + 1, dtype=bool)  # the last entry stands for "no place"
        new = np.zeros(0, dtype=np.int64)
        for t in range(self._horizon, -1, -1):
            before = good.copy()
            # Every move can be reversed; -1 is not a place.
            good[self.graph.neighbours(new)] = True
            good[near.get(t, new[:0])] = True
            new = np.flatnonzero(good[:-1] & ~before[:-1])
        return np.logical_and(good[:-1], self.graph.free)

    def moves_to_meet(self) -> IntArray:
        """Returns the number of moves from each place [P] to a place that is near somebody at step
        0.

        It is the largest integer if no such place can be reached.
        """
        far = np.iinfo(np.int64).max
        moves = np.full(self.graph.n_places, far)
        reached = np.zeros(self.graph.n_places + 1, dtype=bool)
        reached[-1] = True  # it stands for "no place"
        new, done = np.unique(self._near_by_step.get(0, np.zeros(0, dtype=np.int64))), 0
        while len(new):
            moves[new], reached[new] = done, True
            heads = np.unique(self.graph.neighbours(new))  # every move can be reversed
            new, done = heads[~reached[heads]], done + 1
        return moves

    @cached_property
    def _near_by_step(self) -> dict[int, IntArray]:
        """Returns the places near somebody, for each of the steps that are examined."""
        cases = [(t, a) for t in range(self._horizon + 1) for a in range(len(self._actors))]
        step = -(-len(cases) // _MOST)
        found: dict[int, list[IntArray]] = {}
        for t, a in cases[:: max(step, 1)]:
            found.setdefault(t, []).append(self._near_to(self._actors[a], t))
        return {t: np.concatenate(parts) for t, parts in found.items()}

    def near_at_the_end(self) -> IntArray:
        """Returns the distinct places [n] from which somebody is near at the last step."""
        actors = self._actors[:: max(-(-len(self._actors) // _MOST), 1)]
        parts = [self._near_to(actor, self._horizon) for actor in actors]
        return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *parts]))

    def _near_to(self, actor: Actor, t: int) -> IntArray:
        """Returns the places [n] from which an actor is near at a step."""
        height_map = self._workspace.height_map
        reach = math.ceil(self._near / height_map.resolution) + 1
        target = actor.poses[t, :3] + [0.0, 0.0, actor.shape.height / 2]
        cell = height_map.cell_of(target[0], target[1])
        places = self.graph.places_around(*cell, reach)
        eyes = self.graph.positions(height_map, places)
        close = np.flatnonzero(np.hypot(*(eyes[:, :2] - target[:2]).T) <= self._near)
        seen: IntArray = places[close[self._sees(eyes[close], target)]]
        return seen

    def _sees(self, eyes: FloatArray, target: FloatArray) -> BoolArray:
        """Returns True [n] if nothing solid is on the line from an eye [n, 3] to a point."""
        height_map, columns = self._workspace.height_map, self._workspace.columns
        (width, depth), (ox, oy), size = height_map.shape, height_map.origin, height_map.resolution
        spans = [part.reshape(len(part), -1) for part in (columns.low, columns.high)]
        free, ways = np.ones(len(eyes), dtype=bool), np.ascontiguousarray((eyes - target).T)
        points = min(math.ceil(_PER_CELL * self._near / size), _MOST_POINTS)
        goal = height_map.cell_of(target[0], target[1])
        is_inside = height_map.inside(*goal)  # then all lines are inside, as eyes always are
        for share in (np.arange(points) + 0.5) / points:
            x, y, z = (start + share * way for start, way in zip(target, ways, strict=True))
            i = np.floor((x - ox) / size).astype(np.int64)
            j = np.floor((y - oy) / size).astype(np.int64)
            # A wall in the person's own cell does not hide them.
            hides = (i != goal[0]) | (j != goal[1])
            if not is_inside:
                hides &= (i >= 0) & (i < width) & (j >= 0) & (j < depth)
            low, high = (np.take(part, i * depth + j, axis=1, mode="clip") for part in spans)
            free &= ~(((low <= z) & (high > z)).any(axis=0) & hides)
        return free
