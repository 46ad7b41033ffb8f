import numpy as np
import pytest

from pipecore.deformation import SectionCurve, fit_section

R = 0.084
TURN = 2 * np.pi


def spread(rng, start, arc, n):
    """Angles that leave no hole by chance."""
    return start + (np.arange(n) + rng.uniform(0, 1, n)) * arc / n


def ellipse(theta, a, b):
    return a * b / np.hypot(b * np.cos(theta), a * np.sin(theta))


def dent(theta, depth=0.01, clock=1.0, half_width=0.5):
    turn = np.mod(theta - clock + np.pi, TURN) - np.pi
    return R - depth * np.cos(np.pi / 2 * np.minimum(np.abs(turn) / half_width, 1)) ** 2


def fitted(theta, r) -> SectionCurve:
    curve = fit_section(theta, r)
    assert curve, curve.reason
    return curve


def test_that_a_circle_has_its_radius_and_curvature_everywhere(rng):
    theta = spread(rng, 0, TURN, 200)
    curve = fitted(theta, np.full(200, R))
    assert curve.order == 0
    assert curve.is_closed
    at = np.linspace(-7, 7, 50)
    assert np.allclose(curve.radius_at(at), R, rtol=1e-12)
    assert np.allclose(curve.curvature_at(at), 1 / R, rtol=1e-9)
    assert curve.curvature_variation == pytest.approx(0.0, abs=1e-6)


def test_that_a_noisy_circle_stays_a_circle_mostly(rng):
    curves = [
        fitted(spread(rng, 0, TURN, 150), R + 0.002 * rng.normal(size=150)) for _ in range(40)
    ]
    assert np.mean([c.order <= 1 for c in curves]) > 0.6
    assert np.median([c.curvature_variation for c in curves]) < 0.05
    assert np.mean([c.noise for c in curves]) == pytest.approx(0.002, rel=0.05)


def test_that_an_ellipse_has_the_curvature_of_its_axes_ends():
    theta = np.linspace(0, TURN, 400, endpoint=False)
    a, b = 0.1, 0.09
    curve = fitted(theta, ellipse(theta, a, b))
    assert curve.curvature_at(0.0) == pytest.approx(a / b**2, rel=1e-3)
    assert curve.curvature_at(np.pi / 2) == pytest.approx(b / a**2, rel=1e-3)
    assert curve.curvature_variation > 0.1


