"""The parts of the documentation that are made from the code: commands, files, worked examples."""

__all__ = [
    "bound_pictures",
    "commands",
    "diagrams",
    "docstrings",
    "entries",
    "formats",
    "gallery",
    "lists",
    "node_pictures",
    "one_face",
    "recorded_tree",
    "scene_pictures",
    "tree_pictures",
    "worked",
    "worked_words",
]
