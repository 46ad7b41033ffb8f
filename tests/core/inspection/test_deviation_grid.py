from dataclasses import replace

import numpy as np
import pytest

from pipecore.inspection.deviation_grid import clock_from, grid_deviation
from pipecore.inspection.points import ElementPoints, element_points
from tests.factories import make_scan

CLOUD, RESULT = make_scan()
DENTED, HALF_SEEN = 2, 9


def points(element_id, deviation=None) -> ElementPoints:
    found = element_points(CLOUD, RESULT, element_id)
    if deviation is None:
        return found
    return replace(found, deviation=np.full(len(found), deviation))


def test_that_angles_from_a_clock_lie_on_either_side_of_it():
    assert clock_from(np.deg2rad([0, 90, 270])) == pytest.approx(np.deg2rad([0, 90, -90]))
    assert clock_from(0.0, np.deg2rad(350)) == pytest.approx(np.deg2rad(10))


def test_that_the_grid_keeps_every_point_and_their_mean():
    grid = grid_deviation(RESULT.element(DENTED), points(DENTED, 0.0034))
    assert grid.n_points.sum() == (RESULT.element_id == DENTED).sum()
    filled = grid.n_points > 0
    assert grid.deviation[filled] == pytest.approx(0.0034)
    assert np.isnan(grid.deviation[~filled]).all()


def test_that_the_deepest_cell_of_the_grid_is_the_dent():
    dent = RESULT.deformation(1)
    grid = grid_deviation(RESULT.element(DENTED), points(DENTED))
    row, column = np.unravel_index(np.nanargmin(grid.deviation), grid.deviation.shape)
    chainage, clock = float(grid.chainages[row]), float(grid.clocks[column])
    assert abs(chainage - dent.chainage) < 0.05
    assert abs(clock_from(clock, dent.clock)) < np.deg2rad(30)
    assert grid.cell(chainage, clock) == (row, column)
    assert grid.cell(chainage + 10, clock) is None


def test_that_a_part_of_the_grid_about_another_clock_shows_the_same_surface():
    dent = RESULT.deformation(1)
    extent = dent.chainage - 0.2, dent.chainage + 0.2
    element, found = RESULT.element(DENTED), points(DENTED)
    part = grid_deviation(element, found, extent=extent, centre_clock=dent.clock)
    assert (part.start, part.start + part.length) == pytest.approx(extent)
    inside = (found.chainage >= extent[0]) & (found.chainage <= extent[1])
    assert part.n_points.sum() == inside.sum()
    row, column = np.unravel_index(np.nanargmin(part.deviation), part.deviation.shape)
    n_columns = part.deviation.shape[1]
    assert abs(column - n_columns / 2) < n_columns / 12
    assert part.cell(float(part.chainages[row]), float(part.clocks[column])) == (row, column)


def test_that_what_no_station_saw_stays_empty():
    grid = grid_deviation(RESULT.element(HALF_SEEN), points(HALF_SEEN))
    n_columns = grid.n_points.shape[1]
    share_seen = (grid.n_points.sum(axis=0) > 0).sum() / n_columns
    assert share_seen == pytest.approx(140 / 360, abs=2.5 / n_columns)


def test_that_points_without_deviation_are_left_out():
    chainage, clock = np.array([0.1, 0.2, 0.3]), np.array([0.0, 1.0, 2.0])
    few = ElementPoints(
        np.arange(3), chainage, np.full(3, 0.1), clock, np.array([0.001, np.nan, 0.002])
    )
    assert grid_deviation(RESULT.element(DENTED), few).n_points.sum() == 2
