"""Bands around a pipe: told from the pipe's own surface, and from its own deformations."""

import numpy as np
import pytest

from pipecore import Settings, detect
from pipecore.elements.refinement.raised_bands import is_off_bands
from pipecore.geometry import LineAxis
from pipecore.settings import DirectionPreset
from tests.core.shapes import cloud_of, random_direction, tube

SPACING, NOISE = 0.006, 0.0015
PITCH, BAND = 0.10, 0.03


def banded(rng, axis, radius, height):
    """A pipe seen over 150° with a band of `height` in each `PITCH` of its length."""
    xyz, normals = tube(rng, axis, radius, spacing=SPACING, noise=NOISE, arc=np.deg2rad(150))
    on_band = np.mod(axis.pipe_coordinates(xyz)[0], PITCH) < BAND
    return xyz + np.where(on_band, height, 0.0)[:, None] * normals, normals, on_band


def test_that_bands_are_told_from_the_pipe(rng):
    radius = rng.uniform(0.15, 0.4)
    axis = LineAxis(rng.uniform(-1, 1, 3), random_direction(rng), 0.9)
    xyz, _, on_band = banded(rng, axis, radius, 0.005)
    chainage, rho, _ = axis.pipe_coordinates(xyz)
    own = is_off_bands(chainage, rho - radius - 0.0015, SPACING, radius)
    assert own is not None
    # Rows that hold an edge are both.
    assert on_band[own].mean() < 0.1
    assert own[~on_band].mean() > 0.5


@pytest.mark.parametrize("shape", ["plain", "bowed", "stepped", "dented"])
def test_that_a_pipe_without_bands_keeps_all_its_points(rng, shape):
    chainage = rng.uniform(0, 2.0, 8000)
    offset = {
        "plain": np.zeros(len(chainage)),
        "bowed": 0.01 * np.sin(np.pi * chainage / 2.0),
        "stepped": np.where(chainage > rng.uniform(0.5, 1.5), 0.005, 0.0),
        "dented": -0.012 * np.exp(-(((chainage - 1.0) / 0.08) ** 2)),
    }[shape]
    residual = offset + NOISE * rng.normal(size=len(chainage))
    assert is_off_bands(chainage, residual, SPACING, 0.11) is None


def test_that_the_radius_of_a_banded_pipe_is_its_own(rng):
    radius = rng.uniform(0.15, 0.35)
    axis = LineAxis(rng.uniform(-1, 1, 3), random_direction(rng), 1.2)
    xyz, normals, _ = banded(rng, axis, radius, 0.005)
    # The edges of bands turn so many normals that automatic directions miss a lone pipe's.
    settings = Settings().replace({"stacks.preset": DirectionPreset.AXES_AND_DIAGONALS})
    result = detect(cloud_of((xyz, normals)), settings)
    element = max(result.elements, key=lambda e: e.n_points)
    # A fit to pipe and bands alike is 1.5 mm too large.
    assert element.radius == pytest.approx(radius, abs=max(4 * element.radius_sd, 0.0005))
