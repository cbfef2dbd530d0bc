"""Shapes of actors: polygons around a foot point on the ground, with the heading along +x."""

import math

import numpy as np

from cocap_opt.arithmetic import cosines, sines
from cocap_opt.data import LARGEST, SMALLEST, Data, FloatArray, whole, within

_BOX_FACES = ("front", "left", "back", "right", "top")


class Cuboid(Data, frozen=True, tag="cuboid"):
    """A box with four sides and a top; its bottom is on the ground and never seen.

    Attributes
    ----------
    length : m, along the actor's heading
    width : m, across it
    height : m
    """

    length: float = 1.0
    width: float = 1.0
    height: float = 1.8

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_sizes(self)

    def faces(self) -> list[FloatArray]:
        """Returns the faces as polygons [V, 3]: front, left, back, right, top.

        Corners are counter-clockwise seen from outside.
        """
        x, y, z = self.length / 2, self.width / 2, self.height
        base = np.array([[x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0], [-x, -y, 0.0]])
        return _prism_faces(base, z)

    @property
    def face_names(self) -> tuple[str, ...]:
        """Names of the faces, in their order, as people read them."""
        return _BOX_FACES


class Prism(Data, frozen=True, tag="prism"):
    """An upright regular prism: `sides` side faces, the first facing the heading, and a top.

    Attributes
    ----------
    sides : number of side faces, 3..64
    apothem : distance from the centre to the middle of a side, m
    height : m
    """

    sides: int = 6
    apothem: float = 0.5
    height: float = 1.8

    def __post_init__(self) -> None:
        super().__post_init__()
        whole(self.sides, "sides")
        within(self.sides, 3, 64, "sides")
        _require_sizes(self)

    def faces(self) -> list[FloatArray]:
        """Returns the faces as polygons [V, 3]: the sides, then the top.

        Corners are counter-clockwise seen from outside.
        """
        corner = self.apothem / math.cos(math.pi / self.sides)
        angles: FloatArray = np.arange(self.sides, dtype=np.float64)
        angles = 2 * math.pi / self.sides * (angles - 0.5)
        base = np.column_stack(
            [corner * cosines(angles), corner * sines(angles), np.zeros(self.sides)]
        )
        return _prism_faces(base, self.height)

    @property
    def face_names(self) -> tuple[str, ...]:
        """Names of the faces, in their order, as people read them."""
        return (*(f"side {k}" for k in range(self.sides)), "top")


class TriangulatedCuboid(Data, frozen=True, tag="triangulated-cuboid"):
    """A box whose sides and top consist of two triangles each; every triangle is a face of its own.

    The actors of Greedy Perspectives are such boxes: the square roots of all triangles' coverage
    are summed. Triangles are ordered like the faces of `Cuboid`, in pairs, and cut along the same
    diagonals as in the source: seen from outside, from the lower left to the upper right corner of
    the front and the right side, from the lower right to the upper left corner of the left side and
    the back, and from the front left to the back right corner of the top. The first of each pair is
    the right one, seen from outside; on the top it is the one at the back left.

    Attributes
    ----------
    length : m
    width : m
    height : m
    """

    length: float = 1.0
    width: float = 1.0
    height: float = 2.5

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_sizes(self)

    def faces(self) -> list[FloatArray]:
        """Returns the faces as triangles [3, 3], counter-clockwise seen from outside."""
        quads = Cuboid(length=self.length, width=self.width, height=self.height).faces()
        first_to_third, second_to_fourth = ((0, 1, 2), (2, 3, 0)), ((1, 2, 3), (3, 0, 1))
        cuts = [
            first_to_third,
            second_to_fourth,
            second_to_fourth,
            first_to_third,
            second_to_fourth,
        ]
        return [
            quad[list(corners)] for quad, cut in zip(quads, cuts, strict=True) for corners in cut
        ]

    @property
    def face_names(self) -> tuple[str, ...]:
        """Names of the faces, in their order, as people read them."""
        return tuple(f"{side}, half {k}" for side in _BOX_FACES for k in (1, 2))


Shape = Cuboid | Prism | TriangulatedCuboid


def _require_sizes(shape: Shape) -> None:
    for field in ("length", "width", "apothem", "height"):
        if hasattr(shape, field):
            within(getattr(shape, field), SMALLEST, LARGEST, field, "m")


def _prism_faces(base: FloatArray, height: float) -> list[FloatArray]:
    """Returns the sides and the top of a prism over a base [V, 3]."""
    top = base + np.array([0.0, 0.0, height])
    following = np.roll(np.arange(len(base)), -1)
    sides = [
        np.stack([base[i], base[j], top[j], top[i]])
        for i, j in zip(range(len(base)), following, strict=True)
    ]
    return [*sides, top]
