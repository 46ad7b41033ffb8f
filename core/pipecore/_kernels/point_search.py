"""Search for the points around an axis or a place, in the cells that `cell_search` found."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipecore._kernels.cell_search import appended, cells_around
from pipecore._kernels.grouping import argsort_keys
from pipecore._kernels.pipe_coordinates import across_axis, polar, tangent
from pipecore._kernels.surface_models import MOST_PARAMETERS, at_point


class OrientedPoints(NamedTuple):
    """Points with normals.

    xyz, normals (n, 3): places, metres, and unit normals of either sign, nan where not known;
    is_free (n,): points that may be found.
    """

    xyz: NDArray[np.float64]
    normals: NDArray[np.float64]
    is_free: NDArray[np.bool_]


class Target(NamedTuple):
    """A surface that points are looked for on.

    kind, surface (14,): see `surface_models`;
    band: largest distance of points on it, metres;
    depth: least distance of points inside it, metres;
    min_cos: least cosine between a point's normal and the surface's.
    """

    kind: int
    surface: NDArray[np.float64]
    band: float
    depth: float
    min_cos: float


@njit(cache=True, nogil=True)
def points_around(xyz, grid, cells, tube):
    """Find the points of some cells that lie in a tube, in ascending order.

    Parameters
    ----------
    xyz (n, 3) : points, metres
    grid : PointCells
    cells (c,) : indices of fine cells
    tube : Tube
    """
    members, starts, axis = grid.members, grid.starts, tube.axis
    inner, outer = tube.inner, tube.outer
    n_most = 0
    for c in cells:
        n_most += starts[c + 1] - starts[c]
    found = np.empty(n_most, np.int64)
    n = 0
    for c in cells:
        for m in range(starts[c], starts[c + 1]):
            i = members[m]
            chainage, up, right = across_axis(axis, xyz[i, 0], xyz[i, 1], xyz[i, 2])
            rho2 = up * up + right * right
            if inner * inner < rho2 < outer * outer and tube.begin < chainage < tube.end:
                found[n] = i
                n += 1
    found = found[:n]
    return found[argsort_keys(found)]


@njit(cache=True, nogil=True)
def points_in_ball(xyz, grid, cells, place, radius):
    """Find the points of some cells within a distance of a place, in ascending order.

    Parameters
    ----------
    xyz (n, 3) : points, metres
    grid : PointCells
    cells (c,) : indices of fine cells
    place (3,) : metres
    radius : metres
    """
    members, starts = grid.members, grid.starts
    found = np.empty(256, np.int64)
    n = 0
    for c in cells:
        for m in range(starts[c], starts[c + 1]):
            i = members[m]
            x, y, z = xyz[i, 0] - place[0], xyz[i, 1] - place[1], xyz[i, 2] - place[2]
            if x * x + y * y + z * z <= radius * radius:
                found = appended(found, n, i)
                n += 1
    found = found[:n]
    return found[argsort_keys(found)]


@njit(cache=True, nogil=True)
def points_on_sphere(points, grid, cells, centre, inner, outer, min_cos, stride):
    """Find the free points of some cells in a shell whose normals point to its centre.

    Parameters
    ----------
    points : OrientedPoints
    grid : PointCells
    cells (c,) : indices of fine cells
    centre (3,) : metres
    inner, outer : radii of the shell, metres
    min_cos : least cosine between a normal and the direction to the centre
    stride : only every so many-th point is examined

    Returns
    -------
    Indices of the points, ascending.
    """
    xyz, normals, is_free = points.xyz, points.normals, points.is_free
    members, starts = grid.members, grid.starts
    found = np.empty(256, np.int64)
    n = 0
    for c in cells:
        for m in range(starts[c] + (-starts[c]) % stride, starts[c + 1], stride):
            i = members[m]
            if not is_free[i]:
                continue
            x, y, z = xyz[i, 0] - centre[0], xyz[i, 1] - centre[1], xyz[i, 2] - centre[2]
            rho = math.sqrt(x * x + y * y + z * z)
            if not inner < rho < outer:
                continue
            cosine = (normals[i, 0] * x + normals[i, 1] * y + normals[i, 2] * z) / rho
            if abs(cosine) > min_cos:
                found = appended(found, n, i)
                n += 1
    found = found[:n]
    return found[argsort_keys(found)]


@njit(cache=True, nogil=True)
def points_on(points, grid, cells, tube, target, stride):
    """Find the free points of some cells that lie on a surface about an axis.

    Parameters
    ----------
    points : OrientedPoints
    grid : PointCells
    cells (c,) : indices of fine cells
    tube : Tube
    target : Target
    stride : only every so many-th point is examined

    Returns
    -------
    Indices of the points (m,), ascending, and (4, m): distance from the surface, chainage,
    clock angle, and the angle from the surface's normal to the point's towards increasing
    clock; metres and radians.
    """
    xyz, normals, is_free = points.xyz, points.normals, points.is_free
    members, starts, axis = grid.members, grid.starts, tube.axis
    found, table = np.empty(256, np.int64), np.empty((256, 4))
    row = np.empty(MOST_PARAMETERS)
    n = 0
    for c in cells:
        for m in range(starts[c] + (-starts[c]) % stride, starts[c + 1], stride):
            i = members[m]
            if not is_free[i]:
                continue
            x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
            residual, ox, oy, oz = at_point(target.kind, target.surface, x, y, z, row)
            if not abs(residual) < target.band:
                continue
            cosine = normals[i, 0] * ox + normals[i, 1] * oy + normals[i, 2] * oz
            if not abs(cosine) > target.min_cos:
                continue
            chainage, up, right = across_axis(axis, x, y, z)
            rho, clock = polar(up, right)
            if not (tube.inner < rho < tube.outer and tube.begin < chainage < tube.end):
                continue
            tx, ty, tz = tangent(axis, chainage)
            ahead = (
                normals[i, 0] * (ty * oz - tz * oy)
                + normals[i, 1] * (tz * ox - tx * oz)
                + normals[i, 2] * (tx * oy - ty * ox)
            )
            if n == table.shape[0]:
                longer = np.empty((2 * n, 4))
                longer[:n] = table
                table = longer
            found = appended(found, n, i)
            table[n, 0], table[n, 1], table[n, 2] = residual, chainage, clock
            table[n, 3] = math.atan(ahead / cosine)
            n += 1
    order = argsort_keys(found[:n])
    columns = np.empty((4, n))
    for k in range(n):
        for column in range(4):
            columns[column, k] = table[order[k], column]
    return found[:n][order], columns


@njit(cache=True, nogil=True)
def stride_of(grid, cells, max_points):
    """Return the stride at which no more than a given number of the points of cells are examined.

    Parameters
    ----------
    grid : PointCells
    cells (c,) : indices of fine cells
    max_points : 0 for all
    """
    n = 0
    for c in cells:
        n += grid.starts[c + 1] - grid.starts[c]
    return max(1, -(-n // max_points)) if max_points > 0 else 1


@njit(cache=True, nogil=True)
def usual_spacing(spacing, chosen, least):
    """Return the median distance of chosen points to their neighbours, metres.

    Parameters
    ----------
    spacing (n,) : of every point, nan where not known, metres
    chosen (m,) : indices of points
    least : least value returned, and the one where none is known, metres
    """
    known = np.empty(chosen.shape[0])
    n = 0
    for i in chosen:
        if not math.isnan(spacing[i]):
            known[n] = spacing[i]
            n += 1
    return max(least, np.median(known[:n])) if n > 0 else least


@njit(cache=True, nogil=True)
def points_on_surface(points, spacing, voxel, grid, tube, shell, target, max_points):
    """Find the points on a surface about an axis, of a sample of them where there are many.

    Parameters
    ----------
    points : OrientedPoints
    spacing (n,) : distance of each point to its neighbours, metres
    voxel : least spacing, metres
    grid : PointCells
    tube : Tube in which points may lie
    shell : Tube whose cells are examined
    target : Target
    max_points : number of points in the cells above which a sample is examined; 0 for all

    Returns
    -------
    As `points_on`, and the distance between neighbours among the examined points, metres.
    """
    cells = cells_around(grid, shell)
    stride = stride_of(grid, cells, max_points)
    inliers, columns = points_on(points, grid, cells, tube, target, stride)
    return inliers, columns, usual_spacing(spacing, inliers, voxel) * math.sqrt(stride)


@njit(cache=True, nogil=True)
def points_inside(points, grid, cells, tube, target):
    """Return chainage and clock (2, m) of the points inside a surface about an axis.

    Parameters
    ----------
    points : OrientedPoints, free or not
    grid : PointCells
    cells (c,) : indices of fine cells
    tube : Tube
    target : Target
    """
    xyz, normals = points.xyz, points.normals
    members, starts, axis = grid.members, grid.starts, tube.axis
    table = np.empty((256, 2))
    row = np.empty(MOST_PARAMETERS)
    n = 0
    for c in cells:
        for m in range(starts[c], starts[c + 1]):
            i = members[m]
            x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
            residual, ox, oy, oz = at_point(target.kind, target.surface, x, y, z, row)
            if not residual < -target.depth:
                continue
            cosine = normals[i, 0] * ox + normals[i, 1] * oy + normals[i, 2] * oz
            if not abs(cosine) > target.min_cos:
                continue
            chainage, up, right = across_axis(axis, x, y, z)
            rho, clock = polar(up, right)
            if tube.inner < rho < tube.outer and tube.begin < chainage < tube.end:
                if n == table.shape[0]:
                    longer = np.empty((2 * n, 2))
                    longer[:n] = table
                    table = longer
                table[n, 0], table[n, 1] = chainage, clock
                n += 1
    return table[:n].T.copy()


@njit(cache=True, nogil=True)
def full_resolution_points(members, starts, chosen, xyz, index, places):
    """Write the full-resolution points that chosen voxel means stand for.

    Those of one mean are in the order of their coordinates.

    Parameters
    ----------
    members (n,), starts (m + 1,) : the points of each mean, and where they begin
    chosen (c,) : indices of means
    xyz (n, 3) : full-resolution points, metres
    index (k,), places (k, 3) : filled with indices and coordinates
    """
    n = 0
    for c in chosen:
        first = n
        for m in range(starts[c], starts[c + 1]):
            i = members[m]
            x, y, z = np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2])
            k = n
            while k > first and (
                places[k - 1, 0] > x
                or (places[k - 1, 0] == x and places[k - 1, 1] > y)
                or (places[k - 1, 0] == x and places[k - 1, 1] == y and places[k - 1, 2] > z)
            ):
                index[k] = index[k - 1]
                for a in range(3):
                    places[k, a] = places[k - 1, a]
                k -= 1
            index[k] = i
            places[k, 0], places[k, 1], places[k, 2] = x, y, z
            n += 1
