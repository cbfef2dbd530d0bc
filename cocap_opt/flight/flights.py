"""Flights of plans, checked before they are flown, and their rows for tables and files."""

import math
from collections.abc import Iterator
from datetime import datetime
from typing import Any, NamedTuple

import numpy as np

from cocap_opt.data import LARGEST, FieldError, FloatArray, ProblemError
from cocap_opt.flight.earth import Geodesy
from cocap_opt.flight.filming import parts_of, view_reward
from cocap_opt.flight.notes import Kind, Note
from cocap_opt.flight.pace import Demand
from cocap_opt.flight.safety import Danger, Nearest, dangers
from cocap_opt.flight.smooth import Smooth, spare
from cocap_opt.flight.strain import steep_ground, sufficient_step
from cocap_opt.flight.trajectory import Samples, Trajectory
from cocap_opt.problem import BODY, Airspace, Plan, Problem
from cocap_opt.referee import Verdict, check
from cocap_opt.text import significant

PER_STEP = 10  # default number of rows per step of a smooth flight
MOST_ROWS = 5_000_000
_TOUCH = 1e-6  # m; smaller values are rounding errors
_EVEN = ", even with the quickest changes of speed; "
_UNITS = {"speed": "m/s", "climb": "m/s", "descent": "m/s", "acceleration": "m/s2",
          "yaw_rate": "deg/s", "gimbal_rate": "deg/s"}  # fmt: skip
_ANGLES = "yaw_rate", "gimbal_rate"  # computed in rad/s
FAST = 23.0  # m/s; camera drones reach 16 to 23 m/s
STRONG = 5.0  # m/s2; drones that tilt by up to 25 or 35 degrees reach 4.6 or 6.9


class LimitError(ProblemError):
    """A drone cannot fly this flight.

    Attributes
    ----------
    step : length of a step in s with which the same plan could be flown
    any_plan : length of a step in s with which any plan could be flown
    way_out : another remedy, appended to the message; empty if there is none
    """

    def __init__(self, words: str, step: float, any_plan: float, way_out: str = "") -> None:
        self.words, self.step, self.any_plan, self.way_out = words, step, any_plan, way_out
        super().__init__(f"{words}{way_out}; to fly this plan, use steps of {step:g} s")


