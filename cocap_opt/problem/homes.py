"""Homes of drones: the flight heights from which a drone can land at its home."""

from cocap_opt.problem.robot import Robot
from cocap_opt.problem.scene import SceneData


def landing_layers(scene: SceneData, robot: Robot) -> list[int]:
    """Returns the layers between which and its home a drone can fly straight up and down."""
    assert robot.home is not None
    (x, y), motion, workspace = robot.home, robot.motion, scene.workspace
    ground = float(scene.height_map.heights[x, y])
    lowest_above = min((low for low, _ in workspace.columns.at(x, y)[1:]), default=float("inf"))
    found = []
    for layer, height in enumerate(motion.layers):
        altitude = scene.height_map.altitude(x, y, height)
        low, high = altitude - motion.clearance, altitude + motion.clearance
        closed = workspace.forbidden.solid_at(x, y, ground, altitude)
        if ground < low and high < lowest_above and not closed:
            found.append(layer)
    return found
