"""What shapes leave of values, against numpy's least squares."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore._kernels import misfit

pytestmark = pytest.mark.kernels


def left_by(terms, values):
    return values - terms @ np.linalg.lstsq(terms, values, rcond=None)[0]


def test_that_least_squares_leave_what_they_do(rng):
    terms, values = rng.normal(size=(30, 5)), rng.normal(size=30)
    left = values.copy()
    misfit.remove_explained(terms.copy(), left)
    assert_allclose(left, left_by(terms, values), atol=1e-12)


def test_that_a_term_that_others_hold_adds_nothing(rng):
    terms, values = rng.normal(size=(30, 4)), rng.normal(size=30)
    doubled = np.column_stack(
        [terms[:, :3], terms[:, 0] - 2 * terms[:, 2], terms[:, 3], 0 * values]
    )
    left = values.copy()
    misfit.remove_explained(doubled.copy(), left)
    assert_allclose(left, left_by(terms, values), atol=1e-12)


@pytest.mark.parametrize("n_harmonics", [1, 2])
def test_that_a_section_is_held_against_circle_or_oval_by_the_medians_of_its_sectors(
    rng, n_harmonics
):
    clock = rng.uniform(0.3, 5.0, 700)
    residual = rng.normal(size=700) + np.cos(2 * clock)
    residual[clock > 4.8] = 50.0
    few = np.concatenate([clock, [5.5, 5.51]]), np.concatenate([residual, [99.0, 99.0]])
    found = misfit.section_misfit(*few, 36, 5, 0.005, n_harmonics)
    sector = (few[0] / (2 * np.pi) * 36).astype(int)
    used = [s for s in range(36) if (sector == s).sum() >= 5]
    medians = [np.sort(few[1][sector == s])[(sector == s).sum() // 2] for s in used]
    angle = (np.array(used) + 0.5) * (2 * np.pi / 36)
    terms = [np.ones_like(angle)]
    for k in range(1, n_harmonics + 1):
        terms += [np.cos(k * angle), np.sin(k * angle)]
    left = left_by(np.stack(terms, axis=1), np.array(medians))
    assert found == pytest.approx(np.sqrt((left**2).sum() / (len(left) - len(terms))))


def test_that_few_sectors_tell_no_misfit(rng):
    assert (
        misfit.section_misfit(rng.uniform(0, 0.8, 500), rng.normal(size=500), 36, 5, 0.02, 1) == 0
    )


def test_that_the_least_sum_of_distances_passes_by_what_is_far_off(rng):
    terms = np.column_stack([np.ones(40), np.linspace(-1, 1, 40)])
    values = terms @ [0.3, -0.7] + 1e-3 * rng.normal(size=40)
    values[::4] += 5.0
    left = misfit.least_distances(terms, values, np.full(40, 1e-3), 30)
    assert_allclose(left[::4], 5.0, atol=0.02)
    assert np.abs(np.delete(left, np.s_[::4])).max() < 0.02


def test_that_a_sphere_is_held_against_the_medians_of_its_patches(rng):
    n, radius = 4000, 0.3
    out = rng.normal(size=(n, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    centre = rng.normal(size=3)
    # A quarter about the vertical is not seen, and the lower part neither; noise has no say.
    seen = np.flatnonzero((np.arctan2(out[:, 1], out[:, 0]) > -np.pi / 2) & (out[:, 2] > -0.5))
    departure = np.where(out[:, 2] > 0.0, 0.004, -0.002) + rng.normal(0, 1e-4, n)
    xyz = centre + (radius + departure)[:, None] * out
    found, low, high, arc, per_point = misfit.sphere_misfit(xyz, seen, centre, radius, 36, 12, 8, 5)
    # Of eight even steps of height four are above the middle and two below.
    assert found == pytest.approx(np.sqrt((4 * 0.004**2 + 2 * 0.002**2) / 6), rel=0.02)
    assert low == pytest.approx((xyz[seen, 2] - centre[2]).min())
    assert high == pytest.approx((xyz[seen, 2] - centre[2]).max())
    assert arc == pytest.approx(1.5 * np.pi, abs=0.2)
    # Six of eight steps and three of four quarters are seen: 54 patches of equal area.
    assert per_point == pytest.approx(54 / len(seen), rel=0.1)
    assert misfit.sphere_misfit(xyz, seen[:3], centre, radius, 36, 12, 8, 5)[0] == np.inf
