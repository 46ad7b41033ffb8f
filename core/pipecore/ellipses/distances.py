"""Distances of points from an ellipse, and how they change with it.

The ellipse is c + S·(cos t, sin t) with a symmetric S. Its five parameters are the centre
x and y, the mean m of the semi-axes, and h·cos 2θ and h·sin 2θ, where h is half their
difference and θ the angle of the major axis: S = m·I + h·[[cos 2θ, sin 2θ], [sin 2θ, -cos 2θ]].
They have no singularity at the circle, where an axis ratio and an angle would have one.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

N_PARAMETERS = 5


def to_parameters(centre: Array, semi_major: float, semi_minor: float, angle: float) -> Array:
    """Return the five parameters of an ellipse.

    Parameters
    ----------
    centre : ndarray, shape (2,)
    semi_major, semi_minor : float
    angle : float
        Of the major axis from the first coordinate, radians.

    Returns
    -------
    ndarray, shape (5,)
        Centre x and y, m, h·cos 2θ and h·sin 2θ.
    """
    mean, half_difference = 0.5 * (semi_major + semi_minor), 0.5 * (semi_major - semi_minor)
    cos_part, sin_part = half_difference * np.cos(2 * angle), half_difference * np.sin(2 * angle)
    return np.array([*centre, mean, cos_part, sin_part])


def canonical(parameters: Array) -> Array:
    """Return the parameters of the same ellipse with both semi-axes positive.

    Parameters
    ----------
    parameters : ndarray, shape (5,)

    Returns
    -------
    ndarray, shape (5,)
    """
    x, y, mean, cos_part, sin_part = parameters
    half_difference = np.hypot(cos_part, sin_part)
    angle = 0.5 * np.arctan2(sin_part, cos_part)
    first, second = abs(mean + half_difference), abs(mean - half_difference)
    if first < second:
        first, second, angle = second, first, angle + 0.5 * np.pi
    return to_parameters(np.array([x, y]), first, second, angle)


def orthogonal_distances(points: Array, parameters: Array) -> tuple[Array, Array]:
    """Return orthogonal distances from an ellipse, and their derivatives by its parameters.

    The foot of a point slides along the ellipse, across the normal n, so the distance
    changes only with the ellipse's own motion at the foot: -n·∂(c + S·u).

    Parameters
    ----------
    points : ndarray, shape (n, 2)
    parameters : ndarray, shape (5,)

    Returns
    -------
    distance : ndarray, shape (n,)
        Outside positive.
    jacobian : ndarray, shape (n, 5)
    """
    mean, cos_part, sin_part = parameters[2:]
    half_difference = np.hypot(cos_part, sin_part)
    angle = 0.5 * np.arctan2(sin_part, cos_part)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    axes = np.array([mean + half_difference, mean - half_difference])
    # A trial step may turn an axis round: the curve is the same with its length positive.
    lengths = np.maximum(np.abs(axes), 1e-9)
    local = (points - parameters[:2]) @ turn
    on_circle = _foot_on_circle(np.abs(local), lengths) * np.where(local < 0, -1.0, 1.0)
    normal = on_circle / lengths
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    distance = ((local - on_circle * lengths) * normal).sum(axis=1)
    (ux, uy), (nx, ny) = turn @ (on_circle * np.sign(axes)).T, turn @ normal.T
    jacobian = -np.column_stack([nx, ny, nx * ux + ny * uy, nx * ux - ny * uy, nx * uy + ny * ux])
    return distance, jacobian


def _foot_on_circle(points: Array, axes: Array) -> Array:
    """Where the unit circle holds the nearest points of an ellipse with these semi-axes.

    Newton's iteration for t in (a x / (t + a²))² + (b y / (t + b²))² = 1; from the left
    of the root, where it starts, it converges without leaving that side, for any point.
    """
    stretched = np.maximum(points, 1e-14 * axes) * axes
    t = (stretched - axes**2).max(axis=1)
    ratio = stretched / (t[:, None] + axes**2)
    for _ in range(60):
        excess = (ratio**2).sum(axis=1) - 1
        step = 0.5 * excess / (ratio**2 / (t[:, None] + axes**2)).sum(axis=1)
        t += np.maximum(step, 0.0)
        ratio = stretched / (t[:, None] + axes**2)
        if excess.max() < 1e-12:
            break
    return np.asarray(ratio / np.linalg.norm(ratio, axis=1, keepdims=True))


def radial_distances(points: Array, parameters: Array) -> tuple[Array, Array]:
    """Return distances along the rays from the centre, and their derivatives by the parameters.

    v = d - r, equations 2 and 3 of the paper: with y = S⁻¹(x - c) the ray meets the
    ellipse at r = d / |y|.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
    parameters : ndarray, shape (5,)

    Returns
    -------
    distance : ndarray, shape (n,)
        Outside positive.
    jacobian : ndarray, shape (n, 5)
    """
    x, y, mean, cos_part, sin_part = parameters
    inverse = np.linalg.inv(np.array([[mean + cos_part, sin_part], [sin_part, mean - cos_part]]))
    offset = points - np.array([x, y])
    # The centre itself has no ray; it counts as a hair beside it.
    d = np.maximum(np.linalg.norm(offset, axis=1), 1e-12)
    on_unit = offset @ inverse
    rho = np.maximum(np.linalg.norm(on_unit, axis=1), 1e-12)
    gradient = (on_unit @ inverse) / rho[:, None]
    (gx, gy), (ux, uy) = gradient.T, on_unit.T
    ray = (offset / d[:, None]) * (1 - 1 / rho)[:, None]
    by_scale = -(d / rho**2)[:, None]
    by_shape = np.column_stack([gx * ux + gy * uy, gx * ux - gy * uy, gx * uy + gy * ux])
    jacobian = np.column_stack([by_scale * gradient - ray, by_scale * by_shape])
    return d * (1 - 1 / rho), jacobian
