"""Recipes: scenes made of maps, meshes, tracks and drones, which a TOML file names.

`recipe` reads the file; each other module has the tables of one kind of part, or reads its files.
"""

__all__ = [
    "airspace",
    "drones",
    "earth",
    "geotiff",
    "ground_plans",
    "mesh_files",
    "meshes",
    "pace",
    "people",
    "raster",
    "raster_files",
    "recipe",
    "resample",
    "rules",
    "systems",
    "tables",
    "terrain",
    "track_database",
    "track_doubts",
    "track_layout",
    "track_order",
    "track_rows",
    "track_table",
    "tracks",
    "walls",
]
