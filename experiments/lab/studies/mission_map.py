"""A map of missions as another program reads them: pymavlink, whose reader MAVProxy uses."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.patheffects import withStroke

from cocap_opt.data import FloatArray
from cocap_opt.flight.earth import Geodesy
from cocap_opt.pictures.figures import picture, robot_colour
from cocap_opt.pictures.style import LABEL, SMALL, TITLE, new_figure
from cocap_opt.problem import Problem
from cocap_opt.problem.pictures import LAND_COLOURS, NAME
from cocap_opt.problem.whole_names import WholeName

_AROUND = 0.25  # margin on each side, as a share of the missions' extent
_WAYPOINT = 16  # MAV_CMD_NAV_WAYPOINT
_DIGITS = 4  # decimals of degrees beside the axes


def mission_map(problem: Problem, missions: Sequence[Path]) -> bytes:
    """Returns a PNG of the waypoints of missions, by latitude and longitude, over a scene's land.

    Parameters
    ----------
    missions : files of waypoints, one for each drone in their order
    """
    found = [_waypoints(mission) for mission in missions]
    figure = new_figure(7.0, 5.6)
    ax = figure.add_subplot()
    for area in problem.land_cover:
        outline, *holes = (_degrees(problem, rim) for rim in (area.outline, *area.holes))
        ax.fill(*outline.T, color=LAND_COLOURS[area.kind], lw=0)
        if area.name is not None:
            shown = area.replace(outline=outline, holes=tuple(holes))
            ax.add_artist(WholeName(
                shown, fontsize=SMALL, style="italic", color=NAME, transform=ax.transData,
                path_effects=[withStroke(linewidth=2, foreground="w")],
            ))  # fmt: skip
    for drone, way in enumerate(found):
        colour = robot_colour(drone)
        ax.plot(*way.T, color=colour, lw=1.6, marker=".", ms=5)
        ax.annotate(
            f"drone {drone}", way[0], xytext=(7, -9), textcoords="offset points", color=colour,
            fontsize=SMALL, weight="bold", path_effects=[withStroke(linewidth=2, foreground="w")],
        )  # fmt: skip
    points = np.concatenate(found)
    low, high = points.min(axis=0), points.max(axis=0)
    room = _AROUND * (high - low)
    ax.set_xlim(low[0] - room[0], high[0] + room[0])
    ax.set_ylim(low[1] - room[1], high[1] + room[1])
    ax.set_aspect(1 / np.cos(np.radians(low[1])))  # degrees of longitude are shorter
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(f"{{x:.{_DIGITS}f}}")
    ax.set_xlabel("longitude (degrees)", fontsize=LABEL)
    ax.set_ylabel("latitude (degrees)", fontsize=LABEL)
    ax.set_title(f"{len(missions)} missions of {problem.name}, read by pymavlink", fontsize=TITLE)
    ax.tick_params(labelsize=SMALL)
    return picture(figure, ".png")


def _waypoints(mission: Path) -> FloatArray:
    """Returns longitudes and latitudes [n, 2] (degrees) of a mission's waypoints."""
    from pymavlink import mavwp  # of the extra `test`

    loader = mavwp.MAVWPLoader()
    loader.load(str(mission))
    items = [loader.wp(number) for number in range(loader.count())]
    return np.array([(item.y, item.x) for item in items[1:] if item.command == _WAYPOINT])


def _degrees(problem: Problem, rim: FloatArray) -> FloatArray:
    """Returns longitudes and latitudes [n, 2] (degrees) of points [n, 2] (m)."""
    assert problem.earth is not None
    geodesy = Geodesy(problem.earth, problem.height_map.centre(0, 0))
    latitude, longitude = geodesy.degrees(*rim.T)
    return np.column_stack([longitude, latitude])
