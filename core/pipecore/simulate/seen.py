"""Which parts of the true axes and deformations the points of a scan show."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipecore.geometry import Array
from pipecore.simulate.truth import COVERAGE_STEP, TrueDeformation, TrueElement, Truth
from pipecore.types import DeformationKind, Floats


def with_coverage(
    truth: Truth, xyz: Floats, element_id: NDArray[np.int32], spacing: float
) -> Truth:
    """Return `truth` with the arcs and shares of area that the labelled points show."""
    order = np.argsort(element_id, kind="stable")
    bounds = np.searchsorted(element_id[order], np.arange(1, len(truth.elements) + 2))
    points = {
        e.element_id: np.asarray(xyz[order[bounds[i] : bounds[i + 1]]], dtype=np.float64)
        for i, e in enumerate(truth.elements)
    }
    covered = replace(
        truth, elements=tuple(_covered(e, points[e.element_id], spacing) for e in truth.elements)
    )
    return replace(
        covered,
        deformations=tuple(
            _seen(d, covered.element(d.element_id), points[d.element_id], spacing)
            for d in truth.deformations
        ),
    )


def _covered(element: TrueElement, points: Array, spacing: float) -> TrueElement:
    length = element.axis.length
    n_steps = max(1, round(length / COVERAGE_STEP))
    chainage, _, clock = element.axis.pipe_coordinates(points)
    order = np.argsort(chainage)
    chainage, clock = chainage[order], clock[order]
    edges = np.linspace(0.0, length, n_steps + 1)
    # Two rows of points say little of where an arc ends, so the neighbours help.
    first = np.searchsorted(chainage, edges[:-1] - COVERAGE_STEP)
    last = np.searchsorted(chainage, edges[1:] + COVERAGE_STEP)
    radii = element.radius_at((edges[:-1] + edges[1:]) / 2)
    arc = [_arc(clock[i:j], r, spacing) for i, j, r in zip(first, last, radii, strict=True)]
    count = np.diff(np.searchsorted(chainage, edges)).astype(np.int32)
    return replace(element, arc_seen=np.array(arc), points_seen=count)


def _arc(clock: Array, radius: float, spacing: float) -> float:
    """Angle that neighbours cover which are no further apart than the spacing explains."""
    if len(clock) < 2:
        return 0.0
    clock = np.sort(clock)
    gaps = np.diff(np.r_[clock, clock[0] + 2 * np.pi])
    largest = max(np.deg2rad(12.0), 2.5 * spacing / max(radius, spacing))
    return float(gaps[gaps <= largest].sum())


def _seen(
    deformation: TrueDeformation, element: TrueElement, points: Array, spacing: float
) -> TrueDeformation:
    """Count the cells of the deformation's footprint that hold a point."""
    if deformation.kind in (DeformationKind.BOW, DeformationKind.KINK):
        # They show wherever the axis does.
        is_visible = element.is_visible(np.linspace(0.0, element.axis.length, 200))
        return replace(deformation, seen=float(is_visible.mean()), n_points=len(points))
    chainage, _, clock = element.axis.pipe_coordinates(points)
    radius = float(element.radius_at(deformation.chainage))
    along = (chainage - deformation.chainage_start) / deformation.length
    around = np.mod(clock - deformation.clock + np.pi, 2 * np.pi) - np.pi
    across = 0.5 + radius * around / deformation.width
    n_along, n_across = (
        max(3, int(extent / max(2 * spacing, extent / 20)))
        for extent in (deformation.length, deformation.width)
    )
    is_inside = (along >= 0) & (along < 1) & (across >= 0) & (across < 1)
    cell = (
        np.floor(along[is_inside] * n_along) * n_across + np.floor(across[is_inside] * n_across)
    ).astype(np.int64)
    is_hit = np.bincount(cell, minlength=n_along * n_across) > 0
    if deformation.kind in (DeformationKind.DENT, DeformationKind.BULGE):
        # Their footprint is the ellipse in the rectangle.
        u, v = np.meshgrid(
            (np.arange(n_along) + 0.5) / n_along * 2 - 1,
            (np.arange(n_across) + 0.5) / n_across * 2 - 1,
            indexing="ij",
        )
        is_hit = is_hit[(np.hypot(u, v) < 1).ravel()]
    return replace(deformation, seen=float(is_hit.mean()), n_points=int(is_inside.sum()))
