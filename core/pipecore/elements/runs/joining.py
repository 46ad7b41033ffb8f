"""Straights that follow each other with hardly a turn are one pipe, bowed or kinked."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.refinement.curved_fit import bow_of_straight, fit_curved_pipe, goes_on
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
MIN_BOW_RADII, MIN_GROWTH_RADII, MIN_STRAIGHT_RADII = 0.06, 3.0, 3.0
"""A pipe bowed by less, in radii, is told by a straight axis, as is one that grows by no more.
Shorter pieces are not followed."""
MAX_BOW_SHARE = 0.06
"""A pipe bows or sags by 5 % of its length at the most, and some scatter: more is a bend, made to
turn the run."""
CLEAR_RADII = 2.5
"""The bow is that between so many radii off the ends, where a bend that begins may be followed."""
BEYOND_SHARE = 0.12
"""Beyond its end a bowed pipe leaves the straight piece's surface by this share of the radius."""
MIN_SHOWN_BOW_RADII = 0.04
"""A straight whose own points bow by as much, in radii, is followed; near its line only they do
less than the pipe."""
MAX_SCATTER_RATIO, MAX_SCATTER_RATIO_OF_SECTION = 0.95, 1.05
"""A curve that is hardly longer than the straight in its place scatters less, by this ratio; or
no more than about a section model, which may have bowed with it."""
MIN_INLIERS_SHARE = 0.7
"""A curved pipe has at least this share of the points of the pieces that it takes the place of."""
MAX_GAP = 12.0
"""Longest gap between the parts of one pipe, in radii."""
SAME_RADIUS = 0.02


def join_bowed(
    fitted: list[FittedElement], nearby: NearbyPoints, is_free: Flags
) -> list[FittedElement]:
    """Put one pipe about a curved axis in the place of straights that are pieces of it.

    Parameters
    ----------
    fitted : list of FittedElement
        Straights; others stay as they are.
    nearby : NearbyPoints
    is_free : ndarray of bool
        Downsampled points that are on none of them; changed.

    Returns
    -------
    list of FittedElement
        The bowed pipes in the place of their longest pieces; the other pieces are gone.
    """
    order = sorted(range(len(fitted)), key=lambda i: (-fitted[i].axis.length, i))
    groups = {i: group for group in _groups(fitted, MAX_KINK_COS) for i in group}
    result: list[FittedElement | None] = list(fitted)
    tried: set[tuple[int, ...]] = set()
    for i in order:
        group = [k for k in groups.get(i, [i]) if result[k] is fitted[k]]
        if i not in group or not _is_straight(fitted[i]) or tuple(group) in tried:
            continue
        tried.add(tuple(group))
        alike = [
            k
            for k, f in enumerate(result)
            if f is not None and k not in group and _have_one_radius(fitted[i], f)
        ]
        usable = is_free.copy()
        for k in (*group, *alike):
            usable[fitted[k].inliers] = True
        parts = [fitted[k] for k in group]
        is_bowed = any(_shows_bow(p, nearby) for p in parts)
        if not (
            is_bowed
            or _leave_line(parts)
            or any(goes_on(p, BEYOND_SHARE, nearby, usable) for p in parts)
        ):
            continue
        pipe = fit_curved_pipe(parts, nearby, usable)
        if pipe is None:
            continue
        taken = [k for k in (*group, *alike) if _is_within(fitted[k], pipe)]
        is_better = _is_better(pipe, parts, len(taken), is_bowed=is_bowed)
        if not is_better or not set(group) <= set(taken):
            continue
        for k in taken:
            is_free[fitted[k].inliers] = True
            result[k] = None
        for k in set(alike) - set(taken):
            pipe = replace(pipe, inliers=np.setdiff1d(pipe.inliers, fitted[k].inliers))
        is_free[pipe.inliers] = False
        result[i] = pipe
    return [f for f in result if f is not None]


