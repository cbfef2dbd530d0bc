"""Rules against collisions between robots."""

import math

from cocap_opt.data import LARGEST, Data, require, within


class CollisionRules(Data, frozen=True):
    """The conflicts between robots that are forbidden.

    Planners, formulations and referee learn it from here only. The vertex rule forbids two
    robots in one cell at one step (layers count, headings do not), the swap rule that two robots
    exchange cells in one step, and the separation rule that two robots' cell centres are nearer
    than this many metres at one step.

    Attributes
    ----------
    vertex : True: no two robots in one cell at one step
    swap : True: no two robots exchange cells in one step
    separation : m, least distance of cell centres at each step; 0: no such rule
    """

    vertex: bool = True
    swap: bool = True
    separation: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        within(self.separation, 0, LARGEST, "separation", "m")
        require(
            self.vertex or not (self.swap or self.separation),
            "vertex",
            "must be true where the swap or separation rule is on",
        )

    def too_near(self, way: tuple[float, float, float]) -> bool:
        """Returns True if robots break a rule when this way (m) leads from one to the other."""
        apart = math.hypot(*way)
        return self.vertex and (apart == 0 or apart < self.separation)

    @property
    def none(self) -> bool:
        """True if robots may pass through each other."""
        return not self.vertex

    def __str__(self) -> str:
        names = [name for name in ("vertex", "swap") if getattr(self, name)]
        if self.separation:
            names.append(f"separation {self.separation:g} m")
        return "+".join(names) or "none"


NO_RULES = CollisionRules(vertex=False, swap=False)
PAPER_RULES = CollisionRules(vertex=True, swap=False)
