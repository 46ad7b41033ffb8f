"""Directions in which a cloud is cut into parallel profiles."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore.types.arrays import Array, Floats

OWN_STACK = 0
"""`Profiles.stack_id` of profiles cut across an element's own axis in the refinement."""


@dataclass(frozen=True, eq=False)
class Stack:
    """All parallel profiles of one direction (paper, section 3.1).

    Profile `i` holds the points whose distance along `direction` from the local zero
    lies in [offset + i·width, offset + (i + 1)·width). Only points that are at least
    `min_spacing` from their neighbours join: wide profiles are for thinly scanned places.

    Parameters
    ----------
    stack_id : int
        From 1; 0 is `OWN_STACK`.
    direction : ndarray
        Unit vector, shape (3,).
    width : float
        Thickness of a profile, metres.
    offset : float
        Distance of profile 0 from the local zero, metres.
    name : str
    min_spacing : float
        Metres.
    """

    stack_id: int
    direction: Array
    width: float
    offset: float = 0.0
    name: str = ""
    min_spacing: float = 0.0

    def profile_index(self, xyz: Floats) -> NDArray[np.int32]:
        """Index of the profile that each point of `xyz` (n, 3) falls into.

        Parameters
        ----------
        xyz : ndarray
            Local coordinates, shape (n, 3).

        Returns
        -------
        ndarray of int32
            Shape (n,).
        """
        along = np.asarray(xyz, dtype=np.float64) @ self.direction
        return np.floor((along - self.offset) / self.width).astype(np.int32)
