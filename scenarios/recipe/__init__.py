"""Recipes: scenes made of maps, meshes, tracks and drones, which a TOML file names.

`recipe` reads the file; each other module has the tables of one kind of part, or reads its files.
`lighter` changes a recipe to what costs less to plan.
"""

__all__ = ["lighter", "recipe"]
