"""The error of a point that is triangulated from several images, predicted to first order.

Drone i measures the pixel coordinates of the point in its image, with covariance C_i. The best
estimate from all measurements has the covariance

    Sigma = (sum_i J_i^T C_i^-1 J_i)^-1,

where J_i is the 2 x 3 derivative of the projection with respect to the point. Sigma is the inverse
of the Fisher information, i.e. the Cramer-Rao bound, which least squares reach for small errors.
(Hartley and Zisserman, Multiple View Geometry in Computer Vision, 2nd ed. 2004: section 5.2 on
backward transport of covariance, chapter 12 on triangulation; Kay, Fundamentals of Statistical
Signal Processing: Estimation Theory, 1993, chapter 3.) The root mean square error is sqrt(trace
Sigma).
"""

import numpy as np

from cocap_opt.data import FloatArray

# The smallest eigenvalue of the information, relative to the largest, above which a point counts as
# known. Two rays of equal length at a small angle a give a^2 / 4. Rounding leaves some 1e-16 in
# place of 0, so values above 1e-12 are accurate to a thousandth; this corresponds to rays 2e-6 rad
# apart. Real teams are far above: a drone at 1 m and one at 10 km, at a right angle, give 1e-8.
COLLINEAR = 1e-12


def jacobians(points: FloatArray, focal: FloatArray) -> FloatArray:
    """Returns the derivatives [.., 2, 3] (px/m) of image coordinates (right, up) with respect to
    points.

    u = f x / z and v = f y / z have du = f (dx - x/z dz) / z and likewise dv.

    Parameters
    ----------
    points : [.., 3] m, in camera coordinates: right, up, forward > 0
    focal : [..] focal lengths, px
    """
    scale = focal / points[..., 2]
    result = np.zeros((*points.shape[:-1], 2, 3))
    for axis in range(2):
        result[..., axis, axis] = scale
        result[..., axis, 2] = -scale * points[..., axis] / points[..., 2]
    return result


def turning_jacobians(points: FloatArray, by_point: FloatArray) -> FloatArray:
    """Returns the derivatives [.., 2, 3] (px/rad) of image coordinates with respect to small
    rotations of the camera.

    A camera that turns by w sees the point move by -w x p, which is p x w. The rotations are about
    the camera's axes: right, up, forward. These are left-handed, so that they turn clockwise.

    Parameters
    ----------
    points : [.., 3] m, in camera coordinates
    by_point : [.., 2, 3] px/m, the `jacobians` at the points
    """
    x, y, z = np.moveaxis(points, -1, 0)
    none = np.zeros_like(x)
    crossed = np.stack(
        [
            np.stack([none, -z, y], axis=-1),
            np.stack([z, none, -x], axis=-1),
            np.stack([-y, x, none], axis=-1),
        ],
        axis=-2,
    )
    result: FloatArray = by_point @ crossed
    return result


def pixel_covariances(
    points: FloatArray,
    by_point: FloatArray,
    pixel_error: float,
    position_error: float = 0.0,
    attitude_error: float = 0.0,
) -> FloatArray:
    """Returns the covariances [.., 2, 2] (px2) of image coordinates if camera poses are uncertain.

    They are s^2 I + J_pose C_pose J_pose^T. The derivative with respect to the camera's position is
    the negative of that with respect to the point. On the axis, the variance is s^2 + (f s_pos /
    d)^2 + (f s_att)^2 in both directions.

    Parameters
    ----------
    points : [.., 3] m, in camera coordinates
    by_point : [.., 2, 3] px/m, the `jacobians` at the points
    pixel_error : px, standard deviation along each axis of the image
    position_error : standard deviation of the camera's position along each axis, m
    attitude_error : standard deviation of the camera's attitude about each axis, rad
    """
    result: FloatArray = pixel_error**2 * np.eye(2) + position_error**2 * _squared(by_point)
    if attitude_error:
        result = result + attitude_error**2 * _squared(turning_jacobians(points, by_point))
    return result


def information(axes: FloatArray, by_point: FloatArray, covariances: FloatArray) -> FloatArray:
    """Returns the Fisher information [.., 3, 3] (1/m2) about points, in world coordinates.

    Parameters
    ----------
    axes : [.., 3, 3] right, up and forward unit vectors of the cameras
    by_point : [.., 2, 3] px/m, in camera coordinates
    covariances : [.., 2, 2] px2
    """
    turned = by_point @ axes
    result: FloatArray = turned.swapaxes(-1, -2) @ np.linalg.solve(covariances, turned)
    return result


def rms_errors(total: FloatArray) -> FloatArray:
    """Returns the root mean square errors [..] (m) of points, given all information about them.

    They are infinite if some direction is not determined: with one camera, or with all rays on one
    line (`COLLINEAR`).

    Parameters
    ----------
    total : [.., 3, 3] 1/m2, the sum over all cameras
    """
    values = np.linalg.eigvalsh(total)
    known = values[..., 0] > COLLINEAR * values[..., 2]
    result = np.full(known.shape, np.inf)
    result[known] = np.sqrt((1 / values[known]).sum(axis=-1))
    return result


def _squared(by_pose: FloatArray) -> FloatArray:
    """Returns J J^T [.., 2, 2] of derivatives [.., 2, 3]."""
    result: FloatArray = by_pose @ by_pose.swapaxes(-1, -2)
    return result
