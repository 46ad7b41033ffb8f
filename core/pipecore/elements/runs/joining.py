"""Straights that follow each other with hardly a turn are one pipe, bowed or kinked."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.refinement.curved_fit import fit_curved_pipe
from pipecore.elements.refinement.extent import MIN_REPORTED_GAP_RADII, Extent
from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.refinement.nearby_points import NearbyPoints
from pipecore.elements.refinement.surface_fits import LineSurface, SurfaceFit
from pipecore.elements.runs.ends import AxisSpan, Link, meeting_ends
from pipecore.elements.runs.numbering import number_runs
from pipecore.geometry import CurveAxis, LineAxis

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MAX_TURN_COS = float(np.cos(np.deg2rad(4.0)))
"""No elbow turns by less than this."""
MAX_KINK_COS, MIN_KINKED_RADII = float(np.cos(np.deg2rad(10.0))), 5.0
"""Two pieces, each of so many radii, that meet with hardly a gap are one pipe with a kink up to
this turn: an elbow of so small an angle is rare, and would be short."""
MAX_KINK_GAP = 2.0
"""Gap at a kink, in radii."""
MIN_BOW_RADII = 0.1
"""A pipe bowed by less, in radii, is told by a straight axis: its section model has the bow."""
MIN_INLIERS_SHARE = 0.7
"""A curved pipe has at least this share of the points of the pieces that it takes the place of."""
MAX_GAP = 12.0
"""Longest gap between the parts of one pipe, in radii."""
SAME_RADIUS = 0.02


def bowed_pipes(
    fitted: list[FittedElement], nearby: NearbyPoints, is_free: Flags
) -> list[tuple[list[int], FittedElement]]:
    """Find straights that together are one bowed or kinked pipe.

    Parameters
    ----------
    fitted : list of FittedElement
    nearby : NearbyPoints
    is_free : ndarray of bool
        Downsampled points that are on none of them.

    Returns
    -------
    list of (list of int, FittedElement)
        Numbers of the straights, and the pipe about a curved axis that takes their place.
    """
    found = []
    for group in _groups(fitted):
        parts = [fitted[i] for i in group]
        usable = is_free.copy()
        for part in parts:
            usable[part.inliers] = True
        pipe = fit_curved_pipe(parts, nearby, usable)
        if pipe is not None and _takes_the_place_of(pipe, parts):
            found.append((group, pipe))
    return found


def _groups(fitted: list[FittedElement]) -> list[list[int]]:
    """Numbers of straights that follow each other as pieces of one pipe, two or more."""
    spans = [AxisSpan(f.axis, f.radii) for f in fitted]
    pairs = [(i, j) for i, _, j, _ in meeting_ends(spans) if _are_one_pipe(fitted[i], fitted[j])]
    label = number_runs(len(fitted), pairs)
    groups: dict[int, list[int]] = {}
    for i in sorted({i for pair in pairs for i in pair}):
        groups.setdefault(int(label[i]), []).append(i)
    return list(groups.values())


def _takes_the_place_of(pipe: FittedElement, parts: list[FittedElement]) -> bool:
    """Whether a curved pipe is bowed, and on the points of the pieces it was made of."""
    assert isinstance(pipe.axis, CurveAxis)
    if pipe.axis.bow < MIN_BOW_RADII * pipe.fit.model.radius:
        return False
    held = np.isin(np.concatenate([p.inliers for p in parts]), pipe.inliers)
    return float(np.mean(held)) >= MIN_INLIERS_SHARE


def join_straights(
    fitted: list[FittedElement], links: list[Link], nearby: NearbyPoints
) -> tuple[list[FittedElement], list[Link]]:
    """Join straights of one radius that meet end to end with a turn too small for an elbow.

    Parameters
    ----------
    fitted : list of FittedElement
    links : list of (int, int)
        Pairs of elements that belong together; renumbered.
    nearby : NearbyPoints
    """
    groups = _groups(fitted)
    if not groups:
        return fitted, links
    is_free = np.ones(len(nearby.surface.xyz), np.bool_)
    for f in fitted:
        is_free[f.inliers] = False
    bowed = {tuple(group): pipe for group, pipe in bowed_pipes(fitted, nearby, is_free)}
    pairs = [pair for group in groups for pair in pairwise(group)]
    label = number_runs(len(fitted), pairs)
    # Numbers in the order of each group's first member.
    _, first, group = np.unique(label, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    number = rank[group]
    joined = []
    for k in range(len(first)):
        members = [fitted[m] for m in np.flatnonzero(number == k)]
        if len(members) == 1:
            joined.append(members[0])
        else:
            pipe = bowed.get(tuple(int(m) for m in np.flatnonzero(number == k)))
            joined.append(pipe if pipe is not None else _joined(members))
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
    turn_cos = _turn_cos(a, b)
    is_kinked = (
        min(a.axis.length, b.axis.length) > MIN_KINKED_RADII * smaller
        and gap < MAX_KINK_GAP * smaller
    )
    return (
        turn_cos > (MAX_KINK_COS if is_kinked else MAX_TURN_COS)
        and abs(one.radius - other.radius) < SAME_RADIUS * smaller + 3 * sd
        and gap < MAX_GAP * smaller
    )


def _turn_cos(a: FittedElement, b: FittedElement) -> float:
    """Cosine of the angle by which the axes turn at the ends that are nearest to each other."""
    ends = [
        (float(np.linalg.norm(p - q)), abs(float(t @ u))) for p, t in _ends(a) for q, u in _ends(b)
    ]
    return min(ends)[1]


def _ends(f: FittedElement) -> list[tuple[Array, Array]]:
    """Both ends of an axis with the tangents there."""
    return [(f.axis.at(s), f.axis.tangent(s)) for s in (0.0, f.axis.length)]


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
