"""Which ellipses follow each other, against the rule written with vectors."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pipecore._kernels.chain_links import unite_followers
from pipecore._kernels.disjoint_sets import flatten
from pipecore._kernels.line_search import AxisEllipses, PieceLimits
from tests.core.shapes import random_direction

pytestmark = pytest.mark.kernels

COS_TURN, RADIUS_CHANGE, MAX_OFFSET = np.cos(np.deg2rad(15.0)), 0.06, 0.1


def plainly_follow(a, b) -> bool:
    """The rule for two ellipses, each of centre, axis, radius and its standard deviation."""
    (centre, axis, radius, sd), (other_centre, other_axis, other_radius, other_sd) = a, b
    smaller, slack = min(radius, other_radius), 2 * np.hypot(sd, other_sd)
    mean = axis + np.sign(axis @ other_axis) * other_axis
    offset = np.linalg.norm(np.cross(other_centre - centre, mean)) / np.linalg.norm(mean)
    return bool(
        abs(axis @ other_axis) > COS_TURN
        and abs(radius - other_radius) < RADIUS_CHANGE * smaller + slack
        and offset < MAX_OFFSET * smaller + slack
    )


def test_that_those_are_united_that_follow_each_other(rng):
    n, n_united = 60, 0
    axis = np.array([random_direction(rng)] * n) + 0.15 * rng.normal(size=(n, 3))
    axis *= rng.choice([-1.0, 1.0], n)[:, None] / np.linalg.norm(axis, axis=1)[:, None]
    centre = rng.uniform(-0.05, 0.05, n)[:, None] * axis + 0.004 * rng.normal(size=(n, 3))
    radius, sd = rng.uniform(0.075, 0.085, n), rng.uniform(0.0, 0.001, n)
    members = rng.permutation(n)
    for _ in range(200):
        pair = rng.choice(n, (1, 2), replace=False)
        roots = np.arange(n, dtype=np.int32)
        unite_followers(
            pair, members, AxisEllipses(centre, axis, radius, sd),
            PieceLimits(COS_TURN, MAX_OFFSET, RADIUS_CHANGE), roots,
        )  # fmt: skip
        flatten(roots)
        i, j = np.sort(members[pair[0]])
        expected = plainly_follow(*((centre[k], axis[k], radius[k], sd[k]) for k in (i, j)))
        assert (roots[j] == i) == expected
        assert_array_equal(np.delete(roots, j), np.delete(np.arange(n), j))
        n_united += expected
    assert 5 < n_united < 195
