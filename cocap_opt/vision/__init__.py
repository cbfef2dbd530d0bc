"""Coverage: the pixels that each face of the actors has in each robot's image, and its pictures.

The modules build on one another in this order: projection, bodies, candidates, surfaces, faces,
shadows, visibility, seen, sights, viewpoints, views, coverage, cache; `render` is the slow
reference that they are tested against. `view_kernel` finds what `sights` finds, compiled and ten
times as fast: `compiled_sight` hands it the arrays. `unhidden` and `ceilings` bound coverage before
it is computed, and `default_weights` makes the weight by which a drone that sees somebody counts;
nothing else here uses them. The modules are imported one by one, since `surfaces` loads Embree.
"""

__all__ = [
    "bodies",
    "cache",
    "ceilings",
    "coverage",
    "default_weights",
    "faces",
    "projection",
    "render",
    "seen",
    "shadows",
    "sights",
    "surfaces",
    "unhidden",
    "viewpoints",
    "views",
]
