"""What a simulated scan should show: its true elements, deformations and what was seen."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from pipecore.errors import ReadError
from pipecore.geometry import ArcAxis, Array, LineAxis
from pipecore.types import DeformationKind, ElementKind

COVERAGE_STEP = 0.02
"""Metres of axis over which the arc that was seen is counted."""

MIN_ARC = np.deg2rad(60.0)
MIN_POINTS = 6
"""A step of axis counts as visible from this arc and this number of points on."""


@dataclass(frozen=True, eq=False)
class TrueElement:
    """One piece of a run as it was built, in coordinates local to the truth's origin.

    Parameters
    ----------
    element_id, run_id : int
        The element's id is its points' `truth_element`.
    run_name : str
    kind : ElementKind
    axis : LineAxis or ArcAxis
        Of the undeformed piece. A sphere's is the line along its run, from where the run's
        surface enters it to where it leaves.
    radius, radius_end : float
    centre : ndarray
        As `pipecore.types.Element.centre`.
    arc_seen : ndarray
        Arc (radians) around the axis that has points, per `COVERAGE_STEP` from the start.
    points_seen : ndarray of int32
        Points per `COVERAGE_STEP`.
    """

    element_id: int
    run_id: int
    run_name: str
    kind: ElementKind
    axis: LineAxis | ArcAxis
    radius: float
    radius_end: float
    centre: Array
    arc_seen: Array = field(default_factory=lambda: np.empty(0))
    points_seen: NDArray[np.int32] = field(default_factory=lambda: np.empty(0, np.int32))

    def radius_at(self, chainage: Array | float) -> Array:
        """Undeformed radius about the axis at `chainage`.

        Parameters
        ----------
        chainage : array_like
            Metres.

        Returns
        -------
        ndarray
            Metres, shape as of `chainage`.
        """
        s = np.asarray(chainage, dtype=np.float64)
        if self.kind is ElementKind.SPHERE:
            return np.sqrt(np.maximum(self.radius**2 - (s - self.axis.length / 2) ** 2, 0.0))
        slope = (self.radius_end - self.radius) / self.axis.length
        return np.asarray(self.radius + slope * s)

    def visible_ranges(
        self, min_arc: float = MIN_ARC, min_points: int = MIN_POINTS
    ) -> tuple[tuple[float, float], ...]:
        """Chainage ranges of which at least `min_arc` and `min_points` per step were hit.

        Points are averaged over three steps, as rows of points do not keep step.

        Parameters
        ----------
        min_arc : float
            Radians.
        min_points : int

        Returns
        -------
        tuple of (float, float)
            Metres.
        """
        near = uniform_filter1d(self.points_seen.astype(np.float64), 3, mode="nearest")
        is_seen = (self.arc_seen >= min_arc) & (near >= min_points) & (self.points_seen > 0)
        steps = np.flatnonzero(np.diff(np.r_[0, is_seen.astype(np.int8), 0]))
        step = self.axis.length / max(len(is_seen), 1)
        return tuple(
            (float(a * step), float(b * step)) for a, b in zip(steps[::2], steps[1::2], strict=True)
        )

    def is_visible(self, chainage: Array, min_arc: float = MIN_ARC) -> NDArray[np.bool_]:
        """Whether the axis was seen at each `chainage`; see `visible_ranges`.

        Parameters
        ----------
        chainage : ndarray
            Metres, shape (n,).
        min_arc : float
            Radians.

        Returns
        -------
        ndarray of bool
            Shape (n,).
        """
        is_seen = np.zeros(len(chainage), dtype=np.bool_)
        for start, end in self.visible_ranges(min_arc):
            is_seen |= (chainage >= start) & (chainage <= end)
        return is_seen


@dataclass(frozen=True, eq=False)
class TrueDeformation:
    """A deformation as it was built; the fields are those of `pipecore.types.Deformation`.

    `length` and `width` are the whole footprint's. `shape` is a `DentShape`, or "".
    `seen` is the share of its area that points fell on (of its axis that is visible, for a
    bow or kink), `n_points` their number.

    Parameters
    ----------
    deformation_id, element_id : int
    kind : DeformationKind
    chainage, chainage_start, chainage_end : float
        Of the peak and of the extent, metres from the element's start.
    clock : float
        Clock angle of the peak, radians.
    peak : ndarray
        The peak on the surface, local coordinates, shape (3,).
    depth : float
        Magnitude, metres.
    length, width : float
        Of the whole footprint, metres.
    ovality : float
        As a ratio; nan for other kinds.
    angle : float
        Of a kink, radians; nan for other kinds.
    shape : str
        A `DentShape`, or "".
    seen : float
        Share of its area that points fell on; for a bow or kink, of its axis that is visible.
    n_points : int
        Points on it.
    """

    deformation_id: int
    element_id: int
    kind: DeformationKind
    chainage: float
    chainage_start: float
    chainage_end: float
    clock: float
    peak: Array
    depth: float
    length: float
    width: float
    ovality: float = np.nan
    angle: float = np.nan
    shape: str = ""
    seen: float = 0.0
    n_points: int = 0


@dataclass(frozen=True, eq=False)
class Truth:
    """All that a scan should show. `origin` takes local coordinates to the world.

    Parameters
    ----------
    origin : ndarray
        World coordinates of the local zero, shape (3,).
    elements : tuple of TrueElement
        In the order of their ids, from 1.
    deformations : tuple of TrueDeformation
    """

    origin: Array
    elements: tuple[TrueElement, ...]
    deformations: tuple[TrueDeformation, ...]

    def element(self, element_id: int) -> TrueElement:
        """Return the element with this id.

        Parameters
        ----------
        element_id : int

        Returns
        -------
        TrueElement
        """
        return self.elements[element_id - 1]

    def save(self, path: Path) -> None:
        """Write the truth as JSON, in world coordinates, angles in degrees.

        Parameters
        ----------
        path : Path
        """
        data = {
            "origin": self.origin.tolist(),
            "coverage_step_m": COVERAGE_STEP,
            "elements": [_element_to_dict(e, self.origin) for e in self.elements],
            "deformations": [_deformation_to_dict(d, self.origin) for d in self.deformations],
        }
        path.write_text(_compact_json(data), encoding="utf-8")


def load_truth(path: Path) -> Truth:
    """Read what `Truth.save` wrote.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Truth

    Raises
    ------
    ReadError
        If the file is not there or is not a truth file.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        origin = np.array(data["origin"], dtype=np.float64)
        return Truth(
            origin,
            tuple(_element_from_dict(e, origin) for e in data["elements"]),
            tuple(_deformation_from_dict(d, origin) for d in data["deformations"]),
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ReadError(f"Cannot read the truth file {path}: {error!r}.") from error


def _compact_json(data: dict[str, Any]) -> str:
    """JSON with one element or deformation a line."""
    parts = []
    for key, value in data.items():
        if value and isinstance(value, list) and isinstance(value[0], dict):
            rows = ",\n".join("  " + json.dumps(row, allow_nan=False) for row in value)
            parts.append(f"{json.dumps(key)}: [\n{rows}\n]")
        else:
            parts.append(f"{json.dumps(key)}: {json.dumps(value, allow_nan=False)}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def _point(local: Array, origin: Array) -> list[float]:
    return [round(float(c), 6) for c in local + origin]


def _number(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def _element_to_dict(e: TrueElement, origin: Array) -> dict[str, Any]:
    if isinstance(e.axis, LineAxis):
        axis: dict[str, Any] = {
            "shape": "line",
            "start": _point(e.axis.start, origin),
            "direction": e.axis.direction.tolist(),
            "length": e.axis.length,
        }
    else:
        axis = {
            "shape": "arc",
            "centre": _point(e.axis.centre, origin),
            "normal": e.axis.normal.tolist(),
            "towards_start": e.axis.towards_start.tolist(),
            "bend_radius": e.axis.bend_radius,
            "bend_angle_deg": float(np.rad2deg(e.axis.bend_angle)),
        }
    return {
        "element_id": e.element_id,
        "run_id": e.run_id,
        "run_name": e.run_name,
        "kind": str(e.kind),
        "axis": axis,
        "start": _point(e.axis.start, origin),
        "end": _point(e.axis.end, origin),
        "radius": e.radius,
        "radius_end": e.radius_end,
        "centre": None if np.isnan(e.centre).any() else _point(e.centre, origin),
        "visible": [[round(a, 4), round(b, 4)] for a, b in e.visible_ranges()],
        "arc_seen_deg": np.rad2deg(e.arc_seen).round(1).tolist(),
        "points_seen": e.points_seen.tolist(),
    }


def _element_from_dict(d: dict[str, Any], origin: Array) -> TrueElement:
    a = d["axis"]
    axis: LineAxis | ArcAxis
    if a["shape"] == "line":
        axis = LineAxis(np.array(a["start"]) - origin, np.array(a["direction"]), a["length"])
    else:
        axis = ArcAxis(
            np.array(a["centre"]) - origin,
            np.array(a["normal"]),
            np.array(a["towards_start"]),
            a["bend_radius"],
            float(np.deg2rad(a["bend_angle_deg"])),
        )
    return TrueElement(
        d["element_id"],
        d["run_id"],
        d["run_name"],
        ElementKind(d["kind"]),
        axis,
        d["radius"],
        d["radius_end"],
        np.full(3, np.nan) if d["centre"] is None else np.array(d["centre"]) - origin,
        np.deg2rad(d["arc_seen_deg"]),
        np.array(d["points_seen"], dtype=np.int32),
    )


def _deformation_to_dict(d: TrueDeformation, origin: Array) -> dict[str, Any]:
    return {
        "deformation_id": d.deformation_id,
        "element_id": d.element_id,
        "kind": str(d.kind),
        "chainage": d.chainage,
        "chainage_start": d.chainage_start,
        "chainage_end": d.chainage_end,
        "clock_deg": float(np.rad2deg(d.clock)),
        "peak": _point(d.peak, origin),
        "depth": d.depth,
        "length": d.length,
        "width": d.width,
        "ovality": _number(d.ovality),
        "angle_deg": _number(float(np.rad2deg(d.angle))),
        "shape": d.shape,
        "seen": round(d.seen, 3),
        "n_points": d.n_points,
    }


def _deformation_from_dict(d: dict[str, Any], origin: Array) -> TrueDeformation:
    def or_nan(value: float | None) -> float:
        return np.nan if value is None else value

    return TrueDeformation(
        d["deformation_id"],
        d["element_id"],
        DeformationKind(d["kind"]),
        d["chainage"],
        d["chainage_start"],
        d["chainage_end"],
        float(np.deg2rad(d["clock_deg"])),
        np.array(d["peak"]) - origin,
        d["depth"],
        d["length"],
        d["width"],
        or_nan(d["ovality"]),
        float(np.deg2rad(or_nan(d["angle_deg"]))),
        d["shape"],
        d["seen"],
        d["n_points"],
    )
