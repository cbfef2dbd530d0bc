"""The cells of a recipe's map in which drones can land straight below their last places."""

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, ProblemError
from cocap_opt.problem import GoalArea, LandCover, Motion
from cocap_opt.problem.land_cover import LANDS, in_cells
from cocap_opt.world.workspace import Workspace

_NO_GROUND = [LANDS.index("building"), LANDS.index("water")]


def ground_to_land_on(
    workspace: Workspace, land_cover: tuple[LandCover, ...], motion: Motion
) -> GoalArea:
    """Returns the cells that such a drone may be in and that have free ground below.

    Free ground means no roof and no obstacle on or above it and, according to the land cover,
    neither water nor a building. No-fly zones are excluded at any height.

    Raises
    ------
    ProblemError
        If the height of the ground is unknown, or there is no such cell; the message is one line.
    """
    height_map = workspace.height_map
    if not height_map.knows_ground:
        raise ProblemError(
            "must be left out if the height of the ground is unknown: set `ground` under [map]"
        )
    zones = Workspace(height_map, (), workspace.no_fly)
    found = (
        motion.free_places(workspace).any(axis=0)
        & ~height_map.stands_out
        & ~_covered(workspace.columns.low)
        & ~_covered(zones.forbidden.low)
        & ~np.isin(in_cells(land_cover, height_map), _NO_GROUND)
    )
    if not found.any():
        raise ProblemError(
            "must be left out here: none of the cells in which these drones may be is above free "
            "ground, without roofs, obstacles, water and no-fly zones"
        )
    return GoalArea(cells=tuple((int(x), int(y)) for x, y in np.argwhere(found)))


def _covered(low: FloatArray) -> BoolArray:
    """Returns the cells [X, Y] covered by a mesh, given the lower ends of its columns [n, X, Y]."""
    return np.asarray(np.isfinite(low[1:]).any(axis=0))
