"""Coverage that is evaluated state by state, where a planner asks for it."""

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.model import Model
from cocap_opt.vision.views import Views


class LazyCoverage:
    """Coverage of the states of one robot class, evaluated on first use and then remembered."""

    def __init__(self, views: Views) -> None:
        self._views = views
        self._known: dict[tuple[int, int], FloatArray] = {}

    @property
    def evaluated(self) -> int:
        """Number of states evaluated so far."""
        return len(self._known)

    def __call__(self, t: int, states: IntArray) -> FloatArray:
        """Coverage [n, F] in px/m2 of states [n] at step t."""
        new = [s for s in states.tolist() if (t, s) not in self._known]
        if new:
            rows = self._views.coverage(t, np.array(new, dtype=np.int64))
            self._known.update(zip(((t, s) for s in new), rows, strict=True))
        return np.array([self._known[t, s] for s in states.tolist()])

    @classmethod
    def of_robots(cls, model: Model) -> "list[LazyCoverage]":
        """Make fresh lazy coverage [R]; the robots of a class share one source."""
        sources = {c.robots: cls(model.views(c)) for c in model.classes}
        return [sources[robot_class.robots] for robot_class in model.class_of]
