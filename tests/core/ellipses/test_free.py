"""Free ellipses of many groups, by the method of the settings."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pipecore.ellipses import fit_direct_ellipses, fit_free_ellipses
from pipecore.errors import CancelledError
from pipecore.settings import EllipseFit

SEMI_MAJOR, SEMI_MINOR, NOISE = 0.11, 0.10, 0.001


def rings(rng, n_groups, n_points=150, strangers=0.0):
    """Points around ellipses, a share of them up to 4 cm outside, and where groups start."""
    t = rng.uniform(0, 2 * np.pi, (n_groups, n_points))
    off = NOISE * rng.normal(size=t.shape)
    is_strange = (rng.uniform(size=t.shape) < strangers) & (np.cos(t) > 0)
    off[is_strange] += rng.uniform(0.01, 0.04, is_strange.sum())
    points = np.stack([(SEMI_MAJOR + off) * np.cos(t), (SEMI_MINOR + off) * np.sin(t)], axis=-1)
    return points.reshape(-1, 2), np.arange(n_groups + 1) * n_points


@pytest.mark.parametrize("method", list(EllipseFit))
def test_that_every_method_finds_clean_ellipses(rng, method):
    points, starts = rings(rng, 4)
    found = fit_free_ellipses(points, starts, np.ones(4, np.bool_), method)
    assert found.semi_minor == pytest.approx(SEMI_MINOR, abs=0.0015)
    assert found.semi_major == pytest.approx(SEMI_MAJOR, abs=0.0015)


def test_that_the_robust_method_bears_strangers_that_mislead_the_direct_one(rng):
    points, starts = rings(rng, 6, strangers=0.3)
    all_wanted = np.ones(6, np.bool_)
    off = {
        method: np.abs(
            fit_free_ellipses(points, starts, all_wanted, method).semi_major - SEMI_MAJOR
        )
        for method in EllipseFit
    }
    assert off[EllipseFit.ROBUST].max() < 0.0015
    assert np.median(off[EllipseFit.ROBUST]) < 0.5 * np.median(off[EllipseFit.DIRECT])


def test_that_only_wanted_groups_get_the_time_of_a_slow_fit(rng):
    points, starts = rings(rng, 3)
    checks = []
    found = fit_free_ellipses(
        points, starts, np.array([False, True, False]), EllipseFit.NONLINEAR,
        lambda: checks.append(1),
    )  # fmt: skip
    assert_array_equal(np.isnan(found.semi_minor), [True, False, True])
    assert len(checks) == 1
    direct = fit_free_ellipses(points, starts, np.array([True, False, True]), EllipseFit.DIRECT)
    every = fit_direct_ellipses(points, starts)
    assert_array_equal(direct.semi_minor, np.where([1, 0, 1], every.semi_minor, np.nan))
    none = fit_free_ellipses(points, starts, np.zeros(3, np.bool_), EllipseFit.DIRECT)
    assert np.isnan(none.semi_minor).all()


def test_that_slow_fits_can_be_cancelled(rng):
    points, starts = rings(rng, 3)

    def cancel():
        raise CancelledError

    with pytest.raises(CancelledError):
        fit_free_ellipses(points, starts, np.ones(3, np.bool_), EllipseFit.ROBUST, cancel)
