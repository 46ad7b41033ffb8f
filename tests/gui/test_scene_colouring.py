"""Colours of points and their legends, without a window."""

import numpy as np
import pytest

from pipecore.editing import delete_elements
from pipecore.formatting import MINUS
from pipegui.model import commands, view_commands
from pipegui.model.colour_limits import shown_limits
from pipegui.model.document import ClipBox, ColourBy, Document, Scan, ViewOptions
from pipegui.scene.colour_assignment import colour_apart, neighbouring_ids
from pipegui.scene.colouring import (
    MUTED,
    SOUND,
    colour_points,
    effective,
    profile_colours,
    profile_rows,
    visible_points,
)
from pipegui.scene.legend import make_legend
from pipegui.scene.spreading import Spread
from pipegui.style.colour_maps import (
    DEVIATION,
    HEIGHT,
    INTENSITY,
    KINDS,
    QUALITATIVE,
    deviation_colours,
    rgb,
)
from pipegui.style.colours import VERDICT
from tests.factories import make_scan

CLOUD, RESULT = make_scan()


def colours_by(colour_by, **options):
    return colour_points(CLOUD, RESULT, ViewOptions(colour_by=colour_by, **options))


def test_that_inward_is_blue_outward_red_and_the_middle_neutral():
    inward, middle, outward = deviation_colours([-8.0, 0.0, 8.0], 8.0).astype(int)
    assert inward[2] > inward[0] + 50
    assert outward[0] > outward[2] + 50
    assert np.ptp(middle) < 10


def test_that_deviation_limits_are_symmetric_and_clip():
    assert np.array_equal(deviation_colours([-50.0], 10), deviation_colours([-10.0], 10))
    assert np.array_equal(deviation_colours([50.0], 10)[0], DEVIATION[-1])
    assert np.array_equal(deviation_colours([0.0], 3), deviation_colours([0.0], 30))


def test_that_the_dent_is_bluer_than_its_pipe():
    colours = colours_by(ColourBy.DEVIATION, deviation_limit_mm=10.0).astype(int)
    blueness = colours[:, 2] - colours[:, 0]
    dent = RESULT.deformation(1)
    in_dent = np.linalg.norm(CLOUD.xyz - dent.peak, axis=1) < 0.03
    pipe = (RESULT.element_id == dent.element_id) & ~in_dent
    assert blueness[in_dent].mean() > blueness[pipe].mean() + 50


@pytest.mark.parametrize(
    "colour_by", [ColourBy.SEGMENT, ColourBy.ELEMENT, ColourBy.KIND, ColourBy.DEVIATION]
)
@pytest.mark.parametrize("dark", [False, True])
def test_that_points_of_nothing_are_muted(colour_by, dark):
    colours = colour_points(CLOUD, RESULT, ViewOptions(colour_by=colour_by), dark=dark)
    assert (colours[RESULT.element_id == 0] == MUTED[dark]).all()
    assert not (colours[RESULT.element_id == 2] == MUTED[dark]).all(axis=1).any()


def test_that_points_of_one_segment_share_a_colour_and_neighbours_do_not():
    colours = colours_by(ColourBy.SEGMENT)
    of_segment = {}
    for i in range(1, len(RESULT.elements) + 1):
        (of_segment[i],) = {tuple(c) for c in colours[RESULT.segment_id == i].tolist()}
    # Along run 1 every element touches the next.
    assert all(of_segment[i] != of_segment[i + 1] for i in range(1, 6))


def test_that_elements_of_one_kind_share_a_colour():
    colours = colours_by(ColourBy.KIND)
    by_kind = {}
    for e in RESULT.elements:
        by_kind.setdefault(e.kind, set()).update(
            map(tuple, colours[RESULT.element_id == e.element_id].tolist())
        )
    assert all(len(found) == 1 for found in by_kind.values())
    assert len({c for found in by_kind.values() for c in found}) == len(by_kind)


