"""Floors, walls and other planes: no profile of theirs holds an ellipse, so none is cut.

A place is told from the normals in cubic cells. Flat cells that go on in each other make
patches, and a patch is plane if the widest pipe there may be would bend away from its plane by
far more than the patch does. Narrow flat patches may be a strip of such a pipe and are no planes.
"""

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import planes as kernels
from pipecore.surface.cells import CELL, Cells

MIN_POINTS = 20
"""Of a cell and those around it, to tell whether they are flat."""
MAX_SPREAD, MAX_CURVED = 0.03, 0.01
"""Largest second eigenvalue of Σnnᵀ of flat places, and its largest difference from the least."""
MAX_TURN_COS = np.cos(np.deg2rad(10.0))
MAX_OFFSET = 0.15
"""Neighbouring cells go on in each other if their normals and means agree as far, in edges."""
BLOCK, SMALLEST_BLOCK = 0.4, 8
"""Patches end at cubes of this edge, in largest radii, and at least so many cells: a hall's floor
need not be plane. Cubes begin at two places, so that no strip is left over at their faces."""
SAGITTA = np.sqrt(0.2)
"""A strip of a cylinder lies off its plane by this times the mean square of its width over its
radius: root mean squares of x² / 2r and x for x spread evenly."""
SHARE_OF_SAGITTA = 0.3
"""A plane lies off itself by at most this share of what the widest pipe would."""

NO_PLANE = -1


def find_planes(
    cells: Cells, voxel: float, max_radius: float
) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """Find the planes of a surface.

    Parameters
    ----------
    cells : Cells
    voxel, max_radius : float
        Edge of the thinning's voxels and largest radius of a pipe, metres.

    Returns
    -------
    plane : ndarray of int32, shape (c,)
        Number of each cell's plane, from 0; `NO_PLANE` for the others.
    is_cut : ndarray of bool, shape (c,)
        Whether profiles have to be cut there: everywhere but well inside planes.
    """
    keys, grid = cells.keys, (cells.frame.n_y, cells.frame.n_z)
    n, max_radius = len(keys), max_radius / (CELL * voxel)  # in edges
    is_flat, is_plane, is_inner = np.zeros((3, n), np.bool_)
    normals, means = np.empty((n, 3)), np.empty((n, 3))
    kernels.describe_cells(
        cells.cells, cells.sums, cells.around(), MIN_POINTS, MAX_SPREAD, MAX_CURVED,
        is_flat, normals, means,
    )  # fmt: skip

    def patches(block: int, begin: int, is_member: NDArray[np.bool_]) -> NDArray[np.int32]:
        roots = np.arange(n, dtype=np.int32)
        kernels.unite_flat(
            keys, cells.cells, *grid, block, begin, is_member, normals, means, MAX_TURN_COS,
            MAX_OFFSET, roots,
        )  # fmt: skip
        return roots

    block = max(SMALLEST_BLOCK, int(BLOCK * max_radius))
    max_ratio = SHARE_OF_SAGITTA * SAGITTA / max_radius
    for begin in (0, block // 2):
        kernels.mark_planes(means, is_flat, patches(block, begin, is_flat), max_ratio, is_plane)
    kernels.mark_inner(keys, *grid, is_plane, cells.sums[:, 0].copy(), is_inner)
    # A plane goes on from block to block.
    roots = patches(0, 0, is_plane)[is_plane]
    plane = np.full(n, NO_PLANE, np.int32)
    plane[is_plane] = np.unique(roots, return_inverse=True)[1]
    return plane, ~is_inner
