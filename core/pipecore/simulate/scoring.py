"""How well a result agrees with the truth of a simulated scan. Knows no detector."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pipecore.geometry import ArcAxis, Array
from pipecore.simulate import TrueDeformation, TrueElement, Truth
from pipecore.simulate.scoring_deformations import WHOLE_AXIS, DeformationMatch, match_deformations
from pipecore.types import Deformation, Element, ElementKind, Result

SAMPLE_STEP = 0.01
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

    @property
    def length(self) -> float:
        """Length along the axis, metres."""
        return self.end - self.start

    def __str__(self) -> str:
        return (
            f"{self.kind} {self.element_id} r {1e3 * self.radius:.0f} mm: "
            f"{self.start:.2f}–{self.end:.2f} m"
        )


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
    doubled_length : float
        Axis length that two reported elements claim; it counts in the precision twice.
    kinds_right, kinds_judged : dict
        Numbers of visible true elements by kind: those of which at least half is claimed
        by one reported element of their kind, and all. One not found is not right.
    radius_errors : dict
        Reported less true radius by true element that has the right kind.
    radius_sds : dict
        The standard deviations reported with these radii.
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
    doubled_length: float
    kinds_right: dict[ElementKind, int]
    kinds_judged: dict[ElementKind, int]
    radius_errors: dict[int, float]
    radius_sds: dict[int, float]
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
        """Median of the radii's absolute errors, metres."""
        return _median(np.abs(list(self.radius_errors.values())))

    @property
    def worst_radius_error(self) -> float:
        """Largest absolute error of a radius, metres."""
        return max((abs(e) for e in self.radius_errors.values()), default=np.nan)

    @property
    def median_axis_error(self) -> float:
        """Median distance of reported from true axes, metres."""
        return _median(self.axis_errors)

    def __str__(self) -> str:
        kinds = ", ".join(
            f"{kind} {self.kinds_right.get(kind, 0)}/{n}" for kind, n in self.kinds_judged.items()
        )
        lines = [
            f"recall {self.recall:.3f} of {self.visible_length:.1f} m, "
            f"precision {self.precision:.3f} of {self.reported_length:.1f} m "
            f"({self.doubled_length:.1f} m twice)",
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
    truths = _true_axes(truth)
    findings = [_find(t, reported, np.deg2rad(min_arc_deg)) for t in truths]
    claims = [_check(r, truths, reported) for r in reported]

    visible_length = sum(f.visible_length for f in findings)
    reported_length = sum(c.length for c in claims)
    judged = [f for f in findings if f.is_judged]
    right = [f for f in judged if f.main is not None and f.main.kind is f.element.kind]
    return Score(
        recall=_share(sum(f.found_length for f in findings), visible_length),
        precision=_share(sum(c.real_length for c in claims), reported_length),
        visible_length=visible_length,
        reported_length=reported_length,
        doubled_length=sum(c.doubled_length for c in claims) / 2,
        kinds_right=dict(Counter(f.element.kind for f in right)),
        kinds_judged=dict(Counter(f.element.kind for f in judged)),
        radius_errors={f.element.element_id: f.radius_error for f in right},
        radius_sds={f.element.element_id: f.main.radius_sd for f in right if f.main},
        axis_errors=np.concatenate([np.empty(0), *(f.axis_errors for f in findings)]),
        bend_radius_errors={
            f.element.element_id: f.bend_radius_error
            for f in right
            if f.element.kind is ElementKind.TORUS
        },
        missed=tuple(s for f in findings for s in f.missed if s.length >= min_stretch),
        false=tuple(s for c in claims for s in c.false if s.length >= min_stretch),
        **match_deformations(result, truth, shift, min_depth, min_seen),
    )


def _share(part: float, whole: float) -> float:
    return part / whole if whole else np.nan


@dataclass(frozen=True)
class _TrueAxis:
    """A true element with what else counts as it."""

    element: TrueElement
    slack: float
    """How far a bow or kink has moved the axis, metres."""
    pipe_inside: TrueElement | None
    """The pipe through a flange."""


def _true_axes(truth: Truth) -> list[_TrueAxis]:
    slack = {d.element_id: d.depth for d in truth.deformations if d.kind in WHOLE_AXIS}
    return [
        _TrueAxis(e, slack.get(e.element_id, 0.0), _pipe_through(e, truth.elements))
        for e in truth.elements
    ]


@dataclass
class _Finding:
    """What was found of one true element."""

    element: TrueElement
    visible_length: float = 0.0
    found_length: float = 0.0
    missed: list[Stretch] = field(default_factory=list)
    is_judged: bool = False
    main: Element | None = None
    """The reported element that stands for at least half of what is visible."""
    radius_error: float = np.nan
    bend_radius_error: float = np.nan
    axis_errors: Array = field(default_factory=lambda: np.empty(0))


def _find(true: _TrueAxis, reported: list[Element], min_arc: float) -> _Finding:
    element = true.element
    chainage, weight = _samples(element)
    is_visible = element.is_visible(chainage, min_arc)
    matches = [_matches(element, chainage, r, true.slack) for r in reported]
    inside = []
    if true.pipe_inside is not None:
        inside = [_matches(true.pipe_inside, chainage, r) for r in reported]
    is_found = np.any([np.zeros(len(chainage), dtype=np.bool_), *matches, *inside], axis=0)
    finding = _Finding(
        element,
        float(weight * is_visible.sum()),
        float(weight * (is_visible & is_found).sum()),
        _stretches(element, chainage, weight, is_visible & ~is_found),
    )
    # The kind of a short stub or a sliver cannot be determined.
    needed = 0.1 if element.kind is ElementKind.CYLINDER else 0.5 * element.axis.length
    finding.is_judged = finding.visible_length >= needed
    counts = [int((m & is_visible).sum()) for m in matches]
    candidates = [i for i, n in enumerate(counts) if n and n >= 0.5 * is_visible.sum()]
    if not candidates:
        return finding
    i = max(candidates, key=lambda i: (reported[i].kind is element.kind, counts[i]))
    finding.main = main = reported[i]
    rows = chainage[matches[i] & is_visible]
    finding.radius_error = float(np.median(_radius_difference(element, rows, main)))
    if isinstance(element.axis, ArcAxis) and isinstance(main.axis, ArcAxis):
        finding.bend_radius_error = main.axis.bend_radius / element.axis.bend_radius - 1
    if not true.slack and element.kind is not ElementKind.SPHERE:
        finding.axis_errors = main.axis.pipe_coordinates(element.axis.at(rows))[1]
    return finding


@dataclass
class _Claim:
    """What is real of one reported element."""

    length: float
    real_length: float
    doubled_length: float
    false: list[Stretch]


def _check(claimed: Element, truths: list[_TrueAxis], reported: list[Element]) -> _Claim:
    chainage, weight = _samples(claimed)
    is_claimed = np.ones(len(chainage), dtype=np.bool_)
    for start, end in claimed.gaps:
        is_claimed &= (chainage < start) | (chainage > end)
    is_real = np.zeros(len(chainage), dtype=np.bool_)
    for true in truths:
        is_real |= _matches(claimed, chainage, true.element, true.slack)
        if true.pipe_inside is not None:
            is_real |= _matches(claimed, chainage, true.pipe_inside)
    is_doubled = np.zeros(len(chainage), dtype=np.bool_)
    for other in reported:
        if other is not claimed:
            is_doubled |= _matches(claimed, chainage, other)
    return _Claim(
        float(weight * is_claimed.sum()),
        float(weight * (is_claimed & is_real).sum()),
        float(weight * (is_claimed & is_doubled).sum()),
        _stretches(claimed, chainage, weight, is_claimed & ~is_real),
    )


def _moved(element: Element, shift: Array) -> Element:
    return replace(element, axis=element.axis.moved(shift), centre=element.centre + shift)


def _samples(element: Element | TrueElement) -> tuple[Array, float]:
    """Chainages in the middle of steps, and the length that each stands for."""
    n_steps = max(1, round(element.axis.length / SAMPLE_STEP))
    weight = element.axis.length / n_steps
    chainage = np.asarray((np.arange(n_steps) + 0.5) * weight, np.float64)
    return chainage, weight


def _matches(
    one: Element | TrueElement,
    chainage: Array,
    other: Element | TrueElement,
    slack: float = 0.0,
) -> Bools:
    """Whether `one` agrees with the axis (by `slack` less strictly) and radius of `other`."""
    if one.kind is ElementKind.SPHERE and other.kind is ElementKind.SPHERE:
        is_near = np.linalg.norm(one.centre - other.centre) <= _tolerance(one.radius)
        is_same = is_near and abs(other.radius / one.radius - 1) <= MAX_RADIUS_RATIO
        return np.full(len(chainage), is_same, dtype=np.bool_)
    if ElementKind.SPHERE in (one.kind, other.kind):
        return np.zeros(len(chainage), dtype=np.bool_)
    along, offset, _ = other.axis.pipe_coordinates(one.axis.at(chainage))
    radius = one.radius_at(chainage)
    cosine = np.abs(np.einsum("ij,ij->i", one.axis.tangent(chainage), other.axis.tangent(along)))
    is_beside = (along >= -SAMPLE_STEP / 2) & (along <= other.axis.length + SAMPLE_STEP / 2)
    difference = _radius_difference(one, chainage, other)
    return np.asarray(
        is_beside
        & (offset <= _tolerance(radius) + slack)
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


def _pipe_through(flange: TrueElement, elements: tuple[TrueElement, ...]) -> TrueElement | None:
    """The pipe inside a flange, as a neighbour in its run has it."""
    for e in elements if flange.kind is ElementKind.FLANGE else ():
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
