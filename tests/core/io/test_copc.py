"""COPC: whatever is asked of the octree, the points are those of the plain LAZ file."""

import numpy as np
import pytest
from laspy import CopcReader
from laspy.copc import Bounds
from numpy.testing import assert_allclose, assert_array_equal

from pipecore import io
from pipecore.errors import ReadError
from pipecore.io.formats import las
from pipecore.io.registry import identify
from pipecore.settings import LengthUnit, TilingSettings
from pipecore.tiling import estimate_need
from pipecore.types import PointCloud
from tests.core.io.copc import ENTRY, write_copc, write_tree
from tests.core.io.writers import FAR, Points, make_points


@pytest.fixture
def points(rng) -> Points:
    return make_points(rng, 20_000)


@pytest.fixture
def written(points, tmp_path, monkeypatch):
    path = tmp_path / "scan.copc.laz"
    return path, write_copc(path, points, monkeypatch)


def box_around(rng) -> np.ndarray:
    """A box with a few percent of the points."""
    low = np.round(FAR + rng.uniform(-30, 10, 3), 4) + 5e-5  # between the file's steps
    return np.array([low, low + np.round(rng.uniform(15, 20, 3), 4)])


def inside(cloud: PointCloud, box: np.ndarray) -> np.ndarray:
    world = cloud.world(cloud.xyz.astype(np.float64))
    return np.flatnonzero(((world >= box[0]) & (world <= box[1])).all(axis=1))


def is_octree_used(path) -> bool:
    with identify(path).open(path) as source:
        return source.within is not None


def test_that_the_file_is_one_for_laspys_copc_reader(rng, written, points):
    path, tree = written
    assert len(tree.pages) > 5
    with CopcReader.open(path) as reader:
        assert len(reader.query()) == len(points.xyz)
        # Between the file's steps, so that nobody's rounding matters.
        corner = Bounds(FAR - 31.0, np.round(FAR + rng.uniform(-5, 5, 3), 4) + 5e-5)
        found = reader.query(corner)
    expected = ((points.xyz >= corner.mins) & (points.xyz <= corner.maxs)).all(axis=1)
    assert len(found) == expected.sum()


def test_that_all_points_are_read_in_the_order_of_the_file(written, points):
    path, tree = written
    order = np.concatenate([tree.rows[key] for key in sorted(tree.rows)])
    assert is_octree_used(path)
    in_order = Points(points.xyz[order], points.intensity[order], points.rgb[order])
    assert in_order.hold(io.read(path))


@pytest.mark.parametrize("unit", [LengthUnit.METRE, LengthUnit.MILLIMETRE])
def test_that_a_box_holds_the_points_between_its_corners(rng, written, unit):
    path, _ = written
    whole = io.read(path)
    box = box_around(rng)
    found = io.read(path, box=box[::-1], length_unit=unit)
    expected = inside(whole, box)
    assert 0 < len(expected) < len(whole) / 5
    world = found.world(found.xyz.astype(np.float64)) / unit.metres
    assert_allclose(world, whole.world(whole.xyz[expected].astype(np.float64)), atol=1e-4)
    assert_array_equal(found.rgb, whole.rgb[expected])
    assert_array_equal(found.intensity, whole.intensity[expected])


def test_that_only_the_nodes_that_touch_a_box_are_read(rng, written, monkeypatch):
    path, _ = written
    box = box_around(rng)
    unpacked = 0
    unpack = las.unpack_chunks

    def counting(file, header, table, which, selection):
        nonlocal unpacked
        given = unpack(file, header, table, which, selection)
        unpacked += len(given)
        return given

    monkeypatch.setattr(las, "unpack_chunks", counting)
    found = io.read(path, box=box)
    n_most = estimate_need([path], TilingSettings(), box).n_points
    assert len(found) < unpacked == n_most < 0.7 * len(io.read(path))


def test_that_the_first_picture_is_of_everywhere(written, monkeypatch):
    path, tree = written
    monkeypatch.setattr(las, "OVERVIEW_POINTS", 700)
    seen = []
    cloud = io.read(path, look=seen.append)
    assert len(seen[0]) == len(tree.rows[0, 0, 0, 0]) == 500
    assert_array_equal(seen[0].origin, cloud.origin)
    assert seen[0].rgb is not None
    # Five hundred points at random leave the outer 5 % of a side empty once in 10¹¹.
    for end in (np.min, np.max):
        assert_allclose(end(seen[0].xyz, axis=0), end(cloud.xyz, axis=0), atol=3.0)


def test_that_the_spacing_is_that_of_all_points_and_not_of_the_coarse_ones(
    rng, tmp_path, monkeypatch
):
    # A sheet in a grid: its spacing is known, and no file order helps to guess it.
    step = 0.02
    grid = np.stack(np.meshgrid(np.arange(300), np.arange(300)), axis=-1).reshape(-1, 2)
    xyz = np.round(FAR + np.column_stack([step * grid, rng.uniform(0, 1e-3, len(grid))]), 4)
    sheet = Points(xyz, rng.integers(0, 9, len(xyz)), rng.integers(0, 255, (len(xyz), 3)))
    path = tmp_path / "sheet.copc.laz"
    write_copc(path, sheet, monkeypatch, per_node=4_000)
    assert io.info(path).spacing == pytest.approx(step, rel=0.15)


