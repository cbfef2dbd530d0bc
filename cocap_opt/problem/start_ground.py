"""The ground above which drones that choose their start may start."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray
from cocap_opt.problem.scene import SceneData

_MOST_NAMED = 4  # numbers of drones in a line of a legend


class StartGround(NamedTuple):
    """The ground above which some drones may start; planners choose the best place.

    Attributes
    ----------
    drones : numbers of the drones that may start there, increasing
    cells : [X, Y] True for cells of the map above which they may start at one of their heights
    """

    drones: tuple[int, ...]
    cells: BoolArray

    @classmethod
    def all_of(cls, scene: SceneData) -> list[StartGround]:
        """Returns the areas of all drones that have several possible starts."""
        found: dict[bytes, StartGround] = {}
        for number in sorted(scene.open_starts):
            cells = np.zeros(scene.height_map.shape, dtype=np.bool_)
            cells[tuple(scene.starts[number].cells[:, :2].T)] = True
            before = found.get(cells.tobytes())
            drones = (number,) if before is None else (*before.drones, number)
            found[cells.tobytes()] = cls(drones, cells)
        return list(found.values())

    @property
    def words(self) -> str:
        """Text that names the drones that may start there."""
        *most, last = map(str, self.drones)
        if not most:
            return f"drone {last} may start here"
        if len(most) < _MOST_NAMED:
            return f"drones {', '.join(most)} and {last} may start here"
        return f"drones {', '.join(most[: _MOST_NAMED - 1])} .. {last} may start here"
