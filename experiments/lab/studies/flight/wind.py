"""Wind with gusts: the air's velocity at each drone at each moment, chosen by a seed.

RotorPy has gusts as well, but they require torch, which nothing else needs, and have no seed.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray

_FEET = 0.3048  # m
_LOWEST = 10.0  # ft; the specification does not cover lower heights


class Wind(NamedTuple):
    """A mean wind with gusts as strong as in MIL-F-8785C (1980) near the ground.

    Strengths and lengths are those of Dryden's model below 1000 ft. All three components have the
    model's spectrum of the component along the wind, a first-order process. In the model, the
    components across the wind and upwards are second-order processes, with slightly less power at
    low frequencies.

    Attributes
    ----------
    speed : speed of the mean wind (m/s), the same at all heights
    seed : selects the wind's direction and the gusts
    """

    speed: float
    seed: int

    def on(self, drone: int, height: float, times: FloatArray) -> FloatArray:
        """Returns the velocity [n, 3] (m/s) of the air around a drone at evenly spaced times [n].

        Gusts on different drones are independent, which is the worst case for their distance.

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
