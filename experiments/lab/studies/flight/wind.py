"""Wind with gusts: what blows upon each drone at each moment, by a seed.

RotorPy has gusts as well, but only with torch, which nothing else needs, and they have no seed.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray

_FEET = 0.3048  # m
_LOWEST = 10.0  # ft, below which the specification says nothing


class Wind(NamedTuple):
    """A mean wind with gusts as strong as MIL-F-8785C (1980) has them near the ground.

    Strengths and lengths are those of Dryden's model below 1000 ft. All three components have the
    spectrum that the model gives to the one along the wind, a process of the first order; those
    across and upwards, which are of the second, have a little less at low frequencies.

    Attributes
    ----------
    speed : m/s, of the mean wind, the same at all heights
    seed : chooses its direction and the gusts
    """

    speed: float
    seed: int

    def on(self, drone: int, height: float, times: FloatArray) -> FloatArray:
        """Returns the velocity [n, 3] (m/s) of the air around a drone at evenly spaced times [n].

        Gusts on different drones have nothing in common, which is the worst for their distance.

        Parameters
        ----------
        height : m above the ground
        """
        angle = np.random.default_rng(self.seed).uniform(0, 2 * np.pi)
        along = np.array([np.cos(angle), np.sin(angle), 0.0])
        mean = np.tile(self.speed * along, (len(times), 1))
        if not self.speed:
            return mean
        rng = np.random.default_rng([self.seed, drone])
        level = max(height / _FEET, _LOWEST)
        base = 0.177 + 0.000823 * level
        upwards, lengths = 0.1 * self.speed, np.array([1.0, 1.0, base**1.2]) * level / base**1.2
        strengths = upwards * np.array([base**-0.4, base**-0.4, 1.0])
        kept = np.exp(-(times[1] - times[0]) * self.speed / (lengths * _FEET))
        gusts = rng.normal(size=(len(times), 3))
        gusts[1:] *= np.sqrt(1 - kept**2)
        for before, after in pairwise(gusts):
            after += kept * before
        axes = np.array([along, [-along[1], along[0], 0.0], [0.0, 0.0, 1.0]])
        found: FloatArray = mean + (gusts * strengths) @ axes
        return found