class Flight(NamedTuple):
    """The flights of a plan, which obey the scene's rules and the drones' limits.

    Attributes
    ----------
    flown : the flights, straight or smooth
    straight : the straight flights of the plan
    verdict : the referee's verdict on the plan
    geodesy : None if the scene is not georeferenced
    demands : the largest demand of each kind on each drone
    slowed : steps of drones at which they pass more slowly than possible
    shortened : steps of drones at which they change speed in less time than possible
    start : time of step 0, with its offset from UTC; None if unspecified
    asked : the scene's airspace, if drones fly closer to people than it says; else None
    cut_short : remark on how complete the plan was at a limit; empty if it is complete
    """

    flown: Trajectory
    straight: Trajectory
    plan: Plan
    verdict: Verdict
    geodesy: Geodesy | None
    demands: list[Demand]
    slowed: int
    shortened: int
    start: datetime | None = None
    asked: Airspace | None = None
    cut_short: str = ""

    @classmethod
    def of(cls, problem: Problem, plan: Plan, smooth: bool) -> "Flight":
        """Returns the flights of a plan, in a scene with a step length.

        Raises
        ------
        ProblemError
            If the plan breaks a rule, or its flights do so between the steps, or a drone cannot fly
            them, or the scene's place on the Earth cannot be computed; the message is one line.
        """
        verdict = check(problem, plan)
        broken = (*verdict.violations, *verdict.conflicts)
        if broken:
            raise ProblemError(f"{broken[0]}; flights must obey the scene's rules")
        straight = Trajectory.straight(problem, plan)
        flown, found, slowed, shortened = (
            Smooth.of(problem, plan) if smooth else Smooth(straight, tuple(dangers(straight)), 0, 0)
        )
        if found:
            raise ProblemError(f"{found[0]}{_way_out(found[0], straight) if smooth else ''}")
        asked = Demand.all_of(flown, smooth)
        _require_limits(problem, asked, flown.step, smooth, shortened)
        return cls(flown, straight, plan, verdict, _geodesy(problem), asked, slowed, shortened)

    @property
    def is_smooth(self) -> bool:
        """True if speeds are continuous."""
        return self.flown is not self.straight

    def columns(self, every: float | None = None) -> dict[str, FloatArray]:
        """Returns the flights as columns: drone, t (s), x, y, z (m), yaw, pitch (degrees), ..

        The names of heights give their datum: the scene's zero (z), the ground if it is known, the
        surface below the drone's first place or at its home (`above_takeoff` or `above_home`; not
        for drones in the air), and the sea or the ellipsoid.

        Parameters
        ----------
        every : time between rows in s; None: a row per step, or ten per step for smooth flights
        """
        problem = self.flown.problem
        found = self.samples(every)
        x, y, z = found.place.T
        columns = {
            "drone": found.drone, "t": found.t, "x": x, "y": y, "z": z,
            "yaw": np.degrees(found.yaw), "pitch": np.degrees(found.pitch),
        }  # fmt: skip
        height_map = problem.height_map
        if height_map.knows_ground:
            columns["above_ground"] = z - height_map.ground[height_map.cells_below(found.place)]
        if not problem.begins_in_the_air:
            homes = [robot.home for robot in problem.robots if robot.home is not None]
            name = "above_home" if homes else "above_takeoff"
            surfaces = (
                height_map.heights[tuple(np.array(homes).T)] if homes else self.flown.start_surfaces
            )
            columns[name] = z - surfaces[found.drone]
        if self.geodesy is not None:
            columns["latitude"], columns["longitude"] = self.geodesy.degrees(x, y)
        if problem.earth is not None and problem.earth.heights is not None:
            columns[f"above_{problem.earth.heights}"] = z + problem.earth.base
        return columns

    def samples(self, every: float | None = None) -> Samples:
        """Returns the drones' positions and angles at the moments of `columns`."""
        return self.flown.at(self._moments(every))

    def off_between_rows(self, every: float | None) -> float:
        """Returns the largest distance (m) of the flight from straight lines between rows."""
        return self.flown.distance_from_chords(self._moments(every))

    def between_rows(self, every: float | None, rows: str = "rows") -> Iterator[Note]:
        """Yields a note on straight lines between rows, if they differ from the flight."""
        off = self.off_between_rows(every)
        if off > _TOUCH:
            yield Note(
                f"{rows} are on the flight that was checked; straight lines between them leave "
                f"it by up to {off:.2g} m: use a smaller --every to keep closer to it"
            )

    def record(self) -> dict[str, Any]:
        """Returns the kind, duration, distances and rewards of the flights as a whole."""
        problem, least = self.flown.problem, self.flown.least_distance()
        parts, close = parts_of(problem), Nearest.of_people(self.flown)
        found: dict[str, Any] = {
            "flight": "smooth" if self.is_smooth else "straight",
            "step": self.flown.step,
            "duration": self.flown.seconds,
            "least_distance": least if math.isfinite(least) else None,
            "people_distance": None if close is None else close.distance,
            "reward": self.verdict.reward,
            "reward_straight": view_reward(self.straight, parts) + self.verdict.reward_moves,
        }
        if self.is_smooth:
            smooth = view_reward(self.flown, parts) + self.verdict.reward_moves
            found |= {
                "reward_smooth": smooth,
                "smoothing_cost": 1 - smooth / found["reward_straight"]
                if found["reward_straight"] > 0
                else None,
                "deviation": self.flown.distance_from(self.straight),
                "slowed": self.slowed,
                "shortened": self.shortened,
            }
        if self.geodesy is not None:
            found |= {"crs": self.geodesy.name, "accuracy": self.geodesy.accuracy}
        return found

    def rows(self) -> list[dict[str, Any]]:
        """Returns the most demanding moment of each drone."""
        rows = []
        for demand in Demand.tightest(self.demands):
            scale = _scale(demand)
            limit = None if demand.limit is None else demand.limit * scale
            rows.append({
                "drone": demand.drone, "tightest": demand.kind.replace("_", " "),
                "at (s)": demand.t, "value": demand.most * scale, "limit": limit,
                "unit": _UNITS[demand.kind],
                "of the limit": None if limit is None else f"{100 * demand.share:.0f} %",
            })  # fmt: skip
        return rows

    def notes(self) -> Iterator[Note]:
        """Yields notes on what was not checked or is unknown, followed by how to read the axes."""
        yield from self.nearer_to_people()
        yield from self._left_open()
        yield from self.axes()

    def nearer_to_people(self) -> Iterator[Note]:
        """Yields a note on how close to people drones may come, if that is closer than the scene
        says.
        """
        if self.asked is not None:
            kept = self.flown.problem.airspace
            nearer, asked = f"{kept.people_aside:g} m aside", f"{self.asked.people_aside:g}"
            if kept.people_above is not None:
                nearer += f" or {kept.people_above:g} m over heads"
                asked += f" and {self.asked.people_above:g}"
            yield Note(
                f"--margin lets drones come closer to people: {nearer}; the scene requires "
                f"{asked} m"
            )

    def _left_open(self) -> Iterator[Note]:
        """Yields notes on what was not checked or is unknown, and on drones that are already in the
        air.
        """
        problem = self.flown.problem
        if problem.begins_in_the_air:
            numbers = ", ".join(f"drone {i} is {r.number}" for i, r in enumerate(problem.robots))
            yield Note(
                "the scene is the rest of a mission: drones hover at their first places until all "
                f"begin; in the mission {numbers}"
            )
        if not self.is_smooth:
            yield Note(
                "speeds are discontinuous at each step, so acceleration was not checked",
                Kind.UNCHECKED,
                "smooth flights (--smooth) have continuous speeds",
            )
        yield from self.near_without_rule()
        if any(robot.motion.corner_cutting for robot in problem.robots):
            yield Note(
                "the scene lets drones cut corners: walls were checked only at the steps",
                Kind.UNCHECKED,
            )
        yield from self._unknown_limits()
        if problem.earth is not None and problem.earth.heights is None:
            yield Note("height datum unknown", remedy="set `heights` under [earth] of a recipe")

    def _most_without_limit(self) -> dict[str, Demand]:
        """Returns, by kind, the largest demand > 0 on a drone whose limit is unknown."""
        most: dict[str, Demand] = {}
        for demand in sorted(self.demands, key=lambda demand: -demand.most):
            if demand.limit is None and demand.most > 0:
                most.setdefault(demand.kind, demand)
        return most

    def _unknown_limits(self) -> Iterator[Note]:
        """Yields a note on the limits that drones do not have, with the most that the flight
        demands of such drones.
        """
        most = self._most_without_limit()
        if all(robot.limits is None for robot in self.flown.problem.robots):
            which, told = "the limits of these drones", [most.get("acceleration")]
        elif most:
            which, told = "some limits of the drones", [*most.values()]
        else:
            return
        asked = ", ".join(_told_demand(demand) for demand in told if demand is not None)
        required = f"; the flight requires {asked}" if asked else ""
        yield Note(f"{which} are unknown and were not checked{required}", Kind.UNCHECKED)

    def beyond_most_drones(self) -> Iterator[Note]:
        """Yields notes on the highest speed and the strongest acceleration of drones whose limits
        are unknown, if few drones can do it.
        """
        most = self._most_without_limit()
        fastest, strongest = most.get("speed"), most.get("acceleration")
        if fastest is not None and fastest.most > FAST:
            yield Note(
                f"drone {fastest.drone} has to fly {fastest.most:,.1f} m/s at {fastest.t:.1f} s, "
                f"and its limit is unknown: few drones fly {FAST:g} m/s",
                Kind.URGENT,
                "are the steps and cells right? set `airframe` or `limits` under [[drones]]",
            )
        if strongest is not None and strongest.most > STRONG:
            yield Note(
                f"drone {strongest.drone} has to accelerate by {strongest.most:,.1f} m/s2 at "
                f"{strongest.t:.1f} s, and its limit is unknown: at {STRONG:g} m/s2 a drone "
                "already tilts by 27 degrees",
                Kind.URGENT,
                "set `limits = { acceleration = 4 }` or the like under [[drones]], and plan again",
            )

    def near_without_rule(self) -> Iterator[Note]:
        """Yields a note on how close drones come to each other, if no rule requires a distance.

        Yields nothing if that is too close, which `too_near` reports.
        """
        nearest = Nearest.of_drones(self.flown)
        if self.flown.problem.rules.separation or nearest is None or nearest.is_too_near:
            return
        kind = "smooth" if self.is_smooth else "straight"
        yield Note(
            "the scene has no rule on the distance of drones between the steps: on this "
            f"{kind} flight they come within {nearest.distance:.2f} m of each other",
            Kind.NO_RULE,
        )

    def too_near(self) -> Iterator[Note]:
        """Yields notes on drones that come too close to each other or to people, if no rule forbids
        it.

        Too close means closer than the default distances of flown scenes.
        """
        yield from self._drones_too_near()
        asked = self.asked or self.flown.problem.airspace
        if nearest := Nearest.of_people_without_rule(self.flown, asked):
            yield Note(
                f"drone {nearest.first} comes within {nearest.distance:.2f} m of "
                f"{self.flown.problem.person(nearest.second)}"
                f"{self.flown.problem.actors[nearest.second].told_swerve} at {nearest.t:.1f} s, "
                "seen from above; the scene has no rule on people",
                Kind.URGENT,
                "plan with `people` under [airspace]",
            )

    def _drones_too_near(self) -> Iterator[Note]:
        """Yields a note on the closest approach of two drones, if it is too close."""
        nearest = Nearest.of_drones(self.flown)
        if self.flown.problem.rules.separation or nearest is None:
            return
        drones = f"drones {nearest.first} and {nearest.second}"
        when, remedy = f"at {nearest.t:.1f} s", "plan with `separation` under [rules]"
        if nearest.distance < BODY:
            words = f"{drones} collide {when} ({nearest.distance:.2f} m apart)"
            yield Note(words, Kind.URGENT, remedy)
        elif nearest.is_too_near:
            words = f"{drones} come within {nearest.distance:.2f} m of each other {when}"
            yield Note(words, Kind.URGENT, remedy)

    def axes(self) -> Iterator[Note]:
        """Yields a note on the direction of the axes, and on the angle between grid north and true
        north.
        """
        if self.geodesy is None:
            return
        turned = self.geodesy.convergence(*self.flown.problem.height_map.centre(0, 0))
        side = "clockwise" if turned > 0 else "counter-clockwise"
        yield Note(
            f"x points to the east and y to the north of {self.geodesy.name}; this north is "
            f"{abs(turned):.2f} degrees {side} of true north here",
            Kind.READING,
        )

    def _moments(self, every: float | None) -> FloatArray:
        """Returns the times (s) of rows."""
        usual = self.flown.step / (PER_STEP if self.is_smooth else 1)
        return _moments(self.flown, usual if every is None else every)


