"""Missions flown by the rules of PX4's multicopters, without wind, acceleration and rounding.

Each rule names the source file of PX4-Autopilot (1.15) that it is read from, and can be left out.
"""

import math
from collections.abc import Collection, Iterator

from mission_rows import Moment, Row, angle_between, ground_metres

TYPES = "a speed's type has no meaning"  # navigator/navigator_main.cpp, Navigator::run
GROUND = "cruise speed is over the ground"  # motion_planning/PositionSmoothing.cpp
CLIMBS = "climbs and descents have limits of their own"  # tasks/Auto/FlightTaskAuto.cpp
CRUISE = "cruise speed has a limit"  # tasks/Auto/FlightTaskAuto.cpp
LOOKS = "a waypoint waits until the drone looks there"  # navigator/mission_block.cpp
HOLDS = "a hold counts from the place on"  # navigator/mission_block.cpp
DELAYS = "a delay is waited"  # navigator/mission_block.cpp
RULES = TYPES, GROUND, CLIMBS, CRUISE, LOOKS, HOLDS, DELAYS

XY_VEL_MAX, Z_UP, Z_DOWN = 12.0, 3.0, 1.5  # m/s, defaults of mc_pos_control
TURN_RATE, YAW_ERROR = 45.0, 12.0  # degrees/s, degrees: MPC_YAWRAUTO_MAX, MIS_YAW_ERR
XY_CRUISE = 5.0  # m/s


def px4_moments(rows: list[Row], without: Collection[str] = ()) -> Iterator[Moment]:
    """Flies a mission: when and where each item ends, from the end of the wait at its start."""
    assert rows[0].command == 22 and rows[-1].command == 17
    place, heading = tuple(rows[0].params[4:]), rows[0].params[3]
    goal_yaw, pitch, t = heading, math.nan, math.nan
    speeds = {1.0: XY_CRUISE, 2.0: Z_UP, 3.0: Z_DOWN}

    def turned(seconds: float) -> float:
        """The heading after so many seconds of turning to where the drone shall look."""
        way = angle_between(heading, goal_yaw)
        return heading + math.copysign(min(abs(way), TURN_RATE * seconds), way)

    for row in rows:
        first, second = row.params[:2]
        if row.command == 178:
            assert second > 0
            speeds[first if TYPES in without else 1.0] = second
        elif row.command == 1000:
            assert row.params[4] == 12  # the horizon, and not the north
            pitch = first
        elif row.command == 16:
            goal, goal_yaw = tuple(row.params[4:]), row.params[3]
            assert 0 < second <= 0.5
            flies = _seconds(place, goal, speeds, without)
            looks = max(abs(angle_between(heading, goal_yaw)) - YAW_ERROR, 0.0) / TURN_RATE
            looks = 0.0 if LOOKS in without else looks
            hold = 0.0 if HOLDS in without else first
            place, reached, seconds = goal, max(flies, looks), max(flies + hold, looks)
            yield Moment(t + reached, place, goal_yaw, pitch, True)
            heading, t = turned(seconds), t + seconds
            if seconds > reached:
                yield Moment(t, place, goal_yaw, pitch, False)
        elif row.command == 93:
            first = 0.0 if DELAYS in without else first
            heading, t = turned(first), 0.0 if math.isnan(t) else t + first
            yield Moment(t, place, goal_yaw, pitch, False)
        else:
            assert row.command in (22, 17, 1001, 115)  # PX4 knows no turns
    assert rows[-1].params[3:] == [goal_yaw, *place]


def _seconds(
    place: tuple[float, ...], goal: tuple[float, ...], speeds: dict[float, float],
    without: Collection[str],
) -> float:  # fmt: skip
    """Seconds of a leg: its velocity is the largest one along it that keeps both limits."""
    along, up = ground_metres(place, goal), goal[2] - place[2]
    cruise = speeds[1.0] if CRUISE in without else min(speeds[1.0], XY_VEL_MAX)
    goes = (math.hypot(along, up) if GROUND in without else along) / cruise
    if TYPES in without:
        return max(goes, abs(up) / speeds[2.0 if up > 0 else 3.0])
    return goes if CLIMBS in without else max(goes, abs(up) / (Z_UP if up > 0 else Z_DOWN))
