"""Circle fits against their textbook forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import least_squares

from pipecore._kernels.circles import geometric_circle, taubin_circle, tukey_weight
from pipecore._kernels.section_circles import empty_circles, fit_sections

pytestmark = pytest.mark.kernels


def noisy_arc(rng, arc_deg, n=50, r=0.1, noise=0.002):
    angle = np.radians(arc_deg) * (np.arange(n) + rng.random(n)) / n + rng.uniform(0, 2 * np.pi)
    rho = r + noise * rng.normal(size=n)
    cx, cy = rng.uniform(-5, 5, 2)
    return cx + rho * np.cos(angle), cy + rho * np.sin(angle)


def taubin_by_svd(x, y):
    """Chernov's form with a singular value decomposition."""
    mx, my = x.mean(), y.mean()
    x, y = x - mx, y - my
    z = x**2 + y**2
    scale = 2 * np.sqrt(z.mean())
    a = np.linalg.svd(np.stack([(z - z.mean()) / scale, x, y], axis=1))[2][2]
    a0 = a[0] / scale
    centre = -a[1:] / a0 / 2
    r = np.sqrt(a[1] ** 2 + a[2] ** 2 + 4 * a0**2 * z.mean()) / abs(a0) / 2
    return centre[0] + mx, centre[1] + my, r


def geometric_by_scipy(x, y, start):
    return least_squares(lambda p: np.hypot(x - p[0], y - p[1]) - p[2], start, xtol=1e-14).x


@pytest.mark.parametrize("arc_deg", [360.0, 180.0, 120.0, 60.0])
def test_that_taubins_circle_is_that_of_its_svd_form(rng, arc_deg):
    for _ in range(5):
        x, y = noisy_arc(rng, arc_deg)
        assert_allclose(taubin_circle(x, y, np.ones(50)), taubin_by_svd(x, y), rtol=1e-8)


def test_that_a_weight_is_as_good_as_repeated_points(rng):
    x, y = noisy_arc(rng, 150.0, n=12)
    weights = rng.integers(0, 4, 12)
    again = np.repeat(x, weights), np.repeat(y, weights)
    assert_allclose(taubin_circle(x, y, weights.astype(float)), taubin_by_svd(*again), rtol=1e-8)


@pytest.mark.parametrize("arc_deg", [360.0, 180.0, 120.0])
def test_that_the_geometric_circle_without_reach_is_that_of_least_squares(rng, arc_deg):
    for _ in range(5):
        x, y = noisy_arc(rng, arc_deg)
        weights = np.empty(50)
        start = taubin_circle(x, y, np.ones(50))
        found = geometric_circle(x, y, *start, np.inf, weights, 30)
        assert_allclose(found, geometric_by_scipy(x, y, start), atol=1e-7)
        assert (weights == 1.0).all()


def test_that_points_out_of_reach_do_not_move_the_circle(rng):
    x, y = noisy_arc(rng, 240.0, noise=0.001)
    far = rng.uniform(0.3, 0.6, 8)  # more than a diameter off
    x_all, y_all = np.append(x, x[:8] + far), np.append(y, y[:8] + far)
    start = taubin_circle(x, y, np.ones(50))
    weights, weights_all = np.empty(50), np.empty(58)
    clean = geometric_circle(x, y, *start, 0.01, weights, 30)
    found = geometric_circle(x_all, y_all, *start, 0.01, weights_all, 30)
    assert_allclose(found, clean, atol=1e-12)
    assert (weights_all[50:] == 0.0).all()
    # The weighted residuals pull no way: the end of the iteration.
    d = np.hypot(x - found[0], y - found[1])
    pull = tukeys(d - found[2], 0.01) * (d - found[2])
    assert abs(pull.sum()) < 1e-6
    assert abs((pull * (x - found[0]) / d).sum()) < 1e-6


def tukeys(residual, reach):
    return np.where(np.abs(residual) < reach, (1 - (residual / reach) ** 2) ** 2, 0.0)


def test_that_weights_are_tukeys(rng):
    residual = rng.uniform(-2, 2, 30)
    assert_allclose([tukey_weight(r, 1.3) for r in residual], tukeys(residual, 1.3))


def test_that_points_which_carry_no_circle_give_none():
    spot = np.full(6, 0.3)
    assert np.isnan(taubin_circle(spot, spot, np.ones(6))).all()
    x = np.linspace(0, 1, 9)
    assert np.isnan(taubin_circle(x, x, np.zeros(9))).all()
    _, _, r = taubin_circle(x, 2 * x, np.ones(9))
    assert np.isnan(r) or r > 1e5
    weights = np.empty(9)
    assert np.isnan(geometric_circle(x, 0 * x, 0.5, -100.0, 100.0, 1e-9, weights, 5)).all()


def test_that_sections_are_the_least_squares_circles_of_their_points(rng):
    groups = [noisy_arc(rng, a, n=40) for a in (350.0, 170.0, 100.0)] + [(np.zeros(3), np.ones(3))]
    x, y = (np.concatenate(c) for c in zip(*groups, strict=True))
    starts = np.cumsum([0, *(len(g[0]) for g in groups)])
    circles = empty_circles(4)
    fit_sections(x, y, starts, 0.04, circles)
    for k, (gx, gy) in enumerate(groups[:3]):
        found = circles.centre_x[k], circles.centre_y[k], circles.radius[k]
        best = geometric_by_scipy(gx, gy, found)
        assert_allclose(found, best, atol=1e-7)
        off = np.hypot(gx - best[0], gy - best[1]) - best[2]
        assert circles.rms[k] == pytest.approx(np.sqrt((off**2).sum() / 37), rel=1e-6)
        angle = np.sort(np.arctan2(gy - found[1], gx - found[0]))
        steps = np.diff(angle, append=angle[0] + 2 * np.pi)
        assert circles.arc[k] == pytest.approx(steps[steps <= 0.04 / found[2]].sum())
    assert np.isnan([column[3] for column in circles]).all()
