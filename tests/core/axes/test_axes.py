"""Chains of centres: along straight pipes and through bends, not across to the next pipe."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pipecore import axes
from pipecore.axes import join_centres
from pipecore.ellipses import Ellipses
from pipecore.geometry import ArcAxis, LineAxis
from pipecore.progress import NoProgress
from tests.core.sections import WIDTH, along
from tests.core.shapes import random_direction, random_rotation


def chains_of(*parts: Ellipses) -> list[np.ndarray]:
    """Chain numbers of each part."""
    chain = join_centres(Ellipses.concatenate(parts), NoProgress())
    return np.split(chain, np.cumsum([len(p) for p in parts])[:-1])


def straight(rng, length=1.0):
    return LineAxis(rng.uniform(-1, 1, 3), random_direction(rng), length)


def test_that_a_straight_pipe_is_one_chain_whichever_way_its_axes_point(rng):
    (chain,) = chains_of(along(straight(rng), 0.08, rng=rng))
    assert_array_equal(chain, 0)


def test_that_a_bend_and_its_straights_are_one_chain(rng):
    q = random_rotation(rng)
    bend = ArcAxis(rng.uniform(-1, 1, 3), q[2], q[0], 0.25, np.pi / 2)
    into = LineAxis(bend.start - 0.5 * bend.tangent(0.0), bend.tangent(0.0), 0.5)
    out = LineAxis(bend.end, bend.tangent(bend.length), 0.5)
    for chain in chains_of(*(along(a, 0.08, rng=rng) for a in (into, bend, out))):
        assert_array_equal(chain, 0)


@pytest.mark.parametrize("gap", [0.01, 0.05])
def test_that_parallel_pipes_stay_apart_however_close(rng, gap):
    radius = 0.08
    one = straight(rng)
    up, _ = one.frame(0.0)
    other = LineAxis(one.start + (2 * radius + gap) * up, one.direction, 0.7)
    first, second = chains_of(along(one, radius, rng=rng), along(other, radius, rng=rng))
    assert_array_equal(first, 0)
    assert_array_equal(second, 1)


def test_that_coaxial_pipes_of_different_radius_stay_apart(rng):
    axis = straight(rng)
    first, second = chains_of(along(axis, 0.1, rng=rng), along(axis, 0.09, step=0.025, rng=rng))
    assert set(first) == {0}
    assert set(second) == {1}


def test_that_crossing_pipes_stay_apart(rng):
    q = random_rotation(rng)
    one = LineAxis(-0.5 * q[0], q[0], 1.0)
    other = LineAxis(-0.3 * q[1] + 0.1 * q[2], q[1], 0.6)
    first, second = chains_of(along(one, 0.06, rng=rng), along(other, 0.04, rng=rng))
    assert set(first) == {0}
    assert set(second) == {1}


def test_that_a_chain_goes_across_a_short_gap_and_not_across_a_long_one(rng):
    axis = straight(rng, 2.0)
    e = along(axis, 0.03, rng=rng)
    s = axis.pipe_coordinates(e.centre)[0]

    def n_chains(gap):
        kept = e[(s < 1.0) | (s > 1.0 + gap)]
        return join_centres(kept, NoProgress()).max() + 1

    assert n_chains(0.03) == 1
    assert n_chains(0.2) == 2


def test_that_wide_pipes_look_further_ahead(rng):
    for radius, n_chains in ((0.05, 2), (0.5, 1)):
        axis = straight(rng, 2.0)
        e = along(axis, radius, rng=rng)
        s = axis.pipe_coordinates(e.centre)[0]
        kept = e[(s < 0.99) | (s > 1.07)]
        assert join_centres(kept, NoProgress()).max() + 1 == n_chains


def test_that_a_reducer_is_part_of_its_run(rng):
    axis = straight(rng)
    s = np.arange(0.0, 1.0, WIDTH)
    radius = np.interp(s, [0.0, 0.4, 0.6, 1.0], [0.1, 0.1, 0.08, 0.08])
    (chain,) = chains_of(along(axis, radius, rng=rng))
    assert_array_equal(chain, 0)


def test_that_the_chain_with_most_ellipses_comes_first_whatever_their_order(rng):
    lengths = [0.4, 1.0, 0.7]
    parts = [along(straight(rng, n), 0.05 * (i + 1)) for i, n in enumerate(lengths)]
    e = Ellipses.concatenate(parts)
    truth = np.repeat([2, 0, 1], [len(p) for p in parts])
    shuffled = rng.permutation(len(e))
    assert_array_equal(join_centres(e[shuffled], NoProgress()), truth[shuffled])


def test_that_no_ellipses_make_no_chains(rng):
    assert len(join_centres(along(straight(rng), 0.1)[:0], NoProgress())) == 0


def test_that_places_looked_at_one_after_the_other_give_the_same_chains(rng, monkeypatch):
    # Of all sizes, so that some look far, in any order and with many centres at one place.
    radii = rng.uniform(0.02, 0.9, 12)
    parts = [along(straight(rng, 0.6), radius, rng=rng) for radius in radii]
    parts += [along(LineAxis(np.zeros(3), np.eye(3)[k], 0.3), 0.05, rng=rng) for k in (1, 2)]
    together = Ellipses.concatenate(parts)
    together = together[rng.permutation(len(together))]
    expected = join_centres(together, NoProgress())
    assert expected.max() > 5
    monkeypatch.setattr(axes, "AT_ONCE", 7)
    assert_array_equal(join_centres(together, NoProgress()), expected)
