import itertools

import numpy as np
import pytest

from pipecore import detect
from tools.world import FAMILIES, scene
from tools.world.assembly import Assembly, Role
from tools.world.clutter import boxes
from tools.world.judging import judge
from tools.world.noise import Noise, correlated_field, disturb
from tools.world.scenes import scanned
from tools.world.surfaces import quad
from tools.world.tubes import Line
from tools.world.viewing import Pattern, View, look

X, Y, Z = np.eye(3)
ALL_ROUND = np.empty((0, 3))


def _pipe(radius=0.1, length=1.5):
    assembly = Assembly()
    line = Line(-length / 2 * X, X, length)
    assembly.element(line, assembly.body("pipe", Role.PIPE), radius)
    return assembly


@pytest.mark.parametrize("family", list(FAMILIES))
def test_that_a_seed_always_draws_the_same_labelled_scene(family):
    one, again = scene(3, family), scene(3, family)
    np.testing.assert_array_equal(one.cloud.xyz, again.cloud.xyz)
    np.testing.assert_array_equal(one.body, again.body)
    assert one.properties == again.properties
    assert len(one.cloud) == len(one.body) == len(one.element_id) == len(one.chainage)
    assert np.isfinite(one.cloud.xyz).all()
    roles = np.array([b.role for b in one.bodies])[one.body]
    assert set(roles[one.element_id > 0]) <= {Role.PIPE}
    assert (family == "clutter") == (len(one.truth.elements) == 0)


def test_that_other_seeds_draw_other_scenes():
    drawn = [tuple(scene(seed, "lone").properties.items()) for seed in range(6)]
    assert len({repr(d) for d in drawn}) == 6


def test_that_one_station_sees_less_than_half_of_a_pipe(rng):
    stations = np.array([[0.0, 4.0, 0.5]])
    drawn = scanned(_pipe(), View(stations, Pattern.EVEN, 0.01), Noise(), rng, {})
    arc = np.rad2deg(np.median(drawn.truth.elements[0].arc_seen))
    assert 140 < arc < 180
    towards = stations[0] - drawn.cloud.xyz
    across = drawn.cloud.xyz * [0, 1, 1]
    assert (np.einsum("ij,ij->i", towards, across) > 0).all()


def test_that_all_round_is_all_round(rng):
    drawn = scanned(_pipe(), View(ALL_ROUND, Pattern.EVEN, 0.01), Noise(), rng, {})
    (element,) = drawn.truth.elements
    assert np.rad2deg(element.arc_seen.min()) > 345
    ((start, end),) = element.visible_ranges()
    assert (start, end) == pytest.approx((0.0, 1.5))
    assert len(drawn.cloud) == pytest.approx(2 * np.pi * 0.1 * 1.5 / 0.01**2, rel=0.03)


def test_that_a_board_hides_what_is_behind_it(rng):
    assembly = _pipe()
    board = quad(np.array([-0.3, 1.0, -1.0]), 2.0 * Z, 0.6 * X, is_two_sided=True)
    assembly.clutter("board", [board])
    station = np.array([[0.0, 3.0, 0.0]])
    seen, _ = look(assembly.patches, View(station, Pattern.EVEN, 0.01), rng)
    on_pipe = seen.samples.points[seen.samples.element_id == 1]
    # The board's shadow is wider than itself.
    assert np.abs(on_pipe[:, 0]).min() > 0.4
    assert np.abs(on_pipe[:, 0]).max() > 0.7


def test_that_scan_lines_are_planes_far_apart(rng):
    view = View(ALL_ROUND, Pattern.LINES, 0.02, 0.002)
    seen, spacing = look(_pipe().patches, view, rng)
    assert spacing == 0.02
    expected = 2 * np.pi * 0.1 * 1.5 / (0.02 * 0.002)
    assert len(seen.samples) == pytest.approx(expected, rel=0.1)


def test_that_a_grid_has_one_point_a_voxel(rng):
    seen, _ = look(_pipe().patches, View(ALL_ROUND, Pattern.GRID, 0.01), rng)
    voxels = np.floor(seen.samples.points / 0.01).astype(int)
    assert len(np.unique(voxels, axis=0)) == len(voxels)


