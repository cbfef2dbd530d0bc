"""Coverage: the pixels that each face of the actors has in each robot's image, and its pictures.

The modules build on one another in this order: spans, projection, bodies, screens, candidates,
skyline, surfaces, faces, shadows, visibility, sights, unhidden, views, coverage, cache; `render`
is the slow reference that they are tested against. They are imported one by one, since those that
cast rays load Embree.
"""

__all__ = [
    "bodies",
    "cache",
    "coverage",
    "faces",
    "projection",
    "render",
    "shadows",
    "sights",
    "spans",
    "unhidden",
    "views",
]
