"""Weights of the objective J, which planners maximise."""

from cocap_opt.data import MOST_WEIGHT, Data, require, whole, within

# The version of coverage, the formula by which pixels are computed. Increase it by one after any
# change of pixels by more than rounding, since J then changes, too: 1, rays to sample points; 2,
# faces are cut by the shadows of convex bodies.
COVERAGE_VERSION = 2


_MOST_CAMERAS = 64
_LEAST_SHARE = 1e-6  # share of a solid angle; much more than rounding


def require_visible_share(share: float, field: str) -> None:
    """Checks the share of a person that a drone must see; the message names the field."""
    within(share, 0, 1, field)
    words = f"must be > 0, not {share!r}; with 0, all drones would see everybody"
    require(share >= _LEAST_SHARE, field, words)


class Views(Data, frozen=True):
    """The part of the objective that counts the drones that see each person.

    A point that fewer than two drones see cannot be reconstructed, however many pixels it has.
    This part is

        sum over t, people of weight x importance at t x min(cameras, number of drones that see
        the person at t).

    A drone sees a person if at least the share `at_least` of the person's unobstructed solid angle
    is visible in its image; a `Cone` camera sees everybody whom it detects. Drones are counted at
    each step, even if pixels add up over time.

    Attributes
    ----------
    cameras : k, the number of drones per person beyond which further drones add nothing
    weight : weight of one drone that sees a person at one step, in px^0.5/m; one number for all
        people or one for each
    at_least : share of the solid angle, 0 < share <= 1
    share : share of all possible views (k drones on each person at each step) that plans should
        reach; not part of J. None: no share is required
    """

    cameras: int = 2
    weight: float | tuple[float, ...] = 1.0
    at_least: float = 0.3
    share: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        whole(self.cameras, "cameras")
        within(self.cameras, 1, _MOST_CAMERAS, "cameras")
        weights = self.weight if isinstance(self.weight, tuple) else (self.weight,)
        for weight in weights:
            within(weight, 0, MOST_WEIGHT, "weight")
        require_visible_share(self.at_least, "at_least")
        if self.share is not None:
            within(self.share, 0, 1, "share")

    def require_for(self, people: int, field: str = "weight") -> None:
        """Checks that there is one weight, or one per person; the message names the field."""
        given = len(self.weights(people))
        require(
            given == people,
            field,
            f"must be one number, or one for each of the {people} people, not {given}",
        )

    def weights(self, people: int) -> tuple[float, ...]:
        """Returns the weight of each person, in px^0.5/m."""
        return self.weight if isinstance(self.weight, tuple) else (self.weight,) * people


class Objective(Data, frozen=True):
    """The weights of the objective, except the actors' face weights.

    J = pixels x sum over t, actors, faces of w sqrt(pixels of all robots at t, in px/m2)
      + sum over robots and their T moves of
          stationarity [same state] + keep_cell [same cell] + keep_heading [same heading]
          + balanced [dx + dy = 0]
      + the drones that see each person, if `views` counts them.

    Each robot is rewarded for its own moves, regardless of its views. The planner of Hughes et al.
    (2024) has `keep_heading` (0.02) and `keep_cell` (0.01). The program of Greedy Perspectives
    (Suresh et al. 2024) has `balanced` (100): it is intended to reward staying, but dx + dy is also
    0 for the two diagonal moves (+1, -1) and (-1, +1).

    With `over_time`, the pixels of a face add up over all steps before the root is taken, which is
    the other reading of CoCap's eq. 1: J = sum over actors, faces of w sqrt(pixels of all robots at
    all t) + the rewards for moves as before. Planning one robot is then no longer a dynamic
    program, but bounds and exact methods remain valid.

    Attributes
    ----------
    stationarity : reward per step in which the state does not change
    keep_cell : reward per step in the same cell, layer included
    keep_heading : reward per step with the same heading
    balanced : reward per step with dx + dy = 0 cells, in any layer
    count_start : True: the views at t = 0 count, too; they are constant if starts are fixed
    over_time : True: pixels add up over time as well as over robots
    pixels : weight of all pixels; 0: only `views` count
    views : the part of J for drones that see a person; None: there is none
    """

    stationarity: float = 0.0
    keep_cell: float = 0.0
    keep_heading: float = 0.0
    balanced: float = 0.0
    count_start: bool = False
    over_time: bool = False
    pixels: float = 1.0
    views: Views | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in ("stationarity", "keep_cell", "keep_heading", "balanced", "pixels"):
            within(getattr(self, field), 0, MOST_WEIGHT, field)