def test_that_the_curvature_is_the_second_derivative_of_the_drawn_curve():
    theta = np.linspace(0, TURN, 500, endpoint=False)
    curve = fitted(theta, dent(theta))
    at, step = np.linspace(0, TURN, 40), 1e-4

    def place(t):
        return curve.radius_at(t) * np.array([np.cos(t), np.sin(t)])

    before, here, after = place(at - step), place(at), place(at + step)
    first, second = (after - before) / (2 * step), (after - 2 * here + before) / step**2
    cross = first[0] * second[1] - first[1] * second[0]
    assert np.allclose(curve.curvature_at(at), cross / np.hypot(*first) ** 3, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("arc_deg", [360, 240, 150])
def test_that_a_dented_section_is_followed_within_its_uncertainty(rng, arc_deg):
    half = np.deg2rad(arc_deg) / 2
    scores, bottoms = [], []
    for _ in range(40):
        theta = spread(rng, 1.0 - half, 2 * half, 150)
        curve = fitted(theta, dent(theta) + 0.002 * rng.normal(size=150))
        at = 1.0 + np.linspace(-0.95 * half, 0.95 * half, 100)
        scores.append((curve.radius_at(at) - dent(at)) / curve.radius_sd_at(at))
        bottoms.append(float(curve.curvature_at(1.0)) * R)
    # A smooth series cannot follow the bell's seam exactly: somewhat above one.
    assert np.sqrt(np.mean(np.square(scores))) < 2.0
    # The bottom is re-entrant: -1.9 times the circle's curvature, and a smooth curve reads less:
    # -1.4 to -1.7, and the median of 40 scatters by 0.15.
    assert -2.6 < np.median(bottoms) < -0.6


def test_that_an_open_arc_stays_open(rng):
    theta = spread(rng, 5.5, np.deg2rad(150), 120)
    curve = fitted(theta, R + 0.001 * rng.normal(size=120))
    assert not curve.is_closed
    assert curve.arc == pytest.approx(np.deg2rad(150), abs=0.2)
    ((start, end),) = curve.spans
    assert 0 <= start < TURN < end
    middle, behind = (start + end) / 2, (start + end) / 2 + np.pi
    for value_at in (
        curve.radius_at, curve.radius_sd_at, curve.curvature_at, curve.curvature_sd_at,
    ):  # fmt: skip
        assert np.isfinite(value_at(middle))
        assert np.isfinite(value_at(middle - TURN))
        assert np.isnan(value_at(behind))
    (clocks,) = curve.clocks()
    assert np.isfinite(curve.radius_at(clocks)).all()


def test_that_a_hole_splits_the_curve(rng):
    theta = spread(rng, 0, TURN, 400)
    theta = theta[np.abs(theta - 2) > np.deg2rad(15)]
    theta = theta[np.abs(theta - 5) > np.deg2rad(15)]
    curve = fitted(theta, np.full(len(theta), R))
    assert len(curve.spans) == 2
    assert np.isnan(curve.radius_at([2.0, 5.0])).all()
    assert np.isfinite(curve.radius_at([0.0, 3.5])).all()


def test_that_the_uncertainty_falls_with_the_number_of_points(rng):
    def sd(n):
        theta = spread(rng, 0, TURN, n)
        return fitted(theta, ellipse(theta, 0.09, 0.08) + 0.002 * rng.normal(size=n))

    few, many = sd(100), sd(100_000)
    assert many.noise == pytest.approx(0.002, rel=0.03)
    assert float(many.radius_sd_at(1.0)) < 0.1 * float(few.radius_sd_at(1.0))


def test_that_stray_points_do_not_pull_the_curve(rng):
    theta = spread(rng, 0, TURN, 300)
    r = R + 0.001 * rng.normal(size=300)
    r[::12] += rng.uniform(0.01, 0.03, 25)
    assert np.allclose(fitted(theta, r).radius_at(np.linspace(0, 6, 30)), R, atol=0.0015)


def test_that_turning_the_section_turns_the_curve(rng):
    theta = spread(rng, 0, TURN, 200)
    r = dent(theta) + 0.001 * rng.normal(size=200)
    here, turned = fitted(theta, r), fitted(theta + 1.3, r)
    at = np.linspace(0, TURN, 30)
    assert here.order == turned.order
    assert np.allclose(here.radius_at(at), turned.radius_at(at + 1.3), atol=1e-9)
    assert np.allclose(here.curvature_at(at), turned.curvature_at(at + 1.3), atol=1e-5)


def test_that_scaling_the_section_scales_the_curve(rng):
    theta = spread(rng, 0, TURN, 200)
    r = dent(theta) + 0.001 * rng.normal(size=200)
    here, larger = fitted(theta, r), fitted(theta, 10 * r)
    assert here.order == larger.order
    assert larger.curvature_at(1.0) == pytest.approx(float(here.curvature_at(1.0)) / 10)
    assert larger.curvature_variation == pytest.approx(here.curvature_variation)


def test_that_the_order_of_points_does_not_matter(rng):
    theta = spread(rng, 0, TURN, 200)
    r = dent(theta) + 0.002 * rng.normal(size=200)
    order = rng.permutation(200)
    a, b = fitted(theta, r), fitted(theta[order], r[order])
    assert np.allclose(a.coefficients, b.coefficients, atol=1e-9)


@pytest.mark.parametrize(
    ("theta", "reason"),
    [
        (np.linspace(0, 6, 8), "only 8 points"),
        (np.linspace(0, 0.5, 100), "of arc"),
        (np.array([0.0, 2.0, 4.0] * 10), "of arc"),
        (np.full(50, np.nan), "only 0 points"),
    ],
)
def test_that_points_that_carry_no_curve_get_a_reason(theta, reason):
    curve = fit_section(theta, np.full(len(theta), R))
    assert not curve
    assert reason in curve.reason


def test_that_arrays_of_unlike_length_are_refused():
    with pytest.raises(ValueError, match="one length"):
        fit_section(np.zeros(3), np.zeros(4))
