"""The demo that ships: the scan, its truth and its scene belong together."""

from functools import cache

import numpy as np
import pytest

from pipecore import io
from pipecore.resources import resource
from pipecore.simulate import Truth, find_scene, load_truth
from pipecore.simulate.placing import place_runs
from pipecore.simulate.surface import KIND_OF_SPEC
from pipecore.types import DeformationKind, ElementKind, PointCloud


@cache
def demo_truth() -> Truth:
    return load_truth(resource("demo", "demo-truth.json"))


@cache
def demo_cloud() -> PointCloud:
    return io.read(resource("demo", "demo.laz"))


def test_that_the_truth_is_that_of_the_scene() -> None:
    truth, placement = demo_truth(), place_runs(find_scene("demo"))
    assert truth.origin.tolist() == [432105.0, 6201877.0, 112.0]
    assert len(truth.elements) == len(placement.elements)
    for a, b in zip(truth.elements, placement.elements, strict=True):
        assert a.kind == b.element.kind
        assert a.radius == b.element.radius
        assert np.abs(a.axis.end - b.element.axis.end).max() < 1e-5
    for d, e in zip(truth.deformations, placement.deformations(), strict=True):
        assert (d.kind, d.depth) == (e.kind, e.depth)
        assert np.abs(d.peak - e.peak).max() < 1e-5


def test_that_the_demo_shows_what_there_is_to_find() -> None:
    truth = demo_truth()
    kinds = [d.kind for d in truth.deformations]
    assert kinds.count(DeformationKind.DENT) == 3
    assert set(kinds) == set(KIND_OF_SPEC.values()) - {DeformationKind.KINK}
    assert {e.kind for e in truth.elements} >= {
        ElementKind.CYLINDER,
        ElementKind.CONE,
        ElementKind.TORUS,
        ElementKind.TEE,
        ElementKind.FLANGE,
    }
    assert all(d.seen > 0.9 for d in truth.deformations if d.shape)
    visible = sum(b - a for e in truth.elements for a, b in e.visible_ranges())
    assert visible > 0.9 * sum(e.axis.length for e in truth.elements)


def test_that_the_demo_is_small_enough_to_ship() -> None:
    assert resource("demo", "demo.laz").stat().st_size < 4_000_000
    assert 400_000 < len(demo_cloud()) < 600_000
    assert demo_cloud().rgb is not None
    assert demo_cloud().intensity is not None


@pytest.mark.parametrize("i", range(6))
def test_that_the_scan_lies_on_the_true_surfaces(i: int) -> None:
    """The points on each deformed element are those of its deformed surface."""
    truth, cloud = demo_truth(), demo_cloud()
    placed = [p for p in place_runs(find_scene("demo")).elements if p.surface.deformations][i]
    local = cloud.world(cloud.xyz) - truth.origin
    axis = placed.element.axis
    chainage, rho, clock = axis.pipe_coordinates(local)
    near = (chainage > 0.02) & (chainage < axis.length - 0.02)
    near &= np.abs(rho - placed.element.radius) < 0.06
    chainage, clock, local = chainage[near], clock[near], local[near]
    offset = local - axis.at(chainage) - placed.surface.displacement(chainage)
    expected = placed.surface.radius(chainage, clock)
    error = np.linalg.norm(offset, axis=1) - expected
    on_it = np.abs(error) < 0.006
    assert on_it.sum() > 1000
    assert abs(np.median(error[on_it])) < 2e-4
    assert error[on_it].std() < 0.0018
    # Without its deformations the same points do not fit so well.
    plain = axis.pipe_coordinates(local[on_it])[1] - placed.element.radius
    assert plain.std() > 1.1 * error[on_it].std()
