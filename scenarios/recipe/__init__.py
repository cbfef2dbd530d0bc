"""Recipes: scenes made of maps, meshes, tracks and drones, which a TOML file names.

`recipe` reads the file, `lighter` changes it to what costs less; each other module has the tables
of one kind of part, or reads its files.
"""

__all__ = ["lighter", "recipe", "rules"]
