"""Limits of airframes by name, each with its source.

What a source does not say is None, and is not checked. Most makers' figures are of the fastest
mode, without wind. Of the cameras' airframes those of the Spark and of AirSim are missing, for want
of a source; the recipe's `limits` states any.
"""

import math

from cocap_opt.problem import Limits

AIRFRAMES: dict[str, Limits] = {
    # PX4-Autopilot (BSD-3), src/modules/mc_pos_control, 2025: defaults of MPC_XY_VEL_MAX,
    # MPC_Z_VEL_MAX_UP, MPC_Z_VEL_MAX_DN, MPC_ACC_HOR, MPC_YAWRAUTO_MAX
    "px4": Limits(
        speed=12.0, climb=3.0, descent=1.5, acceleration=3.0, yaw_rate=math.radians(60.0)
    ),
    # Makers' figures as the wiki of the Zephyr simulator has them: Little-Arms-Studios/
    # zephyr-wiki, getting-started/drones/: mavic-pro.md, phantom-3.md, phantom-4.md, skydio-2.md
    "dji-mavic-pro": Limits(speed=18.0, climb=5.0, descent=3.0, endurance=27 * 60.0),
    "dji-phantom-3": Limits(
        speed=16.0, climb=5.0, descent=3.0, yaw_rate=math.radians(150.0),
        gimbal_rate=math.radians(90.0), endurance=25 * 60.0,
    ),
    "dji-phantom-4": Limits(
        speed=20.0, climb=6.0, descent=3.0, yaw_rate=math.radians(150.0),
        gimbal_rate=math.radians(90.0), endurance=28 * 60.0,
    ),
    "skydio-2": Limits(speed=16.1, endurance=23 * 60.0),
    # The maker's figures for mode P (with the sensors on), and for turns those for mode S, as a
    # laboratory of Embrapa has them for the aircraft that it flies:
    # project.cnpgc.embrapa.br/fenotipagem/docs/hardware
    "dji-phantom-4-pro": Limits(
        speed=13.9, climb=5.0, descent=3.0, yaw_rate=math.radians(250.0),
        gimbal_rate=math.radians(90.0), endurance=30 * 60.0,
    ),
}  # fmt: skip


def airframe_name(limits: Limits | None) -> str | None:
    """Returns the name of an airframe that has these limits, of those known of it; None: none."""
    for name, airframe in AIRFRAMES.items():
        known = ((field, getattr(airframe, field)) for field in airframe.__struct_fields__)
        if all(value in (None, getattr(limits, field, None)) for field, value in known):
            return name
    return None
