"""The faces that drones see from all nodes in their reach, node by node."""

from collections.abc import Iterable

import numpy as np

from cocap_opt.graph.motion import Window
from cocap_opt.graph.networks import Node
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.problem import Problem, Robot
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.views import Views


class Sight:
    """The views of all robots that move and see alike.

    Parameters
    ----------
    spec : any of these robots

    Attributes
    ----------
    seen : the faces that nodes see, and their px/m2; nodes that see nothing are left out
    """

    def __init__(self, problem: Problem, spec: Robot) -> None:
        self.seen: dict[Node, list[tuple[int, float]]] = {}
        self._looked: set[Node] = set()
        self._steps = range(problem.first_step, problem.horizon + 1)
        alike = [
            (robot.start.x, robot.start.y)
            for robot in problem.robots
            if (robot.motion, robot.camera) == (spec.motion, spec.camera)
        ]
        window = Window.around(alike, spec.motion.radius * problem.horizon, problem.workspace)
        tilts = len(spec.camera.tilts)
        self._graph = TimeGraph.of(problem.workspace, spec.motion, tilts, window)
        self._views = Views.of(FaceGeometry(problem), problem, self._graph, spec.camera)

    def look(self, nodes: Iterable[Node]) -> None:
        """Evaluates the views of nodes; those that are known already are not evaluated again."""
        by_step: dict[int, list[int]] = {t: [] for t in self._steps}
        for state, t in set(nodes) - self._looked:
            if t in by_step:
                by_step[t].append(self._graph.index(state))
            self._looked.add((state, t))
        for t, states in by_step.items():
            ordered = np.sort(np.array(states, dtype=np.int64))
            for some in np.array_split(ordered, len(ordered) // self._views.batch + 1):
                coverage = self._views.coverage(t, some)
                for row, face in np.argwhere(coverage > 0).tolist():
                    node = self._graph.state(int(some[row])), t
                    self.seen.setdefault(node, []).append((face, float(coverage[row, face])))