def test_that_uneven_density_varies_a_hundredfold(rng):
    seen, _ = look(_pipe(0.2, 3.0).patches, View(ALL_ROUND, Pattern.UNEVEN, 0.002), rng)
    points = seen.samples.points
    counts = np.histogramdd(points, bins=(8, 1, 1))[0].ravel()
    ends = np.histogramdd(points, bins=(6, 4, 4))[0]
    assert max(counts.max() / counts.min(), ends.max() / ends[ends > 0].min()) > 30


def test_that_noise_has_its_standard_deviations(rng):
    seen, _ = look(_pipe().patches, View(ALL_ROUND, Pattern.EVEN, 0.005), rng)
    true = seen.samples.points
    for noise in (Noise(beam=0.003), Noise(isotropic=0.003), Noise(correlated=0.003, reach=0.05)):
        points, row = disturb(seen, noise, rng)
        off = np.hypot(points[:, 1], points[:, 2]) - 0.1
        assert off.std() == pytest.approx(0.003, rel=0.2)
        assert noise.sd == pytest.approx(0.003)
        np.testing.assert_array_equal(row, np.arange(len(true)))


def test_that_neighbours_share_a_correlated_displacement(rng):
    """Correlations are those of 48 waves: the mean scatters by 0.026 about exp(-d²/2 reach²)."""
    points = rng.uniform(0, 3, (1000, 3))
    both = np.concatenate([points, points + 0.1 * X])
    fields = [correlated_field(both, 1.0, 0.1, rng) for _ in range(12)]
    shared = [np.corrcoef(f[:1000, k], f[1000:, k])[0, 1] for f in fields for k in range(3)]
    assert np.mean(shared) == pytest.approx(np.exp(-0.5), abs=5 * 0.026)
    apart = [np.corrcoef(a[:, 0], b[:, 0])[0, 1] for a, b in itertools.pairwise(fields)]
    assert np.abs(apart).max() < 0.2


def test_that_faults_do_what_they_say(rng):
    stations = np.array([[0.0, 3.0, 0.0], [0.0, -3.0, 0.5]])
    assembly = _pipe()
    assembly.clutter("boxes", boxes(rng))
    seen, _ = look(assembly.patches, View(stations, Pattern.EVEN, 0.01), rng)
    rounded, _ = disturb(seen, Noise(rounding=0.005), rng)
    np.testing.assert_allclose(rounded / 0.005, np.round(rounded / 0.005), atol=1e-6)
    moved, _ = disturb(seen, Noise(offset=0.004), rng)
    shift = np.linalg.norm(moved - seen.samples.points, axis=1)
    np.testing.assert_allclose(shift, 0.004, atol=1e-9)
    repeated, row = disturb(seen, Noise(duplicates=3), rng)
    assert len(repeated) == 3 * len(seen.samples)
    mixed, row = disturb(seen, Noise(mixed=0.03, stray=0.01), rng)
    assert (row == -1).sum() > 0.01 * len(seen.samples)
    assert np.isfinite(mixed).all()


def test_that_a_plain_pipe_is_judged_found_whole_and_right(rng):
    drawn = scanned(_pipe(), View(ALL_ROUND, Pattern.EVEN, 0.01), Noise(beam=0.001), rng, {})
    row = judge(drawn, detect(drawn.cloud))
    (element,) = row["elements"]
    for flag in ("is_found", "is_kind_right", "is_radius_right", "is_whole", "is_ovality_right"):
        assert element[flag], flag
    assert row["found"] == pytest.approx(row["visible"], rel=0.02)
    assert row["false"] == []


def test_that_a_pipe_in_clutter_is_a_false_element_of_its_name(rng):
    assembly = Assembly()
    pipe = _pipe()
    assembly.clutter("mast", [pipe.patches[0]])
    drawn = scanned(assembly, View(ALL_ROUND, Pattern.EVEN, 0.01), Noise(beam=0.001), rng, {})
    row = judge(drawn, detect(drawn.cloud))
    assert row["false"] == ["mast"]
    assert row["elements"] == []
