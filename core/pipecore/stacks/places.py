"""Which stacks cut a place: near a pipe those whose directions are nearest to its axis.

A profile that runs along a pipe holds lines, of which no ellipse comes. Where the normals around
a place tell its axis, few stacks are enough; where they do not, all of them cut it.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import planes as kernels
from pipecore.surface.cells import Cells
from pipecore.types import Stack

ALL = np.int64(-1)
"""The bits of places that all stacks cut."""
N_BITS = 64

N_NEAREST = 3
"""So many directions cut a place with an axis: one well, the others to join its profiles …"""
SAME_COS = 0.03
"""… and those that are nearly as near."""

MIN_POINTS = 20
CURVED, MAX_RATIO = 0.02, 0.15
"""A place has an axis where the second eigenvalue of Σnnᵀ is at least this share of the sum, and
the least at most that share of the second."""
FURTHER = 3
"""Where the normals around a cell are all alike, the same is asked of cells so many times as
wide: a vessel's wall is flat at close quarters."""


def stack_bit(stack: Stack) -> int:
    """Which of the bits of a place tells whether a stack cuts it."""
    return (stack.stack_id - 1) % N_BITS


def stacks_of_cells(cells: Cells, stacks: Sequence[Stack]) -> NDArray[np.int64]:
    """Tell which stacks cut each cell, shape (c,): the bit `stack_bit` is set for those that do.

    A cell is cut by what cuts its neighbours too, so that a curve is not cut off where
    the axes of two cells differ.
    """
    bits = np.full(len(cells.keys), ALL)
    directions = np.unique([stack.direction for stack in stacks], axis=0)
    if len(stacks) > N_BITS or len(directions) <= N_NEAREST or len(bits) == 0:
        return bits
    axes = _axes_of_cells(cells)
    has_axis = ~np.isnan(axes[:, 0])
    axes = axes[has_axis]
    least = np.sort(_cosines(axes, directions), axis=1)[:, -N_NEAREST] - SAME_COS
    own = np.zeros(len(axes), np.int64)
    for stack in stacks:
        is_near = _cosines(axes, stack.direction[None])[:, 0] >= least
        own |= is_near.astype(np.int64) << stack_bit(stack)
    near = np.zeros_like(bits)
    near[has_axis] = own
    united = np.empty_like(bits)
    kernels.unite_bits(cells.keys, cells.frame.n_y, cells.frame.n_z, near, united)
    bits[has_axis] = united[has_axis]
    return bits


def _axes_of_cells(cells: Cells) -> NDArray[np.float64]:
    """Direction that is across to the normals around each cell; nan where there is none."""
    nature, axes = _fit_axes(cells)
    further, place = cells.coarser(FURTHER)
    is_flat = nature == kernels.FLAT
    axes[is_flat] = _fit_axes(further)[1][place[is_flat]]
    return axes


def _fit_axes(cells: Cells) -> tuple[NDArray[np.int8], NDArray[np.float64]]:
    nature, axes = np.empty(len(cells.keys), np.int8), np.empty((len(cells.keys), 3))
    kernels.fit_axes(cells.around(), MIN_POINTS, CURVED, MAX_RATIO, nature, axes)
    return nature, axes


def _cosines(axes: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cosines of the angles between lines, shape (axes, directions).

    Not by BLAS, whose rounding depends on how many rows there are.
    """
    x, y, z = axes.T[:, :, None]
    dx, dy, dz = directions.T[:, None, :]
    return np.asarray(np.abs(x * dx + y * dy + z * dz))
