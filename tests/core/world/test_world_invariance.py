import numpy as np
import pytest

from tools.world.invariance import again, changes, is_same_deformation, is_same_element, measure


def _element(start=0.0, end=1.0, y=0.0, radius=0.1, kind="cylinder"):
    x = np.linspace(start, end, 41)
    axis = np.column_stack([x, np.full(41, y), np.zeros(41)])
    return {"kind": kind, "radius": radius, "axis": axis.tolist()}


@pytest.mark.parametrize(
    ("other", "is_same"),
    [
        (_element(), True),
        (_element(1.0, 0.0), True),
        (_element(radius=0.1015), True),
        (_element(radius=0.103), False),
        (_element(kind="cone"), False),
        (_element(end=0.9), True),
        (_element(end=0.7), False),
        (_element(end=1.4), False),
        (_element(y=0.02), True),
        (_element(y=0.03), False),
    ],
)
def test_that_elements_are_the_same_by_kind_radius_and_overlap(other, is_same):
    assert is_same_element(_element(), other) == is_same
    assert is_same_element(other, _element()) == is_same


def test_that_each_element_stands_for_one_only():
    two = [_element(), _element()]
    assert again(two, [_element()], is_same_element) == 1
    assert again([_element()], two, is_same_element) == 1
    assert again(two, two, is_same_element) == 2


def test_that_deformations_are_the_same_by_kind_place_and_depth():
    dent = {"kind": "dent", "depth": 0.01, "radius": 0.1, "peak": [0, 0, 0]}
    assert is_same_deformation(dent, dent | {"peak": [0.04, 0, 0], "depth": 0.012})
    assert not is_same_deformation(dent, dent | {"peak": [0.06, 0, 0]})
    assert not is_same_deformation(dent, dent | {"depth": 0.013})
    assert not is_same_deformation(dent, dent | {"kind": "bulge"})


def test_that_what_is_found_in_a_changed_cloud_is_given_in_the_frame_of_the_first():
    rows = {change: measure("lone:3", change) for change in ("as it is", "turn 1", "mirror")}
    ((first,), *others) = (r["elements"] for r in rows.values())
    for (other,) in others:
        assert is_same_element(first, other)


def test_that_changes_begin_with_none_and_are_named_apart():
    names = changes(10)
    assert names[0] == "as it is"
    assert len(set(names)) == len(names) == 24
