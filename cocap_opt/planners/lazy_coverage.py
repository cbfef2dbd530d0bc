"""Lazy coverage, for low levels that need few views: each view is evaluated once and cached."""

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.model import Model, Path
from cocap_opt.problem import Problem
from cocap_opt.vision.views import StateViews


class LazyCoverage:
    """Coverage of the states of one robot class, evaluated on first use and then cached."""

    def __init__(self, views: StateViews) -> None:
        self._views = views
        self._known: dict[tuple[int, int], FloatArray] = {}

    @property
    def evaluated(self) -> int:
        """Number of states evaluated so far."""
        return len(self._known)

    def __call__(self, t: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, W] of states [n] at step t, like `StateViews.coverage`."""
        at = [(t, s) for s in states.tolist()]
        self._evaluate(at)
        return np.array([self._known[key] for key in at])

    def along(self, problem: Problem, path: Path) -> FloatArray:
        """Returns the pixels [Z] of a path, given as state numbers from step 0 on; empty if there
        is no path.
        """
        at = [(t, path[t]) for t in range(problem.first_step, len(path))]
        # all at once: evaluating a single view takes as long as hundreds together
        self._evaluate(at)
        pixels = problem.no_pixels()
        for t, state in at:
            pixels[problem.view_sums_at(t)] += self._known[t, state]
        return pixels

    def _evaluate(self, at: list[tuple[int, int]]) -> None:
        """Evaluates states at steps, (t, s), that have not been evaluated yet."""
        new = [key for key in at if key not in self._known]
        if new:
            rows = self._views.dense(np.array([t * self._views.n_states + s for t, s in new]))
            self._known.update(zip(new, rows, strict=True))

    @classmethod
    def of_robots(cls, model: Model) -> "list[LazyCoverage]":
        """Returns new lazy coverage [R]; the robots of a class share one instance."""
        sources = {c.robots: cls(model.views(c)) for c in model.classes}
        return [sources[robot_class.robots] for robot_class in model.class_of]
