"""One face: what a column hides of it, and what relaxations allow for it."""

from functools import cache
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.certificates.envelope import Curve, Cut
from cocap_opt.vision.bodies import Bodies
from cocap_opt.vision.shadows import Shadows
from cocap_opt.world.workspace import HeightMap


class Shadow(NamedTuple):
    """A face behind a column, in the image of a drone: right and up, in image heights.

    Attributes
    ----------
    eye : m, of the drone, which looks along +x
    low, high : m, corners of the column
    person : m, corners of the face [V, 3]
    """

    eye: FloatArray
    low: FloatArray
    high: FloatArray
    person: FloatArray
    face: FloatArray  # [V, 2]
    column: list[FloatArray]  # the sides that face the drone
    pieces: list[FloatArray]  # the visible pieces of the face

    @property
    def visible(self) -> float:
        """The share of the face's image that is visible."""
        return sum(map(_area, self.pieces)) / _area(self.face)


@cache
def shadow() -> Shadow:
    """Returns the front of a person, one corner of which a column of 3 m hides."""
    eye = np.array([0.0, 0.1, 5.0])
    low, high = np.array([5.0, 0.0, 0.0]), np.array([6.0, 1.0, 3.0])
    column = HeightMap(heights=np.array([[high[2]]]), origin=(5.0, 0.0))
    person = np.array([[12, 0.25, 0], [12, -0.25, 0], [12, -0.25, 1.8], [12, 0.25, 1.8]])
    face = person - eye
    bodies = Bodies.of_columns(column, np.zeros(3))
    shadows = Shadows.of(bodies, np.zeros(1, dtype=np.int64), eye[None])
    single = np.ones(1, dtype=np.int64)
    pieces, _ = shadows.outside(face[None], 0 * single, single)
    (x, y, z), (u, v, w) = low, high
    sides = [
        np.array([[x, y, z], [x, v, z], [x, v, w], [x, y, w]]),
        np.array([[x, y, w], [x, v, w], [u, v, w], [u, y, w]]),
    ]
    return Shadow(
        eye, low, high, person, _image(face), [_image(side - eye) for side in sides],
        [*map(_image, pieces)],
    )  # fmt: skip


def _image(polygon: FloatArray) -> FloatArray:
    """Returns the image of points [V, 3] that are relative to a drone that looks along +x."""
    return np.column_stack([-polygon[:, 1], polygon[:, 2]]) / polygon[:, :1]


def _area(polygon: FloatArray) -> float:
    x, y = (polygon - polygon[0]).T
    return abs(float(x @ np.roll(y, 1) - y @ np.roll(x, 1))) / 2


class Curves(NamedTuple):
    """The bounds on a face that two drones look at, by the share of each drone that looks."""

    share: FloatArray  # [n] of each drone, 0..1
    concave: FloatArray
    single_view: FloatArray
    cut: FloatArray  # the envelope cut that is tight at two plans
    plans: FloatArray  # [3] the roots of no, one, two views

    def at(self, share: float) -> dict[str, float]:
        """Returns the heights of the curves, and the lowest of them, at a share."""
        names = ("concave", "single_view", "cut")
        found = {name: float(np.interp(share, self.share, getattr(self, name))) for name in names}
        return {**found, "least": min(found.values())}


def curves() -> Curves:
    """Returns the curves of two views of 225 px/m2 each, as in the doorway."""
    view, share = 15.0, np.linspace(0, 1, 201)
    plans = view * np.sqrt(np.arange(3.0))
    phi = Curve(np.array([view]), np.array([plans[2] - plans[1]]))
    cut = Cut.valid(0, {0: phi}, (2,))
    paid = cut.constant + 2 * share * cut.phi(0, np.zeros(1, dtype=np.int64), np.array([view]))
    return Curves(share, view * np.sqrt(2 * share), 2 * view * share, paid, plans)