def test_that_profiles_of_a_stack_alternate():
    colours = colours_by(ColourBy.PROFILE, shown_stack=1)
    index = RESULT.stacks[0].profile_index(CLOUD.xyz)
    found = RESULT.segment_id > 0
    even, odd = (
        {tuple(c) for c in colours[found & (index % 2 == parity)].tolist()} for parity in (0, 1)
    )
    assert len(even) == len(odd) == 1
    assert even != odd


def test_that_height_rises_through_the_map():
    colours = colours_by(ColourBy.HEIGHT)
    order = np.argsort(CLOUD.xyz[:, 2])
    luminance = colours[order].astype(float) @ [0.3, 0.6, 0.1]
    tenth = len(order) // 10
    assert luminance[-tenth:].mean() > luminance[:tenth].mean() + 30


def test_that_a_colouring_falls_back_on_what_the_cloud_has():
    bare = type(CLOUD)(origin=CLOUD.origin, xyz=CLOUD.xyz)
    assert effective(ColourBy.RGB, bare, None) is ColourBy.HEIGHT
    assert effective(ColourBy.DEVIATION, CLOUD, None) is ColourBy.RGB
    assert effective(ColourBy.DEVIATION, bare, None) is ColourBy.HEIGHT
    assert effective(ColourBy.DEVIATION, CLOUD, RESULT) is ColourBy.DEVIATION
    assert colour_points(bare, None, ViewOptions()).shape == CLOUD.xyz.shape


def test_that_a_hidden_element_has_no_visible_points():
    visible = visible_points(CLOUD, RESULT, frozenset({2, 7}))
    assert np.array_equal(visible, ~np.isin(RESULT.element_id, (2, 7)))
    assert visible_points(CLOUD, RESULT, frozenset()) is None
    # Ids that a new result no longer has hide nothing.
    assert visible_points(CLOUD, RESULT, frozenset({999})).all()


def test_that_the_deviation_legend_names_both_limits_in_mm():
    view = ViewOptions(colour_by=ColourBy.DEVIATION, deviation_limit_mm=12.5)
    legend = make_legend(CLOUD, RESULT, view)
    assert "mm" in legend.title
    assert [legend.ticks[i][1] for i in (0, 2, -1)] == ["−12.5", "0", "+12.5"]


def test_that_the_height_legend_is_in_world_coordinates():
    legend = make_legend(CLOUD, RESULT, ViewOptions(colour_by=ColourBy.HEIGHT))
    low, high = float(legend.ticks[0][1]), float(legend.ticks[-1][1])
    world = CLOUD.world(CLOUD.xyz)[:, 2]
    assert world.min() - 0.01 <= low < high <= world.max() + 0.01


@pytest.mark.parametrize("colour_by", [ColourBy.HEIGHT, ColourBy.INTENSITY])
def test_that_beyond_chosen_limits_colours_stay_those_of_the_ends(colour_by):
    values = CLOUD.xyz[:, 2] if colour_by is ColourBy.HEIGHT else CLOUD.intensity
    low, high = (float(v) for v in np.quantile(values, [0.3, 0.6]))
    name = f"{colour_by.name.lower()}_limits"
    view = ViewOptions(colour_by=colour_by, **{name: (low, high)})
    colours = colour_points(CLOUD, RESULT, view)
    table = {ColourBy.HEIGHT: HEIGHT, ColourBy.INTENSITY: INTENSITY}[colour_by]
    assert (colours[values <= low] == table[0]).all()
    assert (colours[values >= high] == table[-1]).all()
    between = np.unique(colours[(values > low) & (values < high)], axis=0)
    assert len(between) > 20
    # The legend says so, in the world's heights.
    ticks = make_legend(CLOUD, RESULT, view).ticks
    base = float(CLOUD.origin[2]) if colour_by is ColourBy.HEIGHT else 0.0
    shown = [float(ticks[i][1].replace(MINUS, "-")) for i in (0, -1)]
    assert shown == pytest.approx([low + base, high + base], abs=0.01 * (high - low))


