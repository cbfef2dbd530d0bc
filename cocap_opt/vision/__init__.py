"""Coverage: the pixels of each actor's faces in each robot's image; also renders these images.

The modules build on one another in this order: projection, bodies, candidates, surfaces, faces,
shadows, visibility, seen, sights, viewpoints, views, coverage, cache; `render` is the slow
reference that they are tested against. `view_kernel` is a compiled version of `sights`, ten times
as fast; `compiled_sight` passes it the arrays. `unhidden` and `ceilings` bound coverage before it
is computed, and `default_weights` computes the weight of a drone that sees somebody; nothing else
here uses them. The modules are imported one by one, since `surfaces` loads Embree.
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
