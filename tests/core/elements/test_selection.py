"""Which proposals become elements: the best supported first, each surface once."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pipecore.elements.proposals import Proposal
from pipecore.elements.refinement.extent import Extent
from pipecore.elements.refinement.nearby_points import NearbyPoints
from pipecore.elements.refinement.refine import FittedElement
from pipecore.elements.refinement.surface_fits import LineSurface, SphereSurface, SurfaceFit
from pipecore.elements.selection import MIN_STRAIGHT_RADII, Selector, select_elements
from pipecore.geometry import LineAxis
from pipecore.progress import NoProgress
from pipecore.settings import ElementSettings
from tests.core.shapes import (
    angle_between,
    ball,
    cloud_of,
    random_direction,
    random_rotation,
    sampled,
    tube,
)

RADIUS, NOISE, SPACING = 0.08, 0.001, 0.008
SETTINGS = ElementSettings()


def nearby_of(*parts):
    return NearbyPoints(cloud_of(*parts), sampled(*parts))


def proposed(axis, radius=RADIUS, n_ellipses=20, length=None):
    """A proposal of a straight with so many ellipses, about the middle of an axis."""
    length = axis.length if length is None else length
    model = LineSurface(axis.at(axis.length / 2), axis.direction, radius)
    return Proposal(model, np.arange(n_ellipses), -length / 2, length / 2)


def selected(proposals, nearby):
    return select_elements(proposals, nearby, SETTINGS, NoProgress())[0]


def scanned(rng, axis, radius=RADIUS):
    return tube(rng, axis, radius, spacing=SPACING, noise=NOISE)


@pytest.fixture
def axis(rng):
    return LineAxis(rng.uniform(-3, 3, 3), random_direction(rng), 1.0)


def test_that_a_proposal_that_is_slightly_off_becomes_the_pipe(rng, axis):
    nearby = nearby_of(scanned(rng, axis))
    up, right = axis.frame(0.0)
    off = LineAxis(axis.start + 0.001 * up - 0.001 * right, axis.direction, 1.0)
    (pipe,) = selected([proposed(off, 1.01 * RADIUS, length=0.8)], nearby)
    assert pipe.fit.model.radius == pytest.approx(RADIUS, abs=0.0005)
    assert np.degrees(angle_between(pipe.axis.direction, axis.direction)) < 0.1
    assert pipe.axis.length == pytest.approx(1.0, abs=0.03)
    assert len(pipe.inliers) > 0.95 * len(nearby.surface.xyz)


def test_that_a_surface_is_taken_once_however_often_it_is_proposed(rng, axis):
    nearby = nearby_of(scanned(rng, axis))
    proposals = [proposed(axis, k * RADIUS, n) for k, n in ((1.02, 12), (1.0, 30), (0.98, 9))]
    (pipe,) = selected(proposals, nearby)
    # Nor is it there for a second selection of the same Selector.
    selector = Selector(nearby, SETTINGS)
    selector.accept(pipe)
    selector.try_proposals(proposals, NoProgress(), (0.0, 1.0))
    assert selector.result() == ([pipe], [])


def test_that_elements_share_no_point(rng):
    q = random_rotation(rng)
    axes = [LineAxis(-0.5 * d + 0.12 * k * q[2], d, 1.0) for k, d in enumerate(q[:2])]
    parts = [scanned(rng, a) for a in axes]
    found = selected([proposed(a) for a in axes], nearby_of(*parts))
    assert len(found) == 2
    inliers = np.concatenate([f.inliers for f in found])
    assert len(np.unique(inliers)) == len(inliers)


def test_that_the_order_of_the_list_is_no_matter(rng):
    q = random_rotation(rng)
    axes = [LineAxis(0.5 * i * q[1], q[0], 0.8) for i in range(3)]
    nearby = nearby_of(*(scanned(rng, a) for a in axes))
    # Twice as many ellipses as the next one; two have equally many.
    proposals = [proposed(a, n_ellipses=n) for a, n in zip(axes, (20, 40, 20), strict=True)]
    first = selected(proposals, nearby)
    again = selected(proposals[::-1], nearby)
    assert len(first) == 3
    assert abs((first[0].axis.start - axes[1].start) @ q[1]) < 0.001
    for one, other in zip(first, again, strict=True):
        assert_array_equal(one.inliers, other.inliers)


def test_that_spheres_come_before_the_pipe_of_more_ellipses_that_their_middle_looks_like(rng):
    centre, radius = rng.uniform(-3, 3, 3), 0.3
    nearby = nearby_of(ball(rng, centre, radius, spacing=SPACING, noise=NOISE))
    band = LineAxis(centre, random_direction(rng), 0.1)
    middle = LineAxis(centre - 0.1 * band.direction, band.direction, 0.2)
    sphere = Proposal(SphereSurface(centre, 1.01 * radius), np.arange(10))
    (found,) = selected([proposed(middle, radius, 90), sphere], nearby)
    assert isinstance(found.fit.model, SphereSurface)
    assert found.fit.model.radius == pytest.approx(radius, abs=0.0005)
    assert_allclose(found.fit.model.centre, centre, atol=0.001)


def test_that_a_proposal_of_the_wrong_radius_or_beside_the_pipe_is_not_accepted(rng, axis):
    nearby = nearby_of(scanned(rng, axis))
    up, _ = axis.frame(0.0)
    beside = LineAxis(axis.start + 3 * RADIUS * up, axis.direction, 1.0)
    assert selected([proposed(axis, 2 * RADIUS)], nearby) == []
    assert selected([proposed(beside)], nearby) == []
    assert selected([], nearby) == []


def test_that_what_was_refused_leaves_its_points_to_others(rng, axis):
    nearby = nearby_of(scanned(rng, axis))
    wrong, right = proposed(axis, 2 * RADIUS, n_ellipses=90), proposed(axis, n_ellipses=10)
    (pipe,) = selected([wrong, right], nearby)
    assert pipe.fit.model.radius == pytest.approx(RADIUS, abs=0.0005)


def test_that_straights_that_are_too_short_are_returned_and_keep_their_points(rng, axis):
    stub = LineAxis(axis.start, axis.direction, 1.2 * RADIUS)
    nearby = nearby_of(scanned(rng, stub))
    selector = Selector(nearby, SETTINGS)
    proposals = [proposed(stub)]
    short = selector.try_proposals(proposals, NoProgress(), (0, 1), MIN_STRAIGHT_RADII)
    assert short == proposals
    assert selector.result() == ([], [])
    assert selector.is_free.all()


def fitted(axis, inliers, radius=RADIUS):
    """A straight as the refinement leaves it."""
    model = LineSurface(axis.at(axis.length / 2), axis.direction, radius)
    extent = Extent(0.0, axis.length, 2 * np.pi, 1.0, ())
    fit = SurfaceFit(model, np.eye(5) * 1e-8, NOISE, 1000)
    return FittedElement(fit, axis, np.asarray(inliers, np.intp), extent, 0.0)


def test_that_an_end_is_joined_once_and_the_fitting_linked_to_its_straights(rng):
    q = random_rotation(rng)
    axes = [LineAxis(1.0 * i * q[0], q[0], 0.6) for i in range(2)]
    between = LineAxis(axes[0].end, q[0], 0.4)
    parts = [scanned(rng, a) for a in (*axes, between)]
    surface = sampled(*parts)
    along = (surface.xyz - axes[0].start) @ q[0]
    selector = Selector(NearbyPoints(cloud_of(*parts), surface), SETTINGS)
    # The first one was followed a little into what joins it.
    selector.accept(fitted(axes[0], np.flatnonzero(along < 0.65)))
    selector.accept(fitted(axes[1], np.flatnonzero(along > 1.0)))
    ends = (0, 1), (1, 0)
    selector.try_proposal(proposed(between, length=0.3), between=ends)
    accepted, links = selector.result()
    assert len(accepted) == 3
    assert links == [(2, 0), (2, 1)]
    assert not selector.is_free[accepted[2].inliers].any()
    # It was given the points that its straight had, and nothing is given once more.
    assert (along[accepted[2].inliers] < 0.64).any()
    selector.try_proposal(proposed(between, length=0.3), between=ends)
    assert len(selector.result()[0]) == 3


def test_that_a_straight_in_the_side_of_a_reducer_is_replaced_by_it_and_the_links_follow(rng):
    q = random_rotation(rng)
    wide, narrow = LineAxis(-0.6 * q[0], q[0], 0.6), LineAxis(0.3 * q[0], q[0], 0.6)
    between = LineAxis(np.zeros(3), q[0], 0.3)
    cone = tube(rng, between, 0.1, radius_end=0.06, spacing=SPACING, noise=NOISE)
    parts = [scanned(rng, wide, 0.1), cone, scanned(rng, narrow, 0.06)]
    surface = sampled(*parts)
    along = surface.xyz @ q[0]
    selector = Selector(NearbyPoints(cloud_of(*parts), surface), SETTINGS)
    selector.accept(fitted(wide, np.flatnonzero(along < 0.0), 0.1))
    inside = np.flatnonzero((along > 0.1) & (along < 0.2))
    selector.accept(fitted(LineAxis(0.1 * q[0], q[0], 0.1), inside, 0.08))
    selector.accept(fitted(narrow, np.flatnonzero(along > 0.3), 0.06))
    selector.try_reducers()
    accepted, links = selector.result()
    assert [f.fit.model.is_tapered for f in accepted] == [False, False, True]
    assert links in ([(2, 0), (2, 1)], [(2, 1), (2, 0)])
    assert np.isin(inside, accepted[2].inliers).mean() > 0.9
    # Both ends are joined now: nothing comes of another try.
    selector.try_reducers()
    assert len(selector.result()[0]) == 3
