"""A scene as it is scanned: its cloud, and what should be found in it."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.simulate import TrueElement, Truth
from pipecore.simulate.truth import COVERAGE_STEP
from pipecore.types import ElementKind, PointCloud
from tools.world.assembly import NO_BODY, Assembly, Body, Role
from tools.world.noise import Noise, disturb
from tools.world.surfaces import Array
from tools.world.viewing import MAX_POINTS, Seen, View, look


@dataclass(frozen=True, eq=False)
class WorldScene:
    """A cloud with its truth.

    Parameters
    ----------
    cloud : PointCloud
    truth : Truth
        Local coordinates are the cloud's. A true run is a body: its name is that of the body.
    bodies : tuple of Body
    body : ndarray of int32, shape (n,)
        Index of the body that each point lies on.
    element_id : ndarray of int32, shape (n,)
        True element of each point, 0 for none.
    chainage : ndarray, shape (n,)
        Along that element's curve, metres; nan for none.
    spacing : float
        Of points, or of scan lines, metres.
    branched : frozenset of int
        True elements that a branch divides.
    properties : dict
        What was drawn, for grouping figures.
    """

    cloud: PointCloud
    truth: Truth
    bodies: tuple[Body, ...]
    body: NDArray[np.int32]
    element_id: NDArray[np.int32]
    chainage: Array
    spacing: float
    branched: frozenset[int] = frozenset()
    properties: dict[str, Any] = field(default_factory=dict)


def scanned(
    assembly: Assembly,
    view: View,
    noise: Noise,
    rng: np.random.Generator,
    properties: dict[str, Any],
) -> WorldScene:
    """Scan an assembly: look at it, add the noise, and count what is seen of each element."""
    seen, spacing = look(assembly.patches, view, rng)
    most = max(1, MAX_POINTS // max(len(seen.samples), 1))
    noise = replace(noise, duplicates=min(noise.duplicates, most))
    points, row = disturb(seen, noise, rng)
    is_real = row >= 0
    row = np.maximum(row, 0)
    body = np.where(is_real, seen.samples.body[row], NO_BODY).astype(np.int32)
    element_id = np.where(is_real, seen.samples.element_id[row], 0).astype(np.int32)
    lengths = np.array([np.nan, *(e.axis.length for e in assembly.elements)])
    elements = tuple(
        _covered(e, seen, seen.samples.element_id == e.element_id, spacing)
        for e in assembly.elements
    )
    deformations = tuple(
        replace(
            d,
            n_points=int((seen.samples.element_id == d.element_id).sum()),
            seen=_seen_share(d, elements[d.element_id - 1]),
        )
        for d in assembly.deformations
    )
    things = sorted(b.name for b in assembly.bodies[1:] if b.role is not Role.PIPE)
    stations = np.asarray(view.stations, dtype=np.float64).reshape(-1, 3)
    return WorldScene(
        PointCloud(np.zeros(3), np.ascontiguousarray(points, np.float32), stations=stations),
        Truth(np.zeros(3), elements, deformations),
        tuple(assembly.bodies),
        body,
        element_id,
        seen.samples.u[row] * lengths[element_id],
        spacing,
        frozenset(assembly.branched),
        properties
        | {"n_points": len(points), "spacing": spacing, "noise": noise.sd, "things": things},
    )


def _covered(
    element: TrueElement, seen: Seen, rows: NDArray[np.bool_], spacing: float
) -> TrueElement:
    """The element with the arc that has points at each step of its axis.

    Steps are shorter than the spacing of lines may be: each looks as far as that.
    """
    length = element.axis.length
    n_steps = max(1, round(length / COVERAGE_STEP))
    if element.kind is ElementKind.SPHERE:
        chainage, _, angle = element.axis.pipe_coordinates(seen.samples.points[rows])
    else:
        chainage, angle = seen.samples.u[rows] * length, 2 * np.pi * seen.samples.v[rows]
    order = np.argsort(chainage)
    chainage, angle = chainage[order], angle[order]
    middles = (np.arange(n_steps) + 0.5) * length / n_steps
    reach = max(COVERAGE_STEP, 1.2 * spacing)
    first = np.searchsorted(chainage, middles - reach)
    last = np.searchsorted(chainage, middles + reach)
    largest_gap = max(np.deg2rad(15.0), 3 * spacing / max(element.radius, element.radius_end))
    arc = [_arc(angle[i:j], largest_gap) for i, j in zip(first, last, strict=True)]
    # What counts as seen in the scoring is six points a step, of whatever spacing.
    count = np.where(last - first >= 6, 6 + last - first, 0)
    return replace(element, arc_seen=np.array(arc), points_seen=count.astype(np.int32))


def _arc(angle: Array, largest_gap: float) -> float:
    if len(angle) < 2:
        return 0.0
    angle = np.sort(angle)
    gaps = np.diff(np.r_[angle, angle[0] + 2 * np.pi])
    return float(gaps[gaps <= largest_gap].sum())


def _seen_share(deformation: Any, element: TrueElement) -> float:
    """Share of the section that is seen where the deformation is."""
    chainage = (np.arange(len(element.arc_seen)) + 0.5) * COVERAGE_STEP
    near = (chainage >= deformation.chainage_start) & (chainage <= deformation.chainage_end)
    return float(np.mean(element.arc_seen[near]) / (2 * np.pi)) if near.any() else 0.0
