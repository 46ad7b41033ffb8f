"""From local coordinates to pixels and back to sizes, without asking VTK point by point."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonMath import vtkMatrix4x4

from pipecore.geometry import Array


@dataclass(frozen=True, eq=False)
class Projection:
    """How the camera maps space to the view at one moment.

    Parameters
    ----------
    matrix : ndarray, shape (4, 4)
        Rows give u·w, v·w, depth and w of a point (x, y, z, 1): pixels from the left and
        from the top, and metres in front of the camera.
    pixel_at_zero, pixel_per_depth : float
        A pixel is `pixel_at_zero + pixel_per_depth · depth` metres large.
    """

    matrix: Array
    pixel_at_zero: float
    pixel_per_depth: float

    @classmethod
    def of_camera(
        cls,
        to_clip: Array,
        to_eye: Array,
        size: tuple[int, int],
        view_angle: float,
        parallel_scale: float | None = None,
    ) -> "Projection":
        """Return the projection of a camera.

        Parameters
        ----------
        to_clip, to_eye : ndarray, shape (4, 4)
            The camera's matrices; in eye coordinates it looks along -z.
        size : tuple of int
            Width and height of the view in pixels.
        view_angle : float
            Vertical, radians.
        parallel_scale : float, optional
            Half the height of the view in metres, for a parallel projection.
        """
        width, height = size
        matrix = np.stack(
            [
                (to_clip[0] + to_clip[3]) * width / 2,
                (to_clip[3] - to_clip[1]) * height / 2,
                -to_eye[2],
                to_clip[3],
            ]
        )
        if parallel_scale is not None:
            return cls(matrix, 2 * parallel_scale / height, 0.0)
        return cls(matrix, 0.0, 2 * np.tan(view_angle / 2) / height)

    def to_screen(self, points: Array) -> tuple[Array, Array]:
        """Return pixels (n, 2) and depths (n,) of points (n, 3); nan behind the camera."""
        points = np.atleast_2d(points)
        u, v, depth, w = self.matrix @ np.column_stack([points, np.ones(len(points))]).T
        w = np.where((w > 0) & (depth > 0), w, np.nan)
        return np.column_stack([u / w, v / w]), depth

    def pixel_size(self, depth: float) -> float:
        """Return the size in metres of a pixel at `depth`."""
        return self.pixel_at_zero + self.pixel_per_depth * depth

    def ray(self, u: float, v: float) -> tuple[Array, Array]:
        """Return origin and unit direction of the ray through the pixel (u, v)."""
        # Two planes of points that map to u and to v meet in the ray.
        plane_u = self.matrix[0] - u * self.matrix[3]
        plane_v = self.matrix[1] - v * self.matrix[3]
        direction = np.cross(plane_u[:3], plane_v[:3])
        direction /= np.linalg.norm(direction)
        if direction @ self.matrix[2, :3] < 0:
            direction = -direction
        planes = np.stack([plane_u, plane_v, self.matrix[2]])
        origin = np.linalg.solve(planes[:, :3], -planes[:, 3])
        return origin, direction


def as_array(vtk_matrix: vtkMatrix4x4) -> NDArray[np.float64]:
    """Return a vtkMatrix4x4 as an array."""
    return np.array([[vtk_matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
