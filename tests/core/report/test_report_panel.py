"""Panels of figures: places, ticks, broken lines and pictures of cells."""

import base64
import io
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.image import imread
from numpy.testing import assert_allclose, assert_array_equal

from pipecore.report.panel import Panel, figure, limits_of, round_ticks

BOX = (10.0, 20.0, 200.0, 100.0)


def paths(panel: Panel, stroke: str) -> list[str]:
    drawing = ET.fromstring(figure(300, 200, [panel], "drawn"))
    return [p.get("d", "") for p in drawing.iter() if p.get("stroke") == stroke]


def test_that_values_lie_between_the_edges_of_the_panel():
    panel = Panel(BOX, (-1.0, 1.0), (0.0, 50.0))
    assert_allclose(panel.across([-1.0, 0.0, 1.0]), [10, 110, 210])
    assert_allclose(panel.down([0.0, 50.0]), [120, 20])


def test_that_a_line_is_broken_where_a_place_is_not_known():
    panel = Panel(BOX, (0.0, 10.0), (0.0, 10.0))
    x = np.array([0.0, 5.0, 6.0, 7.0, 8.0])
    panel.line(x, np.array([np.nan, 0.0, 10.0, np.nan, 5.0]), "red", 1.0)
    assert paths(panel, "red") == ["M110.0 120.0L130.0 20.0M170.0 70.0"]


def test_that_points_and_bars_are_only_where_they_are_known():
    panel = Panel(BOX, (0.0, 10.0), (0.0, 10.0))
    x, y = np.array([0.0, 5.0]), np.array([np.nan, 10.0])
    panel.points(x, y, "red", 2.0)
    panel.bars(x, y - 10, y, "blue")
    assert paths(panel, "red") == ["M110.0 20.0h.01"]
    assert paths(panel, "blue") == ["M110.0 120.0V20.0"]


def test_that_nothing_known_draws_nothing():
    panel = Panel(BOX, (0.0, 1.0), limits_of(np.full(3, np.nan), margin=0.1))
    panel.line(np.arange(3.0), np.full(3, np.nan), "red", 1.0)
    assert paths(panel, "red") == []


@given(
    st.floats(-1e7, 1e7),
    st.floats(1e-3, 1e6),
    st.floats(1.0, 12.0),
)
def test_that_ticks_are_round_numbers_within_the_limits(low, span, n_most):
    high = low + span
    ticks = round_ticks((high, low), n_most)
    assert ticks == round_ticks((low, high), n_most)
    assert len(ticks) <= n_most + 2
    slack = 1e-6 * span
    for value, text in ticks:
        assert low - slack <= value <= high + slack
        assert float(text.replace("\u2212", "-")) == pytest.approx(
            value, abs=1e-9 * abs(low) + 1e-9
        )
    steps = np.diff([value for value, _ in ticks])
    assert_allclose(steps, steps[:1].repeat(len(steps)), rtol=1e-6, atol=1e-9 * abs(low))


def test_that_limits_hold_the_values_with_room(rng):
    values = rng.normal(size=20)
    low, high = limits_of(values[:10], values[10:], margin=0.25)
    assert low == pytest.approx(values.min() - 0.25 * np.ptp(values))
    assert high == pytest.approx(values.max() + 0.25 * np.ptp(values))
    low, high = limits_of(np.array([3.0, np.nan]), margin=0.25)
    assert low < 3.0 < high


def test_that_cells_are_blue_inward_red_outward_and_holes_are_seen_through(rng):
    panel = Panel(BOX, (0.0, 1.0), (0.0, 1.0))
    panel.cells(np.array([[-5.0, 0.0, 9.0], [np.nan, -2.0, 2.0]]), 5.0)
    (data,) = re.findall(r"base64,([^\"]*)", panel.svg())
    pixels = imread(io.BytesIO(base64.b64decode(data)), format="png")
    assert pixels.shape == (2, 3, 4)
    assert_array_equal(pixels[..., 3], [[1, 1, 1], [0, 1, 1]])
    assert_allclose(pixels[0, 1, :3], pixels[0, 1, 0])  # neither
    for (row, column), (more, less) in {(0, 0): (2, 0), (1, 1): (2, 0), (0, 2): (0, 2)}.items():
        assert pixels[row, column, more] > pixels[row, column, less]
    assert pixels[1, 2, 0] > pixels[1, 2, 2]


def test_that_texts_cannot_put_anything_into_the_figure():
    evil = "<script>&"
    drawing = figure(300, 200, [Panel(BOX, (0.0, 1.0), (0.0, 1.0), evil, evil)], '"' + evil)
    texts = [t.text for t in ET.fromstring(drawing).iter() if t.text]
    assert texts.count(evil) == 2
