"""The meshes of a recipe: bridges and other solids that a height map cannot hold.

They are OBJ, STL, PLY and OFF, and glTF (GLB), whose y axis is upwards by its standard.
"""

import math
from pathlib import Path
from typing import Literal

import numpy as np

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.scenarios.foreign import MESHES, require
from cocap_opt.scenarios.meshes.files import READERS, read_mesh
from cocap_opt.scenarios.tables import PER_METRE, Coordinate, Table, Unit
from cocap_opt.scenarios.text import naming
from cocap_opt.world.workspace import Mesh

UP = {".glb": "y", ".gltf": "y"}  # axis that is upwards; in other files it is z, as in surveys


class MeshTable(Table):
    """One of the tables `mesh` of a recipe, see `cocap_opt.scenarios.recipe.recipe.EXAMPLE`."""

    file: str
    unit: Unit = "m"  # of its coordinates
    up: Literal["y", "z"] | None = None  # axis that is upwards; None: y for glTF, z for others
    turn: Coordinate = 0.0  # degrees about its origin, counter-clockwise seen from above
    at: tuple[Coordinate, Coordinate, Coordinate] = (0.0, 0.0, 0.0)  # m, where its origin lies

    def mesh(self, folder: Path) -> Mesh:
        """Reads all geometry of the file as one mesh; vertices at the same place become one.

        Raises
        ------
        ProblemError
            If the file cannot be read whole or holds no triangles; one line, naming the file.
        """
        path = folder / self.file
        with naming(path):
            require(path, MESHES)
            if path.suffix.lower() not in READERS:
                raise ProblemError(f"must be named {', '.join(READERS)}")
            vertices, triangles = read_mesh(path, PER_METRE[self.unit])
            if (self.up or UP.get(path.suffix.lower(), "z")) == "y":
                vertices = vertices[:, [0, 2, 1]] * np.array([1.0, -1.0, 1.0])
            turn = math.radians(self.turn)
            return Mesh(vertices=_placed(vertices, turn, self.at), triangles=triangles)


def _placed(vertices: FloatArray, turn: float, at: tuple[float, float, float]) -> FloatArray:
    """Returns the vertices turned by `turn` rad about the z axis, and shifted by `at`."""
    c, s = math.cos(turn), math.sin(turn)
    x, y, z = vertices.T
    placed: FloatArray = np.column_stack([c * x - s * y, s * x + c * y, z]) + np.array(at)
    return placed
