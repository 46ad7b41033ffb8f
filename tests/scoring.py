"""How well a result agrees with the truth of a simulated scan. Knows no detector."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pipecore.geometry import ArcAxis, Array, LineAxis
from pipecore.simulate import TrueDeformation, TrueElement, Truth
from pipecore.types import Deformation, DeformationKind, Element, ElementKind, Result

STEP = 0.01
"""Axes are compared every so many metres."""
MAX_OFFSET_RATIO, MIN_OFFSET = 0.15, 0.005
MAX_ANGLE = np.deg2rad(10.0)
MAX_RADIUS_RATIO = 0.10

Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Stretch:
    """A part of an element's axis, for looking at what went wrong."""

    element_id: int
    kind: ElementKind
    radius: float
    start: float
    end: float

    def __str__(self) -> str:
        return (
            f"{self.kind} {self.element_id} r {1e3 * self.radius:.0f} mm: "
            f"{self.start:.2f}–{self.end:.2f} m"
        )


@dataclass(frozen=True)
class DeformationMatch:
    """A true deformation with the reported one that stands for it."""

    true: TrueDeformation
    reported: Deformation

    @property
    def is_kind_right(self) -> bool:
        return self.true.kind == self.reported.kind

    @property
    def depth_error(self) -> float:
        return self.reported.depth - self.true.depth

    @property
    def length_ratio(self) -> float:
        """Reported over true length of the footprint."""
        return self.reported.length / self.true.length

    @property
    def width_ratio(self) -> float:
        return self.reported.width / self.true.width

    @property
    def position_error(self) -> float:
        """Distance of the peaks, metres."""
        return float(np.linalg.norm(self.reported.peak - self.true.peak))

    @property
    def ovality_error(self) -> float:
        return self.reported.ovality - self.true.ovality


@dataclass(frozen=True, eq=False)
class Score:
    """Figures of one scan; lengths in metres.

    Parameters
    ----------
    recall : float
        Share of the visible true axis length that was found.
    precision : float
        Share of the reported axis length (gaps left out) that is real.
    visible_length, reported_length : float
    kinds_right, kinds_judged : dict
        Numbers of visible true elements by kind: those whose main reported element has
        their kind, and all. One not found is not right.
    radius_errors : dict
        Reported less true radius by true element, where its main reported element has
        its kind.
    axis_errors : ndarray
        Distances between true and reported axes at all matched samples; elements with a
        bow or a kink are left out.
    bend_radius_errors : dict
        Relative, by true element.
    missed, false : tuple of Stretch
    deformations : tuple of DeformationMatch
    missed_deformations : tuple of TrueDeformation
        Those that should have been found.
    false_deformations, duplicate_deformations : tuple of Deformation
        Where nothing is; where something is that was already matched.
    """

    recall: float
    precision: float
    visible_length: float
    reported_length: float
    kinds_right: dict[ElementKind, int]
    kinds_judged: dict[ElementKind, int]
    radius_errors: dict[int, float]
    axis_errors: Array
    bend_radius_errors: dict[int, float]
    missed: tuple[Stretch, ...]
    false: tuple[Stretch, ...]
    deformations: tuple[DeformationMatch, ...] = ()
    missed_deformations: tuple[TrueDeformation, ...] = ()
    false_deformations: tuple[Deformation, ...] = ()
    duplicate_deformations: tuple[Deformation, ...] = ()

    def kind_share(self, kinds: Sequence[ElementKind] = tuple(ElementKind)) -> float:
        """Share of elements of the given true kinds that got the right kind."""
        judged = sum(self.kinds_judged.get(k, 0) for k in kinds)
        return sum(self.kinds_right.get(k, 0) for k in kinds) / judged if judged else np.nan

    @property
    def median_radius_error(self) -> float:
        return _median(np.abs(list(self.radius_errors.values())))

    @property
    def worst_radius_error(self) -> float:
        return max((abs(e) for e in self.radius_errors.values()), default=np.nan)

    @property
    def median_axis_error(self) -> float:
        return _median(self.axis_errors)

    def __str__(self) -> str:
        kinds = ", ".join(
            f"{kind} {self.kinds_right.get(kind, 0)}/{n}" for kind, n in self.kinds_judged.items()
        )
        lines = [
            f"recall {self.recall:.3f} of {self.visible_length:.1f} m, "
            f"precision {self.precision:.3f} of {self.reported_length:.1f} m",
            f"kinds {self.kind_share():.2f} ({kinds})",
            f"radius: median {1e3 * self.median_radius_error:.2f} mm, "
            f"worst {1e3 * self.worst_radius_error:.2f} mm; "
            f"axis: median {1e3 * self.median_axis_error:.2f} mm; bend radius: median "
            f"{100 * _median(np.abs(list(self.bend_radius_errors.values()))):.1f} %",
            f"deformations: {len(self.deformations)} found, {len(self.missed_deformations)} "
            f"missed, {len(self.false_deformations)} false, "
            f"{len(self.duplicate_deformations)} twice",
        ]
        lines += [f"  missed {s}" for s in self.missed]
        lines += [f"  false {s}" for s in self.false]
        lines += [
            f"  {m.true.kind} → {m.reported.kind}: depth {1e3 * m.true.depth:.1f} "
            f"{1e3 * m.depth_error:+.1f} mm, length × {m.length_ratio:.2f}, "
            f"width × {m.width_ratio:.2f}, peak off {1e3 * m.position_error:.0f} mm"
            for m in self.deformations
        ]
        lines += [
            f"  missed {d.kind} {1e3 * d.depth:.1f} mm on element {d.element_id}"
            for d in self.missed_deformations
        ]
        lines += [
            f"  false {d.kind} {1e3 * d.depth:.1f} mm on element {d.element_id}"
            for d in self.false_deformations
        ]
        return "\n".join(lines)


