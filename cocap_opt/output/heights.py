"""Words for the surface that heights are above."""

from cocap_opt.problem.scene import SceneData


def over_datum(scene: SceneData) -> str:
    """Says what the heights of layers and of the ceiling are above."""
    earth = scene.earth
    if scene.height_map.datum is not None:
        return "above the ground"
    if earth is None or earth.heights is None or earth.base:
        return "above z = 0 of the map"
    return "above the sea" if earth.heights == "sea" else "above the ellipsoid"
