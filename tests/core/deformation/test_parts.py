import numpy as np
import pytest

from pipecore.deformation.bump import bump_shape, cone, fit_bump, frustum
from pipecore.deformation.contour import fit_contour
from pipecore.deformation.deviation_map import Grid, close_holes, group_median
from pipecore.deformation.matched_filter import MatchedFilter
from pipecore.deformation.ovality import true_ranges
from pipecore.deformation.strain import dent_strain


def patch(
    rng, *, n=600, height=-0.01, length=0.12, width=0.08, noise=0.001, q=1.0, form=bump_shape
):
    """Points on one bump a little off the middle of a plane piece."""
    along, around = rng.uniform(-0.15, 0.15, (2, n))
    rho = np.hypot(2 * (along - 0.01) / length, 2 * (around + 0.005) / width)
    deviation = height * form(rho, q) + noise * rng.normal(size=n)
    return along, around, deviation, np.full(n, noise)


def fitted(data, start=(-0.008, 0.1, 0.1), contour_sd=1e-4):
    return fit_bump(*data, start=start, diameter=0.2, contour_sd=contour_sd, inflation=1.0)


def test_that_a_bump_without_noise_is_recovered(rng):
    along, around, deviation, noise = patch(rng, noise=0)
    bump = fitted((along, around, deviation, noise + 1e-5))
    assert bump.height == pytest.approx(-0.01, rel=1e-3)
    assert (bump.length, bump.width) == pytest.approx((0.12, 0.08), rel=1e-3)
    assert (bump.along, bump.around) == pytest.approx((0.01, -0.005), abs=1e-4)
    # f'' at the peak of h·cos²(π u / L) is 2π² h / L².
    assert bump.curvature_along == pytest.approx(2 * np.pi**2 * 0.01 / 0.12**2, rel=0.01)


@pytest.mark.parametrize("q", [0.7, 2.0], ids=["pointed", "flat-bottomed"])
def test_that_the_depth_follows_the_form_of_the_dent(rng, q):
    bump = fitted(patch(rng, n=4000, q=q))
    assert abs(bump.height + 0.01) < 6.5 * bump.height_sd
    # 0.6 ± 0.12 mm for the pointed one.
    assert bump.height_sd < 0.0016


def test_that_the_depth_s_standard_deviation_is_what_depths_scatter_by(rng):
    # Of the three forms together: which of them it is, is a part of the uncertainty.
    forms = (bump_shape, cone, frustum)
    bumps = [fitted(patch(rng, n=300, noise=0.002, form=forms[i % 3])) for i in range(90)]
    t = np.array([(b.height + 0.01) / b.height_sd for b in bumps])
    assert 0.6 < np.std(t) < 1.5  # ± 0.09
    assert abs(np.mean(t)) < 0.5


def test_that_a_patch_of_noise_is_no_clear_bump(rng):
    bump = fitted(patch(rng, height=0.0))
    assert bump is None or abs(bump.height) < 6 * bump.height_sd


def grid(length=2.0, radius=0.1, rows=200, columns=63):
    return Grid(length, radius, rows, columns)


def seen(g: Grid, arc: float):
    """Variances of 1 mm² per cell over an arc, inf elsewhere."""
    turn = np.mod(g.clocks + np.pi, 2 * np.pi) - np.pi
    return np.where(np.abs(turn) < arc / 2, 1e-6, np.inf) + np.zeros(g.shape)


def test_that_a_dent_does_not_pull_the_contour(rng):
    g = grid()
    s, clock = g.chainages[:, None], np.mod(g.clocks + np.pi, 2 * np.pi) - np.pi
    rho = np.hypot((s - 1.0) / 0.05, clock[None, :] / 0.5)
    height = -0.02 * bump_shape(rho) + 0.001 * rng.normal(size=g.shape)
    variance = seen(g, np.deg2rad(150))
    contour = fit_contour(g, height, variance, 3)
    assert np.max(np.abs(contour.height[np.isfinite(variance)])) < 0.001


