"""Merging, splitting and re-classifying: elements fitted and measured anew."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from pipecore.catalogues import with_sizes
from pipecore.editing.changes import Labels, find, kinds_of, noted, on_elements
from pipecore.editing.refitting import RefittedElement, fit_shape, measure_anew, part_of
from pipecore.elements.refinement.extent import MIN_REPORTED_GAP_RADII
from pipecore.errors import EditError
from pipecore.geometry import AnyAxis, Array, LineAxis
from pipecore.progress import NoProgress, Progress
from pipecore.types import Element, ElementKind, PointCloud, Result

STAGES = {"fitting": 0.2, "thinning": 0.15, "normals": 0.25, "deformations": 0.4}
"""The stages in their order, with the share of the time that each usually takes."""

MERGED = (ElementKind.CYLINDER, ElementKind.CONE, ElementKind.TORUS)
MAX_OFFSET = 0.3
"""Axes of one line or arc leave it by less than this share of the radius."""
MAX_TURN_COS = float(np.cos(np.deg2rad(8.0)))
MAX_RADIUS_DIFFERENCE = 0.05
MIN_PART_RADII = 0.1
"""Shortest part of a split element, in radii."""


def merge_elements(
    cloud: PointCloud,
    result: Result,
    element_ids: Collection[int],
    progress: Progress = NoProgress(),
) -> Result:
    """Merge elements on one line or one arc, such as a pipe behind an obstacle.

    The merged element has the lowest of their ids and the name of the first that has one;
    their runs are joined.

    Parameters
    ----------
    cloud : PointCloud
        The cloud that the result is of.
    result : Result
    element_ids : collection of int
        Two or more.
    progress : Progress

    Returns
    -------
    Result
        With the change noted in `edits`.

    Raises
    ------
    EditError
        If they are not of one kind and size, or not on one line or arc.
    CancelledError
        From `progress`.
    """
    parts = [find(result, i) for i in sorted(set(element_ids))]
    if len(parts) < 2:
        raise EditError("Select at least two elements to merge.")
    _check_alike(parts)
    axis = _common_axis(parts)
    first = parts[0]
    ends = sorted(_span_on(axis, part) for part in parts)
    between = tuple(
        (a[1], b[0])
        for a, b in pairwise(ends)
        if b[0] - a[1] > MIN_REPORTED_GAP_RADII * first.radius
    )
    n_points = [max(p.n_points, 1) for p in parts]
    radius = float(np.average([p.radius for p in parts], weights=n_points))
    is_cone = first.kind is ElementKind.CONE
    start_radius, end_radius = _taper(axis, parts) if is_cone else (radius, radius)
    merged = replace(
        first,
        axis=axis,
        radius=start_radius,
        radius_end=end_radius,
        name=next((p.name for p in parts if p.name), ""),
        gaps=tuple(sorted((*between, *_gaps_on(axis, parts)))),
    )
    gone = {p.element_id for p in parts}
    shape = _shape_on(cloud, result, merged, gone, progress)
    merged = with_sizes(shape.element, result.settings_of(first.element_id).elements)
    changed = measure_anew(cloud, result, gone, [merged], progress)
    runs = {p.run_id for p in parts}
    elements = (
        replace(e, run_id=first.run_id) if e.run_id in runs else e for e in changed.elements
    )
    names = [result.run_names.get(p.run_id, "") for p in parts]
    name = next(filter(None, names), "")
    run_names = {**result.run_names, first.run_id: name} if name else result.run_names
    joined = replace(changed, elements=tuple(elements), run_names=run_names)
    return noted(joined, f"merged {Labels(parts)}")


def split_element(
    cloud: PointCloud,
    result: Result,
    element_id: int,
    chainage: float,
    progress: Progress = NoProgress(),
) -> Result:
    """Split an element at a chainage; the part before it keeps the id.

    Parameters
    ----------
    cloud : PointCloud
        The cloud that the result is of.
    result : Result
    element_id : int
    chainage : float
        Where to cut, metres from the element's start.
    progress : Progress

    Returns
    -------
    Result
        With the change noted in `edits`.

    Raises
    ------
    EditError
        If the cut is too near to an end, or the element is a sphere.
    CancelledError
        From `progress`.
    """
    whole = find(result, element_id)
    if whole.kind is ElementKind.SPHERE:
        raise EditError("A sphere cannot be split.")
    length, least = whole.axis.length, MIN_PART_RADII * whole.radius
    if not least <= chainage <= length - least:
        raise EditError(
            "{element.label} is {length:.3f} m long: "
            "split it between {least:.3f} and {most:.3f} m.",
            element=whole,
            length=length,
            least=least,
            most=length - least,
        )
    new_id = max(e.element_id for e in result.elements) + 1
    middle_radius = float(whole.radius_at(chainage))
    pieces = [
        replace(whole, axis=whole.axis.part(0.0, chainage), radius_end=middle_radius),
        replace(
            whole,
            element_id=new_id,
            axis=whole.axis.part(chainage, length),
            radius=middle_radius,
            name="",
        ),
    ]
    parts = []
    for piece, start in zip(pieces, (0.0, chainage), strict=True):
        gaps = (
            (max(low - start, 0.0), min(high - start, piece.axis.length))
            for low, high in whole.gaps
        )
        piece_ = replace(piece, gaps=tuple((a, b) for a, b in gaps if b > a))
        shape = _shape_on(cloud, result, piece_, {element_id}, progress, must_fit=False)
        parts.append(with_sizes(shape.element, result.settings_of(element_id).elements))
    changed = measure_anew(cloud, result, {element_id}, parts, progress)
    return noted(changed, f"split {whole.label} at {chainage:.3f} m")


def change_kind(
    cloud: PointCloud,
    result: Result,
    element_id: int,
    kind: ElementKind,
    progress: Progress = NoProgress(),
) -> Result:
    """Set the kind of an element and measure it again as that.

    Parameters
    ----------
    cloud : PointCloud
        The cloud that the result is of.
    result : Result
    element_id : int
    kind : ElementKind
        One of `kinds_of`.
    progress : Progress

    Returns
    -------
    Result
        With the change noted in `edits`.

    Raises
    ------
    EditError
        If its axis cannot be that of such a kind.
    CancelledError
        From `progress`.
    """
    element = find(result, element_id)
    if kind not in kinds_of(element):
        raise EditError(
            "{element.label} cannot be a {kind}: its axis is of another shape.",
            element=element,
            kind=kind,
        )
    changed = replace(element, kind=kind)
    if (kind is ElementKind.CONE) != (element.kind is ElementKind.CONE):
        if kind is not ElementKind.CONE:
            mean = 0.5 * (element.radius + element.radius_end)
            changed = replace(changed, radius=mean, radius_end=mean)
        changed = _shape_on(cloud, result, changed, {element_id}, progress).element
    changed = with_sizes(changed, result.settings_of(element_id).elements)
    anew = measure_anew(cloud, result, {element_id}, [changed], progress)
    return noted(anew, f"{element.label} is a {kind}")


def _shape_on(
    cloud: PointCloud,
    result: Result,
    element: Element,
    owners: Collection[int],
    progress: Progress,
    *,
    must_fit: bool = True,
) -> RefittedElement:
    """Fit an element to the points of its former owners between its ends."""
    index = np.flatnonzero(on_elements(result.element_id, owners))
    thinning = result.settings_of(min(owners)).thinning
    shape = fit_shape(element, part_of(cloud, index), thinning, progress)
    if not shape.is_fitted and must_fit:
        raise EditError(
            "The points do not carry {element.label} as a {kind}.",
            element=element,
            kind=element.kind,
        )
    return shape


def _check_alike(parts: Sequence[Element]) -> None:
    first = parts[0]
    for other in parts[1:]:
        names = Labels((first, other))
        if other.kind is not first.kind or type(other.axis) is not type(first.axis):
            raise EditError(
                "{names} are not of one kind; change the kind of one first.", names=names
            )
        if first.kind not in MERGED:
            raise EditError(
                "{names} cannot be merged: only pipes, reducers and bends can.", names=names
            )
        slack = MAX_RADIUS_DIFFERENCE * min(first.radius, other.radius)
        slack += 3 * float(np.nan_to_num(np.hypot(first.radius_sd, other.radius_sd)))
        if first.kind is not ElementKind.CONE and abs(first.radius - other.radius) > slack:
            raise EditError(
                "{names} are not of one size: their radii are {radius:.1f} and {other:.1f} mm.",
                names=names,
                radius=1000 * first.radius,
                other=1000 * other.radius,
            )


def _common_axis(parts: Sequence[Element]) -> AnyAxis:
    """The line or arc on which all parts lie, from the first end to the last."""
    longest = max(parts, key=lambda p: p.axis.length)
    samples = np.concatenate([p.axis.at(np.linspace(0, p.axis.length, 20)) for p in parts])
    axis = longest.axis
    if isinstance(axis, LineAxis):
        weight = np.repeat([p.axis.length for p in parts], 20)
        weight = weight / weight.sum()
        middle = weight @ samples
        centred = samples - middle
        direction = np.linalg.eigh((weight[:, None] * centred).T @ centred)[1][:, -1]
        if direction @ longest.axis.tangent(0.0) < 0:
            direction = -direction
        axis = LineAxis(middle, direction, 0.0)
    chainage, rho, _ = axis.pipe_coordinates(samples)
    name = "line" if isinstance(axis, LineAxis) else "arc"
    for part, off in zip(parts, rho.reshape(len(parts), 20).max(axis=1), strict=True):
        turn = abs(float(part.axis.tangent(0.0) @ axis.tangent(_span_on(axis, part)[0])))
        if off > MAX_OFFSET * part.radius or turn < MAX_TURN_COS:
            raise EditError(
                "{names} do not lie on one {shape}: {element.label} is {off:.0f} mm off it.",
                names=Labels(parts),
                shape=name,
                element=part,
                off=1000 * off,
            )
    return axis.part(float(chainage.min()), float(chainage.max()))


def _span_on(axis: AnyAxis, part: Element) -> tuple[float, float]:
    """Chainages of a part's ends on another axis, the lower first."""
    ends = np.stack([part.axis.start, part.axis.end])
    low, high = np.sort(axis.pipe_coordinates(ends)[0]).tolist()
    return low, high


def _gaps_on(axis: AnyAxis, parts: Sequence[Element]) -> list[tuple[float, float]]:
    """The parts' own gaps, as chainages of another axis."""
    found = []
    for part in parts:
        for gap in part.gaps:
            low, high = np.sort(axis.pipe_coordinates(part.axis.at(np.array(gap)))[0]).tolist()
            found.append((low, high))
    return found


def _taper(axis: AnyAxis, parts: Sequence[Element]) -> tuple[float, float]:
    """Radii at both ends of a line through the radii at the parts' ends."""
    chainage: list[Array] = []
    radius: list[Array] = []
    for part in parts:
        ends = np.array([0.0, part.axis.length])
        chainage.append(axis.pipe_coordinates(part.axis.at(ends))[0])
        radius.append(part.radius_at(ends))
    slope, start = np.polyfit(np.concatenate(chainage), np.concatenate(radius), 1)
    return float(start), float(start + slope * axis.length)
