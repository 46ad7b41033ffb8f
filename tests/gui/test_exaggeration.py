"""Sections drawn with enlarged deviations, without a window."""

import numpy as np
import pytest

from pipecore.inspection.section import SectionEllipse
from pipegui.plots.exaggeration import ellipse_points, exaggerate

CIRCLE = SectionEllipse((0.003, -0.002), 0.080, 0.080, 0.0)
TILTED = SectionEllipse((0.003, -0.002), 0.110, 0.080, 0.7)


@pytest.mark.parametrize("reference", [CIRCLE, TILTED])
def test_that_points_on_the_reference_stay_however_exaggerated(reference):
    points = ellipse_points(reference)
    assert exaggerate(points, reference, 20) == pytest.approx(points)


@pytest.mark.parametrize("reference", [CIRCLE, TILTED])
def test_that_exaggeration_multiplies_the_deviation_and_nothing_else(reference, rng):
    points = ellipse_points(reference) + rng.normal(0, 0.002, (181, 2))
    drawn = exaggerate(points, reference, 7)
    assert reference.deviation(drawn) == pytest.approx(7 * reference.deviation(points))
    assert reference.clock(drawn) == pytest.approx(reference.clock(points))
    assert exaggerate(points, reference, 1) == pytest.approx(points)


def test_that_an_ellipse_has_its_axes():
    reach = np.linalg.norm(ellipse_points(TILTED, 361) - TILTED.centre_uv, axis=1)
    assert reach.max() == pytest.approx(0.110, rel=1e-4)
    assert reach.min() == pytest.approx(0.080, rel=1e-4)