def test_that_taper_and_bow_are_in_the_contour(rng):
    g = grid(length=3.0, rows=300)
    s = g.chainages[:, None]
    truth = 0.002 * s + 0.008 * np.sin(np.pi * s / 3) * np.cos(g.clocks)[None, :]
    variance = seen(g, np.deg2rad(150))
    contour = fit_contour(g, truth + 0.001 * rng.normal(size=g.shape), variance, 3)
    error = (contour.height - truth)[np.isfinite(variance)]
    assert np.sqrt(np.mean(error**2)) < 0.0004


def test_that_the_contour_knows_how_well_it_is_known(rng):
    g = grid()
    errors = []
    for _ in range(20):
        variance = seen(g, np.deg2rad(160))
        contour = fit_contour(g, 0.001 * rng.normal(size=g.shape), variance, 3)
        used = np.isfinite(variance)
        errors.append((contour.height / contour.sd)[used])
    assert 0.6 < np.std(np.concatenate(errors)) < 1.5
    unseen = contour.sd[~used].max()
    assert unseen > 2 * contour.sd[used].max()


def test_that_pure_noise_has_no_candidates_at_six_sigma(rng):
    g = grid(length=20.0, rows=2000)
    count = rng.poisson(1.0, g.shape).astype(float)
    noise = rng.normal(size=g.shape) * 0.002 / np.sqrt(np.maximum(count, 1))
    bumps = MatchedFilter.of(g, count / 0.002**2, count, np.ones(g.shape, bool))
    assert bumps.find(np.where(count > 0, noise, np.nan), np.zeros(g.shape), 6.0) == []


def test_that_medians_of_groups_are_those_of_numpy(rng):
    group = rng.integers(0, 20, 300)
    group = group[group != 7]
    values = rng.normal(size=len(group))
    median, count = group_median(group, values, 21)
    for k in range(21):
        inside = values[group == k]
        assert count[k] == len(inside)
        if len(inside):
            assert median[k] == pytest.approx(np.median(inside))
        else:
            assert np.isnan(median[k])


def test_that_a_map_is_interpolated_round_the_clock():
    g = grid(columns=90)
    table = np.cos(g.clocks)[None, :] + g.chainages[:, None]
    clock = np.linspace(0, 2 * np.pi, 50)
    s = np.linspace(0.1, 1.9, 50)
    assert np.allclose(g.interpolate(table, s, clock), np.cos(clock) + s, atol=2e-3)


def test_that_small_holes_are_closed_and_large_ones_are_not():
    cells = np.ones((20, 30), bool)
    cells[5:7, 29] = False  # at the seam of the clock
    cells[10:16, 10:16] = False
    closed = close_holes(cells)
    assert closed[5:7, 29].all()
    assert not closed[12:14, 12:14].any()


def test_that_runs_are_told_apart():
    flags = np.array([1, 1, 0, 1, 0, 0, 1], bool)
    assert true_ranges(flags) == [(0, 1), (3, 3), (6, 6)]


def test_that_strain_follows_its_parts():
    flat = {"length": 1.0, "radius": 0.1, "wall": 0.008}
    none = dent_strain(depth=0.0, curvature_along=0.0, curvature_around=0.0, **flat)
    assert none == pytest.approx(0.0, abs=1e-12)
    # Bending along the pipe alone: ε₂ = t / (2 R₂), equivalent 2/√3 of it.
    bent = dent_strain(depth=0.0, curvature_along=2.0, curvature_around=0.0, **flat)
    assert bent == pytest.approx(2 / np.sqrt(3) * 0.004 * 2.0)
    # A section bent flat (r″ = r at the bottom): ε₁ = t / (2 R₀).
    around = dent_strain(depth=0.0, curvature_along=0.0, curvature_around=1 / 0.1, **flat)
    assert around == pytest.approx(2 / np.sqrt(3) * 0.004 / 0.1)
