"""Public functions for flights: drones at every moment, and the effects of delays and losses."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cocap_opt.api.arguments import (
    listed,
    listed_numbers,
    plan_for,
    require,
    require_flag,
    require_number,
    require_whole,
)
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Result

if TYPE_CHECKING:
    import pandas as pd

    from cocap_opt.flight.flight_scene import FlightScene


def trajectory(
    problem: Problem,
    plan: Plan | Result | None,
    *,
    smooth: bool = False,
    step: float | None = None,
    margin: float | None = None,
    every: float | None = None,
    hovering: bool = False,
) -> "pd.DataFrame":
    """Return the position of each drone of a plan at every moment, as `cocap-opt fly` writes it.

    Straight flights go from step to step at constant speeds. Smooth flights pass the same places at
    the steps, with continuous speed and acceleration; it is proved for every moment that the drones
    keep their distance from each other and from obstacles. Each row is a moment of the flight.
    Straight lines between rows deviate from the flight by up to `attrs["off_between_rows"]` m, and
    nothing is proved about those lines.

    Parameters
    ----------
    problem : the problem that the plan is for
    plan : a plan that obeys the scene's rules, or a result that has one
    smooth : fly with continuous speed and acceleration
    step : seconds per step, if the problem does not define it
    margin : m by which drones may be closer to people than the problem says, sideways and over
        heads, so that a plan that keeps more distance than it must can be flown smoothly
    every : seconds between rows (default: one row per step, or ten for smooth flights)
    hovering : also accept a plan in which no drone moves, which is otherwise refused

    Returns
    -------
    DataFrame
        A row per drone and moment: `drone`, `t` (s since step 0), `x`, `y`, `z` (m, coordinates of
        the map), `yaw` (degrees, 0 along x, counter-clockwise, without jumps at a full turn),
        `pitch` (degrees, of the camera, 0 level, negative below), `above_ground` where the ground
        is known from the map, `above_takeoff` (over the surface below the drone's first place) or
        `above_home` (not for drones in the air) and, if the scene has a place on the Earth,
        `latitude`, `longitude` (WGS 84), `above_sea` or `above_ellipsoid`. `attrs` has `step`,
        `reward`, `least_distance` (m, between two drones at any moment), `people_distance` (m, from
        a drone to the middle of a person, seen from above, less the `swerve` of that person; None
        without people) and the like, and, for drones with homes, `from_home`: for each drone and
        part of the take the `seconds` from take-off to landing, and the ways `out` and `back`, as
        in `cocap-opt fly --json`.

    Raises
    ------
    ValueError
        If the plan breaks a rule, no drone moves, the length of a step is given nowhere or twice,
        drones with this margin would keep no distance to people, a drone cannot fly in this way, or
        the scene's place cannot be converted; one line.

    Examples
    --------
    >>> co.trajectory(problem, result, step=1.0, smooth=True)
    """
    from pandas import DataFrame

    from cocap_opt.flight.ways import has_homes, parts_of_take, records_of

    flown = plan_for(problem, plan, "flown")
    require_flag(smooth, "smooth")
    require_flag(hovering, "hovering")
    if every is not None:
        require_number(every, "every")
    if flown.stays and not hovering:
        why = ("" if plan is None else plan.cut_short) or "all drones stay at their starts"
        raise ValueError(f"plan: no drone moves ({why}); to fly it, pass hovering=True")
    flight = _flight_scene(problem, step, margin).flight(flown, smooth)
    table = DataFrame(flight.columns(every))
    table.attrs = {**flight.record(), "off_between_rows": flight.off_between_rows(every)}
    if has_homes(problem):
        table.attrs["from_home"] = records_of(parts_of_take(flight.flown.problem, flown))
    return table


def robustness(
    problem: Problem,
    plan: Plan | Result | None,
    *,
    smooth: bool = False,
    step: float | None = None,
    margin: float | None = None,
    late: Sequence[float] | None = None,
    aside: Sequence[float] | None = None,
    lag: Sequence[float] | None = None,
    lost: Sequence[int] | None = None,
) -> "pd.DataFrame":
    """Evaluate a plan when people deviate from their walks, or a drone is late or lost.

    The drones do not react: all others fly as planned. Distances and rules are evaluated at every
    moment, on the flights' polynomials; J is computed between the steps, too. A drone that is lost
    at a step leaves the scene: from then on it contributes nothing and is near nobody.

    Parameters
    ----------
    problem : the problem that the plan is for
    plan : a plan that obeys the scene's rules, or a result that has one
    smooth : fly with continuous speed and acceleration
    step : seconds per step, if the problem does not define it
    margin : m by which drones may be closer to people than the problem says, sideways and over
        heads, so that a plan that keeps more distance than it must can be flown smoothly
    late : s by which all people are late, and, in a second change, early. None: 1 and 2 s, unless
        the flight is shorter
    aside : m by which all people walk to the left of their path, and, in a second change, to the
        right. None: 1 m
    lag : s by which any one drone is late; the worst drone counts. None: 0.5, 1 and 2 s, unless the
        flight is shorter
    lost : steps at which drones are lost, one drone at a time. None: each drone at its worst step,
        the last one at which its loss costs as much as if it had never flown

    Returns
    -------
    DataFrame
        A row per change, preceded by one for the plan: `change` (in words), `reward` (J), `share`
        (of the J of the flight as planned), `least_distance` (m, between two drones),
        `people_distance` (m, seen from above, where the scene requires one), `rules` (kept, or whom
        drones come too close to; none if no rule holds between the steps), `ask_drones` and
        `ask_people` (m, the distance that the scene should require: its own plus the shortfall).
        Rows of lost drones have `lost_drone` and `lost_step`; these and the plan's also have
        `by_two` and `by_none` (shares of person-steps seen by two drones or more, and by none) and
        `no_longer` (a list of `person` and `steps`: person-steps that two drones see as planned,
        but no longer do). `attrs` has `delay_tolerance`: the seconds by which one drone may be
        behind another; and `delay_tolerance_to_people`: the seconds by which drones may be ahead of
        people or behind them. Delays must be less than that; inf: any delay is allowed; None: the
        scene requires no such distance, or has no people.

    Raises
    ------
    ValueError
        If the plan breaks a rule, the length of a step is given nowhere or twice, drones with this
        margin would keep no distance to people, a drone cannot fly in this way, or a change is zero
        or longer than the flight; one line.

    Examples
    --------
    >>> co.robustness(problem, result, step=2.0, smooth=True, lag=[0.2, 1])
    """
    from pandas import DataFrame

    from cocap_opt.flight.changes import (
        Changes,
        tolerated_delay,
        tolerated_delay_of_people,
    )
    from cocap_opt.footage.losses import what_if

    flown = plan_for(problem, plan, "flown")
    require_flag(smooth, "smooth")
    flight = _flight_scene(problem, step, margin).without_earth.flight(flown, smooth)
    changes = Changes.of(
        flight,
        None if late is None else listed_numbers(late, "late", "numbers of seconds"),
        None if aside is None else listed_numbers(aside, "aside", "numbers of metres"),
        None if lag is None else listed_numbers(lag, "lag", "numbers of seconds"),
    )
    steps = None if lost is None else listed(lost, "lost", "whole numbers of steps")
    for each in steps or ():
        require_whole(each, "lost", "whole numbers of steps")
    table = DataFrame(what_if(flight, changes, steps).records())
    table.attrs = {
        "delay_tolerance": tolerated_delay(flight),
        "delay_tolerance_to_people": tolerated_delay_of_people(flight),
    }
    return table


def _flight_scene(problem: Problem, step: float | None, margin: float | None) -> "FlightScene":
    """Returns the scene in which plans of a problem are flown."""
    from cocap_opt.flight.flight_scene import FlightScene

    if step is not None:
        require_number(step, "step")
    if margin is not None:
        require(margin, "margin", "a number of metres >= 0", int, float, np.number)
    return FlightScene.of(problem, step, margin)