def _scale(demand: Demand) -> float:
    """Returns the factor from a demand's unit to the unit in which people read it."""
    return 180 / math.pi if demand.kind in _ANGLES else 1.0


def _told_demand(demand: Demand) -> str:
    """Returns a demand in words, e.g. "acceleration 12.1 m/s2 (drone 2)"."""
    value = f"{significant(demand.most * _scale(demand), 3)} {_UNITS[demand.kind]}"
    return f"{demand.kind.replace('_', ' ')} {value} (drone {demand.drone})"


def _moments(flown: Trajectory, every: float) -> FloatArray:
    """Returns times (s) from 0 to the end, with the given spacing; includes the end."""
    if not 0 < every <= LARGEST:  # True for nan, too
        words = f"must be a number of seconds > 0 and at most {LARGEST:,.0f}, not {every!r}"
        raise FieldError("every", words)
    rows = flown.seconds / every * len(flown.pieces)
    if rows > MOST_ROWS:
        raise FieldError("every", f"must make at most {MOST_ROWS} rows, not {rows:.3g}")
    count = math.floor(flown.seconds / every + 1e-9)
    times = np.round(np.arange(count + 1) * every, 9)
    if flown.seconds - times[-1] > 1e-9 * flown.seconds:
        times = np.append(times, flown.seconds)
    return times


