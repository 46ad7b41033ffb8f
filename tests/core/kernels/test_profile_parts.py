"""One point of a profile, one curve of a stack, the rows of an axis, and bends that follow."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pipecore._kernels.axis_rows import cover_rows
from pipecore._kernels.bend_support import best_follower
from pipecore._kernels.curve_splitting import share_on_one_section
from pipecore._kernels.profile_cuts import StackCut, carry_point, height_of, slope_to
from tests.core.shapes import random_rotation, unit_rows

pytestmark = pytest.mark.kernels


def test_that_heights_and_slopes_are_products_with_the_direction(rng):
    xyz, normals = rng.normal(size=(2, 9, 3))
    direction = unit_rows(rng.normal(size=(1, 3)))[0]
    normals[4] = np.nan
    for i in range(9):
        assert height_of(xyz, i, direction, 0.3) == pytest.approx(xyz[i] @ direction - 0.3)
        slope = slope_to(normals, i, direction)
        assert np.isnan(slope) if i == 4 else slope == pytest.approx(normals[i] @ direction)


def test_that_a_point_of_a_tube_is_carried_along_it_to_the_mid_plane(rng):
    """Along an oblique straight tube whose section the mid-plane cuts as well."""
    frame = random_rotation(rng)
    cut = StackCut(frame[2], frame[0], frame[1], 0.02, 0.005)
    for _ in range(20):
        normal = unit_rows(rng.normal(size=(1, 3)) * [1.0, 1.0, 0.3])[0] @ frame
        xyz, normals = rng.uniform(-1, 1, (1, 3)), normal[None]
        nd = float(normal @ cut.direction)
        index, u, v, mu, mv = carry_point(xyz, normals, 0, nd, cut)
        middle = cut.offset + (index + 0.5) * cut.width
        assert abs(xyz[0] @ cut.direction - middle) <= cut.width / 2 + 1e-12
        carried = u * cut.e1 + v * cut.e2 + middle * cut.direction
        # It stays in its tangent plane, and moves no further than that is steep.
        assert (carried - xyz[0]) @ normal == pytest.approx(0.0, abs=1e-12)
        reach = cut.width / 2 / np.sqrt(1 - nd**2)
        assert np.linalg.norm(carried - xyz[0]) <= reach + 1e-12
        assert_allclose([mu, mv], [normal @ cut.e1, normal @ cut.e2])


def circle(rng, n, r=0.1, arc=2 * np.pi):
    angle = arc * np.arange(n) / n
    normals = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    return r * normals[:, :2], normals


def test_that_the_share_on_one_section_is_that_of_the_points_on_it(rng):
    uv, normals = circle(rng, 60)
    assert share_on_one_section(uv, normals, 0.002, 0.05, 0.7) == 1.0
    uv[:12] *= 1.3
    assert share_on_one_section(uv, normals, 0.002, 0.05, 0.7) == pytest.approx(48 / 60)
    # Points on it whose normals do not point to the centre are not of it.
    uv, normals = circle(rng, 60)
    normals[:6, :2] = normals[:6, 1::-1] * [-1.0, 1.0]
    assert share_on_one_section(uv, normals, 0.002, 0.05, 0.7) == pytest.approx(54 / 60)


def test_that_a_curve_without_an_axis_or_a_section_has_no_share(rng):
    uv, normals = circle(rng, 20)
    # The axis along the profile's plane, and two points.
    assert share_on_one_section(uv, normals[:, [0, 2, 1]], 0.002, 0.05, 0.7) == 0.0
    assert share_on_one_section(uv[:2], normals[:2], 0.002, 0.05, 0.7) == 0.0
    assert share_on_one_section(np.zeros((20, 2)), normals, 0.002, 0.05, 0.7) == 0.0


LIMITS = (0.45, np.deg2rad(180.0), 0.8, 0.003, np.deg2rad(200.0), 0.05, 0.6, 0.4)


def rows(rng, n=6000, length=1.0, arc=2 * np.pi):
    chainage, clock = rng.uniform(0, length, n), rng.uniform(0, arc, n)
    return chainage, clock, 0.001 * rng.normal(size=n), 0.02 * rng.normal(size=n)


def covered(parts, length=1.0):
    return cover_rows(*parts, length, 0.1, 0.0, 0.05, 24, LIMITS)


def test_that_every_step_of_a_whole_pipe_is_covered(rng):
    arc, found, n_core = covered(rows(rng))
    assert_array_equal(found, np.arange(20))
    assert n_core == 20
    assert_allclose(arc, 2 * np.pi, atol=2 * 2 * np.pi / 24)


def test_that_steps_off_the_surface_flat_or_seen_too_little_are_not_covered(rng):
    # Seen over 230°, so that a plane could be, as far as clock angles go.
    chainage, clock, residual, angle = rows(rng, arc=4.0)
    step = (chainage / 0.05).astype(int)
    residual[step == 3] += 0.01
    # On a plane the angle takes back what the clock turns.
    angle[step == 7] = -clock[step == 7]
    narrow = (step == 12) & (clock > 0.5)
    parts = [values[~narrow] for values in (chainage, clock, residual, angle)]
    _, found, n_core = covered(parts)
    assert_array_equal(found, np.setdiff1d(np.arange(20), [3, 7, 12]))
    assert n_core == 17


def test_that_an_oval_step_is_covered_and_a_bowed_one_is_not(rng):
    chainage, clock, residual, angle = rows(rng)
    step = (chainage / 0.05).astype(int)
    oval = np.abs(step - 10) <= 2
    # Five standard deviations (σ·√(2/300) = 0.08 mm) below the largest amplitude, 0.05 r.
    residual[oval] += 0.0046 * np.cos(2 * clock[oval] - 0.4)
    bowed = np.abs(step - 4) <= 1
    residual[bowed] += 0.02 * np.cos(clock[bowed])
    _, found, _ = covered((chainage, clock, residual, angle))
    assert set(range(9, 12)) <= set(found)
    assert not set(found) & {3, 4, 5}


def test_that_steps_beyond_the_proposed_length_are_covered_but_do_not_count(rng):
    _, found, n_core = covered(rows(rng), length=0.5)
    assert_array_equal(found, np.arange(20))
    assert n_core == 10
    # Nothing of the proposed extent has points.
    _, found, n_core = covered(rows(rng), length=-1.0)
    assert len(found) == n_core == 0


def follower(place, normal, starts, bend_radii, azimuths, tolerance, min_cos, max_angle, most):
    """The rule written with vectors."""
    best = (-1, 0, 0, 0)
    for i, start in enumerate(starts):
        for j, bend in enumerate(bend_radii):
            for k, azimuth in enumerate(azimuths):
                towards = np.array([0.0, np.cos(azimuth), np.sin(azimuth)])
                centre = np.array([start, 0.0, 0.0]) + bend * towards
                ahead = np.array([1.0, 0.0, 0.0])
                count = 0
                for p, n in zip(place.T, normal.T, strict=True):
                    q = p - centre
                    along = q @ ahead
                    angle = np.arctan2(along, -q @ towards)
                    if not 0.0 < angle < min(max_angle, most / bend):
                        continue
                    radial = np.cos(angle) * -towards + np.sin(angle) * ahead
                    outward = q - bend * radial
                    rho = np.linalg.norm(outward)
                    count += bool(abs(rho - 1) < tolerance and abs(n @ outward) > min_cos * rho)
                if count > best[0]:
                    best = count, i, j, k
    return best


@pytest.mark.parametrize("true", [(0, 1, 3), (1, 0, 0), (1, 2, 6)])
def test_that_the_bend_with_most_points_is_found(rng, true):
    starts, bend_radii = np.array([0.0, 0.6]), np.array([2.0, 3.0, 5.0])
    azimuths = np.arange(8) * np.pi / 4
    start, bend, azimuth = starts[true[0]], bend_radii[true[1]], azimuths[true[2]]
    towards = np.array([0.0, np.cos(azimuth), np.sin(azimuth)])
    ahead, side = np.array([1.0, 0.0, 0.0]), np.array([0.0, -np.sin(azimuth), np.cos(azimuth)])
    angle, clock = rng.uniform(0.05, 1.2, 120), rng.uniform(0, 2 * np.pi, 120)
    radial = -np.cos(angle)[:, None] * towards + np.sin(angle)[:, None] * ahead
    normal = np.cos(clock)[:, None] * radial + np.sin(clock)[:, None] * side
    place = start * ahead + bend * towards + bend * radial + normal
    # Strays that lie on no bend.
    place = np.concatenate([place, rng.uniform(-3, 3, (60, 3))])
    normal = np.concatenate([normal, unit_rows(rng.normal(size=(60, 3)))])
    args = place.T.copy(), normal.T.copy(), starts, bend_radii
    rest = 0.08, 0.85, 1.5, 6.0
    found = best_follower(*args, np.cos(azimuths), np.sin(azimuths), *rest)
    assert found[1:] == true
    assert found == follower(*args, azimuths, *rest)
    assert found[0] >= 100


def test_that_of_no_points_the_first_bend_counts():
    nothing, one = np.empty((3, 0)), np.ones(1)
    assert best_follower(nothing, nothing, one, one, one, one, 0.1, 0.9, 1.5, 6.0) == (0, 0, 0, 0)
