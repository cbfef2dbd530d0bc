"""Pinhole cameras in space: their images of points, also if the cameras are slightly displaced."""

from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import FloatArray, IntArray


class Cameras(NamedTuple):
    """Cameras that look at points; leading axes are those of the points, or 1.

    Attributes
    ----------
    places : [.., C, 3] m
    axes : [.., C, 3, 3] right, up and forward unit vectors
    focal : [.., C] px
    """

    places: FloatArray
    axes: FloatArray
    focal: FloatArray

    def seen(self, points: FloatArray) -> FloatArray:
        """Returns points [.., 3] (m) in the axes of each camera [.., C, 3]: right, up, forward."""
        ways = points[..., None, :] - self.places
        result: FloatArray = (self.axes @ ways[..., None])[..., 0]
        return result

    def images(self, seen: FloatArray) -> FloatArray:
        """Returns the images [.., C, 2] (px, right and up of the middle) of such points."""
        result: FloatArray = self.focal[..., None] * seen[..., :2] / seen[..., 2:]
        return result

    def rays(self, images: FloatArray) -> FloatArray:
        """Returns unit vectors [.., C, 3] from the cameras through their images."""
        inner = np.concatenate([images / self.focal[..., None], np.ones_like(images[..., :1])], -1)
        ways = (inner[..., None, :] @ self.axes)[..., 0, :]
        result: FloatArray = ways / np.linalg.norm(ways, axis=-1, keepdims=True)
        return result

    def for_points(self, shape: tuple[int, ...]) -> Self:
        """Returns the cameras with an entry for each of the points [*shape], as [n, C, ..]."""
        count = self.focal.shape[-1]
        return type(self)(
            np.broadcast_to(self.places, (*shape, count, 3)).reshape(-1, count, 3),
            np.broadcast_to(self.axes, (*shape, count, 3, 3)).reshape(-1, count, 3, 3),
            np.broadcast_to(self.focal, (*shape, count)).reshape(-1, count),
        )

    def taken(self, which: IntArray) -> Self:
        """Returns the cameras of the points with these numbers [n]."""
        return type(self)(self.places[which], self.axes[which], self.focal[which])

    def moved(self, ways: FloatArray, turns: FloatArray) -> Self:
        """Returns cameras with displaced positions and rotated directions.

        Parameters
        ----------
        ways : [.., C, 3] m
        turns : [.., C, 3] rad, about the axes of the cameras
        """
        angles = np.linalg.norm(turns, axis=-1)[..., None, None]
        x, y, z = np.moveaxis(turns, -1, 0)
        none = np.zeros_like(x)
        rows = [[none, -z, y], [z, none, -x], [-y, x, none]]
        crossed = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
        # Rodrigues' formula; np.sinc has a factor pi, and is 1 at 0.
        first, second = np.sinc(angles / np.pi), np.sinc(angles / (2 * np.pi)) ** 2 / 2
        turned = np.eye(3) + first * crossed + second * (crossed @ crossed)
        return type(self)(self.places + ways, turned @ self.axes, self.focal)
