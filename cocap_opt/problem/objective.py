"""Weights of the objective J, which planners maximise."""

from cocap_opt.data import MOST_WEIGHT, Data, within

# The version of coverage, the law by which the pixels of a state are computed. Whoever changes a
# number of it by more than rounding adds one here, since each J is then another:
# 1, rays to sample points; 2, faces are cut by the shadows of convex bodies.
COVERAGE_VERSION = 2


class Objective(Data, frozen=True):
    """The weights of the objective, besides the actors' face weights.

    J = sum over t, actors, faces of w sqrt(pixels of all robots at t, in px/m2)
      + sum over robots and their T moves of
          stationarity [same state] + keep_cell [same cell] + keep_heading [same heading]
          + balanced [dx + dy = 0].

    Each robot is rewarded for its own moves, whatever it sees. The planner of Hughes et al.
    (2024) has `keep_heading` (0.02) and `keep_cell` (0.01). The program of Greedy Perspectives
    (Suresh et al. 2024) has `balanced` (100): it is meant for staying, but dx + dy is 0 for the
    two diagonal moves (+1, -1) and (-1, +1) as well.

    With `over_time` the pixels of a face add up over all steps before the root is taken, the
    other reading of CoCap's eq. 1: J = sum over actors, faces of w sqrt(pixels of all robots
    at all t) + the rewards for moves as before. Planning one robot is then no longer a dynamic
    program; bounds and exact methods hold.

    Attributes
    ----------
    stationarity : reward per step in which the state does not change
    keep_cell : reward per step in the same cell, layer included
    keep_heading : reward per step with the same heading
    balanced : reward per step with dx + dy = 0 cells, layers aside
    count_start : True: the views at t = 0 count too (a constant)
    over_time : True: pixels add up over time as well as over robots
    """

    stationarity: float = 0.0
    keep_cell: float = 0.0
    keep_heading: float = 0.0
    balanced: float = 0.0
    count_start: bool = False
    over_time: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in ("stationarity", "keep_cell", "keep_heading", "balanced"):
            within(getattr(self, field), 0, MOST_WEIGHT, field)