def _geodesy(problem: Problem) -> Geodesy | None:
    if problem.earth is None:
        return None
    try:
        return Geodesy(problem.earth, problem.height_map.centre(0, 0))
    except FieldError as error:
        raise FieldError(f"earth.{error.field}", error.allowed) from error


def _way_out(danger: Danger, straight: Trajectory) -> str:
    """Returns a remedy if no smooth flight is safe: the additional distance that a plan must
    keep.
    """
    if same := dangers(straight):
        return f"{_EVEN}the straight flight is not safe either: {same[0]}"
    problem, other = straight.problem, "the straight flight is safe: omit --smooth"
    if danger.person is None:
        return f"{_EVEN}{other}"
    (drone,), airspace = danger.drones, problem.airspace
    margin = math.ceil(100 * spare(problem, problem.robots[drone])) / 100
    larger = f"people = {_up(airspace.people_aside + margin)}"
    if airspace.people_above is not None:
        larger += f" and over_people = {_up(airspace.people_above + margin)}"
    return (
        f"{_EVEN}plan with {larger} in [airspace], and fly that plan with --margin {_up(margin)}; "
        f"for this plan {other}"
    )


def _up(metres: float) -> str:
    """Returns a distance, rounded up to centimetres."""
    return f"{math.ceil(100 * metres - _TOUCH) / 100:.2f}".rstrip("0").rstrip(".")


def _require_limits(
    problem: Problem, found: list[Demand], step: float, is_smooth: bool, shortened: int
) -> None:
    """Raises an error, with the shortest sufficient step, if a drone cannot fly the flights."""
    broken = [demand for demand in found if not demand.is_kept]
    if not broken:
        return
    worst = max(broken, key=lambda demand: demand.slower)
    scale = 180 / math.pi if worst.kind in _ANGLES else 1.0
    limit = (worst.limit or 0.0) * scale
    shorter = ""
    if shortened and worst.kind == "acceleration":
        shorter = ", because it changes its speed quickly to keep away from people"
    flown, robot = problem.replace(step=step), problem.robots[worst.drone]
    steep = steep_ground(flown, robot, worst.kind, is_smooth)
    same = math.ceil(100 * step * worst.slower) / 100
    usual = sufficient_step(problem, is_smooth)
    enough = usual if step < usual else sufficient_step(problem, True, shortened=True)
    raise LimitError(
        f"drone {worst.drone} cannot fly this: {worst.kind.replace('_', ' ')} "
        f"{worst.most * scale:.4g} {_UNITS[worst.kind]} at {worst.t:.4g} s, more than its "
        f"{limit:.4g}{shorter}",
        same,
        max(same, enough),
        steep,
    )
