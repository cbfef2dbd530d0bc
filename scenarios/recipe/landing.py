"""The cells of a recipe's map in which drones can land straight below the places where they end."""

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, ProblemError
from cocap_opt.problem import GoalArea, LandCover, Motion
from cocap_opt.problem.land_cover import LANDS, in_cells
from cocap_opt.world.workspace import Workspace

_NO_GROUND = [LANDS.index("building"), LANDS.index("water")]


def ground_to_land_on(
    workspace: Workspace, land_cover: tuple[LandCover, ...], motion: Motion
) -> GoalArea:
    """Returns the cells in which such a drone may be and below which there is ground.

    Nothing stands there, neither a roof nor an obstacle, nothing hangs above, and as far as the
    land cover tells there is neither water nor a building. No-fly zones are left out, however high.

    Raises
    ------
    ProblemError
        If the height of the ground is unknown, or there is no such cell; one line.
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
            "must be left out here: no cell in which these drones may be is above free ground, "
            "without roofs, obstacles, water and no-fly zones"
        )
    return GoalArea(cells=tuple((int(x), int(y)) for x, y in np.argwhere(found)))


def _covered(low: FloatArray) -> BoolArray:
    """Returns the cells [X, Y] above which a mesh is, by the feet of their columns [n, X, Y]."""
    return np.asarray(np.isfinite(low[1:]).any(axis=0))
