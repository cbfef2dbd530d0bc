"""Points located from their images in several cameras, by least squares and by a library."""

import numpy as np

from cocap_opt.data import BoolArray, FloatArray
from cocap_opt.experiments.lab.studies.quality.cameras import Cameras
from cocap_opt.footage.accuracy import jacobians

_ROUNDS = 60
_ARRIVED = 1e-7  # m; the search ends after a shorter step
_DAMPED = 1e-3  # the first damping, as a share of the diagonal
_STUCK = 1e9  # damping at which the search gives up, as no step decreases the sum
_LOST = 1e4  # m from the person; for diverging rays, the best point is infinitely far away
_LEAST = 1e-12  # share of its sum added to the diagonal, so that a step always exists


def least_squares(
    cameras: Cameras, images: FloatArray, whitening: FloatArray, middles: FloatArray
) -> FloatArray:
    """Returns the points [n, 3] (m) with the smallest sum of squares of whitened image errors.

    This is the most likely point if errors are normal. The Levenberg-Marquardt method starts from
    the point nearest to all rays, or from the middle of the person if that point is behind a
    camera.

    Parameters
    ----------
    cameras : [n, C]
    images : [n, C, 2] px
    whitening : [n, C, 2, 2] 1/px, the errors of an image times it are independent with variance 1
    middles : [n, 3] m
    """
    points = nearest_to_rays(cameras, images)
    astray = ~_ahead(cameras, points)
    points[astray] = middles[astray]
    active, damping = np.arange(len(points)), np.full(len(points), _DAMPED)
    for _ in range(_ROUNDS):
        if not len(active):
            break
        some_cameras, white = cameras.taken(active), whitening[active]
        errors = _errors(some_cameras, images[active], white, points[active])
        steps = _steps(some_cameras, white, points[active], errors, damping[active])
        tried = points[active] + steps
        after = _errors(some_cameras, images[active], white, tried)
        better = _ahead(some_cameras, tried) & (_squares(after) <= _squares(errors))
        points[active[better]] = tried[better]
        damping[active] *= np.where(better, 0.1, 10)
        arrived = np.linalg.norm(steps, axis=-1) < _ARRIVED
        lost = np.linalg.norm(points[active] - middles[active], axis=-1) > _LOST
        active = active[~arrived & ~lost & (damping[active] < _STUCK)]
    return points


def nearest_to_rays(cameras: Cameras, images: FloatArray) -> FloatArray:
    """Returns the points [n, 3] (m) with the smallest sum of squared distances from all rays."""
    rays = cameras.rays(images)
    across = np.eye(3) - rays[..., :, None] * rays[..., None, :]
    right = (across @ cameras.places[..., None]).sum(axis=-3)
    result: FloatArray = np.linalg.solve(across.sum(axis=-3), right)[..., 0]
    return result


def by_library(cameras: Cameras, images: FloatArray) -> FloatArray:
    """Returns the points [n, 3] (m) that aniposelib triangulates, by its linear method (DLT).

    Parameters
    ----------
    cameras : [C]
    images : [n, C, 2] px

    Raises
    ------
    ModuleNotFoundError
        If aniposelib is not installed.
    """
    from aniposelib.cameras import Camera, CameraGroup
    from scipy.spatial.transform import Rotation

    group = []
    for place, axes, focal in zip(*cameras, strict=True):
        turn = axes * [[1.0], [-1.0], [1.0]]  # OpenCV's y goes down
        group.append(
            Camera(
                matrix=np.diag([focal, focal, 1.0]),
                rvec=Rotation.from_matrix(turn).as_rotvec(),
                tvec=-turn @ place,
            )
        )
    pixels = np.ascontiguousarray(images.swapaxes(0, 1) * [1.0, -1.0])
    return np.asarray(CameraGroup(group).triangulate(pixels))


def has_library() -> bool:
    """Returns True if aniposelib is installed."""
    try:
        import aniposelib.cameras  # noqa: F401
    except ImportError:  # also if OpenCV lacks a system library
        return False
    return True


def _ahead(cameras: Cameras, points: FloatArray) -> BoolArray:
    """Returns an array [n], True for points [n, 3] that are behind no camera."""
    return np.asarray((cameras.seen(points)[..., 2] > 0).all(axis=-1))


def _errors(
    cameras: Cameras, images: FloatArray, whitening: FloatArray, points: FloatArray
) -> FloatArray:
    """Returns the whitened image errors [n, C, 2]; undefined for points behind a camera."""
    seen = cameras.seen(points)
    seen[..., 2] = np.where(seen[..., 2] > 0, seen[..., 2], 1.0)
    result: FloatArray = (whitening @ (images - cameras.images(seen))[..., None])[..., 0]
    return result


def _squares(errors: FloatArray) -> FloatArray:
    """Returns the sums of squares [n] of errors [n, C, 2]."""
    result: FloatArray = (errors**2).sum(axis=(-1, -2))
    return result


def _steps(
    cameras: Cameras,
    whitening: FloatArray,
    points: FloatArray,
    errors: FloatArray,
    damping: FloatArray,
) -> FloatArray:
    """Returns a damped step [n, 3] (m) of each point."""
    by_point = whitening @ jacobians(cameras.seen(points), cameras.focal) @ cameras.axes
    turned = by_point.swapaxes(-1, -2)
    matrix = (turned @ by_point).sum(axis=-3)
    right = (turned @ errors[..., None]).sum(axis=-3)
    diagonal = np.einsum("nii->ni", matrix)
    added = damping[:, None] * diagonal + _LEAST * diagonal.sum(axis=-1, keepdims=True)
    damped = matrix + np.eye(3) * added[..., None]
    result: FloatArray = np.linalg.solve(damped, right)[..., 0]
    return result