def test_that_chosen_limits_are_kept_and_fitted_ones_follow_the_points():
    document = Document(scans=(Scan("plant.laz", CLOUD, RESULT),))
    document = view_commands.set_view(document, colour_by=ColourBy.HEIGHT)
    base = float(CLOUD.origin[2])
    chosen = view_commands.set_limits(document, (base + 2.0, base + 1.0))
    assert chosen.view.height_limits == pytest.approx((1.0, 2.0))
    assert shown_limits(CLOUD, chosen.view) == pytest.approx((base + 1.0, base + 2.0))
    assert view_commands.set_limits(chosen, (base, base)) is chosen
    assert view_commands.fit_limits(chosen).view.height_limits is None
    # Another scan has other heights.
    other = commands.open_scan(chosen, Scan("other.laz", CLOUD))
    assert other.view.height_limits is None


def test_that_the_kind_legend_lists_the_kinds_that_are_there():
    legend = make_legend(CLOUD, RESULT, ViewOptions(colour_by=ColourBy.KIND))
    names = {name for _, name in legend.swatches}
    assert names == {"Pipe", "Bend", "Reducer", "Sphere", "Flange"}


def test_that_neighbours_are_those_whose_points_are_near(rng):
    a = rng.uniform(0, 1, (500, 3))
    east = np.array([1.0, 0, 0])
    b, c = a + 1.05 * east, a + 5 * east
    ids = np.repeat([1, 2, 3, 0], 500).astype(np.int32)
    xyz = np.concatenate([a, b, c, a + 0.5 * east])
    assert neighbouring_ids(xyz, ids, 0.3).tolist() == [[1, 2]]


def test_that_neighbours_never_share_a_colour_where_there_are_enough(rng):
    n, n_colours = 60, len(QUALITATIVE)
    # A random graph in which nobody has more neighbours than there are other colours.
    degree, pairs = np.zeros(n + 1, int), []
    for a, b in rng.integers(1, n + 1, (400, 2)).tolist():
        if a != b and degree[a] < n_colours - 1 and degree[b] < n_colours - 1:
            pairs.append((a, b))
            degree[[a, b]] += 1
    pairs = np.array(pairs, np.int32)
    colour = colour_apart(n, pairs, n_colours)
    assert (colour[pairs[:, 0]] != colour[pairs[:, 1]]).all()
    assert set(colour[1:]) == set(range(n_colours))


def test_that_deformed_stretches_have_the_colour_of_their_verdict_and_sound_pipes_none():
    colours = colours_by(ColourBy.VERDICT)
    worst = RESULT.deformation(1)  # to reject
    near = np.linalg.norm(CLOUD.xyz - worst.peak, axis=1) < 0.03
    near &= RESULT.element_id == worst.element_id
    assert near.sum() > 10
    assert (colours[near] == rgb(VERDICT[worst.verdict])).all()
    deformed = {d.element_id for d in RESULT.deformations}
    sound = ~np.isin(RESULT.element_id, [*deformed, 0])
    assert (colours[sound] == SOUND).all()
    texts = [text for _, text in make_legend(CLOUD, RESULT, by(ColourBy.VERDICT)).swatches]
    assert texts == ["Reject", "Review", "No deformation"]


def by(colour_by):
    return ViewOptions(colour_by=colour_by)


@pytest.mark.parametrize("colour_by", list(ColourBy))
def test_that_some_rows_have_the_colours_they_have_among_all(colour_by, rng):
    rows = rng.integers(0, len(CLOUD), 500)
    view = ViewOptions(colour_by=colour_by, shown_stack=1)
    some = colour_points(CLOUD, RESULT, view, rows=rows)
    assert np.array_equal(some, colour_points(CLOUD, RESULT, view)[rows])


COLOUR_BLIND = {
    "protan": [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]],
    "deutan": [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]],
    "tritan": [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]],
}
"""What colour-blind people see of linear RGB (Machado and others 2009, severity 1)."""


