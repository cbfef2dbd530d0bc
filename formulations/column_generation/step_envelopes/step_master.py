"""The master problem of step envelopes: the prices that known joint states and arcs allow.

Over prices phi(t, s), constants K_t and potentials u(t, s) it minimises

    sum_t K_t + sum of u at the starts + rho / 2 |phi - centre|^2

such that K_t is at least the height of every known joint state of the step, and the potentials
rise along the known arcs by prices less charges. At steps with a ceiling, prices are at least
those of the centre at first, and states that have none of their own are priced higher by as much as
K_t is below the ceiling (`staged.narrowing`). Fewer joint states and arcs than there are make
it too low, so that they are found by and by; the last term keeps prices near the best so far
(a proximal bundle method; Kiwiel 1990).
"""

from collections.abc import Mapping
from typing import NamedTuple

import clarabel
import numpy as np
from scipy import sparse

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.relaxations.cone_solver import solve_cones
from cocap_opt.stop import Stop

_ACCURACY = 1e-9  # relative, of the solver

Place = tuple[int, int, int]  # class number, step, state number


class KnownArcs(NamedTuple):
    """Moves of one robot that are known [m], in parallel."""

    tails: list[Place]
    heads: list[Place]
    gains: list[float]  # beside prices: rewards less charges


class KnownHeights(NamedTuple):
    """Joint states that are known [h], in parallel, in the order of their steps."""

    steps: list[int]
    at: list[tuple[int, ...]]  # positions of the states of each among all that are priced
    worths: list[float]


class StepSolution(NamedTuple):
    """Prices [n], constants, and the value, which is at most the best bound."""

    prices: FloatArray
    constants: Mapping[int, float]
    value: float
    flow: FloatArray  # [m] number of robots on each known arc in the best mixture of them


class StepMaster(NamedTuple):
    """The part that all master problems of a bundle share.

    Attributes
    ----------
    priced : position of every state with a price
    starts : number of robots that start in each state
    ceilings : of steps at which states without a price of their own are priced higher
    least : least prices at these steps, by position
    """

    priced: Mapping[Place, int]
    starts: Mapping[Place, int]
    ceilings: Mapping[int, float]
    least: Mapping[int, float]

    def solve(
        self, centre: FloatArray, weight: float, arcs: KnownArcs, heights: KnownHeights,
        unpriced: Mapping[Place, float], stop: Stop,
    ) -> StepSolution:  # fmt: skip
        """Returns the solution of one master problem.

        Prices of states that are in no known joint state and on no known arc stay at the centre.

        Parameters
        ----------
        centre : [n] the best prices so far
        weight : > 0, of the distance to them
        unpriced : rewards of the states on arcs that have no price
        stop : for the solver, which ends early at a limit
        """
        # Columns: the constants by step, the prices in use by position, the potentials by place.
        places = dict.fromkeys(
            place for ends in zip(arcs.tails, arcs.heads, strict=True) for place in ends
        )
        used = sorted(
            {self.priced[place] for place in places if place in self.priced}
            | {position for positions in heights.at for position in positions}
        )
        constant_of = {t: k for k, t in enumerate(sorted(set(heights.steps)))}
        first = len(constant_of)
        price_of = {position: first + k for k, position in enumerate(used)}
        node_of = {place: first + len(used) + k for k, place in enumerate(places)}
        size = first + len(used) + len(places)
        # Rows `matrix x <= rhs`, as the entries of a sparse matrix; those of one place add up.
        entries: list[tuple[int, int, float]] = []
        rhs: list[float] = []

        def price_at(place: Place) -> float:
            """Adds a place's price to the row that is being made; returns its constant part."""
            if place in self.priced:
                entries.append((len(rhs), price_of[self.priced[place]], 1.0))
                return 0.0
            if place[1] in self.ceilings:
                entries.append((len(rhs), constant_of[place[1]], -1.0))
                return unpriced[place] + self.ceilings[place[1]]
            return unpriced[place]

        # The tail's potential is at least its price, the gain, and the head's potential.
        for tail, head, gain in zip(*arcs, strict=True):
            entries += [(len(rhs), node_of[tail], -1.0), (len(rhs), node_of[head], 1.0)]
            constant = price_at(tail)
            rhs.append(-gain - constant)
        last = max(place[1] for place in places)
        for place, node in node_of.items():
            if place[1] == last:
                entries.append((len(rhs), node, -1.0))
                constant = price_at(place)
                rhs.append(-0.0 - constant)
        # The step's constant is at least the worth less the prices.
        for t, positions, worth in zip(*heights, strict=True):
            entries.append((len(rhs), constant_of[t], -1.0))
            entries += [(len(rhs), price_of[position], -1.0) for position in positions]
            rhs.append(-worth)
        for position, column in price_of.items():
            if position in self.least:
                entries.append((len(rhs), column, -1.0))
                rhs.append(-self.least[position])
        for t, ceiling in self.ceilings.items():
            entries.append((len(rhs), constant_of[t], 1.0))
            rhs.append(ceiling)
        rows, columns, values = np.array(entries).T
        index: tuple[IntArray, IntArray] = (rows.astype(np.int64), columns.astype(np.int64))
        matrix = sparse.csc_matrix((values, index), shape=(len(rhs), size))

        cost = np.zeros(size)
        cost[:first] = 1.0
        for place, robots in self.starts.items():
            cost[node_of[place]] += robots
        value_of = cost.copy()
        near = slice(first, first + len(used))
        cost[near] = -weight * centre[used]
        weights = np.zeros(size)
        weights[near] = weight
        solution = solve_cones(
            cost, matrix, np.array(rhs), [clarabel.NonnegativeConeT(len(rhs))], stop,
            quadratic=sparse.diags(weights).tocsc(), direct_solve_method="faer",
            tol_gap_rel=_ACCURACY, tol_feas=_ACCURACY,
        )  # fmt: skip
        found = np.nan_to_num(np.array(solution.x))
        prices = centre.copy()
        prices[used] = found[near]
        constants = {t: float(found[k]) for t, k in constant_of.items()}
        flow = np.nan_to_num(np.array(solution.z))[: len(arcs.gains)]
        return StepSolution(prices, constants, float(value_of @ found), flow)
