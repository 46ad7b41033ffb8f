"""Straights that follow each other with hardly a turn are one pipe, bowed or kinked."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.refinement.extent import MIN_REPORTED_GAP_RADII, Extent
from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.refinement.surface_fits import LineSurface, SurfaceFit
from pipecore.elements.runs.ends import AxisSpan, Link, meeting_ends
from pipecore.elements.runs.numbering import number_runs
from pipecore.geometry import LineAxis

Array = NDArray[np.float64]

MAX_TURN_COS = float(np.cos(np.deg2rad(4.0)))
"""No elbow turns by less than this."""
MAX_GAP = 12.0
"""Longest gap between the parts of one pipe, in radii."""
SAME_RADIUS = 0.02


def join_straights(
    fitted: list[FittedElement], links: list[Link]
) -> tuple[list[FittedElement], list[Link]]:
    """Join straights of one radius that meet end to end with a turn too small for an elbow.

    Parameters
    ----------
    fitted : list of FittedElement
    links : list of (int, int)
        Pairs of elements that belong together; renumbered.
    """
    spans = [AxisSpan(f.axis, f.radii) for f in fitted]
    pairs = [(i, j) for i, _, j, _ in meeting_ends(spans) if _are_one_pipe(fitted[i], fitted[j])]
    if not pairs:
        return fitted, links
    label = number_runs(len(fitted), pairs)
    # Numbers in the order of each group's first member.
    _, first, group = np.unique(label, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    number = rank[group]
    joined = []
    for k in range(len(first)):
        members = [fitted[m] for m in np.flatnonzero(number == k)]
        joined.append(members[0] if len(members) == 1 else _joined(members))
    return joined, [(int(number[a]), int(number[b])) for a, b in links]


def _are_one_pipe(a: FittedElement, b: FittedElement) -> bool:
    one, other = a.fit.model, b.fit.model
    if not isinstance(one, LineSurface) or not isinstance(other, LineSurface):
        return False
    if one.is_tapered or other.is_tapered:
        return False
    smaller = min(one.radius, other.radius)
    # Flanges are as long as they are wide at the most, pipes longer.
    if min(a.axis.length, b.axis.length) < 1.5 * smaller:
        return False
    sd = float(np.hypot(a.fit.radius_sd, b.fit.radius_sd))
    gap = min(
        float(np.linalg.norm(p - q))
        for p in (a.axis.start, a.axis.end)
        for q in (b.axis.start, b.axis.end)
    )
    return (
        abs(float(one.direction @ other.direction)) > MAX_TURN_COS
        and abs(one.radius - other.radius) < SAME_RADIUS * smaller + 3 * sd
        and gap < MAX_GAP * smaller
    )


def _joined(parts: list[FittedElement]) -> FittedElement:
    """One cylinder along the parts' axes, with the mean of their radii."""
    samples = np.concatenate([p.axis.at(np.linspace(0, p.axis.length, 20)) for p in parts])
    weight = np.repeat([p.axis.length for p in parts], 20)
    weight = weight / weight.sum()
    middle = weight @ samples
    centred = samples - middle
    direction = np.linalg.eigh((weight[:, None] * centred).T @ centred)[1][:, -1]
    precision = np.array([1.0 / p.fit.radius_sd**2 for p in parts])
    radius = float(precision @ [p.fit.model.radius for p in parts] / precision.sum())
    along = centred @ direction
    low, high = float(along.min()), float(along.max())
    model = LineSurface(middle, direction, radius)
    best = max(parts, key=lambda p: p.fit.n_used).fit
    covariance = best.covariance.copy()
    covariance[4, 4] = 1.0 / precision.sum()
    # Never below zero, where parts are on one line but for rounding.
    off_line = np.sqrt(max(weight @ (np.square(centred).sum(axis=1) - along**2), 0.0))
    fit = SurfaceFit(
        model,
        covariance,
        float(np.hypot(max(p.fit.sigma for p in parts), off_line)),
        sum(p.fit.n_used for p in parts),
    )
    covered = sum(p.extent.coverage * p.axis.length for p in parts)
    ends = sorted(
        tuple(sorted((float((q - middle) @ direction) - low) for q in (p.axis.start, p.axis.end)))
        for p in parts
    )
    between = [
        (a[1], b[0]) for a, b in pairwise(ends) if b[0] - a[1] > MIN_REPORTED_GAP_RADII * radius
    ]
    extent = Extent(
        0.0,
        high - low,
        float(np.median([p.extent.arc for p in parts])),
        min(1.0, covered / (high - low)),
        tuple(between),
    )
    return FittedElement(
        fit,
        LineAxis(middle + low * direction, direction, high - low),
        np.concatenate([p.inliers for p in parts]),
        extent,
        max(p.misfit for p in parts),
    )
