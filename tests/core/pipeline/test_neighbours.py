"""Which elements come near an element: found by their boxes, the same as by looking at all."""

import numpy as np

from pipecore.geometry import ArcAxis, LineAxis
from pipecore.measurement.adjacency import bounding_boxes, neighbours_of
from pipecore.types import Element, ElementKind
from tests.core.shapes import random_direction, random_rotation


def element(rng, i):
    q = random_rotation(rng)
    place, radius = rng.uniform(-1.5, 1.5, 3), rng.uniform(0.02, 0.2)
    if i % 3 == 0:
        axis = ArcAxis(place, q[2], q[0], rng.uniform(2, 5) * radius, rng.uniform(0.3, 3.0))
    else:
        axis = LineAxis(place, random_direction(rng), rng.uniform(0.2, 3.0))
    kind = ElementKind.TORUS if i % 3 == 0 else ElementKind.CYLINDER
    centre = np.full(3, np.nan)
    return Element(i + 1, 1, kind, axis, radius, 0.0, radius, centre, 0, 0, np.pi, 0.001)


def test_that_boxes_leave_out_no_neighbour(rng):
    elements = [element(rng, i) for i in range(60)]
    boxes = bounding_boxes(elements)
    everything = np.array([[-1e9] * 3] * 60), np.array([[1e9] * 3] * 60), boxes[2]
    n_near = 0
    for e in elements:
        near = neighbours_of(e, elements, boxes)
        assert near == neighbours_of(e, elements, everything)
        assert e not in near
        n_near += len(near)
    assert 20 < n_near < 60 * 30
