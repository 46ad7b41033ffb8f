"""Clouds, stacks, elements and tables mean what their descriptions say."""

import math
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipecore.geometry import ArcAxis, LineAxis, surface_points, unit
from pipecore.settings import Settings
from pipecore.types import (
    OWN_STACK,
    Deformation,
    DeformationKind,
    Element,
    ElementKind,
    PointCloud,
    Profiles,
    Result,
    Stack,
)


def element(kind: ElementKind, axis: LineAxis | ArcAxis, **changes: Any) -> Element:
    values: dict[str, Any] = {
        "element_id": 7,
        "run_id": 1,
        "kind": kind,
        "axis": axis,
        "radius": 0.1,
        "radius_sd": 1e-4,
        "radius_end": 0.1,
        "centre": np.full(3, np.nan),
        "n_points": 1000,
        "n_profiles": 50,
        "arc": math.pi,
        "rms": 2e-3,
    }
    return Element(**values | changes)


def profiles(rng: np.random.Generator, n: int) -> Profiles:
    """A table of `n` random rows on elements 1 to 3 and stacks 0 and 1."""
    columns: dict[str, Any] = {}
    for name, empty in ((f.name, getattr(Profiles.empty(), f.name)) for f in fields(Profiles)):
        columns[name] = rng.uniform(0.1, 1.0, (n, *empty.shape[1:])).astype(empty.dtype)
    columns["element_id"] = rng.integers(1, 4, n).astype(np.int32)
    columns["stack_id"] = rng.integers(0, 2, n).astype(np.int32)
    columns["profile_index"] = np.arange(n, dtype=np.int32)
    return Profiles(**columns)


def test_that_ten_thousand_kilometres_away_a_tenth_of_a_millimetre_is_kept(
    rng: np.random.Generator,
) -> None:
    origin = np.array([4.3e5, 1e7, 112.0])
    world = origin + rng.uniform(-500.0, 500.0, (1000, 3))
    cloud = PointCloud(origin, (world - origin).astype(np.float32))
    assert np.abs(cloud.world(cloud.xyz) - world).max() < 1e-4
    # A fitted axis is not rounded to the points' own precision.
    assert np.abs(cloud.world(world - origin) - world).max() < 1e-8
    assert len(cloud) == 1000


def test_that_a_stack_cuts_slabs_of_its_width(rng: np.random.Generator) -> None:
    stack = Stack(1, unit(rng.normal(size=3)), width=0.02, offset=0.005)
    points = rng.uniform(-1.0, 1.0, (2000, 3))
    index = stack.profile_index(points)
    along = points @ stack.direction
    assert np.all(along >= 0.005 + index * 0.02 - 1e-12)
    assert np.all(along < 0.005 + (index + 1) * 0.02 + 1e-12)


def test_that_a_profile_s_lower_face_belongs_to_it_and_its_upper_one_to_the_next() -> None:
    stack = Stack(1, np.array([0.0, 0.0, 1.0]), width=0.5)
    heights = np.array([-0.5, -0.25, 0.0, 0.25, 0.5])
    points = np.column_stack([np.zeros((5, 2)), heights])
    assert stack.profile_index(points).tolist() == [-1, -1, 0, 0, 1]


@given(st.floats(0.0, 1.0))
def test_that_a_reducer_narrows_evenly(fraction: float) -> None:
    axis = LineAxis(np.zeros(3), np.array([1.0, 0.0, 0.0]), 0.4)
    reducer = element(ElementKind.CONE, axis, radius=0.1, radius_end=0.06)
    expected = 0.1 + fraction * (0.06 - 0.1)
    assert reducer.radius_at(fraction * 0.4) == pytest.approx(expected)


def test_that_a_pipe_and_a_bend_are_as_wide_everywhere() -> None:
    line = LineAxis(np.zeros(3), np.array([0.0, 1.0, 0.0]), 2.0)
    arc = ArcAxis(np.zeros(3), np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), 0.3, 1.5)
    for pipe in (element(ElementKind.CYLINDER, line), element(ElementKind.TORUS, arc)):
        assert pipe.radius_at(np.linspace(0, pipe.axis.length, 5)) == pytest.approx(np.full(5, 0.1))


