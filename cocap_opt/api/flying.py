"""The face's flights: where drones are at every moment, and what is left when something slips."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cocap_opt.api.arguments import plan_for, require
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
    """Return where each drone of a plan is at every moment, as `cocap-opt fly` writes it.

    Straight flights go from step to step at constant speeds. Smooth ones are at the same places at
    the steps and have continuous speed and acceleration; that they keep away from each other and
    from obstacles is proved for every moment. Rows are moments of the flight: straight lines
    between them are up to `attrs["off_between_rows"]` m beside it, and nothing is proved about
    those lines.

    Parameters
    ----------
    problem : that the plan is for
    plan : a plan that obeys the scene's rules, or a result that has one
    smooth : with continuous speed and acceleration
    step : seconds of a step, if the problem does not define it
    margin : metres by which drones may be nearer to people than the problem says, aside and over
        heads, so that a plan that keeps more distance than it must can be flown smoothly
    every : seconds between rows; else a row a step, and ten a step of smooth flights
    hovering : also accept a plan in which no drone moves, which is otherwise refused

    Returns
    -------
    DataFrame
        A row per drone and moment: `drone`, `t` (s since step 0), `x`, `y`, `z` (m, coordinates of
        the map), `yaw` (degrees, 0 along x, counter-clockwise, without jumps at a full turn),
        `pitch` (degrees, of the camera, 0 level, below is negative), `above_ground` where the map
        tells the ground, `above_takeoff` (over the map below the drone's start), and where the
        scene says it `latitude`, `longitude` (WGS 84), `above_sea` or `above_ellipsoid`. `attrs`
        has `step`, `reward`, `least_distance` (m, between two drones at any moment),
        `people_distance` (m, from a drone to the middle of a person, from above; None where there
        is nobody) and the like, and of drones with homes `from_home`: for each drone and part of
        the take the `seconds` from take-off to landing, and the ways `out` and `back`, as
        `cocap-opt fly --json` has them.

    Raises
    ------
    ValueError
        If the plan breaks a rule, no drone moves, the length of a step is given nowhere or twice,
        drones with this margin would keep no distance to people, a drone cannot fly so, or the
        scene's place cannot be converted; one line.

    Examples
    --------
    >>> co.trajectory(problem, result, step=1.0, smooth=True)
    """
    from pandas import DataFrame

    from cocap_opt.flight.ways import has_homes, parts_of_take, records_of

    flown = plan_for(problem, plan, "flown")
    if flown.stays and not hovering:
        why = ("" if plan is None else plan.cut_short) or "all drones stay at their starts"
        raise ValueError(f"plan: no drone moves ({why}); hovering=True flies it so")
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
    late: Sequence[float] = (1.0, 2.0),
    aside: Sequence[float] = (1.0,),
    lag: Sequence[float] = (0.5, 1.0, 2.0),
    lost: Sequence[int] | None = None,
) -> "pd.DataFrame":
    """Evaluate a plan when people deviate from their walks, or a drone is late or lost.

    Nobody reacts: all others fly as planned. Distances and rules are those of every moment, on
    the flights' polynomials; J is computed between the steps, too. A drone that is lost at a step
    has left the scene: it contributes nothing from there on, and is near nobody.

    Parameters
    ----------
    problem : that the plan is for
    plan : a plan that obeys the scene's rules, or a result that has one
    smooth : with continuous speed and acceleration
    step : seconds of a step, if the problem does not define it
    margin : metres by which drones may be nearer to people than the problem says, aside and over
        heads, so that a plan that keeps more distance than it must can be flown smoothly
    late : s, by which all people are late, and early
    aside : m, by which all people walk to the left of where they would, and to the right
    lag : s, by which any one drone is late; the worst drone counts
    lost : steps at which drones are lost, each by itself. None: each drone at its worst step, the
        last one at which its loss costs as much as if it had never flown

    Returns
    -------
    DataFrame
        A row per change, the first is the plan: `change` (in words), `reward` (J), `share` (of
        the J of the flight as planned), `least_distance` (m, between two drones),
        `people_distance` (m, from above, where the scene asks for one), `rules` (kept, or to whom
        drones come too near; none where there is none between the steps), `ask_drones` and
        `ask_people` (m, the distance to ask for in the scene, its own and what is missing). Of
        lost drones `lost_drone` and `lost_step`; of these and the plan `by_two` and `by_none`
        (shares of person-steps seen by two drones or more, and by none) and `no_longer` (a list of
        `person` and `steps`, who is seen by two as planned and is no longer). `attrs` has
        `delay_tolerance`, the seconds below which drones may be behind each other, and
        `delay_tolerance_to_people`, those below which they may be ahead of people or behind them;
        inf: any delay will do; None: the scene asks for no such distance, or there is nobody.

    Raises
    ------
    ValueError
        If the plan breaks a rule, the length of a step is given nowhere or twice, drones with this
        margin would keep no distance to people, a drone cannot fly so, or a change is none or
        longer than the flight; one line.

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
    flight = _flight_scene(problem, step, margin).without_earth.flight(flown, smooth)
    for step in lost or ():
        require(step, "lost", "whole numbers of steps", int, np.integer)
    table = DataFrame(what_if(flight, Changes(late, aside, lag), lost).records())
    table.attrs = {
        "delay_tolerance": tolerated_delay(flight),
        "delay_tolerance_to_people": tolerated_delay_of_people(flight),
    }
    return table


def _flight_scene(problem: Problem, step: float | None, margin: float | None) -> "FlightScene":
    """Returns the scene that plans of a problem are flown in."""
    from cocap_opt.flight.flight_scene import FlightScene

    if margin is not None:
        require(margin, "margin", "a number of metres >= 0", int, float, np.number)
    return FlightScene.of(problem, step, margin)
