"""People to be filmed."""

from functools import cached_property

import msgspec
import numpy as np

from cocap_opt.data import (
    LARGEST,
    MOST_WEIGHT,
    Data,
    FloatArray,
    frozen,
    read_only,
    require,
    within,
)
from cocap_opt.problem.shapes import Cuboid, Shape
from cocap_opt.text import printable, shortened

_LATEST = 1e12  # s; times may be counted from 1970


class Actor(Data, frozen=True, eq=False, dict=True):
    """A moving person: a shape, its pose at every step, and a weight for each face.

    Attributes
    ----------
    poses : [T+1, 4]: x, y, z of the foot point (m) and yaw (rad, from +x, ccw)
    shape : `Cuboid`, `Prism` or `TriangulatedCuboid`
    weights : one per face of the shape; None: all 1
    importance : [>= T+1] factor of the weights; None: all 1
    name : the person's name for readers; None if unspecified
    begin : time of step 0 in the person's track, s; None: there is no track
    take : name of the only take in which the person is present; None: all takes
    swerve : how far the person may be, horizontally, from the straight walk between two steps, m

    Raises
    ------
    ProblemError
        If poses are not [>= T+1, 4] finite numbers (T is checked by `Problem`), or if weights are
        out of range or not one per face.
    """

    poses: FloatArray
    shape: Shape = Cuboid()
    weights: tuple[float, ...] | None = None
    importance: tuple[float, ...] | None = None
    name: str | None = None
    begin: float | None = None
    take: str | None = None
    swerve: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        msgspec.structs.force_setattr(self, "poses", frozen(self.poses, "poses", 2))
        columns = self.poses.shape[1]
        require(columns == 4, "poses", f"must have 4 columns x, y, z, yaw, not {columns}")
        if self.weights is not None:
            faces = len(self.shape.faces())
            require(
                len(self.weights) == faces,
                "weights",
                f"must hold one weight for each of the {faces} faces, not {len(self.weights)}",
            )
            for weight in self.weights:
                within(weight, 0, MOST_WEIGHT, "weights")
        if self.name is not None:
            msgspec.structs.force_setattr(self, "name", shortened(printable(self.name)))
        if self.take is not None:
            msgspec.structs.force_setattr(self, "take", shortened(printable(self.take)))
        if self.begin is not None:
            within(self.begin, -_LATEST, _LATEST, "begin")
        within(self.swerve, 0, LARGEST, "swerve", "m")
        for value in self.importance or ():
            within(value, 0, MOST_WEIGHT, "importance")

    def nearest(self, aside: float) -> float:
        """Least distance (m) to the person, `aside` m from the straight walk, seen from above."""
        return max(aside - self.swerve, 0.0)

    @property
    def told_swerve(self) -> str:
        """Words after a distance that is less the swerve; empty on straight walks."""
        by = f"{self.swerve:.3g} m by which the person may leave the straight walk"
        return f", counting the {by}" if self.swerve else ""

    @cached_property
    def middles(self) -> FloatArray:
        """The middle of the body at each step [T+1, 3] (m)."""
        return read_only(self.poses[:, :3] + [0.0, 0.0, self.shape.height / 2])

    @cached_property
    def face_weights(self) -> FloatArray:
        """Weights of the faces of this actor [F of its shape], without its importance."""
        if self.weights is None:
            return read_only(np.ones(len(self.shape.faces())))
        return read_only(np.array(self.weights, dtype=np.float64))
