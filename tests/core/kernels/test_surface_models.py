"""Distances from surfaces and the parts of their fits, against differences and plain sums."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pipecore._kernels import surface_fit
from pipecore._kernels import surface_models as kernels
from tests.core.shapes import random_direction, unit_rows

pytestmark = pytest.mark.kernels

KINDS = (kernels.CYLINDER, kernels.CONE, kernels.TORUS, kernels.SPHERE)
LAST = {kernels.CYLINDER: 0.0, kernels.CONE: 0.2, kernels.TORUS: 0.3, kernels.SPHERE: 0.0}


def surface(rng, kind):
    numbers = np.zeros(14)
    numbers[:3], numbers[3:6] = rng.normal(size=3), random_direction(rng)
    numbers[12], numbers[13] = 0.1, LAST[kind]
    kernels.place_frame(numbers)
    return numbers


def at(kind, numbers, place):
    slopes = np.empty(kernels.MOST_PARAMETERS)
    found = kernels.at_point(kind, numbers, *place, slopes)
    return found[0], np.array(found[1:]), slopes[: kernels.n_parameters(kind)]


def around(rng, numbers, n=40):
    return numbers[:3] + rng.uniform(-0.25, 0.25, (n, 3))


def test_that_a_frame_is_right_handed_for_any_direction(rng):
    for direction in (*np.eye(3), *-np.eye(3), *(random_direction(rng) for _ in range(20))):
        numbers = np.zeros(14)
        numbers[3:6] = direction
        kernels.place_frame(numbers)
        frame = np.stack([numbers[6:9], numbers[9:12], direction])
        assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(frame) == pytest.approx(1.0)


@pytest.mark.parametrize("kind", KINDS)
def test_that_outward_is_the_gradient_of_the_distance(rng, kind):
    numbers = surface(rng, kind)
    for place in around(rng, numbers):
        distance, outward, _ = at(kind, numbers, place)
        gradient = [
            (at(kind, numbers, place + h)[0] - at(kind, numbers, place - h)[0]) / 2e-6
            for h in 1e-6 * np.eye(3)
        ]
        assert_allclose(outward, gradient, atol=1e-5)
        assert np.linalg.norm(outward) == pytest.approx(1.0)
        on_surface = place - distance * outward
        assert at(kind, numbers, on_surface)[0] == pytest.approx(0.0, abs=1e-9)


def differences(kind, numbers, place):
    """Change of the distance of a point with each parameter."""
    found = []
    for step in 1e-6 * np.eye(kernels.n_parameters(kind)):
        beside = [numbers.copy(), numbers.copy()]
        for moved, h in zip(beside, (-step, step), strict=True):
            kernels.move(kind, moved, h)
        found.append((at(kind, beside[1], place)[0] - at(kind, beside[0], place)[0]) / 2e-6)
    return found


@pytest.mark.parametrize("kind", [kernels.CYLINDER, kernels.TORUS, kernels.SPHERE])
def test_that_slopes_are_the_derivatives_by_the_parameters(rng, kind):
    numbers = surface(rng, kind)
    for place in around(rng, numbers, 10):
        assert_allclose(at(kind, numbers, place)[2], differences(kind, numbers, place), atol=1e-5)


def test_that_the_slopes_of_a_cone_lead_where_its_derivatives_do(rng):
    """A tilt leaves out that it moves points along the axis, which an offset makes up for."""
    numbers = surface(rng, kernels.CONE)
    on_surface = []
    for place in around(rng, numbers, 40):
        distance, outward, _ = at(kernels.CONE, numbers, place)
        on_surface.append(place - distance * outward)
    slopes = np.array([at(kernels.CONE, numbers, place)[2] for place in on_surface])
    true = np.array([differences(kernels.CONE, numbers, place) for place in on_surface])
    combination, *_ = np.linalg.lstsq(slopes, true, rcond=None)
    assert_allclose(slopes @ combination, true, atol=1e-5)
    # Radius and slope, whose deviations are reported, are the derivatives themselves.
    assert_allclose(slopes[:, [0, 1, 4, 5]], true[:, [0, 1, 4, 5]], atol=1e-5)
    assert np.linalg.cond(combination) < 2


@pytest.mark.parametrize("kind", KINDS)
def test_that_many_points_are_as_one_by_one(rng, kind):
    numbers, p = surface(rng, kind), kernels.n_parameters(kind)
    xyz = np.concatenate([around(rng, numbers), numbers[None, :3]])
    residuals, slopes, outward = np.empty(41), np.empty((41, p)), np.empty((41, 3))
    kernels.at_points(kind, numbers, xyz, residuals, slopes, outward)
    for i in range(40):
        distance, direction, row = at(kind, numbers, xyz[i])
        assert residuals[i] == distance
        assert_array_equal(outward[i], direction)
        assert_array_equal(slopes[i], row)
    # On the axis there is no outward.
    assert np.isnan([residuals[40], *outward[40]]).all()


@pytest.mark.parametrize("kind", [kernels.CYLINDER, kernels.CONE])
def test_that_the_sums_of_lines_are_those_of_their_points(rng, kind):
    numbers, p, reach = surface(rng, kind), kernels.n_parameters(kind), 0.15
    xyz = around(rng, numbers, 200)
    normal, right, residuals = np.empty((p, p)), np.empty(p), np.empty(200)
    n = surface_fit.line_equations(numbers, xyz, reach, residuals, normal, right)
    rows = [at(kind, numbers, place) for place in xyz]
    distance, slopes = np.array([r[0] for r in rows]), np.array([r[2] for r in rows])
    weight = np.clip(1 - (distance / reach) ** 2, 0, None) ** 2
    assert n == np.count_nonzero(weight) > 5
    assert_allclose(residuals, distance, atol=1e-12)
    assert_allclose(normal, slopes.T @ (weight[:, None] * slopes), atol=1e-12)
    assert_allclose(right, slopes.T @ (weight * distance), atol=1e-12)
    # Nothing counts of points that are all on the axis.
    on_axis = np.tile(numbers[:3], (5, 1))
    assert surface_fit.line_equations(numbers, on_axis, reach, np.empty(5), normal, right) == 0
    assert not normal.any()


def one_sided(rng, noise, n=4000, radius=0.1):
    """A cylinder seen from +x over 140°, with noise along x, and its points."""
    numbers = np.zeros(14)
    numbers[5], numbers[12] = 1.0, radius
    kernels.place_frame(numbers)
    angle = np.deg2rad(rng.uniform(-70, 70, n))
    xyz = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), rng.uniform(-1, 1, n)])
    xyz[:, 0] += noise * rng.normal(size=n)
    return numbers, xyz


BEAM = surface_fit.BeamNoise(
    0.55, np.array([-2.334, -0.742, 0.742, 2.334]), np.array([0.0459, 0.4541, 0.4541, 0.0459])
)


def test_that_the_bias_of_noise_along_the_beam_is_subtracted(rng):
    noise = 0.006
    radii = {}
    for name, beam in (("left", BEAM._replace(min_one_sided=np.inf)), ("subtracted", BEAM)):
        numbers, xyz = one_sided(rng, noise, n=40_000)
        covariance = np.empty((5, 5))
        surface_fit.fit_surface(kernels.CYLINDER, numbers, xyz, noise, 30, 1e-9, beam, covariance)
        radii[name] = (numbers[12], np.sqrt(covariance[4, 4]))
    # The bias is about σ²/r, many standard deviations here, and a tenth of that at most is left.
    assert radii["left"][0] < 0.1 - 0.5 * noise**2 / 0.1
    assert abs(radii["subtracted"][0] - 0.1) < max(0.2 * noise**2 / 0.1, 5 * radii["subtracted"][1])


def test_that_a_surface_seen_all_round_or_without_noise_is_left_where_it_is(rng):
    numbers, xyz = one_sided(rng, 0.0)
    for facing, points in ((np.array([0.3, 0.0, 0.0]), xyz), (np.array([0.9, 0.0, 0.0]), xyz)):
        moved = numbers.copy()
        surface_fit.subtract_range_noise_bias(
            kernels.CYLINDER, moved, points, 0.01, facing, BEAM, np.eye(5)
        )
        # But for the frame across, which any step sets anew.
        assert_allclose(np.delete(moved - numbers, np.s_[6:12]), 0.0, atol=1e-12)


def test_that_the_correction_is_the_inverse_times_the_mean_gradient(rng):
    numbers, xyz = one_sided(rng, 0.004)
    beam, reach = unit_rows(np.array([[1.0, 0.2, 0.1]]))[0], 0.02
    sd = surface_fit.noise_along(kernels.CYLINDER, numbers, xyz, reach, beam)
    pull = np.empty(5)
    surface_fit.pull_along(
        kernels.CYLINDER, numbers, xyz, reach, beam, sd * BEAM.steps, BEAM.shares, pull
    )
    inverse = np.diag([1.0, 2.0, 3.0, 4.0, 5.0]) * 1e-6
    expected, moved = numbers.copy(), numbers.copy()
    kernels.move(kernels.CYLINDER, expected, inverse @ pull)
    surface_fit.subtract_range_noise_bias(
        kernels.CYLINDER, moved, xyz, reach, 0.8 * beam, BEAM, inverse
    )
    assert np.abs(moved - numbers).max() > 0.0
    assert_allclose(moved, expected, atol=1e-12)
