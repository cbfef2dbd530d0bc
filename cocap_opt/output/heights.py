"""Words for the datum of heights."""

from cocap_opt.problem.scene import SceneData


def over_datum(scene: SceneData) -> str:
    """Returns words for the datum of flight heights and the ceiling."""
    earth = scene.earth
    if scene.height_map.datum is not None:
        return "above the ground"
    if earth is None or earth.heights is None or earth.base:
        return "above z = 0 of the map"
    return "above the sea" if earth.heights == "sea" else "above the ellipsoid"