@given(st.floats(0.0, 1.0), st.floats(0.0, 2 * math.pi))
def test_that_a_sphere_s_surface_keeps_its_distance_from_the_centre(
    fraction: float, clock: float
) -> None:
    centre = np.array([1.0, 2.0, 3.0])
    # The axis may begin and end inside the sphere, as its profiles did.
    axis = LineAxis(centre - [0.0, 0.15, 0.0], np.array([0.0, 1.0, 0.0]), 0.25)
    sphere = element(ElementKind.SPHERE, axis, radius=0.2, radius_end=0.2, centre=centre)
    chainage = fraction * axis.length
    point = surface_points(axis, chainage, sphere.radius_at(chainage), clock)
    assert np.linalg.norm(point - centre) == pytest.approx(0.2)


def test_that_a_sphere_has_no_width_beyond_its_poles() -> None:
    axis = LineAxis(np.zeros(3), np.array([0.0, 0.0, 1.0]), 1.0)
    sphere = element(ElementKind.SPHERE, axis, radius=0.2, centre=np.array([0.0, 0.0, 0.5]))
    assert sphere.radius_at(np.array([0.2, 0.3, 0.5])) == pytest.approx([0.0, 0.0, 0.2])


@pytest.mark.parametrize("kind", ElementKind)
def test_that_every_element_has_a_name_to_call_it_by(kind: ElementKind) -> None:
    axis = LineAxis(np.zeros(3), np.array([0.0, 0.0, 1.0]), 1.0)
    label = element(kind, axis).label
    assert label[0].isupper()
    assert label.endswith(" 7")


def test_that_the_rows_of_an_element_are_all_its_rows(rng: np.random.Generator) -> None:
    table = profiles(rng, 100)
    parts = [table.of_element(i) for i in (1, 2, 3)]
    assert sum(map(len, parts)) == 100
    assert all(np.all(part.element_id == i) for i, part in zip((1, 2, 3), parts, strict=True))
    own = table.of_element(2, OWN_STACK)
    assert np.all(own.element_id == 2)
    assert np.all(own.stack_id == OWN_STACK)
    assert len(own) + len(table.of_element(2, 1)) == len(table.of_element(2))


def test_that_tables_put_together_keep_every_row_and_type(rng: np.random.Generator) -> None:
    first, second = profiles(rng, 5), profiles(rng, 3)
    both = Profiles.concatenate([first, Profiles.empty(), second])
    assert len(both) == 8
    for f in fields(Profiles):
        column = getattr(both, f.name)
        assert column.dtype == getattr(Profiles.empty(), f.name).dtype
        np.testing.assert_array_equal(column[:5], getattr(first, f.name))
        np.testing.assert_array_equal(column[5:], getattr(second, f.name))


def test_that_no_tables_make_an_empty_one() -> None:
    assert len(Profiles.concatenate([])) == 0
    assert len(Profiles.empty().of_element(1)) == 0
    assert Profiles.empty().centre.shape == (0, 3)


def test_that_the_paper_s_flattest_ellipse_comes_from_a_cut_at_45_degrees(
    rng: np.random.Generator,
) -> None:
    table = profiles(rng, 1)
    table.semi_minor[0] = 0.1
    table.semi_major[0] = 0.1 / math.cos(math.pi / 4)
    assert table.flattening[0] == pytest.approx(1 - 1 / math.sqrt(2))


def test_that_a_result_finds_things_by_their_ids() -> None:
    axis = LineAxis(np.zeros(3), np.array([0.0, 0.0, 1.0]), 1.0)
    elements = tuple(element(ElementKind.CYLINDER, axis, element_id=i) for i in (1, 2))
    deformations = tuple(
        Deformation(
            deformation_id=i,
            element_id=on,
            kind=DeformationKind.DENT,
            chainage=0.5,
            chainage_start=0.4,
            chainage_end=0.6,
            clock=0.0,
            peak=np.zeros(3),
            depth=0.01,
            depth_sd=0.001,
            length=0.2,
            width=0.1,
        )
        for i, on in ((1, 2), (2, 2), (3, 1))
    )
    result = Result(
        settings=Settings(),
        origin=np.zeros(3),
        source=None,
        n_cloud_points=0,
        stacks=(),
        elements=elements,
        profiles=Profiles.empty(),
        deformations=deformations,
        segment_id=np.empty(0, np.int32),
        element_id=np.empty(0, np.int32),
        deviation=np.empty(0, np.float32),
        seconds={},
    )
    assert result.element(2) is elements[1]
    assert result.deformation(3) is deformations[2]
    assert result.deformations_of(2) == deformations[:2]
    assert result.deformations_of(1) == deformations[2:]
