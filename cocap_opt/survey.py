"""What is known of views without casting rays, once so many are asked for that it pays.

Planners that look at few states never pay for it. It changes no view's value.
"""

import math

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.problem import Problem
from cocap_opt.sightlines import Heights, Known, Sightlines
from cocap_opt.visibility import TOUCH, sample_points

AT_ONCE = 8  # sectors, so that limits are asked for often
MOST_CELLS = 1 << 17  # of a map, to bound the memory
SINGLE = 1e-5  # of a coordinate, much more than rays lose by their single precision


class Survey:
    """Sightlines at some flight heights.

    Parameters
    ----------
    layers : m, the flight heights
    margin : m, by which a ray may be off its way
    """

    def __init__(self, problem: Problem, layers: tuple[float, ...], margin: float) -> None:
        self._problem, self._eyes, self._margin = problem, layers, margin
        self._layers: list[Sightlines] = []
        self._missing = _worth(problem, len(layers), margin)

    @property
    def started(self) -> bool:
        """Whether so many views were asked for that it pays."""
        return bool(self._layers)

    @property
    def whole(self) -> bool:
        """Whether there is something to know."""
        return bool(self._layers) and self._layers[-1].whole

    def ask(self, views: int) -> None:
        """Say that so many views of an actor are wanted; goes on with the survey if it pays."""
        self._missing -= views
        if self._missing > 0 or self.whole:
            return
        if not self._layers:
            self._layers = [
                Sightlines(self._problem.height_map, _heights(self._problem, eye), self._margin)
                for eye in self._eyes
            ]
        next(lines for lines in self._layers if not lines.whole).look(AT_ONCE)

    def known(self, at: IntArray, ways: FloatArray, radii: FloatArray) -> Known:
        """What is known of all actors from the middles of cells.

        Parameters
        ----------
        at : [3, n] layer, x and y
        ways : [n, A, 2] m, from there to the actors' middles
        radii : [A] m, of the circles in which the actors are
        """
        hidden, clear = np.zeros((2, *ways.shape[:2]), dtype=bool)
        if not self.whole:
            return Known(hidden, clear)
        layer, x, y = at
        width, depth = self._problem.height_map.shape
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < depth)
        for k, lines in enumerate(self._layers):
            here = np.flatnonzero(inside & (layer == k))
            cells = x[here] * depth + y[here]
            hidden[here], clear[here] = lines.known(cells, ways[here], radii)
        row, actor = np.nonzero(clear)
        clear[row, actor] = _alone(ways[row], actor, radii + self._margin)
        return Known(hidden, clear)


def ray_margin(problem: Problem, origin: FloatArray) -> float:
    """How far off its way a ray may be (m), if it is cast in coordinates from `origin` [3]."""
    height_map, steps = problem.height_map, problem.horizon + 1
    low = np.array(height_map.origin)
    ends = [low - origin[:2], low + np.array(height_map.shape) * height_map.resolution - origin[:2]]
    ends += [height_map.heights - origin[2], height_map.altitudes(problem.layers) - origin[2]]
    for actor in problem.actors:
        ends += [actor.poses[:steps, :3] - origin, *actor.shape.faces()]
    return 2 * TOUCH + SINGLE * max(float(np.abs(end).max()) for end in ends)


def _worth(problem: Problem, layers: int, margin: float) -> float:
    """How many views of an actor take twice as long by rays as the survey, roughly.

    It never pays where little would be known, and holds for one flight height above columns
    only: not where drones follow a datum, and not where there are meshes.
    """
    if problem.meshes or problem.height_map.datum is not None:
        return math.inf
    cells = problem.height_map.heights.size
    if cells > MOST_CELLS or margin > problem.height_map.resolution / 8:
        return math.inf
    return layers * max(problem.height_map.shape) * (cells + 10_000) / 15


def _heights(problem: Problem, eye: float) -> Heights:
    """Heights between a camera and all that rays are sent to from it."""
    lowest, highest = [eye], [eye]
    for actor in problem.actors:
        feet, faces = actor.poses[: problem.horizon + 1, 2], actor.shape.faces()
        points = [sample_points(face, problem.face_samples)[0] for face in faces]
        lowest.append(float(feet.min() + np.concatenate(points)[:, 2].min()))
        highest.append(float(feet.max() + np.concatenate(faces)[:, 2].max()))
    return Heights(eye, min(lowest), max(highest))


def _alone(ways: FloatArray, actor: IntArray, radii: FloatArray) -> BoolArray:
    """Whether no other actor can be between a camera and an actor [n].

    Parameters
    ----------
    ways : [n, A, 2] m, from the cameras to the middles of all actors
    actor : [n] which one is looked at
    radii : [A] m, of the circles in which the actors are
    """
    row = np.arange(len(actor))
    way = ways[row, actor][:, None]
    square = way[..., 0] ** 2 + way[..., 1] ** 2
    along = ways[..., 0] * way[..., 0] + ways[..., 1] * way[..., 1]
    # All rays are within the actor's radius of the one to its middle.
    share = np.clip(along / np.where(square > 0, square, 1.0), 0.0, 1.0)
    off = ways - share[..., None] * way
    distance = np.sqrt(off[..., 0] ** 2 + off[..., 1] ** 2)
    apart = distance > radii + radii[actor][:, None]
    apart[row, actor] = True
    result: BoolArray = np.all(apart, axis=1)
    return result
