"""Robust statistics: right on normal noise, deaf to outliers."""

import numpy as np
import pytest

from pipecore.robust import MAD_TO_SD, TUKEY_REACH, robust_sd, sample_evenly, tukey_weights


def test_scale_of_normal_noise_is_its_standard_deviation():
    noise = np.random.default_rng(7).normal(0.0, 2.5, 200_000)
    # The estimate's own standard deviation is 1.17 σ / √n = 0.0065.
    assert robust_sd(noise) == pytest.approx(2.5, abs=5 * 0.0066)


def test_outliers_move_the_scale_only_by_their_number():
    rng = np.random.default_rng(8)
    noise = np.concatenate([rng.normal(0.0, 1.0, 2000), np.full(1000, 1e6)])
    # The median of all is the upper quartile of the |noise|, 1.150 σ.
    assert robust_sd(noise) == pytest.approx(MAD_TO_SD * 1.150, rel=0.1)


def test_biweight_falls_from_one_to_zero_at_its_reach_and_is_even():
    q = np.linspace(0.0, 2.0, 201)
    weights = tukey_weights(q)
    assert weights[0] == 1.0
    assert np.all(np.diff(weights[q <= 1.0]) < 0)
    assert np.all(weights[q >= 1.0] == 0.0)
    np.testing.assert_array_equal(tukey_weights(-q), weights)


def test_biweight_mean_is_95_percent_as_efficient_as_least_squares():
    # Asymptotic efficiency (E ψ')² / E ψ² for normal noise, by quadrature.
    x = np.linspace(-8.0, 8.0, 200_001)
    density = np.exp(-0.5 * x * x) / np.sqrt(2 * np.pi)
    psi = x * tukey_weights(x / TUKEY_REACH)
    slope = np.gradient(psi, x)
    step = x[1] - x[0]
    efficiency = (slope * density).sum() ** 2 * step / (psi**2 * density).sum()
    assert efficiency == pytest.approx(0.95, abs=1e-3)


def test_even_sample_keeps_order_ends_and_limit():
    rows = np.arange(3000).reshape(1000, 3)
    sample = sample_evenly(rows, 17)
    assert sample.shape == (17, 3)
    np.testing.assert_array_equal(sample[[0, -1]], rows[[0, -1]])
    gaps = np.diff(sample[:, 0]) // 3
    assert gaps.max() - gaps.min() <= 1


def test_few_rows_are_returned_as_they_are():
    rows = np.arange(5.0)
    assert sample_evenly(rows, 5) is rows
