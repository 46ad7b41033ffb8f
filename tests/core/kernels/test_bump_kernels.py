"""Bumps' residuals and derivatives, against their sections and finite differences."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore._kernels import bumps
from pipecore.deformation.bump import BELL, CONE, FRUSTUM

pytestmark = pytest.mark.kernels

FORMS = (BELL, CONE, FRUSTUM)


@pytest.mark.parametrize("form", FORMS, ids=["bell", "cone", "frustum"])
def test_that_sections_are_those_of_the_forms(rng, form):
    for rho in (0.0, 1.0, 1.5, *rng.uniform(0, 1, 20)):
        for q in (1.0, rng.uniform(0.4, 3.0)):
            height, _, _ = bumps.section(form.number, rho, q)
            assert height == pytest.approx(float(form.section(np.array([rho]), q)[0]))


@pytest.mark.parametrize("n_free", [6, 7])
@pytest.mark.parametrize("form", FORMS, ids=["bell", "cone", "frustum"])
def test_that_derivatives_are_those_of_the_residuals(rng, form, n_free):
    n = 80
    along, around = rng.uniform(-0.1, 0.1, (2, n))
    deviation, noise = 0.01 * rng.normal(size=n), rng.uniform(1e-3, 3e-3, n)
    p = np.array([0.012, 0.01, -0.005, np.log(0.15), np.log(0.12), 0.001, np.log(1.3)])[:n_free]
    here, ahead, behind = np.empty((3, n))
    bumps.residuals(form.number, p, along, around, deviation, noise, here)
    q = np.exp(p[6]) if n_free > 6 else 1.0
    rho = np.hypot(2 * (along - p[1]) / 0.15, 2 * (around - p[2]) / 0.12)
    assert_allclose(here, (deviation - p[0] * form.section(rho, q) - p[5]) / noise, atol=1e-9)
    found = np.empty((n, n_free))
    bumps.derivatives(form.number, p, along, around, noise, found)
    # A section has a kink at its rim, a frustum also at its top.
    smooth = (np.abs(rho - 1) > 1e-3) & (np.abs(rho - q / (1 + q)) > 1e-3)
    h = 1e-6
    for k in range(n_free):
        step = h * np.eye(n_free)[k]
        bumps.residuals(form.number, p + step, along, around, deviation, noise, ahead)
        bumps.residuals(form.number, p - step, along, around, deviation, noise, behind)
        numeric = (ahead - behind) / (2 * h)
        assert_allclose(found[smooth, k], numeric[smooth], rtol=1e-4, atol=1e-4)


def test_that_a_point_at_the_peak_has_no_slope():
    p = np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 0.2])
    zero, found = np.zeros(1), np.empty((1, 7))
    for form in FORMS:
        bumps.derivatives(form.number, p, zero, zero, np.ones(1), found)
        assert_allclose(found, [[-1.0, 0, 0, 0, 0, -1.0, 0]], atol=1e-12)
