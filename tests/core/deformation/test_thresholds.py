"""Thresholds filter: what is found, and as what, does not move with them."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from pipecore.deformation import find_deformations
from pipecore.settings import DeformationSettings
from pipecore.types import Deformation, DeformationKind
from tests.core.deformation.sampler import PipeScan, PipeScene, bump, oval

R = 0.11


def scene() -> PipeScene:
    """A dent of 9 mm, an oval stretch of 5 %, and a bow of 12 mm, all round."""
    return PipeScene(
        radius=R,
        length=4.0,
        views=(0.3, 2.4, 4.5),
        shapes=[
            bump(1.0, 0.4, -0.009, length=0.18, width=0.16, r=R),
            oval(2.2, 3.2, 0.05, 0.8, R),
        ],
        sag=lambda s: 0.012 * np.sin(np.pi * s / 4),
    )


def found(scan: PipeScan, **settings: float) -> tuple[Deformation, ...]:
    own = replace(DeformationSettings(), **settings)
    return find_deformations(scan.element, scan.xyz, scan.normals, (), own).deformations


def of_kind(deformations: tuple[Deformation, ...], kind: DeformationKind) -> Deformation:
    return max((d for d in deformations if d.kind is kind), key=lambda d: d.length)


@pytest.fixture(scope="module")
def scan() -> PipeScan:
    return scene().scan(np.random.default_rng(5))


@pytest.fixture(scope="module")
def usual(scan) -> tuple[Deformation, ...]:
    kinds = DeformationKind.DENT, DeformationKind.OVALITY, DeformationKind.BOW
    deformations = found(scan)
    assert {d.kind for d in deformations} == set(kinds)
    return deformations


@pytest.mark.parametrize("min_depth_mm", [0.2, 1.0, 5.0, 8.0])
def test_that_depths_do_not_move_with_the_smallest_depth(scan, usual, min_depth_mm):
    # 0.2 mm dropped a bow of 24.8 mm: its SD was above the threshold.
    now = found(scan, min_depth_mm=min_depth_mm)
    for kind in (DeformationKind.DENT, DeformationKind.OVALITY, DeformationKind.BOW):
        before, after = of_kind(usual, kind), of_kind(now, kind)
        assert after.depth == pytest.approx(before.depth, nan_ok=True)
        assert after.ovality == pytest.approx(before.ovality, nan_ok=True)
        assert after.chainage == before.chainage


@pytest.mark.parametrize("min_ovality_pct", [0.1, 0.5, 1.0, 4.0])
def test_that_ovality_does_not_move_with_the_smallest_ovality(scan, usual, min_ovality_pct):
    # 0.1 % dropped an ovality of 6 %, and the ovality told moved with the threshold.
    now = found(scan, min_ovality_pct=min_ovality_pct)
    before, after = (of_kind(d, DeformationKind.OVALITY) for d in (usual, now))
    for name in ("ovality", "chainage", "length", "clock"):
        assert getattr(after, name) == getattr(before, name)


def test_that_a_higher_threshold_finds_part_of_what_a_lower_one_finds(scan):
    levels = [found(scan, min_depth_mm=d, min_ovality_pct=d) for d in (0.2, 1.0, 3.0, 6.0, 15.0)]
    places = [{(d.kind, round(d.chainage, 6)) for d in each} for each in levels]
    for lower, higher in pairwise(places):
        assert higher <= lower
    assert not places[-1]


def test_that_faint_ovality_is_found_where_it_is_asked_for(rng):
    faint = PipeScene(
        radius=R, length=4.0, views=(0.3, 2.4, 4.5), shapes=[oval(1.0, 3.0, 0.012, 0.8, R)]
    )
    scan = faint.scan(rng)
    assert not found(scan)
    told = of_kind(found(scan, min_ovality_pct=0.5), DeformationKind.OVALITY)
    assert told.ovality == pytest.approx(0.012, rel=0.15)
