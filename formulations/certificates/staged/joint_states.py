"""The joint states of a team at one step, and their worth.

A joint state is one state for each robot. Its worth is the sum of the weighted returns of the
pixels that its robots have together; each state has a price. Its reduced profit is the difference
of the two,

    F(s) - sum_i price(s_i),     F(s) = sum_f w_f phi_f(sum_i c_f(s_i)).

The return phi_f of a face is the root. Where drones that see people are counted, each person is one
more face here, with c = 0 or 1 and phi = min(., k): prices include credits for these, too, so that
F would be too low without them.

Robots of one class are alike, so that joint states are multisets; states in conflict are not part
of the same joint state. Only joint states count that some plan above a target may visit: their
worth less their charges is at least a floor (`narrowing` has the inequality).

The producer of a certificate searches among more states than its checker, and the rounding of
profits depends on the search. The profit of a joint state that is found is therefore computed
again, from its own states alone and correctly rounded.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cocap_opt.arithmetic import exact_sum
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.pricing import UNIT_ROUNDOFF
from cocap_opt.formulations.certificates.staged.conflicts import Conflicts
from cocap_opt.model import Model
from cocap_opt.returns import Returns

# The most reduced profit of a joint state at other prices, and by how much each state's price, or
# charge, is higher than then [n].
Ceiling = tuple[float, FloatArray]


@dataclass(frozen=True, eq=False)
class JointStates:
    """The states that are left to the robots at one step, class by class.

    Attributes
    ----------
    t : the step
    sizes : number of robots of each class
    class_of : [n] number of each state's class, not decreasing
    states : [n] number of each state in the graph of its class
    pixels : [n, F] coverage of the faces that any of the states sees, px/m2; then of the people
        whose drones are counted, 1 where a state sees the person
    weights : [F] of all of these, > 0
    returns : of all of these: roots, then counts
    price : [n] of each state, in units of J
    charge : [n] of each state; a joint state counts if its worth less its charges is >= `floor`
    floor : in units of J
    conflicts : of the states
    ceilings : of earlier prices; rounding included
    limits : ceilings of the worth less the charges; rounding included
    """

    t: int
    sizes: tuple[int, ...]
    class_of: IntArray
    states: IntArray
    pixels: FloatArray
    weights: FloatArray
    returns: Returns
    price: FloatArray
    charge: FloatArray
    floor: float
    conflicts: Conflicts
    ceilings: tuple[Ceiling, ...] = ()
    limits: tuple[Ceiling, ...] = ()

    @classmethod
    def of(
        cls,
        model: Model,
        t: int,
        left: Sequence[IntArray],
        price: Sequence[FloatArray],
        charge: Sequence[FloatArray],
        floor: float,
        ceilings: tuple[Ceiling, ...] = (),
        limits: tuple[Ceiling, ...] = (),
        apart: Sequence[int] | None = None,
    ) -> "JointStates":
        """Returns the joint states of a step.

        Parameters
        ----------
        left : for each class, the numbers [n] of the states that are left at the step
        price, charge : for each class, of these states [n]
        ceilings, limits : over these states
        apart : the class of each robot, if every robot is a class of its own here; "for each class"
            then means for each robot
        """
        class_of = np.repeat(np.arange(len(left)), [*map(len, left)])
        numbers = range(len(left)) if apart is None else apart
        sizes = model.class_sizes if apart is None else (1,) * len(apart)
        pixels = np.concatenate([
            model.coverage_at(model.classes[c], t, states)
            for c, states in zip(numbers, left, strict=True)
        ])  # fmt: skip
        view_sums = model.problem.step_view_sums[t]
        weights = model.problem.view_sum_weights[view_sums]
        seen = (pixels > 0).any(axis=0) & (weights > 0)
        at = np.concatenate([
            model.places.positions[c][states % model.classes[c].graph.n_places]
            for c, states in zip(numbers, left, strict=True)
        ])  # fmt: skip
        return cls(
            t, sizes, class_of, np.concatenate(left), pixels[:, seen], weights[seen],
            model.problem.returns.part(view_sums[seen]),
            np.concatenate(price), np.concatenate(charge), floor,
            Conflicts.of(model.problem.rules, at), ceilings, limits,
        )  # fmt: skip

    @cached_property
    def bounds(self) -> tuple[Ceiling, ...]:
        """The ceilings, followed by the limits."""
        return (*self.ceilings, *self.limits)

    @cached_property
    def cliques(self) -> IntArray:
        """Numbers [n] such that any two states with the same number, all of a class, conflict."""
        return self.conflicts.cliques(self.class_of)

    @cached_property
    def most_pixels(self) -> FloatArray:
        """The most [F] that any of the states sees of each face."""
        most: FloatArray = self.pixels.max(axis=0, initial=0.0)
        return most

    @cached_property
    def margin(self) -> float:
        """The room that a constant leaves above a profit for rounding, in units of J.

        In the search a profit is a sum of at most R (F + 2) terms, each the result of a few
        operations, none of them larger than what all robots see and all prices at most: rounding
        changes it by at most an eighth of this.
        """
        robots = sum(self.sizes)
        most = self.weights @ self.returns.values(robots * self.most_pixels)
        most += robots * np.abs(self.price).max(initial=0.0)
        most += robots * np.abs(self.charge).max(initial=0.0)
        return float(16 * robots * (len(self.weights) + robots + 4) * UNIT_ROUNDOFF * most)

    def part(self, positions: IntArray, floor: float) -> "JointStates":
        """Returns the joint states of some of the states, those up to another floor.

        Parameters
        ----------
        positions : [n] of the states, increasing
        """
        ceilings, limits = (
            tuple((profit, raised[positions]) for profit, raised in bounds)
            for bounds in (self.ceilings, self.limits)
        )
        return replace(
            self,
            class_of=self.class_of[positions],
            states=self.states[positions],
            pixels=self.pixels[positions],
            price=self.price[positions],
            charge=self.charge[positions],
            floor=floor,
            conflicts=self.conflicts.part(positions),
            ceilings=ceilings,
            limits=limits,
        )

    def worth(self, chosen: Sequence[int]) -> float:
        """Returns F of a joint state, whose states are given by their positions.

        It depends on these states alone: not on their order, nor on which others are listed.
        """
        return exact_sum(self._worths(chosen))

    def worths(self, chosen: IntArray) -> FloatArray:
        """Returns F of some joint states [K, R], each the same in whatever company."""
        seen = np.zeros((len(chosen), len(self.weights)))
        for k in range(chosen.shape[1]):
            seen += self.pixels[chosen[:, k]]
        worths: FloatArray = (self.returns.values(seen) * self.weights).sum(axis=1)
        return worths

    def reduced_profit(self, chosen: Sequence[int]) -> float:
        """Returns the worth of a joint state less its states' prices; as `worth` does."""
        return exact_sum([*self._worths(chosen), *(-self.price[list(chosen)]).tolist()])

    def _worths(self, chosen: Sequence[int]) -> list[float]:
        """Returns the worth of each face [F] in a joint state."""
        pixels = [math.fsum(seen) for seen in self.pixels[list(chosen)].T.tolist()]
        worths: list[float] = (self.weights * self.returns.values(np.array(pixels))).tolist()
        return worths

    @cached_property
    def sparse(self) -> tuple[IntArray, IntArray, FloatArray]:
        """The pixels in compressed sparse rows: first entry of each state [n+1], faces, pixels."""
        rows, faces = np.nonzero(self.pixels)
        return (
            np.searchsorted(rows, np.arange(len(self.pixels) + 1)),
            np.ascontiguousarray(faces),  # numba compiles once more for another layout
            self.pixels[rows, faces],
        )
