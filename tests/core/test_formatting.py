import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipecore.formatting import (
    NOT_MEASURABLE,
    cell,
    format_clock,
    format_coordinate,
    format_count,
    format_measure,
    text_cell,
)


@pytest.mark.parametrize(
    ("degrees", "clock"),
    [(0, "12:00"), (15, "12:30"), (30, "1:00"), (90, "3:00"), (180, "6:00"), (272.5, "9:05")],
)
def test_that_a_clock_angle_reads_as_on_a_clock(degrees, clock):
    assert format_clock(np.deg2rad(degrees)) == clock
    assert format_clock(np.deg2rad(degrees + 360)) == clock
    assert format_clock(np.deg2rad(degrees - 360)) == clock


def test_that_a_clock_never_shows_hour_zero_or_minute_sixty():
    shown = {format_clock(angle) for angle in np.linspace(0, 2 * np.pi, 5001)}
    assert len(shown) == 720
    assert not any(text.startswith("0:") or text.endswith(":60") for text in shown)
    assert format_clock(np.nan) == ""


@pytest.mark.parametrize(
    ("value", "sd", "text"),
    [
        (109.5234, 0.04, "109.52 ± 0.04"),
        (109.5234, 0.14, "109.52 ± 0.14"),
        (109.5234, 2.4, "110 ± 2"),
        (109.5234, 23.0, "110 ± 23"),
        (57.15, 0.097, "57.15 ± 0.10"),
        (57.15, 0.0996, "57.15 ± 0.10"),
        (-3.2, 0.5, "−3.2 ± 0.5"),
        (-0.001, 0.5, "0.0 ± 0.5"),
        (8.0, math.nan, "8.0"),
        (8.0, 0.0, "8.0"),
        (math.nan, 0.1, NOT_MEASURABLE),
        (math.inf, 0.1, NOT_MEASURABLE),
    ],
)
def test_that_the_uncertainty_decides_the_digits(value, sd, text):
    assert format_measure(value, sd) == text


def test_that_a_unit_follows_a_number_but_not_the_lack_of_one():
    assert format_measure(109.52, 0.04, "mm") == "109.52 ± 0.04 mm"
    assert format_measure(math.nan, math.nan, "mm") == NOT_MEASURABLE


@given(st.floats(-1e6, 1e6), st.floats(1e-5, 1e4))
def test_that_what_is_shown_is_the_value_within_its_uncertainty(value, sd):
    shown, shown_sd = format_measure(value, sd).replace("−", "-").split(" ± ")
    assert abs(float(shown) - value) <= 0.52 * max(sd, 1.0 if sd > 1 else sd)
    assert float(shown_sd) == pytest.approx(sd, rel=0.26)


@given(st.floats(-1e8, 1e8), st.integers(0, 6))
def test_that_a_number_for_machines_is_the_nearest_with_its_digits(value, decimals):
    text = cell(value, decimals)
    assert abs(float(text) - value) <= 0.5001 * 10.0**-decimals
    assert "e" not in text
    assert not text.startswith("-0.") or float(text) < 0


def test_that_a_machine_gets_nothing_where_nothing_was_measured():
    assert cell(math.nan, 2) == cell(math.inf, 2) == ""
    assert cell(-0.0001, 2) == "0.00"


@pytest.mark.parametrize("text", ["=1+1", "+cmd", "-2", "@SUM(A1)", "\tx"])
def test_that_no_text_is_a_formula_to_a_spreadsheet(text):
    assert text_cell(text) == f"'{text}"
    assert text_cell("DN 150 / NPS 6") == "DN 150 / NPS 6"
    assert text_cell("") == ""


def test_that_coordinates_are_grouped_and_counts_agree_with_their_noun():
    assert format_coordinate(6201877.53) == "6\u2009201\u2009877.530"
    assert format_coordinate(-12.3456, 2) == "−12.35"
    assert format_count(1, "pipe") == "1 pipe"
    assert format_count(1200, "pipe") == "1,200 pipes"
