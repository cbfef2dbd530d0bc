"""Meshes: solids that a height map cannot hold, in files of several formats."""