def _median(values: Array) -> float:
    return float(np.median(values)) if len(values) else np.nan


def score(
    result: Result,
    truth: Truth,
    *,
    min_arc_deg: float = 60.0,
    min_stretch: float = 0.03,
    min_depth: float = 0.005,
    min_seen: float = 0.6,
) -> Score:
    """Compare a result with the truth.

    A true sample of an axis is found if a reported axis passes within max(0.15 r, 5 mm)
    with its tangent within 10° and its radius within 10 %; a reported sample is real by
    the same rule on the whole true axes, seen or not. A sphere is found by its centre
    and radius as one. In a flange the radius of its pipe counts as well as its own.

    Parameters
    ----------
    result : Result
    truth : Truth
    min_arc_deg : float
        Arc from which on an axis counts as visible.
    min_stretch : float
        Shorter missed and false stretches are counted but not listed, metres.
    min_depth, min_seen : float
        Deformations less deep (metres) or seen over less of their area may be missed.
    """
    shift = result.origin - truth.origin
    reported = [_moved(e, shift) for e in result.elements]
    true = list(truth.elements)
    through = [_pipe_through(f, true) for f in true if f.kind is ElementKind.FLANGE]
    through_of = {f.element_id: f for f in through if f is not None}

    n_found = n_visible = 0.0
    missed: list[Stretch] = []
    kinds_right: dict[ElementKind, int] = {}
    kinds_judged: dict[ElementKind, int] = {}
    radius_errors: dict[int, float] = {}
    bend_radius_errors: dict[int, float] = {}
    axis_errors = []
    displaced = {
        d.element_id
        for d in truth.deformations
        if d.kind in (DeformationKind.BOW, DeformationKind.KINK)
    }
    for element in true:
        chainage, weight = _samples(element)
        is_visible = element.is_visible(chainage, np.deg2rad(min_arc_deg))
        matches = np.array([_matches(element, chainage, r) for r in reported], dtype=np.bool_)
        matches = matches.reshape(len(reported), len(chainage))
        is_found = matches.any(axis=0)
        if element.element_id in through_of:
            pipe = through_of[element.element_id]
            for r in reported:
                is_found |= _matches(pipe, chainage, r)
        n_visible += weight * is_visible.sum()
        n_found += weight * (is_visible & is_found).sum()
        missed += _stretches(element, chainage, weight, is_visible & ~is_found)

        shortest = 0.1 if element.kind is ElementKind.CYLINDER else 0.5 * element.axis.length
        if weight * is_visible.sum() < shortest:
            continue
        kinds_judged[element.kind] = kinds_judged.get(element.kind, 0) + 1
        n_matched = (matches & is_visible).sum(axis=1)
        if not n_matched.any():
            continue
        # Of elements that match as much, one of the right kind is the one meant.
        main = max(
            range(len(reported)), key=lambda i: (n_matched[i], reported[i].kind is element.kind)
        )
        rows = matches[main] & is_visible
        if element.element_id not in displaced and element.kind is not ElementKind.SPHERE:
            axis_errors.append(
                reported[main].axis.pipe_coordinates(element.axis.at(chainage))[1][rows]
            )
        if reported[main].kind is not element.kind or n_matched[main] < 0.5 * is_visible.sum():
            continue
        kinds_right[element.kind] = kinds_right.get(element.kind, 0) + 1
        radius_errors[element.element_id] = float(
            np.median(_radius_difference(element, chainage[rows], reported[main]))
        )
        if isinstance(element.axis, ArcAxis) and isinstance(reported[main].axis, ArcAxis):
            bend_radius_errors[element.element_id] = (
                reported[main].axis.bend_radius / element.axis.bend_radius - 1
            )

    n_real = n_reported = 0.0
    false: list[Stretch] = []
    for r in reported:
        chainage, weight = _samples(r)
        is_claimed = np.ones(len(chainage), dtype=np.bool_)
        for start, end in r.gaps:
            is_claimed &= (chainage < start) | (chainage > end)
        is_real = np.zeros(len(chainage), dtype=np.bool_)
        for element in [*true, *through_of.values()]:
            is_real |= _matches(r, chainage, element)
        n_reported += weight * is_claimed.sum()
        n_real += weight * (is_claimed & is_real).sum()
        false += _stretches(r, chainage, weight, is_claimed & ~is_real)

    return Score(
        n_found / n_visible if n_visible else np.nan,
        n_real / n_reported if n_reported else np.nan,
        n_visible,
        n_reported,
        kinds_right,
        kinds_judged,
        radius_errors,
        np.concatenate(axis_errors) if axis_errors else np.empty(0),
        bend_radius_errors,
        tuple(s for s in missed if s.end - s.start >= min_stretch),
        tuple(s for s in false if s.end - s.start >= min_stretch),
        **_match_deformations(result, truth, shift, min_depth, min_seen),
    )


