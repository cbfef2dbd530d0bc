"""Limits of airframes by name, each with its source.

Makers' figures of the DJI and Skydio cameras' airframes are not here: no source of them could be
checked. Whoever has one states the limits in the recipe.
"""

import math

from cocap_opt.problem import Limits

AIRFRAMES: dict[str, Limits] = {
    # PX4-Autopilot (BSD-3), src/modules/mc_pos_control, defaults of MPC_XY_VEL_MAX,
    # MPC_Z_VEL_MAX_UP, MPC_Z_VEL_MAX_DN, MPC_ACC_HOR, MPC_YAWRAUTO_MAX (2025): the px4 cameras'
    "px4": Limits(
        speed=12.0, climb=3.0, descent=1.5, acceleration=3.0, yaw_rate=math.radians(60.0)
    ),
}
