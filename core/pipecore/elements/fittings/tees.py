"""Tees: where a branch meets the side of a run, with the part of the run around it.

A scan does not show the welds of a tee, so its length is that of a standard one of the
run's size, ASME B16.9: from the branch's axis to either end 25 mm and 0.7 of the run's
outside diameter, which is within 4 mm of the table from DN 40 to DN 500.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.refinement.extent import Extent
from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.runs.ends import AxisSpan, LineIndex
from pipecore.geometry import AnyAxis, ArcAxis

MIN_BRANCH_SIN = float(np.sin(np.deg2rad(30.0)))
"""A branch leaves its run at this angle or more."""
MAX_SKEW = 0.25
"""The axes pass each other within this share of the run's radius."""
END_DISTANCE_RADII = (0.5, 1.6)
"""A branch ends where the run's surface is: so many of the run's radii from its axis."""
MAX_GAP, MAX_FAR_SKEW = 4.0, 0.1
"""A branch whose end is hidden may end so many of its radii off, with a smaller skew."""
MIN_BRANCH_RATIO = 0.38
"""A branch that is narrower, in radii of the run, is a nozzle and not a tee."""
CENTRE_TO_END = (0.025, 0.7)
"""Metres, and outside diameters more."""
MIN_REST_RADII = 0.7
"""What is left of the run beside a tee is a separate pipe from so many radii on."""


@dataclass(frozen=True)
class Junction:
    """An end of `branch` in the side of `run`."""

    branch: int
    run: int
    chainage: float
    """Where the axes meet."""
    is_wide: bool
    """Whether the branch is wide enough for a tee."""


def find_junctions(spans: list[AxisSpan], met: set[tuple[int, int]]) -> list[Junction]:
    """Ends that run into the side of a straight of no smaller radius.

    Parameters
    ----------
    spans : list of AxisSpan
        Of all elements.
    met : set of (int, int)
        Ends (element, 0 for its start or 1 for its end) that another element follows.
    """
    found = []
    lines = LineIndex([span.axis for span in spans])
    radii = np.array([max(span.radii) for span in spans])
    for i, branch in enumerate(spans):
        for end in (0, 1):
            point = branch.axis.end if end else branch.axis.start
            tangent = branch.axis.tangent(branch.axis.length if end else 0.0)
            outward = tangent if end else -tangent
            for j in lines.near(point, END_DISTANCE_RADII[1] * radii + MAX_GAP * branch.radii[end]):
                run = spans[j]
                if i == j or isinstance(run.axis, ArcAxis):
                    continue
                radius = max(run.radii)
                if branch.radii[end] > 1.05 * radius:
                    continue
                chainage, rho, _ = run.axis.pipe_coordinates(point[None])
                beside = -0.5 * radius < chainage[0] < run.axis.length + 0.5 * radius
                least, most = (r * radius for r in END_DISTANCE_RADII)
                is_far = rho[0] > most
                if is_far:
                    most = radius + (0.0 if (i, end) in met else MAX_GAP) * branch.radii[end]
                if not beside or not least < rho[0] < most:
                    continue
                ahead = run.axis.tangent(chainage[0])
                across = np.cross(outward, ahead)
                sine = float(np.linalg.norm(across))
                towards = run.axis.at(chainage[0]) - point
                skew = abs(float(towards @ across)) / max(sine, 1e-9)
                max_skew = MAX_FAR_SKEW if is_far else MAX_SKEW
                if sine > MIN_BRANCH_SIN and skew < max_skew * radius and towards @ outward > 0:
                    # Where the axes meet, not where the branch ends, is a lateral's middle.
                    slope = float(outward @ ahead) / sine
                    middle = float(chainage[0]) + slope * float(rho[0])
                    is_wide = branch.radii[end] > MIN_BRANCH_RATIO * radius
                    found.append(Junction(i, j, middle, is_wide))
    return found


def tee_ends(chainages: list[float], length: float, radius: float) -> list[tuple[float, float]]:
    """Where the tees of one run start and end.

    Tees that would overlap end half-way between their branches; a remainder of run that is
    too short for a pipe is part of the tee beside it.

    Parameters
    ----------
    chainages : list of float
        Of the branches' axes; those at one place make one tee (a cross).
    length, radius : float
        Of the run, metres.
    """
    least, diameters = CENTRE_TO_END
    reach, rest = least + diameters * 2 * radius, MIN_REST_RADII * radius
    middles: list[float] = []
    for chainage in sorted(chainages):
        if not middles or chainage - middles[-1] > radius:
            middles.append(chainage)
    ends = [(max(m - reach, 0.0), min(m + reach, length)) for m in middles]
    for k in range(len(ends) - 1):
        if ends[k + 1][0] - ends[k][1] < rest:
            border = 0.5 * (middles[k] + middles[k + 1])
            ends[k], ends[k + 1] = (ends[k][0], border), (border, ends[k + 1][1])
    if ends and ends[0][0] < rest:
        ends[0] = (0.0, ends[0][1])
    if ends and length - ends[-1][1] < rest:
        ends[-1] = (ends[-1][0], length)
    return [(low, high) for low, high in ends if high - low > rest]


@dataclass(frozen=True, eq=False)
class ElementPart:
    """An element, or a stretch of one that tees have cut: `whole` is the element's number."""

    found: FittedElement
    axis: AnyAxis
    whole: int
    is_tee: bool = False


def cut_tees(
    fitted: list[FittedElement],
    axes: list[AnyAxis],
    tees: list[Junction],
    xyz: NDArray[np.float64],
) -> list[ElementPart]:
    """Cut runs into their tees and what is left between them.

    Parameters
    ----------
    fitted : list of FittedElement
    axes : list of LineAxis or ArcAxis
        Theirs, trimmed to what they meet.
    tees : list of Junction
    xyz : ndarray, shape (n, 3)
        The downsampled points.

    Returns
    -------
    list of ElementPart
        In the order of the elements; the parts of one follow each other along its axis.
    """
    parts = []
    for i, (found, axis) in enumerate(zip(fitted, axes, strict=True)):
        middles = [t.chainage for t in tees if t.run == i]
        if not middles or isinstance(axis, ArcAxis):
            parts.append(ElementPart(found, axis, i))
            continue
        chainage, _, _ = axis.pipe_coordinates(xyz[found.inliers])
        at = -np.inf
        ends = tee_ends(middles, axis.length, found.fit.model.radius)
        borders = [0.0, *(b for pair in ends for b in pair), axis.length]
        for k, (low, high) in enumerate(pairwise(borders)):
            if high - low < 1e-9:
                continue
            upto = high if high < axis.length else np.inf
            inliers = found.inliers[(chainage >= at) & (chainage < upto)]
            at = upto
            part = _cut(found, axis, low, high, inliers)
            parts.append(ElementPart(part, part.axis, i, is_tee=k % 2 == 1))
    return parts


def _cut(
    run: FittedElement, axis: AnyAxis, low: float, high: float, inliers: NDArray[np.intp]
) -> FittedElement:
    """The stretch of a run between two chainages of its trimmed axis."""
    part = axis.part(low, high)
    shift = float(run.axis.pipe_coordinates(part.start[None])[0][0])
    gaps = tuple(
        (max(a - shift, 0.0), min(b - shift, part.length))
        for a, b in run.extent.gaps
        if b > shift and a < shift + part.length
    )
    extent = Extent(0.0, part.length, run.extent.arc, run.extent.coverage, gaps)
    return replace(run, axis=part, inliers=inliers, extent=extent)
