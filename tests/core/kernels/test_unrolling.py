"""Points in an element's coordinates, against the axes' own geometry."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore._kernels import unrolling
from pipecore.geometry import ArcAxis, LineAxis, cross, unit
from tests.core.shapes import bowed_axis

pytestmark = pytest.mark.kernels


def axes(rng):
    normal = unit(rng.normal(size=3))
    yield LineAxis.between(rng.normal(size=3), rng.normal(size=3))
    yield ArcAxis(rng.normal(size=3), normal, unit(cross(normal, rng.normal(size=3))), 0.6, 1.2)
    yield bowed_axis(rng)


@pytest.mark.parametrize("slope", [0.0, 0.3])
def test_that_points_are_unrolled_as_the_axes_say(rng, slope):
    for axis in axes(rng):
        xyz = axis.at(rng.uniform(0, axis.length, 50)) + 0.1 * rng.normal(size=(50, 3))
        normals = rng.normal(size=(50, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        normals[7] = np.nan
        s, rho, clock, height, alignment = np.empty((5, 50))
        unrolling.unroll(axis.numbers, 0.08, slope, xyz, normals, s, rho, clock, height, alignment)
        for found, expected in zip((s, rho, clock), axis.pipe_coordinates(xyz), strict=True):
            assert_allclose(found, expected, atol=1e-12)
        assert_allclose(height, (rho - 0.08 - slope * s) / np.hypot(1, slope), atol=1e-12)
        outward = (xyz - axis.at(s)) / rho[:, None] - slope * axis.tangent(s)
        expected = np.abs(np.einsum("ij,ij->i", outward, normals)) / np.hypot(1, slope)
        assert_allclose(alignment, expected, atol=1e-9)
        assert np.isnan(alignment[7])


def test_that_a_point_on_the_axis_faces_nothing(rng):
    for axis in axes(rng):
        places = axis.at(np.array([0.3]))
        s, rho, clock, height, alignment = np.empty((5, 1))
        unrolling.unroll(
            axis.numbers, 0.08, 0.0, places, np.ones((1, 3)), s, rho, clock, height, alignment
        )
        assert_allclose((s[0], rho[0], height[0]), (0.3, 0.0, -0.08), atol=1e-9)
        assert np.isfinite(alignment[0])
