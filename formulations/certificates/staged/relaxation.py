"""A concave relaxation of the completions of a partial joint state.

At a node of the search some robots have their states, and together see z_f of each face f. The
remaining robots add c_f(s) for the states s that they take. The gain of a face is concave and 0 at
0,

    psi_f(y) = phi_f(z_f + y) - phi_f(z_f),

so that for any alpha from 0 to 1 and beta >= 0, as for certificates (`cocap_opt.returns`),

    psi_f(sum c) <= alpha sum psi_f(c) + beta sum c + kappa,
    kappa = sup over y >= 0 of (1 - alpha) psi_f(y) - beta y.

With alpha = 1 for all faces, this is the sum of the largest gains, which the search uses for
pruning anyway. This bound is weak if several robots see the same faces; tangents, alpha = 0, are
stronger there.

A joint state is relevant if it meets several conditions at once, each of the form

    constant - sum of payments of its states (+ gains of the faces) > 0:

its profit exceeds the least profit asked for, its worth less charges is not below the floor, and
each ceiling leaves room. A sum of these conditions, weighted with shares >= 0, is then above 0,
too; the right-hand sides above turn it into a sum over states. Its maximum is found by taking the
best states one by one, at most one from each set of mutually conflicting states. If even the
maximum is not above 0, no completion of this node is relevant, and a state whose sum with the best
other states is not above 0 can be dropped.

Any alpha, beta and shares give a valid bound. Good ones are found by the conditional gradient
method: each round moves a mixture of states a little towards the best states, and the prices are
the slopes at the mixture. If the mixture meets all conditions, no prices can prune the node.

Example: late in the proof of scene `field`, seed 12, the searches at its twenty steps take 0.24
million nodes and 9 s instead of 12.6 million and 89 s.
"""

from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates.staged.joint_states import JointStates

ROUNDS = 60  # rounds of conditional gradients at a node; half of the nodes take fewer than four
ROBOTS = 2  # smallest number of remaining robots: with one, each state is checked by itself
STEP = 30.0  # a round moves 2 / (STEP + round) of the way; a node begins near its parent's mixture
# how sharply alpha falls from 1 to 0 where joint gains fall below the sum of single gains
BEND = 8.0
HEAT = 0.01  # relative to the lowest condition; conditions within this range get a share, too
# relative to the share of the lowest condition; smaller shares are left out, as they cost time only
LEAST_SHARE = 1e-4
# smallest remaining share of the parent's mixture with which a node starts from it
LEAST_MASS = 0.3
# of the most that a state sees of a face: tangents touch the root at no fewer pixels
LEAST_PIXELS = 1 / 16
ROOM = 4.0  # multiple of a search's margin that allows for rounding here


class Conditions(NamedTuple):
    """Conditions on completions of a node: constant - payments, possibly + gains, must be > 0.

    Attributes
    ----------
    constants : [P] of the node
    payments : [P, n] of all states; the gains count in the first two conditions
    """

    constants: FloatArray
    payments: FloatArray


class _Mixture(NamedTuple):
    """A convex combination of completions, with its values for faces and conditions."""

    shares: FloatArray  # [m] of each state that may be taken
    pixels: FloatArray  # [F] in addition to the pixels seen so far
    gains: FloatArray  # [F] sum of the gains of single states
    values: FloatArray  # [P] of the conditions, without gains


class _Prices(NamedTuple):
    """The right-hand side of the inequality for the sum of the conditions."""

    constant: float
    worth: FloatArray  # [m] of each state that may be taken


