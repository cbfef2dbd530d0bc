"""Coverage: the pixels that each face of the actors has in each robot's image, and its pictures.

The order of the modules is projection, visibility, faces, views, coverage, cache; `render` is the
slow reference that they are tested against. They are imported one by one, since those that cast
rays load Embree.
"""

__all__ = ["cache", "coverage", "faces", "projection", "render", "views", "visibility"]
