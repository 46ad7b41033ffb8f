"""The direct ellipse: exact without noise, honest where there is none."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore.ellipses import fit_direct_ellipses


def ellipse(centre, semi_major, semi_minor, angle, t):
    x, y = semi_major * np.cos(t), semi_minor * np.sin(t)
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([centre[0] + c * x - s * y, centre[1] + s * x + c * y], axis=1)


def fit(*groups):
    return fit_direct_ellipses(np.concatenate(groups), np.cumsum([0, *map(len, groups)]))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("arc", [2 * np.pi, np.pi, 2.0])
def test_that_noise_free_points_give_back_their_ellipse(rng, scale, arc):
    n_trials = 24
    centres = scale * rng.uniform(-20, 20, (n_trials, 2))
    semi_major = scale * rng.uniform(0.5, 2.0, n_trials)
    semi_minor = semi_major * rng.uniform(0.3, 0.9, n_trials)
    angles = np.linspace(-np.pi / 2, np.pi / 2, n_trials) + 1e-3
    groups = [
        ellipse(c, a, b, angle, rng.uniform(0, 6) + np.linspace(0, arc, 31)[:-1])
        for c, a, b, angle in zip(centres, semi_major, semi_minor, angles, strict=True)
    ]
    found = fit(*groups)
    assert_allclose(found.centre, centres, atol=1e-6 * scale)
    assert_allclose(found.semi_major, semi_major, rtol=1e-6)
    assert_allclose(found.semi_minor, semi_minor, rtol=1e-6)
    assert_allclose(np.sin(found.angle - angles), 0.0, atol=1e-5)
    assert (found.rss < (1e-7 * scale) ** 2).all()


def test_that_a_circle_has_equal_axes(rng):
    found = fit(ellipse((3.0, -1.0), 0.2, 0.2, 0.0, np.linspace(0, 6, 20)))
    assert_allclose([found.semi_major[0], found.semi_minor[0]], 0.2, rtol=1e-7)


def test_that_the_fit_moves_turns_and_grows_with_its_points(rng):
    points = ellipse((0, 0), 0.3, 0.2, 0.4, np.linspace(0, 5, 40)) + 0.004 * rng.normal(
        size=(40, 2)
    )
    turn, shift, scale = 0.7, np.array([100.0, -30.0]), 2.5
    c, s = np.cos(turn), np.sin(turn)
    moved = scale * points @ np.array([[c, s], [-s, c]]) + shift
    found = fit(points, moved)
    assert found.semi_major[1] == pytest.approx(scale * found.semi_major[0])
    assert found.semi_minor[1] == pytest.approx(scale * found.semi_minor[0])
    assert np.sin(found.angle[1] - found.angle[0] - turn) == pytest.approx(0.0, abs=1e-7)
    assert_allclose(found.centre[1], scale * found.centre[0] @ np.array([[c, s], [-s, c]]) + shift)
    assert found.rss[1] == pytest.approx(scale**2 * found.rss[0])


def test_that_the_residuals_are_distances(rng):
    noise = 0.002
    t = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    off = noise * rng.normal(size=400)
    points = (0.1 + off)[:, None] * np.stack([np.cos(t), np.sin(t)], axis=1)
    found = fit(points)
    assert np.sqrt(found.rss[0] / 395) == pytest.approx(noise, rel=0.2)  # 3.6 %


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((8, 2)),
        np.linspace(0, 1, 9)[:, None] * [1.0, 2.0],
        np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 0.3]]),
        np.array([[0.0, 0.0], [1.0, 1.0]] * 5),
        np.ones((1, 2)),
    ],
)
def test_that_points_without_an_ellipse_get_nan_and_do_not_disturb_others(points):
    good = ellipse((1.0, 2.0), 0.3, 0.2, 0.4, np.linspace(0, 6, 20))
    found = fit(good, points, good)
    assert np.isnan([found.semi_major[1], found.semi_minor[1], *found.centre[1]]).all()
    assert_allclose(found.semi_major[[0, 2]], 0.3, rtol=1e-6)