def _is_straight(f: FittedElement) -> bool:
    model = f.fit.model
    is_pipe = isinstance(model, LineSurface) and not model.is_tapered
    return is_pipe and f.axis.length > MIN_STRAIGHT_RADII * model.radius


def _have_one_radius(a: FittedElement, b: FittedElement) -> bool:
    one, other = a.fit.model, b.fit.model
    if not isinstance(other, LineSurface) or other.is_tapered:
        return False
    sd = float(np.hypot(a.fit.radius_sd, b.fit.radius_sd))
    return abs(one.radius - other.radius) < SAME_RADIUS * min(one.radius, other.radius) + 3 * sd


def _is_within(part: FittedElement, pipe: FittedElement) -> bool:
    """Whether a piece's points are on a pipe."""
    return float(np.mean(np.isin(part.inliers, pipe.inliers))) >= MIN_INLIERS_SHARE


def _shows_bow(part: FittedElement, nearby: NearbyPoints) -> bool:
    """Whether a straight's own points leave it as those of a bowed pipe do."""
    return bow_of_straight(part, nearby) > MIN_SHOWN_BOW_RADII * part.fit.model.radius


def _leave_line(parts: list[FittedElement]) -> bool:
    """Whether pieces lie on no straight line, together."""
    ends = np.concatenate([p.axis.at(np.linspace(0.0, p.axis.length, 3)) for p in parts])
    centred = ends - ends.mean(axis=0)
    direction = np.linalg.svd(centred, full_matrices=False)[2][0]
    off = np.linalg.norm(centred - (centred @ direction)[:, None] * direction, axis=1)
    return bool(off.max() > MIN_SHOWN_BOW_RADII * parts[0].fit.model.radius)


def _is_better(
    pipe: FittedElement, parts: list[FittedElement], n_taken: int, *, is_bowed: bool
) -> bool:
    """Whether a curved pipe is bowed, and more than the pieces that it was made of."""
    assert isinstance(pipe.axis, CurveAxis)
    radius = pipe.fit.model.radius
    if pipe.axis.bow > MAX_BOW_SHARE * pipe.axis.chord.length:
        return False
    clear = CLEAR_RADII * radius
    if pipe.axis.length < 2 * clear + MIN_STRAIGHT_RADII * radius:
        return False
    if pipe.axis.part(clear, pipe.axis.length - clear).bow < MIN_BOW_RADII * radius:
        return False
    grown = pipe.axis.length - max(p.axis.length for p in parts)
    if n_taken > 1 or grown > MIN_GROWTH_RADII * radius:
        return True
    if not is_bowed or len(parts) > 1:
        return False
    # A section model may have followed the bow: then the curve is to be as close to the points.
    (part,) = parts
    ratio = MAX_SCATTER_RATIO if part.section is None else MAX_SCATTER_RATIO_OF_SECTION
    return pipe.fit.sigma < ratio * part.fit.sigma


def _groups(fitted: list[FittedElement], max_turn_cos: float) -> list[list[int]]:
    """Numbers of straights that follow each other as pieces of one pipe, two or more."""
    spans = [AxisSpan(f.axis, f.radii) for f in fitted]
    pairs = [
        (i, j)
        for i, _, j, _ in meeting_ends(spans)
        if _are_one_pipe(fitted[i], fitted[j], max_turn_cos)
    ]
    label = number_runs(len(fitted), pairs)
    groups: dict[int, list[int]] = {}
    for i in sorted({i for pair in pairs for i in pair}):
        groups.setdefault(int(label[i]), []).append(i)
    return list(groups.values())


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
    pairs = [pair for group in _groups(fitted, MAX_TURN_COS) for pair in pairwise(group)]
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


def _are_one_pipe(a: FittedElement, b: FittedElement, max_turn_cos: float) -> bool:
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
        turn_cos > (max_turn_cos if is_kinked else MAX_TURN_COS)
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