def _moved(element: Element, shift: Array) -> Element:
    axis = element.axis
    if isinstance(axis, LineAxis):
        moved: LineAxis | ArcAxis = replace(axis, start=axis.start + shift)
    else:
        moved = replace(axis, centre=axis.centre + shift)
    return replace(element, axis=moved, centre=element.centre + shift)


def _samples(element: Element | TrueElement) -> tuple[Array, float]:
    """Chainages in the middle of steps, and the length that each stands for."""
    n_steps = max(1, round(element.axis.length / STEP))
    weight = element.axis.length / n_steps
    return (np.arange(n_steps) + 0.5) * weight, weight


def _matches(one: Element | TrueElement, chainage: Array, other: Element | TrueElement) -> Bools:
    """Whether `one` at each chainage agrees with the axis and radius of `other`."""
    if one.kind is ElementKind.SPHERE and other.kind is ElementKind.SPHERE:
        is_near = np.linalg.norm(one.centre - other.centre) <= _tolerance(one.radius)
        is_same = is_near and abs(other.radius / one.radius - 1) <= MAX_RADIUS_RATIO
        return np.full(len(chainage), is_same, dtype=np.bool_)
    if ElementKind.SPHERE in (one.kind, other.kind):
        return np.zeros(len(chainage), dtype=np.bool_)
    along, offset, _ = other.axis.pipe_coordinates(one.axis.at(chainage))
    radius = one.radius_at(chainage)
    cosine = np.abs(np.einsum("ij,ij->i", one.axis.tangent(chainage), other.axis.tangent(along)))
    is_beside = (along >= -STEP / 2) & (along <= other.axis.length + STEP / 2)
    difference = _radius_difference(one, chainage, other)
    return np.asarray(
        is_beside
        & (offset <= _tolerance(radius))
        & (cosine >= np.cos(MAX_ANGLE))
        & (np.abs(difference) <= MAX_RADIUS_RATIO * radius)
    )


def _tolerance(radius: Array | float) -> Array:
    return np.maximum(MAX_OFFSET_RATIO * np.asarray(radius), MIN_OFFSET)


