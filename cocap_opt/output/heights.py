"""Words for the surface that heights are above."""

from cocap_opt.problem import Problem


def over_datum(problem: Problem) -> str:
    """Says what the heights of layers and of the ceiling are above."""
    earth = problem.earth
    if problem.height_map.datum is not None:
        return "above the ground"
    if earth is None or earth.heights is None or earth.base:
        return "above z = 0 of the map"
    return "above the sea" if earth.heights == "sea" else "above the ellipsoid"
