"""Cuts through cylinders and spheres, known in closed form."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore._kernels import circles, curve_splitting, oblique_cuts
from pipecore._kernels.curve_fits import CurveFits, CurveLimits, fit_curves
from pipecore._kernels.curve_splitting import SplitLimits
from tests.core.shapes import random_rotation, unit_rows

# Random numbers wrap around on purpose, which plain numpy warns of.
pytestmark = [pytest.mark.kernels, pytest.mark.filterwarnings("ignore:overflow encountered")]

SPLIT = SplitLimits(
    min_points=6, tolerance=0.004, max_gap=0.03, cos_radial=0.9, min_cos_tilt=np.cos(np.pi / 4),
    max_radius=5.0, n_trials=60, max_pieces=6,
)  # fmt: skip


def axis_of(tilt_deg, azimuth_deg):
    t, a = np.radians(tilt_deg), np.radians(azimuth_deg)
    return np.array([np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), np.cos(t)])


def cut_cylinder(axis, centre, r, angles):
    """Points (u, v) and normals (u, v, d) of the cut of a cylinder by the plane d = 0."""
    e1 = np.cross(axis, [0.3, 0.5, -0.8])
    e1 /= np.linalg.norm(e1)
    e2 = np.cross(axis, e1)
    normals = np.cos(angles)[:, None] * e1 + np.sin(angles)[:, None] * e2
    points = r * normals - (r * normals[:, 2] / axis[2])[:, None] * axis
    assert_allclose(points[:, 2], 0.0, atol=1e-12)
    return np.ascontiguousarray(points[:, :2] + centre), normals


def fit(*curves, tolerance=0.004, max_gap=0.04):
    uv, normals = (np.concatenate(c) for c in zip(*curves, strict=True))
    starts = np.cumsum([0, *(len(c[0]) for c in curves)])
    fits = CurveFits.empty(len(curves))
    limits = CurveLimits(tolerance, max_gap, 0.0, np.inf)
    fit_curves(uv, normals, starts, 0, len(curves), limits, fits)
    return fits


def test_that_curves_with_a_steep_or_hardly_defined_axis_are_none(rng):
    angles = np.linspace(0, np.pi, 40)
    uv, normals = cut_cylinder(axis_of(30.0, 10.0), np.zeros(2), 0.1, angles)
    for limits, is_one in (((0.85, np.inf), True), ((0.88, np.inf), False), ((0.0, -1.0), False)):
        fits = CurveFits.empty(1)
        starts = np.array([0, len(uv)])
        fit_curves(uv, normals, starts, 0, 1, CurveLimits(0.002, 0.05, *limits), fits)
        assert all(np.isfinite(column).all() == is_one for column in fits)
        assert all(np.isnan(column).all() != is_one for column in fits)


def test_that_the_common_axis_is_the_least_eigenvector_of_the_normals(rng):
    normals = unit_rows(rng.normal(size=(30, 3)) * [1.0, 0.6, 0.1]) @ random_rotation(rng)
    chosen = rng.random(30) < 0.7
    u, v, d, l1, l2 = oblique_cuts.common_axis(normals, chosen)
    values, vectors = np.linalg.eigh(normals[chosen].T @ normals[chosen] / chosen.sum())
    assert d >= 0
    assert abs(np.array([u, v, d]) @ vectors[:, 0]) == pytest.approx(1.0, abs=1e-9)
    assert_allclose([l1, l2], values[:2], atol=1e-12)
    assert np.isnan(oblique_cuts.common_axis(normals, np.arange(30) < 2)).all()


def test_that_looking_along_an_axis_is_a_projection(rng):
    axis = axis_of(rng.uniform(0, 60), rng.uniform(0, 360))
    uv, normals = rng.normal(size=(10, 2)), unit_rows(rng.normal(size=(10, 3)))
    x, y, mx, my = np.empty((4, 10))
    tu, tv = oblique_cuts.project_along_axis(uv, normals, *axis, x, y, mx, my)
    # The view's base: across the tilt, and towards it.
    across = np.array([-tv, tu, 0.0])
    towards = np.cross(across, axis)
    towards *= np.sign(towards @ [tu, tv, 0.0])
    points = np.column_stack([uv, np.zeros(10)])
    assert_allclose(np.stack([x, y]), np.stack([points @ across, points @ towards]), atol=1e-12)
    assert_allclose(np.stack([mx, my]), np.stack([normals @ across, normals @ towards]), atol=1e-12)


@pytest.mark.parametrize("tilt_deg", [0.0, 12.0, 35.0, 44.0])
@pytest.mark.parametrize("arc_deg", [360.0, 170.0, 100.0])
def test_that_an_exact_cut_gives_back_its_cylinder(rng, tilt_deg, arc_deg):
    axis = axis_of(tilt_deg, rng.uniform(0, 360))
    r, centre = rng.uniform(0.02, 0.5), rng.uniform(-5, 5, 2)
    step = np.radians(arc_deg) / 60
    angles = rng.uniform(0, 6) + step * np.arange(60)
    found = fit(cut_cylinder(axis, centre, r, angles), max_gap=1.5 * step * r).rows(0)
    assert_allclose(found.centre, centre, atol=1e-8)
    assert_allclose(found.axis, axis, atol=1e-7)
    assert found.radius == pytest.approx(r, abs=1e-8)
    assert found.rms < 1e-8
    seen = 360.0 if arc_deg == 360.0 else np.degrees(59 * step)
    assert np.degrees(found.arc) == pytest.approx(seen, abs=1e-4)
    assert found.n_points == 60
    assert found.radial_share == 1.0
    # On a cylinder the normals of a cut meet on its axis, abreast of the cut's middle.
    meeting = found.meeting_point - [*centre, 0.0]
    if np.isfinite(meeting[0]):
        assert np.linalg.norm(np.cross(meeting, axis)) < 1e-5


def test_that_the_normals_of_a_cut_sphere_meet_in_its_centre(rng):
    big_r, centre = 0.3, rng.uniform(-2, 2, 2)
    heights = np.array([0.02, 0.08, -0.12])
    curves = []
    for h in heights:
        angles = np.linspace(0, rng.uniform(3, 6), 40)
        rho = np.sqrt(big_r**2 - h**2)
        uv = centre + rho * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        rim = np.column_stack([uv - centre, np.full(40, h)])
        curves.append((uv, rim / big_r))
    fits = fit(*curves)
    assert_allclose(fits.meeting_point[:, :2], np.tile(centre, (3, 1)), atol=1e-8)
    assert_allclose(fits.meeting_point[:, 2], -heights, atol=1e-8)
    assert_allclose(fits.meeting_distance, big_r, atol=1e-8)


def test_that_too_few_points_or_parallel_normals_give_no_fit(rng):
    angles = np.linspace(0, 3, 4)
    wall = np.column_stack([np.linspace(0, 1, 20), np.zeros(20)])
    fits = fit(
        cut_cylinder(axis_of(10, 0), np.zeros(2), 0.1, angles),
        (wall, np.tile([0.0, 1.0, 0.0], (20, 1))),
    )
    assert all(np.isnan(column).all() for column in fits)


def test_that_the_covered_arc_is_all_but_the_wide_gaps(rng):
    for _ in range(20):
        angles = np.sort(rng.uniform(-np.pi, np.pi, rng.integers(1, 12)))
        max_gap = rng.uniform(0.3, 1.5)
        following = np.append(angles[1:], angles[0] + 2 * np.pi)
        gaps = following - angles
        expected = gaps[gaps <= max_gap].sum()
        assert circles.covered_arc(angles, max_gap) == pytest.approx(expected, abs=1e-9)


def test_that_a_curve_of_two_pipes_is_split_into_its_pipes_and_a_single_one_left_whole(rng):
    angles = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    small = cut_cylinder(axis_of(5, 40), np.array([0.0, 0.0]), 0.06, angles)
    large = cut_cylinder(axis_of(20, 200), np.array([0.17, 0.0]), 0.11, angles)
    shuffled = rng.permutation(80)
    both = [np.concatenate(pair)[shuffled] for pair in zip(small, large, strict=True)]
    origin = np.repeat([0, 1], 40)[shuffled]
    uv = np.concatenate([both[0], small[0]])
    normals = np.concatenate([both[1], small[1]])
    piece = np.zeros(120, np.int64)
    curve_splitting.split_curves(uv, normals, np.array([0, 80, 120]), 0, 2, SPLIT, piece)
    assert (piece[80:] == 0).all()
    labels = [piece[:80][origin == k] for k in (0, 1)]
    winners = [np.bincount(label).argmax() for label in labels]
    assert 0 not in winners
    assert winners[0] != winners[1]
    for label, winner in zip(labels, winners, strict=True):
        assert (label == winner).mean() > 0.9


def test_that_the_best_circle_has_most_points_and_only_free_ones(rng):
    angles = np.linspace(0, 2 * np.pi, 30, endpoint=False)
    many = cut_cylinder(axis_of(0, 0), np.zeros(2), 0.1, angles)
    few = cut_cylinder(axis_of(0, 0), np.array([0.5, 0.0]), 0.05, angles[::3])
    uv, normals = (np.concatenate(p) for p in zip(many, few, strict=True))
    inliers = np.empty(40, np.bool_)

    def best(free):
        return curve_splitting.best_circle(
            uv, normals, free, SPLIT._replace(tolerance=0.003), 7, inliers
        )

    free = np.ones(40, np.bool_)
    assert best(free) == 30
    assert list(np.flatnonzero(inliers)) == list(range(30))
    free[:30] = False
    assert best(free) == 10
    assert list(np.flatnonzero(inliers)) == list(range(30, 40))
    assert best(np.zeros(40, np.bool_)) == 0


@pytest.mark.parametrize("spread_deg", [4.0, 9.9, 25.0])
def test_that_a_flat_curve_has_no_pair_that_tells_an_axis(rng, spread_deg):
    n = 60
    mean = unit_rows(rng.normal(size=(1, 3)))[0]
    off = np.radians(rng.uniform(0, spread_deg, n))
    across = unit_rows(np.cross(mean, rng.normal(size=(n, 3))))
    normals = np.cos(off)[:, None] * mean + np.sin(off)[:, None] * across
    normals[::3] *= -1
    free = rng.uniform(size=n) < 0.8
    # What is not free does not count.
    normals[~free] = unit_rows(rng.normal(size=(n, 3)))[~free]
    cos = np.abs(normals[free] @ normals[free].T)
    is_flat = curve_splitting.is_flat(normals, free)
    assert is_flat == (spread_deg < 8.0) or spread_deg == 9.9
    if is_flat:
        assert cos.min() >= curve_splitting.MIN_PAIR_COS
    _, i, j = curve_splitting.pick_pair(*normals[free].T.copy(), np.uint64(7))
    assert not is_flat or (i, j) == (-1, -1)


def test_that_the_turn_on_a_circle_counts_points_that_lie_on_it_and_face_its_centre(rng):
    axis, r = axis_of(25.0, 40.0), 0.1
    angles = rng.uniform(0, np.pi, 80)
    uv, normals = cut_cylinder(axis, np.array([0.3, -0.2]), r, angles)
    uv[::5] += 0.03
    normals[::7] = unit_rows(rng.normal(size=normals[::7].shape))
    x, y, mx, my = (np.empty(80) for _ in range(4))
    tu, tv = oblique_cuts.project_along_axis(uv, normals, *axis, x, y, mx, my)
    cx, cy = x[1] - r * mx[1], y[1] - r * my[1]
    is_on = np.array(
        [
            oblique_cuts.fits_circle(*row, cx, cy, r, 0.004, 0.9)
            for row in zip(x, y, mx, my, strict=True)
        ]
    )
    assert 20 < is_on.sum() < 70
    theta = np.arctan2(y - cy, x - cx)[is_on]
    expected = len(theta) - abs(np.exp(2j * theta).sum())
    turn = curve_splitting.turn_on_circle(
        *(column.astype(np.float32) for column in (*uv.T, *normals.T)),
        tu, tv, axis[2], np.hypot(*axis[:2]), cx, cy, r, 0.004, 0.9,
    )  # fmt: skip
    # Each point's share is that of one on the circle itself.
    assert turn == pytest.approx(expected, abs=0.05 * len(theta))
