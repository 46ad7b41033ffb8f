"""Fits of bumps, against their sections, finite differences and scipy."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import least_squares

from pipecore._kernels import bump_fit
from pipecore._kernels.bump_fit import BumpPoints, BumpPrior
from pipecore.deformation.bump import BELL, CONE, FRUSTUM

pytestmark = pytest.mark.kernels

FORMS = (BELL, CONE, FRUSTUM)


@pytest.mark.parametrize("form", FORMS, ids=["bell", "cone", "frustum"])
def test_that_sections_are_those_of_the_forms(rng, form):
    for rho in (0.0, 1.0, 1.5, *rng.uniform(0, 1, 20)):
        for q in (1.0, rng.uniform(0.4, 3.0)):
            height, _, _ = bump_fit.section(form.number, rho, q)
            assert height == pytest.approx(float(form.section(np.array([rho]), q)[0]))


def residuals(form, p, data, priors):
    """Of points and priors, as the forms' own sections give them."""
    along, around, deviation, noise = data
    slopes, middle = priors
    rho = np.hypot(2 * (along - p[1]) / np.exp(p[3]), 2 * (around - p[2]) / np.exp(p[4]))
    height = form.section(rho, np.exp(p[6]) if len(p) > 6 else 1.0)
    return np.append((p[0] * height + p[5] - deviation) / noise, slopes @ p - middle)


def made(rng, form, n_free, n=200):
    """A noisy bump, priors, and its parameters."""
    along, around = rng.uniform(-0.1, 0.1, (2, n))
    p = np.array([0.02, 0.01, -0.005, np.log(0.12), np.log(0.1), 0.001, np.log(1.3)])[:n_free]
    noise = rng.uniform(1e-3, 2e-3, n)
    slopes = np.diag([10.0, 30.0, 30.0, 1.0, 1.0, 300.0, 2.0])[:n_free, :n_free]
    priors = BumpPrior(slopes, slopes @ p)
    nothing = BumpPoints(along, around, np.zeros(n), np.ones(n))
    height = residuals(form, p, nothing, priors)[:n]
    return BumpPoints(along, around, height + noise * rng.normal(size=n), noise), priors, p


@pytest.mark.parametrize("n_free", [6, 7])
@pytest.mark.parametrize("form", FORMS, ids=["bell", "cone", "frustum"])
def test_that_sums_are_those_of_the_residuals_and_their_derivatives(rng, form, n_free):
    data, priors, p = made(rng, form, n_free)
    q = np.exp(p[6]) if n_free > 6 else 1.0
    rho = np.hypot(2 * (data[0] - p[1]) / np.exp(p[3]), 2 * (data[1] - p[2]) / np.exp(p[4]))
    # A section has a kink at its rim, a frustum also at its top.
    smooth = (np.abs(rho - 1) > 1e-3) & (np.abs(rho - q / (1 + q)) > 1e-3)
    data = BumpPoints(*(values[smooth] for values in data))
    here = residuals(form, p, data, priors)
    steps = 1e-6 * np.eye(n_free)
    jacobian = np.stack(
        [
            (residuals(form, p + h, data, priors) - residuals(form, p - h, data, priors)) / 2e-6
            for h in steps
        ],
        axis=1,
    )
    normal, right = np.empty((n_free, n_free)), np.empty(n_free)
    total = bump_fit.gather(form.number, p, data, priors, normal, right)
    assert total == pytest.approx(here @ here)
    expected = jacobian.T @ jacobian
    assert_allclose(normal, expected, rtol=1e-4, atol=1e-4 * np.abs(expected).max())
    size = np.linalg.norm(jacobian, axis=0) * np.linalg.norm(here)
    assert_allclose(right / size, -(jacobian.T @ here) / size, atol=1e-4)


@pytest.mark.parametrize("n_free", [6, 7])
@pytest.mark.parametrize("form", FORMS, ids=["bell", "cone", "frustum"])
def test_that_a_fit_is_no_worse_than_scipys(rng, form, n_free):
    data, priors, p = made(rng, form, n_free)
    first = p + [0.004, 0.004, 0.003, 0.2, -0.2, 0.0, 0.0][:n_free]
    found, normal = np.empty(n_free), np.empty((n_free, n_free))
    chi2 = bump_fit.fit(form.number, first, data, priors, 60, 1e-6, found, normal)
    here = residuals(form, found, data, priors)
    assert chi2 == pytest.approx(here @ here)
    best = least_squares(lambda p: residuals(form, p, data, priors), first, x_scale="jac")
    assert chi2 <= 2 * best.cost * (1 + 1e-3) + 0.1
    again, right = np.empty((n_free, n_free)), np.empty(n_free)
    bump_fit.gather(form.number, found, data, priors, again, right)
    assert_allclose(normal, again)


def test_that_a_point_at_the_peak_has_no_slope():
    p = np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 0.2])
    zero, one = np.zeros(1), np.ones(1)
    normal, right = np.empty((7, 7)), np.empty(7)
    for form in FORMS:
        total = bump_fit.gather(
            form.number,
            p,
            BumpPoints(zero, zero, zero, one),
            BumpPrior(np.zeros((1, 7)), zero),
            normal,
            right,
        )
        slopes = np.array([1.0, 0, 0, 0, 0, 1.0, 0])
        assert total == pytest.approx(1e-4)
        assert_allclose(normal, np.outer(slopes, slopes), atol=1e-12)
        assert_allclose(right, -0.01 * slopes, atol=1e-12)
