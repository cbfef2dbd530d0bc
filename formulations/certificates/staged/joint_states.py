"""The joint states of a team at one step, and their worth.

A joint state consists of one state for each robot. Its worth is the sum of the weighted returns of
the pixels that its robots have together; each state has a price. Its reduced profit is the worth
less the prices,

    F(s) - sum_i price(s_i),     F(s) = sum_f w_f phi_f(sum_i c_f(s_i)).

The return phi_f of a face is the root. If drones that see people are counted, each person is one
more face here, with c = 0 or 1 and phi = min(., k): prices include credits for people, too, so F
has to include them.

Robots of one class are interchangeable, so joint states are multisets; no joint state contains two
states in conflict. Only joint states that some plan above a target may visit count: their worth
less their charges is at least a floor (see the inequality in `narrowing`).

The producer of a certificate searches among more states than its checker, and the rounding of
profits depends on the search. Therefore the profit of a joint state that was found is recomputed
from its own states alone, correctly rounded.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cocap_opt.arithmetic import exact_sum
from cocap_opt.data import FloatArray, IndexArray, IntArray
from cocap_opt.formulations.certificates.pricing import UNIT_ROUNDOFF
from cocap_opt.formulations.certificates.staged.conflicts import Conflicts
from cocap_opt.model import Model
from cocap_opt.returns import Returns

# A ceiling: the largest reduced profit of a joint state at other prices, and the increase of each
# state's price, or charge, since then [n].
Ceiling = tuple[float, FloatArray]


@dataclass(frozen=True, eq=False)
class JointStates:
    """The states that remain for the robots at one step, class by class.

    Attributes
    ----------
    t : the step
    sizes : number of robots of each class
    class_of : [n] number of each state's class, not decreasing
    states : [n] number of each state in the graph of its class
    pixels : [n, F] coverage of the faces that any of the states sees, px/m2; then a column per
        counted person, 1 where a state sees the person
    weights : [F] weights of these faces and people, > 0
    returns : their returns: roots for faces, then counts for people
    price : [n] price of each state, in units of J
    charge : [n] charge of each state; a joint state counts if its worth less its charges is >=
        `floor`
    floor : in units of J
    conflicts : conflicts of the states
    ceilings : ceilings of earlier prices, including rounding
    limits : ceilings of the worth less the charges, including rounding
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
        left : for each class, the numbers [n] of the remaining states at the step
        price, charge : for each class, the prices and charges of these states [n]
        ceilings, limits : ceilings and limits over these states
        apart : the class of each robot, if every robot is a class of its own here; "for each class"
            above then means "for each robot"
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
        """Numbers [n] such that any two states with the same number conflict; all have the same
        class.
        """
        return self.conflicts.cliques(self.class_of)

    @cached_property
    def most_pixels(self) -> FloatArray:
        """The most [F] that any state sees of each face."""
        most: FloatArray = self.pixels.max(axis=0, initial=0.0)
        return most

    @cached_property
    def margin(self) -> float:
        """The allowance for rounding in a constant that bounds a profit, in units of J.

        A profit in the search is a sum of at most R (F + 2) terms. Each is the result of a few
        operations on numbers no larger than the pixels of all robots and the sum of the largest
        prices, so rounding changes it by at most an eighth of this margin.
        """
        robots = sum(self.sizes)
        most = self.weights @ self.returns.values(robots * self.most_pixels)
        most += robots * np.abs(self.price).max(initial=0.0)
        most += robots * np.abs(self.charge).max(initial=0.0)
        return float(16 * robots * (len(self.weights) + robots + 4) * UNIT_ROUNDOFF * most)

    def part(self, positions: IntArray, floor: float) -> "JointStates":
        """Returns the joint states over some of the states, for another floor.

        Parameters
        ----------
        positions : [n] positions of the states, increasing
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
        """Returns F of a joint state, given the positions of its states.

        The result depends on these states alone: not on their order, nor on which others are in the
        list.
        """
        return exact_sum(self._worths(chosen))

    def worths(self, chosen: IntArray) -> FloatArray:
        """Returns F of several joint states [K, R]; each value is independent of the other joint
        states.
        """
        seen = np.zeros((len(chosen), len(self.weights)))
        for k in range(chosen.shape[1]):
            seen += self.pixels[chosen[:, k]]
        worths: FloatArray = (self.returns.values(seen) * self.weights).sum(axis=1)
        return worths

    def reduced_profit(self, chosen: Sequence[int]) -> float:
        """Returns the worth of a joint state less its states' prices, with the same rounding as
        `worth`.
        """
        return exact_sum([*self._worths(chosen), *(-self.price[list(chosen)]).tolist()])

    def _worths(self, chosen: Sequence[int]) -> list[float]:
        """Returns the worth of each face [F] in a joint state."""
        pixels = [math.fsum(seen) for seen in self.pixels[list(chosen)].T.tolist()]
        worths: list[float] = (self.weights * self.returns.values(np.array(pixels))).tolist()
        return worths

    @cached_property
    def sparse(self) -> tuple[IndexArray, IndexArray, FloatArray]:
        """The pixels as compressed sparse rows: first entry of each state [n+1], faces, pixels."""
        rows, faces = np.nonzero(self.pixels)
        return (
            np.searchsorted(rows, np.arange(len(self.pixels) + 1)).astype(np.uint32),
            # `astype` makes them contiguous; numba would compile again for another layout
            faces.astype(np.uint32),
            self.pixels[rows, faces],
        )
