"""What touches, surrounds or follows a pipe is an element of its own, and of its own kind."""

import numpy as np
import pytest

from pipecore.geometry import ArcAxis, LineAxis
from pipecore.pipeline import detect
from pipecore.types import ElementKind
from tests.core.shapes import angle_between, ball, cloud_of, random_rotation, tube

NOISE = 0.0015


def has(elements, radius, length, kind=ElementKind.CYLINDER):
    """Whether one element has this radius, within 1 mm, and most of this length."""
    return any(
        e.kind is kind and abs(e.radius - radius) < 0.001 and e.axis.length > 0.85 * length
        for e in elements
    )


def test_that_the_shells_of_a_cut_open_pipe_are_two_pipes(rng):
    q = random_rotation(rng)
    inner, outer = rng.uniform(0.04, 0.06), rng.uniform(0.10, 0.14)
    axis = LineAxis(rng.uniform(-1, 1, 3), q[0], 1.2)
    clock = rng.uniform(0, 2 * np.pi)
    cloud = cloud_of(
        tube(rng, axis, inner, spacing=0.008, noise=NOISE, arc=np.deg2rad(170), middle_clock=clock),
        tube(
            rng, axis, outer, spacing=0.008, noise=NOISE, arc=np.deg2rad(170),
            middle_clock=clock + np.pi,
        ),
    )  # fmt: skip
    elements = detect(cloud).elements
    assert len(elements) == 2
    assert has(elements, inner, 1.2)
    assert has(elements, outer, 1.2)


def test_that_parallel_pipes_a_centimetre_apart_are_two(rng):
    q = random_rotation(rng)
    one, other = rng.uniform(0.03, 0.1, 2)
    start = rng.uniform(-1, 1, 3)
    cloud = cloud_of(
        tube(rng, LineAxis(start, q[0], 1.2), one, spacing=0.008, noise=NOISE),
        tube(
            rng, LineAxis(start + (one + other + 0.01) * q[1], q[0], 1.2), other,
            spacing=0.008, noise=NOISE,
        ),
    )  # fmt: skip
    elements = detect(cloud).elements
    assert len(elements) == 2
    assert has(elements, one, 1.2)
    assert has(elements, other, 1.2)


def test_that_a_rack_of_pipes_seen_from_above_is_as_many_pipes(rng):
    """The middle one has a tangent plane in common with its neighbour on either side."""
    along, across, up = random_rotation(rng)
    radii, start, pipes = rng.uniform(0.03, 0.1, 3), rng.uniform(-1, 1, 3), []
    for i, radius in enumerate(radii):
        if i:
            start = start + (radii[i - 1] + radius + 0.01) * across
        axis = LineAxis(start, along, 1.2)
        clock_up, clock_right = axis.frame(0.0)
        middle = np.arctan2(up @ clock_right, up @ clock_up)
        pipes.append(
            tube(rng, axis, radius, spacing=0.008, noise=NOISE, arc=2.8, middle_clock=middle)
        )
    elements = detect(cloud_of(*pipes)).elements
    assert len(elements) == 3
    assert all(has(elements, radius, 1.2) for radius in radii)


def test_that_pipes_that_cross_in_contact_are_two(rng):
    q = random_rotation(rng)
    one, other = rng.uniform(0.04, 0.1, 2)
    angle = rng.uniform(np.deg2rad(40), np.deg2rad(90))
    middle = rng.uniform(-1, 1, 3)
    along = np.cos(angle) * q[0] + np.sin(angle) * q[1]
    cloud = cloud_of(
        tube(rng, LineAxis(middle - 0.7 * q[0], q[0], 1.4), one, spacing=0.008, noise=NOISE),
        tube(
            rng, LineAxis(middle + (one + other) * q[2] - 0.7 * along, along, 1.4), other,
            spacing=0.008, noise=NOISE,
        ),
    )  # fmt: skip
    elements = detect(cloud).elements
    assert len(elements) == 2
    assert has(elements, one, 1.4)
    assert has(elements, other, 1.4)
    assert np.isclose(
        angle_between(elements[0].axis.direction, elements[1].axis.direction),
        angle,
        atol=np.deg2rad(0.5),
    )


def test_that_connected_pieces_are_told_by_their_axes_and_radii(rng):
    """Figure 7 of the paper: cylinder, torus, cylinder, cone, cylinder in one run; a sphere."""
    q = random_rotation(rng)
    radius, bend = rng.uniform(0.07, 0.1), rng.uniform(0.25, 0.4)
    narrow = 0.6 * radius
    start = rng.uniform(-1, 1, 3)
    first = LineAxis(start, q[0], 1.0)
    arc = ArcAxis(first.end + bend * q[1], q[2], -q[1], bend, np.pi / 2)
    second = LineAxis(arc.end, q[1], 0.6)
    taper = LineAxis(second.end, q[1], 0.25)
    third = LineAxis(taper.end, q[1], 0.8)

    def piece(axis, r, r_end=None):
        return tube(rng, axis, r, radius_end=r_end, spacing=0.008, noise=NOISE)

    elements = detect(
        cloud_of(
            piece(first, radius),
            piece(arc, radius),
            piece(second, radius),
            piece(taper, radius, narrow),
            piece(third, narrow),
            ball(rng, start + 1.5 * q[2], 0.2, 0.01, NOISE),
        )
    ).elements
    kinds = sorted(e.kind.value for e in elements)
    assert kinds == sorted(["cylinder"] * 3 + ["torus", "cone", "sphere"])
    torus = next(e for e in elements if e.kind is ElementKind.TORUS)
    assert torus.axis.bend_radius == pytest.approx(bend, rel=0.02)
    assert torus.radius == pytest.approx(radius, abs=0.001)
    cone = next(e for e in elements if e.kind is ElementKind.CONE)
    # Where a cone ends is known to 3 cm, and the radii there by as much of its slope.
    at_ends = 0.001 + 0.03 * (radius - narrow) / taper.length
    assert sorted((cone.radius, cone.radius_end)) == pytest.approx([narrow, radius], abs=at_ends)
    assert has(elements, narrow, 0.8)
    of_run = [e for e in elements if e.kind is not ElementKind.SPHERE]
    assert len({e.run_id for e in of_run}) == 1


@pytest.mark.parametrize("arc_deg", [150, 360])
def test_that_a_vessel_of_five_metres_is_found(rng, arc_deg):
    radius = rng.uniform(3.5, 4.9)
    axis = LineAxis(rng.uniform(-5, 5, 3), np.array([0.0, 0.0, 1.0]), 6.0)
    cloud = cloud_of(
        tube(
            rng, axis, radius, spacing=0.05, noise=0.002,
            arc=np.deg2rad(arc_deg), middle_clock=rng.uniform(0, 6),
        )
    )  # fmt: skip
    elements = detect(cloud).elements
    assert len(elements) == 1
    assert has(elements, radius, 6.0)
