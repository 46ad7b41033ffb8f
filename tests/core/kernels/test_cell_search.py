"""Search for points in cells, against distances to all of them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pipecore._kernels import cell_search, point_search
from pipecore._kernels.grouping import group_by_label
from pipecore._kernels.surface_models import CYLINDER
from pipecore.elements.refinement.surface_fits import LineSurface
from pipecore.geometry import ArcAxis, LineAxis
from pipecore.surface.grid import table_of
from tests.core.shapes import random_direction, random_rotation, unit_rows

# Hashing wraps around on purpose, which plain numpy warns of.
pytestmark = [pytest.mark.kernels, pytest.mark.filterwarnings("ignore:overflow encountered")]

EDGE, FINE = 0.4, 0.1


def cells_with(xyz):
    """The points in fine cells, four of them along the side of a coarse one."""
    low = np.floor(xyz.min(axis=0) / EDGE) * EDGE
    fine = np.floor((xyz - low) / FINE).astype(np.int64)
    places, of_point = np.unique(fine, axis=0, return_inverse=True)
    coarse_places = places // 4
    n_y, n_z = coarse_places[:, 1].max() + 1, coarse_places[:, 2].max() + 1
    number = (coarse_places[:, 0] * n_y + coarse_places[:, 1]) * n_z + coarse_places[:, 2]
    keys, coarse = np.unique(number, return_inverse=True)
    order, cell_starts = group_by_label(coarse.ravel(), len(keys))
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    members, starts = group_by_label(rank[of_point.ravel()], len(order))
    return cell_search.PointCells(
        low, EDGE, int(n_y), int(n_z), table_of(keys), cell_starts,
        low + (places[order] + 0.5) * FINE, 0.5 * np.sqrt(3.0) * FINE + 1e-9,
        members.astype(np.int32), starts,
    )  # fmt: skip


def axes(rng):
    q = random_rotation(rng)
    return (
        LineAxis(rng.uniform(0.5, 1.0, 3), random_direction(rng), 0.8),
        ArcAxis(rng.uniform(0.5, 1.5, 3), q[2], q[0], 0.4, 1.3),
    )


@pytest.fixture
def cloud(rng):
    xyz = rng.uniform(0.0, 2.0, (3000, 3))
    return xyz, cells_with(xyz)


def held(grid, cells):
    """Points of some cells."""
    return {int(i) for c in cells for i in grid.members[grid.starts[c] : grid.starts[c + 1]]}


@pytest.mark.parametrize("which", [0, 1])
def test_that_the_cells_around_an_axis_hold_all_points_of_the_tube(rng, cloud, which):
    xyz, grid = cloud
    axis = axes(rng)[which]
    for inner, outer, begin, end in ((0.0, 0.3, 0.0, axis.length), (0.15, 0.25, 0.1, 0.3)):
        tube = cell_search.Tube(axis.numbers, inner, outer, begin, end)
        cells = cell_search.cells_around(grid, tube)
        assert len(np.unique(cells)) == len(cells)
        chainage, rho, _ = axis.pipe_coordinates(xyz)
        there = (rho > inner) & (rho < outer) & (chainage > begin) & (chainage < end)
        assert there.any()
        assert set(np.flatnonzero(there)) <= held(grid, cells)
        assert_array_equal(
            point_search.points_around(xyz, grid, cells, tube), np.flatnonzero(there)
        )
        # What no cell is near to is not looked at.
        assert len(cells) < 0.7 * len(grid.middles)


def test_that_a_tube_beside_the_cloud_has_no_cells(rng, cloud):
    _, grid = cloud
    axis = LineAxis(np.array([9.0, 9.0, 9.0]), random_direction(rng), 0.5)
    assert (
        len(cell_search.cells_around(grid, cell_search.Tube(axis.numbers, 0.0, 0.3, 0.0, 0.5))) == 0
    )
    assert len(cell_search.cells_in_shell(grid, np.full(3, -9.0), 0.0, 0.3)) == 0


def test_that_the_cells_in_a_shell_hold_all_its_points(rng, cloud):
    xyz, grid = cloud
    for inner, outer in ((0.0, 0.3), (0.25, 0.4)):
        place = rng.uniform(0.3, 1.7, 3)
        cells = cell_search.cells_in_shell(grid, place, inner, outer)
        distance = np.linalg.norm(xyz - place, axis=1)
        there = (distance >= inner) & (distance <= outer)
        assert there.any()
        assert set(np.flatnonzero(there)) <= held(grid, cells)
        if inner == 0.0:
            found = point_search.points_in_ball(xyz, grid, cells, place, outer)
            assert_array_equal(found, np.flatnonzero(there))


def oriented(rng, xyz):
    return point_search.OrientedPoints(
        xyz, unit_rows(rng.normal(size=xyz.shape)), rng.random(len(xyz)) < 0.6
    )


def test_that_points_on_a_sphere_are_free_and_face_its_centre(rng, cloud):
    xyz, grid = cloud
    points, centre = oriented(rng, xyz), rng.uniform(0.5, 1.5, 3)
    cells = cell_search.cells_in_shell(grid, centre, 0.2, 0.4)
    outward = xyz - centre
    rho = np.linalg.norm(outward, axis=1)
    cosine = np.abs(np.einsum("ij,ij->i", points.normals, outward)) / rho
    expected = np.flatnonzero(points.is_free & (rho > 0.2) & (rho < 0.4) & (cosine > 0.5))
    found = point_search.points_on_sphere(points, grid, cells, centre, 0.2, 0.4, 0.5, 1)
    assert len(found) > 10
    assert_array_equal(found, expected)
    some = point_search.points_on_sphere(points, grid, cells, centre, 0.2, 0.4, 0.5, 3)
    assert set(some) < set(found)


def test_that_points_on_and_inside_a_surface_are_told_by_distance_and_normal(rng, cloud):
    xyz, grid = cloud
    axis, points = axes(rng)[0], oriented(rng, xyz)
    model = LineSurface(axis.start, axis.direction, 0.25)
    tube = cell_search.Tube(axis.numbers, 0.05, 0.4, -0.1, axis.length + 0.1)
    cells = cell_search.cells_around(grid, tube)
    target = point_search.Target(CYLINDER, model.numbers(), 0.05, 0.08, 0.4)
    residual, _, outward = model.residuals(xyz)
    chainage, rho, clock = axis.pipe_coordinates(xyz)
    cosine = np.einsum("ij,ij->i", points.normals, outward)
    there = (rho > 0.05) & (rho < 0.4) & (chainage > -0.1) & (chainage < axis.length + 0.1)
    there &= np.abs(cosine) > 0.4
    on = np.flatnonzero(there & points.is_free & (np.abs(residual) < 0.05))
    found, columns = point_search.points_on(points, grid, cells, tube, target, 1)
    assert len(on) > 10
    assert_array_equal(found, on)
    assert_allclose(columns[:3], [residual[on], chainage[on], clock[on]], atol=1e-12)
    around = np.cross(axis.direction, outward[on])
    ahead = np.einsum("ij,ij->i", points.normals[on], around)
    assert_allclose(columns[3], np.arctan(ahead / cosine[on]), atol=1e-9)
    inside = np.flatnonzero(there & (residual < -0.08))
    seen = point_search.points_inside(points, grid, cells, tube, target)
    assert_allclose(np.sort(seen[0]), np.sort(chainage[inside]), atol=1e-12)
    assert_allclose(np.sort(seen[1]), np.sort(clock[inside]), atol=1e-12)

    spacing = rng.uniform(0.01, 0.03, len(xyz))
    whole, same, usual = point_search.points_on_surface(
        points, spacing, 0.001, grid, tube, tube, target, 0
    )
    assert_array_equal(whole, on)
    assert_array_equal(same, columns)
    assert usual == pytest.approx(np.median(spacing[on]))
    few = len(held(grid, cells)) // 3
    sample, _, wider = point_search.points_on_surface(
        points, spacing, 0.001, grid, tube, tube, target, few
    )
    stride = point_search.stride_of(grid, cells, few)
    assert set(sample) < set(on)
    assert wider == pytest.approx(np.median(spacing[sample]) * np.sqrt(stride))


def test_that_the_stride_keeps_below_the_number_of_points_wanted(cloud):
    _, grid = cloud
    cells = np.arange(len(grid.middles))
    for wanted in (1, 7, 100, 2999, 3000, 10_000):
        stride = point_search.stride_of(grid, cells, wanted)
        assert 3000 / stride <= wanted
        assert stride == 1 or 3000 / (stride - 1) > wanted
    assert point_search.stride_of(grid, cells, 0) == 1
    assert point_search.stride_of(grid, cells[:0], 5) == 1


def test_that_the_usual_spacing_is_the_median_of_those_known_but_no_less_than_wanted(rng):
    spacing = rng.uniform(0.01, 0.02, 50)
    spacing[::4] = np.nan
    chosen = rng.permutation(50)[:21]
    expected = np.nanmedian(spacing[chosen])
    assert point_search.usual_spacing(spacing, chosen, 0.0) == pytest.approx(expected)
    assert point_search.usual_spacing(spacing, chosen, 0.5) == 0.5
    assert point_search.usual_spacing(np.full(3, np.nan), np.arange(3), 0.1) == 0.1
    assert point_search.usual_spacing(spacing, chosen[:0], 0.1) == 0.1


@pytest.mark.parametrize("which", [0, 1])
def test_that_the_distance_from_an_axis_is_to_the_whole_line_or_circle(rng, which):
    axis = axes(rng)[which]
    for place in rng.uniform(0, 2, (30, 3)):
        if which == 0:
            expected = np.linalg.norm(np.cross(place - axis.start, axis.direction))
        else:
            height = (place - axis.centre) @ axis.normal
            across = np.linalg.norm(place - axis.centre - height * axis.normal)
            expected = np.hypot(across - axis.bend_radius, height)
        assert cell_search.distance_from_axis(axis.numbers, *place) == pytest.approx(expected)
    s = 0.3 * axis.length
    assert cell_search.distance_from_axis(axis.numbers, *axis.at(s)) == pytest.approx(0.0, abs=1e-7)


def test_that_a_full_array_is_doubled_and_keeps_its_items():
    items = np.array([4, 5])
    assert cell_search.appended(items, 1, 6) is items
    assert_array_equal(items, [4, 6])
    longer = cell_search.appended(items, 2, 7)
    assert len(longer) == 4
    assert_array_equal(longer[:3], [4, 6, 7])


def test_that_full_resolution_points_come_in_the_order_of_their_coordinates(rng):
    parent = rng.permutation(np.repeat(np.arange(6), 5))
    xyz = np.round(rng.uniform(0, 1, (30, 3)), 1)
    members, starts = group_by_label(parent, 6)
    chosen = np.array([4, 0, 2])
    index, places = np.empty(15, np.int64), np.empty((15, 3))
    point_search.full_resolution_points(members, starts, chosen, xyz, index, places)
    assert_array_equal(parent[index], np.repeat(chosen, 5))
    assert_array_equal(places, xyz[index])
    for k in range(3):
        own = places[5 * k : 5 * k + 5].tolist()
        assert own == sorted(own)
