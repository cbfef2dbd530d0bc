"""One robot of a problem."""

from cocap_opt.data import Data, require
from cocap_opt.problem.camera import AnyCamera, Camera
from cocap_opt.problem.limits import Limits
from cocap_opt.problem.motion import Motion, State


class Robot(Data, frozen=True):
    """One camera drone: its start, motion and camera, and perhaps a goal for step T.

    Attributes
    ----------
    start : cell, layer, heading and pitch at step 0
    motion : the moves that it can make in one step
    camera : what it films with: a `Camera`, or the `Cone` of Hughes et al.
    goal : cell (x, y), any layer and orientation
    limits : how fast it may move and turn; None: nothing is known of them
    """

    start: State
    motion: Motion = Motion()
    camera: AnyCamera = Camera()
    goal: tuple[int, int] | None = None
    limits: Limits | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        require(isinstance(self.start, State), "start", "must be a State")
        sizes = self.goal is None or len(self.goal) == 2
        require(sizes, "goal", "must be a cell (x, y)")

    @property
    def orientation_sizes(self) -> tuple[int, int, int]:
        """Number of layers, headings and pitches, in the order of `State`."""
        return len(self.motion.layers), self.motion.headings, len(self.camera.tilts)