def lab_seen(colours, matrix):
    channels = np.asarray(colours) / 255
    low = channels <= 0.04045
    linear = np.where(low, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    seen = np.clip(linear @ np.array(matrix).T, 0, 1)
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    xyz = seen @ np.array(to_xyz).T / [0.9505, 1.0, 1.089]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    x, y, z = f.T
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=1)


@pytest.mark.parametrize("kind_of_sight", COLOUR_BLIND)
def test_that_colour_blind_people_tell_kinds_and_verdicts_apart(kind_of_sight):
    verdicts = [rgb(c) for c in VERDICT.values()]
    for colours in (KINDS, np.array(verdicts)):
        lab = lab_seen(colours, COLOUR_BLIND[kind_of_sight])
        distance = np.linalg.norm(lab[:, None] - lab[None], axis=2)
        assert distance[~np.eye(len(lab), dtype=bool)].min() > 8  # 2.3 is just noticeable


def test_that_points_outside_the_box_are_not_visible():
    box = ClipBox((0.5, 0.2, 0.1), (1.5, 1.6, 1.0))
    visible = visible_points(CLOUD, RESULT, frozenset({2}), box)
    inside = np.all((CLOUD.xyz >= box.low) & (CLOUD.xyz <= box.high), axis=1)
    assert np.array_equal(visible, inside & (RESULT.element_id != 2))


@pytest.mark.parametrize("n", [1, 7, 8192, 20_001, 1_000_003])
def test_that_spreading_is_a_permutation_whichever_way_it_is_asked_for(n):
    spread = Spread(n)
    whole = spread.rows(0, n)
    assert np.array_equal(np.sort(whole), np.arange(n))
    cut = n // 3
    parts = [spread.rows(0, cut), spread.rows(cut, n + 10)]
    assert np.array_equal(np.concatenate(parts), whole)


def test_that_the_first_points_are_spread_over_all_of_the_cloud():
    first = Spread(5_000_000).rows(0, 25_000)
    counts, _ = np.histogram(first, bins=100, range=(0, 5_000_000))
    assert counts.min() > 200
    assert counts.max() < 300
    # Not every so manieth: that would show as stripes in a scan's rows.
    assert len(np.unique(np.diff(np.sort(first)))) > 500


def test_that_a_profile_holds_the_points_of_its_slab_and_colours_them_by_element():
    stack = RESULT.stacks[0]
    rows = profile_rows(CLOUD, stack, 40)
    expected = np.flatnonzero(stack.profile_index(CLOUD.xyz) == 40)
    # Points on the border may fall to either side in the points' own precision.
    assert len(np.setxor1d(rows, expected)) <= 2
    assert len(rows) > 20
    colours = profile_colours(CLOUD, RESULT, rows)
    ids = RESULT.element_id[rows]
    for element in np.unique(ids):
        assert len(np.unique(colours[ids == element], axis=0)) == 1
    assert len(np.unique(colours, axis=0)) > 2


def test_that_all_else_is_muted_where_one_profile_is_shown():
    colours = colours_by(ColourBy.PROFILE, shown_stack=1, shown_profile=40)
    assert (colours == MUTED[False]).all()


@pytest.mark.parametrize("colour_by", [ColourBy.KIND, ColourBy.VERDICT, ColourBy.ELEMENT])
def test_that_after_a_deletion_the_others_keep_their_colours(colour_by):
    """Ids of deleted elements leave gaps, so places in the result are no ids."""
    view, left = ViewOptions(colour_by=colour_by), delete_elements(RESULT, [1])
    others = (RESULT.element_id != 1) & (RESULT.element_id != 0)
    before, after = (colour_points(CLOUD, result, view) for result in (RESULT, left))
    if colour_by is not ColourBy.ELEMENT:  # whose colours are dealt out anew
        assert np.array_equal(after[others], before[others])
    last = left.elements[-1].element_id
    hidden = visible_points(CLOUD, left, frozenset({last}))
    assert np.array_equal(hidden, left.element_id != last)