def _radius_difference(
    one: Element | TrueElement, chainage: Array, other: Element | TrueElement
) -> Array:
    """Radius of `other` less that of `one`, beside `one` at `chainage`."""
    if one.kind is ElementKind.SPHERE:
        return np.full(len(chainage), other.radius - one.radius)
    along, _, _ = other.axis.pipe_coordinates(one.axis.at(chainage))
    along = np.clip(along, 0.0, other.axis.length)
    return other.radius_at(along) - one.radius_at(chainage)


def _pipe_through(flange: TrueElement, elements: list[TrueElement]) -> TrueElement | None:
    """The pipe inside a flange, as a neighbour in its run has it."""
    for e in elements:
        if e.run_id != flange.run_id or e.kind is ElementKind.FLANGE:
            continue
        if np.linalg.norm(e.axis.end - flange.axis.start) < 1e-6:
            radius = e.radius_end
        elif np.linalg.norm(e.axis.start - flange.axis.end) < 1e-6:
            radius = e.radius
        else:
            continue
        return replace(flange, kind=ElementKind.CYLINDER, radius=radius, radius_end=radius)
    return None


def _stretches(
    element: Element | TrueElement, chainage: Array, weight: float, is_in: Bools
) -> list[Stretch]:
    edges = np.flatnonzero(np.diff(np.r_[0, is_in.astype(np.int8), 0]))
    return [
        Stretch(
            element.element_id,
            element.kind,
            element.radius,
            float(chainage[a] - weight / 2),
            float(chainage[b - 1] + weight / 2),
        )
        for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]


@dataclass
class _Claims:
    deformations: list[DeformationMatch] = field(default_factory=list)
    false: list[Deformation] = field(default_factory=list)
    duplicates: list[Deformation] = field(default_factory=list)


WHOLE_AXIS = (DeformationKind.BOW, DeformationKind.KINK)


def _match_deformations(
    result: Result, truth: Truth, shift: Array, min_depth: float, min_seen: float
) -> dict[str, tuple[object, ...]]:
    """Match each true deformation to the nearest reported one on it, of its kind if any is."""
    reported = [replace(d, peak=d.peak + shift) for d in result.deformations]
    claims = _Claims()
    pairs = [
        (t.kind is not d.kind, float(np.linalg.norm(t.peak - d.peak)), i, j)
        for i, t in enumerate(truth.deformations)
        for j, d in enumerate(reported)
        if _is_on(d, t, truth.element(t.element_id))
    ]
    true_done: set[int] = set()
    reported_done: set[int] = set()
    for _, _, i, j in sorted(pairs):
        if i in true_done or j in reported_done:
            continue
        true_done.add(i)
        reported_done.add(j)
        claims.deformations.append(DeformationMatch(truth.deformations[i], reported[j]))
    on_something = {j for _, _, _, j in pairs}
    for j, d in enumerate(reported):
        if j not in reported_done:
            (claims.duplicates if j in on_something else claims.false).append(d)
    missed = [
        t
        for i, t in enumerate(truth.deformations)
        if i not in true_done and t.depth >= min_depth and t.seen >= min_seen
    ]
    return {
        "deformations": tuple(sorted(claims.deformations, key=lambda m: m.true.deformation_id)),
        "missed_deformations": tuple(missed),
        "false_deformations": tuple(claims.false),
        "duplicate_deformations": tuple(claims.duplicates),
    }


def _is_on(reported: Deformation, true: TrueDeformation, element: TrueElement) -> bool:
    """Whether a reported peak lies on the footprint of a true deformation, or just beside."""
    if (reported.kind in WHOLE_AXIS) != (true.kind in WHOLE_AXIS):
        return False
    (chainage,), (offset,), (clock,) = element.axis.pipe_coordinates(reported.peak[None])
    radius = float(element.radius_at(true.chainage))
    margin = max(0.02, 0.25 * true.length)
    if not true.chainage_start - margin <= chainage <= true.chainage_end + margin:
        return False
    if abs(offset - radius) > 0.5 * radius:
        return False
    if true.kind not in (DeformationKind.DENT, DeformationKind.BULGE):
        return True
    around = radius * abs(np.mod(clock - true.clock + np.pi, 2 * np.pi) - np.pi)
    return bool(around <= true.width / 2 + max(0.02, 0.25 * true.width))