def test_that_a_box_beside_the_points_is_told(written):
    with pytest.raises(ReadError, match="lies in the box"):
        io.read(written[0], box=[FAR + 100, FAR + 200])


def test_that_a_box_cuts_plain_files_too(rng, points, tmp_path):
    path = tmp_path / "scan.xyz"
    np.savetxt(path, points.xyz, fmt="%.4f")
    box = box_around(rng)
    found = io.read([path, path], box=box)
    assert len(found) == 2 * len(inside(io.read(path), box)) > 0


def test_that_nodes_without_points_are_passed_over(rng, written):
    # Writers tell of them where only their children have points.
    path, tree = written
    whole, box = io.read(path), box_around(rng)
    *branch, place, n_bytes, n = tree.pages[0][-1]
    tree.pages[0][-1] = (*branch, place, n_bytes + ENTRY.size, n)
    tree.pages[-1].append((9, 0, 0, 0, 0, 0, 0))
    write_tree(path, tree)
    assert is_octree_used(path)
    assert_array_equal(io.read(path).xyz, whole.xyz)
    assert len(io.read(path, box=box)) == len(inside(whole, box))


def set_entry(tree, page, row, **changes):
    names = ("level", "x", "y", "z", "place", "n_bytes", "n")
    entry = dict(zip(names, tree.pages[page][row], strict=True)) | changes
    tree.pages[page][row] = tuple(entry[name] for name in names)


def point_page_at_itself(tree):
    set_entry(tree, 0, -1, place=tree.place, n_bytes=ENTRY.size * len(tree.pages[0]))


def point_page_beyond_the_end(tree):
    set_entry(tree, 0, -1, place=2**62)


def make_page_huge(tree):
    set_entry(tree, 0, -1, n_bytes=2**31 - 32)


def make_page_negative(tree):
    set_entry(tree, 0, -1, n_bytes=-ENTRY.size)


def lie_about_a_count(tree):
    set_entry(tree, 1, 0, n=tree.pages[1][0][6] + 1)


def count_below_nothing(tree):
    set_entry(tree, 1, 0, n=-2)


def point_node_at_another(tree):
    set_entry(tree, 0, 1, place=tree.pages[0][0][4])


def point_node_beyond_the_end(tree):
    set_entry(tree, 1, 0, place=2**63 + 5)


def lose_a_node(tree):
    set_entry(tree, 1, 0, n=0, place=0, n_bytes=0)


def give_a_cell_that_is_not_there(tree):
    set_entry(tree, 0, 0, x=1)


def go_too_deep(tree):
    set_entry(tree, 1, 0, level=2_000_000_000)


def shrink_the_cube(tree):
    tree.half /= 2


def lose_the_cube(tree):
    tree.half = float("nan")


@pytest.mark.parametrize(
    "break_tree",
    [
        point_page_at_itself,
        point_page_beyond_the_end,
        make_page_huge,
        make_page_negative,
        lie_about_a_count,
        count_below_nothing,
        point_node_at_another,
        point_node_beyond_the_end,
        lose_a_node,
        give_a_cell_that_is_not_there,
        go_too_deep,
        shrink_the_cube,
        lose_the_cube,
    ],
)
def test_that_a_file_with_a_broken_octree_is_read_as_plain_laz(rng, written, break_tree):
    path, tree = written
    whole, box = io.read(path), box_around(rng)
    part = io.read(path, box=box)
    break_tree(tree)
    write_tree(path, tree)
    assert not is_octree_used(path)
    assert_array_equal(io.read(path).xyz, whole.xyz)
    again = io.read(path, box=box)
    assert_array_equal(again.world(again.xyz), part.world(part.xyz))
    assert io.info(path).n_points == len(whole)


def test_that_a_node_whose_points_lie_elsewhere_is_told(written):
    path, tree = written
    # Two nodes of one level change places: counts and chunks are right, the cells are not.
    one, other = (tree.pages[0][row] for row in (1, 2))
    tree.pages[0][1], tree.pages[0][2] = (*other[:4], *one[4:]), (*one[:4], *other[4:])
    write_tree(path, tree)
    box = [FAR - 30, FAR + 30]
    with pytest.raises(ReadError, match="outside of the octree"):
        io.read(path, box=box)
    assert len(io.read(path)) == 20_000


def test_that_many_points_come_in_many_chunks(rng, tmp_path, monkeypatch):
    path = tmp_path / "scan.copc.laz"
    write_copc(path, make_points(rng, 60_000), monkeypatch, per_node=3_000)
    monkeypatch.setattr(las, "CHUNK_POINTS", 10_000)
    with identify(path).open(path) as source:
        assert source.within is not None
        chunks = list(source.within(np.array([FAR - 31, FAR + 31])))
    assert len(chunks) >= 5
    assert all(len(c.xyz) <= 10_000 + 3_000 for c in chunks)  # a node more
    assert chunks[-1].fraction == 1.0
    assert sum(len(c.xyz) for c in chunks) == 60_000
