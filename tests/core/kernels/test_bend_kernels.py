"""Points that agree with bends, counted by the kernels and one array operation after another."""

import numpy as np
import pytest

from pipecore._kernels import bend_support
from pipecore.elements.fittings.bends import Corner, pipe_residuals
from pipecore.elements.fittings.open_ends import ViewFromEnd
from pipecore.elements.refinement.surface_fits import LineSurface
from pipecore.geometry import unit

pytestmark = pytest.mark.kernels

TOLERANCE, MIN_COS = 0.02, 0.8


def test_that_points_agree_with_a_pipe_if_they_do_by_its_residuals(rng):
    u = unit(rng.normal(size=3))
    v = unit(np.cross(u, rng.normal(size=3)) - 0.3 * u)
    corner = Corner(rng.normal(size=3), (u, v), float(np.arccos(-(u @ v))), 0.1)
    tried = np.array([0.2, 0.35, 0.6])
    xyz = corner.place + rng.uniform(-0.5, 0.5, (600, 3))
    for bend_radius in tried:  # some of the points lie on each pipe
        part = xyz[rng.integers(0, 600, 150)]
        residual, _, outward, _ = pipe_residuals(corner, bend_radius, 0.1, part)
        on = part - residual[:, None] * outward
        xyz = np.concatenate([xyz, on + 0.3 * TOLERANCE * rng.normal(size=on.shape)])
    normals = rng.normal(size=xyz.shape)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    _, _, outward, _ = pipe_residuals(corner, 0.35, 0.1, xyz[:900])
    normals[:900] = outward
    normals[5] = np.nan
    counts = np.empty((3, 2), np.int64)
    bend_support.agreement(
        xyz, normals, np.stack([corner.surface(b, 0.1).numbers() for b in map(float, tried)]),
        np.stack([LineSurface(corner.place, t, 0.1).numbers() for t in corner.towards]),
        tried * corner.half_tangent, TOLERANCE, MIN_COS, counts,
    )  # fmt: skip
    for k, bend_radius in enumerate(map(float, tried)):
        residual, _, outward, in_bend = pipe_residuals(corner, bend_radius, 0.1, xyz)
        on = np.abs(residual) < TOLERANCE
        on &= np.abs(np.einsum("ij,ij->i", normals, outward)) > MIN_COS
        assert counts[k, 0] == on.sum() > 50
        assert counts[k, 1] == (on & in_bend).sum() > 5


def test_that_the_best_follower_is_the_first_that_most_points_are_on(rng):
    place = np.stack([rng.uniform(-0.5, 3, 300), *rng.uniform(-3, 3, (2, 300))])
    # A bend of radius 2 towards the first vector across.
    angle, around = rng.uniform(0, 1.4, 150), rng.uniform(0, 2 * np.pi, 150)
    rho = 2.0 - np.cos(around)
    place[:, :150] = rho * np.sin(angle), 2.0 - rho * np.cos(angle), np.sin(around)
    normal = rng.normal(size=(3, 300))
    normal /= np.linalg.norm(normal, axis=0)
    normal[:, :150] = (
        -np.cos(around) * np.sin(angle),
        np.cos(around) * np.cos(angle),
        np.sin(around),
    )
    view = ViewFromEnd(place, normal)
    starts, radii, azimuths = np.array([-0.3, 0.0, 0.4]), np.array([1.5, 2.0]), np.arange(0, 6, 0.5)
    count, start, bend_radius, azimuth = view.best_of(starts, radii, azimuths, 0.05)
    on = {
        (s, r, a): int(view.bent(s, r, np.array([a]), 0.05)[0].sum())
        for s in starts for r in radii for a in azimuths
    }  # fmt: skip
    assert count == max(on.values()) > 100
    assert (start, bend_radius, azimuth) == max(on, key=on.__getitem__) == (0.0, 2.0, 0.0)