class Relaxation:
    """The relaxation of a node.

    Parameters
    ----------
    joint : the joint states to search
    pixels : [F] seen so far
    counts : remaining robots of each class
    states : [m] positions of the states that may be taken, class by class
    """

    def __init__(
        self,
        joint: JointStates,
        conditions: Conditions,
        pixels: FloatArray,
        counts: tuple[int, ...],
        states: IntArray,
    ) -> None:
        self._joint, self._counts, self._pixels = joint, counts, pixels
        self._constants = conditions.constants
        self._payments = conditions.payments[:, states]
        self._classes, self._cliques = joint.class_of[states], joint.cliques[states]
        self._amounts = joint.pixels[states]
        self._seen = joint.returns.values(pixels)
        self._gains = joint.returns.values(pixels + self._amounts) - self._seen
        self.kept: BoolArray = np.ones(len(states), dtype=np.bool_)
        self.shares: FloatArray = np.zeros(len(states))

    def run(self, above: FloatArray) -> None:
        """Drops irrelevant states from `kept`, and stores the mixture in `shares`.

        Parameters
        ----------
        above : [m] share of each state in the mixture of the parent node
        """
        first = 0 if np.isfinite(self._constants[0]) else 1
        picks = self._picks(self._gains @ self._joint.weights - self._payments[first])
        if picks is None:
            self.kept[:] = False
            return
        mixture = self._mixed(self._begun(above, picks))
        heat = 0.0
        for k in range(ROUNDS):
            slopes, high, kappa = self._slopes(mixture)
            values = mixture.values + np.where(np.arange(len(mixture.values)) < 2, high, 0.0)
            lowest = float(values.min())
            if lowest > 0:
                break
            # if all conditions are 0, any value will do
            heat = heat or max(-HEAT * lowest, self._joint.margin) or 1.0
            shares = np.exp((lowest - values) / heat)
            shares[shares < LEAST_SHARE] = 0.0
            prices = self._prices(shares, slopes, kappa)
            picks = self._picks(prices.worth)
            if picks is None:
                self.kept[:] = False
                break
            if self._drop(prices, picks):
                break
            step = np.zeros(len(self.kept))
            np.add.at(step, picks, 1.0)
            share = 2 / (STEP + k)
            mixture = self._mixed((1 - share) * mixture.shares + share * step)
        self.shares = mixture.shares

    def _begun(self, above: FloatArray, picks: IntArray) -> FloatArray:
        """Returns the initial shares: those of the parent node, if enough of them remains."""
        shares = np.zeros(len(self.kept))
        for c, count in enumerate(self._counts):
            if not count:
                continue
            of_class = np.where(self._classes == c, above, 0.0)
            mass = float(of_class.sum())
            if mass <= LEAST_MASS * count:
                shares[:] = 0.0
                np.add.at(shares, picks, 1.0)
                return shares
            shares += of_class * (count / mass)
        return shares

    def _mixed(self, shares: FloatArray) -> _Mixture:
        values = self._constants - self._payments @ shares
        return _Mixture(shares, shares @ self._amounts, shares @ self._gains, values)

    def _slopes(self, mixture: _Mixture) -> tuple[tuple[FloatArray, FloatArray], float, float]:
        """Returns alpha and beta [F] times the weights, the gains, and the sum of kappas."""
        n, returns, weights = self._joint.returns.n_roots, self._joint.returns, self._joint.weights
        together = returns.values(self._pixels + mixture.pixels) - self._seen
        together[n:] = returns.caps - self._seen[n:]
        bent = np.divide(
            mixture.gains - together, together, out=np.zeros(len(weights)), where=together > 0
        )
        alpha = np.where(together > 0, np.clip(0.5 - BEND * bent, 0.0, 1.0), 1.0)
        alpha[mixture.gains <= 0] = 1.0
        beta, kappa = np.zeros(len(weights)), (1 - alpha) * together
        squares = self._pixels + np.maximum(mixture.pixels, LEAST_PIXELS * self._joint.most_pixels)
        roots = np.sqrt(squares[:n])
        np.divide(1 - alpha[:n], 2 * roots, out=beta[:n], where=roots > 0)
        kappa[:n] = (1 - alpha[:n]) * (roots - self._seen[:n])
        kappa[:n] -= beta[:n] * (squares[:n] - self._pixels[:n])
        high = float(weights @ np.minimum(mixture.gains, together))
        return (alpha * weights, beta * weights), high, float(weights @ kappa)

    def _prices(
        self, shares: FloatArray, slopes: tuple[FloatArray, FloatArray], kappa: float
    ) -> _Prices:
        """Returns the right-hand side for shares [P] of the conditions, which need not add up to
        1.
        """
        shares = shares / shares.sum()
        gaining, taken = float(shares[:2].sum()), shares > 0
        worth = gaining * (self._gains @ slopes[0] + self._amounts @ slopes[1])
        worth -= shares @ self._payments
        return _Prices(gaining * kappa + float(shares[taken] @ self._constants[taken]), worth)

    def _picks(self, worth: FloatArray) -> IntArray | None:
        """Returns the best states for the remaining robots, those of each class in descending
        order.

        Returns None if there are too few states.
        """
        picks = []
        for c, count in enumerate(self._counts):
            of_class = np.flatnonzero((self._classes == c) & self.kept)
            if not count:
                continue
            best = of_class[np.argsort(-worth[of_class], kind="stable")]
            if self._joint.conflicts.may_repeat:
                best = np.repeat(best[:1], count)
            else:
                _, first = np.unique(self._cliques[best], return_index=True)
                best = best[np.sort(first)[:count]]
            if len(best) < count:
                return None
            picks.append(best)
        return np.concatenate(picks)

    def _drop(self, prices: _Prices, picks: IntArray) -> bool:
        """Drops states whose sum is not above 0; returns True if no state remains."""
        room = ROOM * self._joint.margin
        bound = prices.constant + float(prices.worth[picks].sum())
        if bound <= -room:
            self.kept[:] = False
            return True
        last = np.full(len(self._counts), np.inf)
        np.minimum.at(last, self._classes[picks], prices.worth[picks])
        self.kept &= bound - last[self._classes] + prices.worth > -room
        return False
