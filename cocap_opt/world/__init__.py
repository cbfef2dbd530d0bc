"""Solid matter: a height map, meshes, and the columns of matter above each cell of a grid."""

from cocap_opt.world.columns import Columns, Spans
from cocap_opt.world.triangles import clip
from cocap_opt.world.workspace import HeightMap, Mesh, Workspace

__all__ = ["Columns", "HeightMap", "Mesh", "Spans", "Workspace", "clip"]
