"""Missions flown by the rules of ArduCopter, without wind, acceleration and rounding.

Each rule names the source file of ArduPilot (4.5) that it is read from, and can be left out.
"""

import math
from collections.abc import Collection, Iterator

from mission_rows import Moment, Row, ground_metres

TYPES = "a speed has a type"  # ArduCopter/mode_auto.cpp, do_change_speed
BOTH = "a leg keeps the speeds over ground and in height"  # AC_WPNav.cpp, SCurve.cpp
SLOWEST = "speeds over ground that are too small are ignored"  # AC_WPNav.cpp, set_speed_xy
DELAYS = "a delay is waited"  # ArduCopter/mode_auto.cpp, verify_nav_delay
WHOLE = "a waypoint's hold has whole seconds"  # AP_Mission.cpp, mavlink_int_to_mission_cmd
HELD_UP = "what follows a turn waits for it"  # AP_Mission.cpp, update
RULES = TYPES, BOTH, SLOWEST, DELAYS, WHOLE, HELD_UP

SPEED_MIN = 0.2  # m/s, WPNAV_WP_SPEED_MIN
DEFAULTS = {1.0: 5.0, 2.0: 2.5, 3.0: 1.5}  # m/s, WPNAV_SPEED, .._UP, .._DN


def ardupilot_moments(rows: list[Row], without: Collection[str] = ()) -> Iterator[Moment]:
    """Flies a mission: when and where each item ends, from the end of the wait at its start."""
    assert rows[0].command == 22 and rows[-1].command == 17
    place, compass, pitch, t = tuple(rows[0].params[4:]), math.nan, math.nan, math.nan
    speeds, turns = dict(DEFAULTS), False
    for row in rows:
        first, second = row.params[:2]
        if row.command == 178:
            kind = 1.0 if TYPES in without else first
            ignored = kind == 1.0 and second < SPEED_MIN and SLOWEST not in without
            if not ignored and (not turns or HELD_UP in without):
                speeds[kind] = second
        elif row.command == 1000:
            assert row.params[4] == 12
            pitch = first
        elif row.command == 115:
            assert row.params[3] == 0  # not relative
            compass, turns = first, True
        elif row.command == 16:
            goal, turns = tuple(row.params[4:]), False
            along, up = ground_metres(place, goal), goal[2] - place[2]
            height = abs(up) / speeds[2.0 if up > 0 else 3.0]
            flies = along / speeds[1.0] if BOTH in without else max(along / speeds[1.0], height)
            t, place = t + flies, goal
            yield Moment(t, place, compass, pitch, True)
            hold = first if WHOLE in without else float(int(first))
            t += hold
            if hold:
                yield Moment(t, place, compass, pitch, False)
        elif row.command == 93:
            turns = False
            first = 0.0 if DELAYS in without else first
            t = 0.0 if math.isnan(t) else t + first
            yield Moment(t, place, compass, pitch, False)
        else:
            assert row.command in (22, 17, 1001)
    assert rows[-1].params[4:] == [*place]
