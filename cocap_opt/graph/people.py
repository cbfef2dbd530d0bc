"""Places and moves that are too near to people, step by step."""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cocap_opt.data import IntArray
from cocap_opt.graph.charges import Charges
from cocap_opt.problem import Actor, Airspace
from cocap_opt.world.workspace import HeightMap

if TYPE_CHECKING:
    from cocap_opt.graph.timegraph import TimeGraph


class People(NamedTuple):
    """The people of a problem, to whom drones keep a distance until the horizon."""

    actors: tuple[Actor, ...]
    airspace: Airspace
    horizon: int

    def closed(self, graph: "TimeGraph", height_map: HeightMap) -> Charges:
        """Returns charges that close all places and moves that are too near to somebody."""
        places: list[IntArray] = [np.zeros((0, 2), dtype=np.int64)]
        moves: list[IntArray] = [np.zeros((0, 3), dtype=np.int64)]
        for actor in self.actors:
            for t in range(self.horizon + 1):
                near = self._places(graph, height_map, actor, t)
                places.append(np.column_stack([np.full(len(near), t), near]))
                if t < self.horizon:
                    pairs = self._moves(graph, height_map, actor, t)
                    moves.append(np.column_stack([np.full(len(pairs), t), pairs]))
        return Charges.closing(
            np.unique(np.concatenate(places), axis=0), np.unique(np.concatenate(moves), axis=0)
        )

    def _places(self, graph: "TimeGraph", height_map: HeightMap, actor: Actor, t: int) -> IntArray:
        """Returns the places [n] that are too near to a person at a step."""
        x, y = actor.poses[t, :2].tolist()
        reach = math.ceil(self.airspace.people_aside / height_map.resolution) + 1
        places = graph.places_around(*height_map.cell_of(x, y), reach)
        near = self.airspace.near_person(actor, t, graph.positions(height_map, places))
        return places[near]

    def _moves(self, graph: "TimeGraph", height_map: HeightMap, actor: Actor, t: int) -> IntArray:
        """Returns the moves [n, 2] that come too near to a person between two steps."""
        (x, y), (u, v) = actor.poses[t, :2].tolist(), actor.poses[t + 1, :2].tolist()
        far = self.airspace.people_aside + math.hypot(u - x, v - y)
        reach = math.ceil(far / height_map.resolution) + 1 + graph.motion.radius
        tails, heads = graph.moves_around(*height_map.cell_of(x, y), reach)
        ends = (graph.positions(height_map, some) for some in (tails, heads))
        near = self.airspace.near_person(actor, t, *ends)
        return np.column_stack([tails, heads])[near]
