"""The nouns of the pipeline: cloud, stack, profile, element, deformation, result.

All lengths are metres and all angles radians unless a name says otherwise. Geometry
is in *local* coordinates: world coordinates less the cloud's `origin`. Quantities
that the scan cannot carry are nan, never a guess.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import StrEnum
from operator import attrgetter
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

import pipecore
from pipecore.caller_arrays import check_column, check_coordinates, check_positions
from pipecore.display import Summarised
from pipecore.formatting import format_clock, format_measure
from pipecore.geometry import ArcAxis, LineAxis
from pipecore.local_frame import choose_origin, to_local
from pipecore.notes import Note
from pipecore.reasons import Reason
from pipecore.settings import LengthUnit, Settings
from pipecore.table import Table
from pipecore.units import FileUnit

Array = NDArray[np.float64]
Floats = NDArray[np.float32] | NDArray[np.float64]

NO_ID = 0
"""The id of "none": ids of stacks, segments, elements, runs and deformations start at 1."""


@dataclass(frozen=True, eq=False)
class Field:
    """More values of each point, as a file stores them.

    Parameters
    ----------
    values : ndarray
        Of any integer or floating type, shape (n,) or (n, k).
    scale, offset : float
        What stands for a stored value v is scale · v + offset.
    no_data : float, optional
        The stored value that stands for none.
    description : str
        What the file says of it.
    """

    values: NDArray[Any]
    scale: float = 1.0
    offset: float = 0.0
    no_data: float | None = None
    description: str = ""

    def scaled(self) -> Array:
        """Return what the stored values stand for, float64; nan where there is none."""
        scaled = self.values * self.scale + self.offset
        if self.no_data is not None:
            scaled = np.where(self.values == self.no_data, np.nan, scaled)
        return np.asarray(scaled, dtype=np.float64)


@dataclass(frozen=True, eq=False, repr=False)
class PointCloud(Summarised):
    """Points of one or several scans in one coordinate system.

    Made by `read` from files and by `from_points` from arrays; the constructor takes what
    is in its final form, and checks nothing.

    Parameters
    ----------
    origin : ndarray
        World coordinates of the local zero, float64, shape (3,).
    xyz : ndarray
        Local coordinates, shape (n, 3), C-contiguous; float32 where that keeps 0.1 mm
        (extents up to a kilometre), else float64. All finite.
    intensity : ndarray, optional
        As in the file, float32, shape (n,).
    rgb : ndarray, optional
        uint8, shape (n, 3).
    classification : ndarray, optional
        ASPRS classes, uint8, shape (n,).
    station : ndarray, optional
        Id of the station that each point was scanned from, from 1 on, uint16, shape (n,);
        None where nothing tells.
    station_names : tuple of str
        Where each station comes from: a file, or a file and a scan in it.
    stations : ndarray
        Scanner positions in local coordinates, shape (k, 3): of the stations in the order
        of their ids, nan where a file does not know one.
    crs : str
        The coordinate reference system's name, or "".
    crs_wkt : str
        Its well-known text, where the file or its EPSG code gives one, or "".
    unit : FileUnit
        Unit of the coordinates in the file.
    step : float
        Steps in which the file keeps coordinates, metres, where they are coarse (rounding
        adds an SD of step/√12 to each); 0 where they are fine.
    fields : mapping of str to Field
        More values of each point, as the file has them, where `read` was asked for them.
    notes : tuple of Note
        What a reader should know of the file: what was left out, its unit, its errors.
    source : Path, optional
        The file it was read from.
    """

    origin: Array
    xyz: Floats
    intensity: NDArray[np.float32] | None = None
    rgb: NDArray[np.uint8] | None = None
    classification: NDArray[np.uint8] | None = None
    station: NDArray[np.uint16] | None = None
    station_names: tuple[str, ...] = ()
    stations: Array = field(default_factory=lambda: np.empty((0, 3)))
    crs: str = ""
    crs_wkt: str = ""
    unit: FileUnit = FileUnit()
    step: float = 0.0
    fields: Mapping[str, Field] = field(default_factory=dict)
    notes: tuple[Note, ...] = ()
    source: Path | None = None

    @classmethod
    def from_points(
        cls,
        xyz: ArrayLike,
        *,
        intensity: ArrayLike | None = None,
        rgb: ArrayLike | None = None,
        classification: ArrayLike | None = None,
        stations: ArrayLike | None = None,
        crs: str = "",
    ) -> "PointCloud":
        """Make a cloud of arrays, which are checked and copied.

        Parameters
        ----------
        xyz : array_like
            World coordinates in metres, shape (n, 3). float64, or float32 where that is
            fine enough: at 400 km its steps are 3 cm.
        intensity : array_like, optional
            Shape (n,).
        rgb : array_like, optional
            Whole numbers from 0 to 255, shape (n, 3).
        classification : array_like, optional
            ASPRS classes, shape (n,).
        stations : array_like, optional
            Scanner positions in world coordinates, shape (3,) or (k, 3). They say along
            which line each point's noise is, which makes radii better.
        crs : str
            The coordinate reference system's name.

        Returns
        -------
        PointCloud
            Its origin is a whole multiple of 100 m near the middle of the points.

        Raises
        ------
        TypeError
            If an array does not hold numbers of the kind that it should.
        ValueError
            If an array has another shape or length, or holds values that are not finite or
            out of range.
        """
        world = check_coordinates(xyz)
        origin = choose_origin(world) if len(world) else np.zeros(3)
        n = len(world)
        return cls(
            origin=origin,
            xyz=to_local(world, origin),
            intensity=None
            if intensity is None
            else check_column(intensity, "the intensity", n, np.float32),
            rgb=None if rgb is None else check_column(rgb, "the colours", n, np.uint8, 3),
            classification=None
            if classification is None
            else check_column(classification, "the classes", n, np.uint8),
            stations=np.empty((0, 3)) if stations is None else check_positions(stations) - origin,
            crs=crs,
        )

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.xyz)

    def _title(self) -> str:
        return "PointCloud"

    def _facts(self) -> dict[str, str]:
        columns = ("intensity", "rgb", "classification")
        facts = {
            "points": f"{len(self):,}",
            "origin": "({:.10g}, {:.10g}, {:.10g}) m".format(*self.origin.tolist()),
            "with": " + ".join(c for c in columns if getattr(self, c) is not None),
            "scanner positions": str(len(self.stations) or ""),
            "crs": self.crs,
            "source": self.source.name if self.source else "",
        }
        return {name: text for name, text in facts.items() if text}

    def world(self, local: Array) -> Array:
        """World coordinates (float64) of local ones, any shape (..., 3)."""
        return np.asarray(local, dtype=np.float64) + self.origin


@dataclass(frozen=True, eq=False)
class Stack:
    """All parallel profiles of one direction (paper, section 3.1).

    Profile `i` holds the points whose distance along `direction` from the local zero
    lies in [offset + i·width, offset + (i + 1)·width). Only points that are at least
    `min_spacing` from their neighbours join: wide profiles are for thinly scanned places.

    Parameters
    ----------
    stack_id : int
        From 1; 0 is `OWN_STACK`.
    direction : ndarray
        Unit vector, shape (3,).
    width : float
        Thickness of a profile, metres.
    offset : float
        Distance of profile 0 from the local zero, metres.
    name : str
    min_spacing : float
        Metres.
    """

    stack_id: int
    direction: Array
    width: float
    offset: float = 0.0
    name: str = ""
    min_spacing: float = 0.0

    def profile_index(self, xyz: Floats) -> NDArray[np.int32]:
        """Index of the profile that each point of `xyz` (n, 3) falls into."""
        along = np.asarray(xyz, dtype=np.float64) @ self.direction
        return np.floor((along - self.offset) / self.width).astype(np.int32)


class ElementKind(StrEnum):
    """What an element is; the values are those of the report."""

    CYLINDER = "cylinder"
    CONE = "cone"
    SPHERE = "sphere"
    TORUS = "torus"
    FLANGE = "flange"
    TEE = "tee"
    OTHER = "other"


@dataclass(frozen=True)
class NominalSize:
    """A catalogue size: its name (such as "DN 150 / NPS 6") and outside diameter in metres.

    Parameters
    ----------
    name : str
        Such as "DN 150 / NPS 6".
    outside_diameter : float
        Metres.
    """

    name: str
    outside_diameter: float


@dataclass(frozen=True, eq=False, repr=False)
class Element(Summarised):
    """One piece of a pipe run with one kind of surface about one axis.

    Parameters
    ----------
    element_id, run_id : int
    kind : ElementKind
    axis : LineAxis or ArcAxis
        As scanned: it starts and ends where the points do. A sphere's axis is the
        straight line along which its profiles were cut; see `centre`.
    radius, radius_sd : float
        Radius (at the start for a cone) and its standard deviation, metres.
    radius_end : float
        Radius at the end of a cone; equal to `radius` for the other kinds.
    centre : ndarray
        Centre of a sphere or of a torus's bend, shape (3,); nan for the other kinds.
    n_points, n_profiles : int
        Points of the full cloud on it; profiles with an accepted ellipse.
    arc : float
        Median arc around the axis that its profiles see, radians.
    rms : float
        Root mean square of the points' distances from the fitted surface, metres.
    ovality, ovality_sd : float
        (Dmax - Dmin) / Dnom as a ratio; nan where the arc cannot carry it.
    straightness : float
        Largest distance of the measured axis from the chord of its ends, metres.
    nominal : NominalSize, optional
        The catalogue size within tolerance, if any.
    gaps : tuple of (float, float)
        Chainage ranges without profiles (paper, figure 11).
    not_measurable : mapping of str to Reason
        Why what is nan could not be measured, by the name of the field; what does not
        apply to the kind is not in it.
    name : str
        What the user calls it, or "".
    """

    element_id: int
    run_id: int
    kind: ElementKind
    axis: LineAxis | ArcAxis
    radius: float
    radius_sd: float
    radius_end: float
    centre: Array
    n_points: int
    n_profiles: int
    arc: float
    rms: float
    ovality: float = np.nan
    ovality_sd: float = np.nan
    straightness: float = np.nan
    nominal: NominalSize | None = None
    gaps: tuple[tuple[float, float], ...] = ()
    not_measurable: Mapping[str, Reason] = field(default_factory=dict)
    name: str = ""

    @property
    def label(self) -> str:
        """What people call it: its own name, else such as "Pipe 3" or "Bend 4"."""
        return self.name or f"{KIND_LABELS[self.kind]} {self.element_id}"

    def _title(self) -> str:
        return f"Element {self.label}"

    def _facts(self) -> dict[str, str]:
        facts = {
            "run": str(self.run_id),
            "size": self.nominal.name if self.nominal else "",
            "radius": format_measure(1000 * self.radius, 1000 * self.radius_sd, "mm"),
            "length": f"{self.axis.length:.3f} m",
            "arc": f"{np.rad2deg(self.arc):.0f}°",
            "ovality": format_measure(100 * self.ovality, 100 * self.ovality_sd, "%"),
            "points": f"{self.n_points:,}",
        }
        return {name: text for name, text in facts.items() if text}

    def radius_at(self, chainage: Array | float) -> Array:
        """Radius of the fitted surface about the axis at `chainage`, metres."""
        s = np.asarray(chainage, dtype=np.float64)
        if self.kind is ElementKind.SPHERE:
            along = (self.centre - self.axis.start) @ self.axis.tangent(0.0)
            return np.sqrt(np.maximum(self.radius**2 - (s - along) ** 2, 0.0))
        slope = (self.radius_end - self.radius) / self.axis.length
        return np.asarray(self.radius + slope * s)


KIND_LABELS = {
    ElementKind.CYLINDER: "Pipe",
    ElementKind.CONE: "Reducer",
    ElementKind.SPHERE: "Sphere",
    ElementKind.TORUS: "Bend",
    ElementKind.FLANGE: "Flange",
    ElementKind.TEE: "Tee",
    ElementKind.OTHER: "Element",
}
"""Label of an element of a kind that has no name of its own, such as "Pipe"."""


OWN_STACK = 0
"""`Profiles.stack_id` of profiles cut across an element's own axis in the refinement."""


@dataclass(frozen=True, eq=False, repr=False)
class Profiles(Summarised):
    """The profiles of all elements with their ellipses: a table, one array per column.

    Rows of one element and stack are in order of `chainage`.

    Parameters
    ----------
    element_id, stack_id, profile_index : ndarray of int32, shape (m,)
        `stack_id` is `OWN_STACK` for profiles cut across the element's own axis; the
        index then counts from the start of the element.
    chainage : ndarray, shape (m,)
    centre : ndarray, shape (m, 3)
        Centre of the ellipse.
    normal, major_direction : ndarray, shape (m, 3)
        Unit normal of the profile's plane; unit vector along the major axis, in the plane.
    semi_minor, semi_major : ndarray, shape (m,)
        Of the ellipse fitted freely where the arc carries it, else of the constrained one:
        about the element's axis in its own stack, along the points' axis in the others.
    semi_minor_sd : ndarray, shape (m,)
        Standard deviation of the semi-minor axis.
    radius, radius_sd : ndarray, shape (m,)
        Of the free circle seen along the axis, and its standard deviation.
    ovality : ndarray, shape (m,)
        (Dmax - Dmin) / Dnom of this profile as a ratio, nan where not measurable.
    centre_deviation, radius_deviation : ndarray, shape (m,)
        Distance of the centre from the element's axis; radius less the element's radius.
    arc : ndarray, shape (m,)
        Arc that the points cover, radians.
    n_points : ndarray of int32, shape (m,)
    rms : ndarray, shape (m,)
    aic_line, aic_ellipse : ndarray, shape (m,)
        Equation 4 of the paper for either model.
    curvature_variation : ndarray, shape (m,)
        Of the smooth curve fitted to the profile (paper, figures 14 and 15): 0 where it is
        round; see `SectionCurve.curvature_variation`. nan where none was fitted.
    """

    element_id: NDArray[np.int32]
    stack_id: NDArray[np.int32]
    profile_index: NDArray[np.int32]
    chainage: Array
    centre: Array
    normal: Array
    major_direction: Array
    semi_minor: Array
    semi_major: Array
    semi_minor_sd: Array
    radius: Array
    radius_sd: Array
    ovality: Array
    centre_deviation: Array
    radius_deviation: Array
    arc: Array
    n_points: NDArray[np.int32]
    rms: Array
    aic_line: Array
    aic_ellipse: Array
    curvature_variation: Array = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        """Leave nan where no curves were fitted."""
        if len(self.curvature_variation) != len(self.element_id):
            unknown = np.full(len(self.element_id), np.nan)
            object.__setattr__(self, "curvature_variation", unknown)

    def __len__(self) -> int:
        """Return the number of profiles."""
        return len(self.element_id)

    def __getitem__(self, rows: NDArray[np.bool_] | NDArray[np.intp] | slice) -> "Profiles":
        """Return the given rows as a table."""
        return Profiles(*(getattr(self, f.name)[rows] for f in fields(self)))

    def _title(self) -> str:
        return "Profiles"

    def _facts(self) -> dict[str, str]:
        return {
            "rows": f"{len(self):,}",
            "elements": f"{len(np.unique(self.element_id)):,}",
            "across elements' own axes": f"{np.count_nonzero(self.stack_id == OWN_STACK):,}",
        }

    @property
    def flattening(self) -> Array:
        """1 - semi-minor / semi-major (paper, section 3.3.1)."""
        return 1.0 - self.semi_minor / self.semi_major

    @property
    def minor_drop(self) -> Array:
        """How much the semi-minor axis lies below the element's radius (paper, figure 13)."""
        return np.asarray(self.radius - self.radius_deviation - self.semi_minor)

    def of_element(self, element_id: int, stack_id: int | None = None) -> "Profiles":
        """Return the rows of one element, of one stack if given."""
        rows = self.element_id == element_id
        if stack_id is not None:
            rows &= self.stack_id == stack_id
        return self[rows]

    @classmethod
    def concatenate(cls, tables: "list[Profiles]") -> "Profiles":
        """Return one table with the rows of all."""
        if not tables:
            return cls.empty()
        return cls(*(np.concatenate([getattr(t, f.name) for t in tables]) for f in fields(cls)))

    @classmethod
    def empty(cls) -> "Profiles":
        """Return a table without rows."""
        shapes: dict[str, Any] = {f.name: np.empty(0) for f in fields(cls)}
        shapes |= {name: np.empty((0, 3)) for name in ("centre", "normal", "major_direction")}
        for name in ("element_id", "stack_id", "profile_index", "n_points"):
            shapes[name] = np.empty(0, np.int32)
        return cls(**shapes)


class DeformationKind(StrEnum):
    """What a deformation is; the values are those of the report."""

    DENT = "dent"
    BULGE = "bulge"
    OVALITY = "ovality"
    BOW = "bow"
    KINK = "kink"


class Verdict(StrEnum):
    """What the chosen rule says of a deformation; the values are those of the report."""

    ACCEPT = "accept"
    REVIEW = "review"
    REJECT = "reject"
    NOT_MEASURABLE = "not measurable"


@dataclass(frozen=True, eq=False, repr=False)
class Deformation(Summarised):
    """A place where an element leaves its shape.

    Parameters
    ----------
    deformation_id, element_id : int
    kind : DeformationKind
    chainage, chainage_start, chainage_end : float
        Of the peak and of the extent, metres from the element's start.
    clock : float
        Clock angle of the peak, radians, 0 = 12:00, clockwise looking along the chainage.
    peak : ndarray
        The peak on the surface, shape (3,).
    depth, depth_sd : float
        Magnitude (outward for a bulge) against the undented contour, metres.
    length, width : float
        Extent along the axis and around the circumference, metres.
    ovality, strain : float
        As ratios; nan where they do not apply or cannot be measured.
    n_points : int
    rule : str
        Name of the rule that gave the verdict.
    verdict : Verdict
    significance : float
        Depth in units of its own noise.
    area, volume : float
        Of a dent or bulge: what it covers of the undented surface (m²), and what lies
        between the two surfaces (m³); nan for the other kinds.
    fitting_id : int
        The nearest flange, bend or other fitting of the run, `NO_ID` if it has none; the
        own element's id if the deformation lies on a fitting.
    fitting_distance : float
        Distance along the run from the peak to where that begins, metres; 0 on a fitting.
    next_id : int
        The nearest other dent or bulge of the run, `NO_ID` if there is none.
    next_distance : float
        Distance over the surface from edge to edge of the two, metres; 0 if they overlap.
    interacts : bool
        Whether that is at most one outside diameter.
    not_measurable : mapping of str to Reason
        Why what is nan could not be measured, by the name of the field; what does not
        apply to the kind is not in it. Empty where all was measured.
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
    depth_sd: float
    length: float
    width: float
    ovality: float = np.nan
    strain: float = np.nan
    n_points: int = 0
    rule: str = ""
    verdict: Verdict = Verdict.NOT_MEASURABLE
    significance: float = np.nan
    area: float = np.nan
    volume: float = np.nan
    fitting_id: int = NO_ID
    fitting_distance: float = np.nan
    next_id: int = NO_ID
    next_distance: float = np.nan
    interacts: bool = False
    not_measurable: Mapping[str, Reason] = field(default_factory=dict)

    def _title(self) -> str:
        return f"Deformation {self.deformation_id}"

    def _facts(self) -> dict[str, str]:
        size = "height" if self.kind is DeformationKind.BULGE else "depth"
        facts = {
            "kind": str(self.kind),
            "element": str(self.element_id),
            size: format_measure(1000 * self.depth, 1000 * self.depth_sd, "mm"),
            "chainage": f"{self.chainage:.3f} m",
            "clock": format_clock(self.clock),
            "verdict": str(self.verdict),
        }
        return {name: text for name, text in facts.items() if text}


class ReviewState(StrEnum):
    """What a person decided about a deformation; the values are those of the report."""

    OPEN = "open"
    ACCEPTED = "accepted"
    REJECTED = "rejected"


@dataclass(frozen=True)
class Review:
    """A person's word on a deformation, beside the rule's verdict.

    Parameters
    ----------
    state : ReviewState
    comment : str
    """

    state: ReviewState = ReviewState.OPEN
    comment: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class Result(Summarised):
    """What a detection found, with the settings that made it.

    Per-point arrays follow the order of the cloud's points.

    Parameters
    ----------
    settings : Settings
    origin : ndarray
        World coordinates of the local zero, shape (3,).
    source : Path, optional
    n_cloud_points : int
    stacks : tuple of Stack
        In the order of their ids.
    elements : tuple of Element
        In the order of their ids, 1, 2, … as detected. What is deleted afterwards leaves
        a gap, so that the others keep their ids.
    profiles : Profiles
    deformations : tuple of Deformation
        In the order of their ids, as for elements.
    segment_id, element_id : ndarray of int32, shape (n,)
        `NO_ID` for points of none. These three are empty in a result that was loaded from a
        report without ``segments.laz``.
    deviation : ndarray of float32, shape (n,)
        Signed radial distance from the element's reference contour, metres, outward
        positive; nan for points of none.
    seconds : dict
        Time spent per step.
    edits : tuple of str
        What was changed by hand since the detection, the first change first.
    run_names : mapping of int to str
        What a person calls runs, by their ids; the others go by number.
    own_settings : mapping of int to Settings
        Of elements that were detected again with other settings, by their ids.
    unit : FileUnit
        Unit of the file's coordinates, as the cloud was read; see `file_unit`.
    notes : tuple of Note
        What was noted when the cloud was read.
    """

    settings: Settings
    origin: Array
    source: Path | None
    n_cloud_points: int
    stacks: tuple[Stack, ...]
    elements: tuple[Element, ...]
    profiles: Profiles
    deformations: tuple[Deformation, ...]
    segment_id: NDArray[np.int32]
    element_id: NDArray[np.int32]
    deviation: NDArray[np.float32]
    seconds: dict[str, float]
    edits: tuple[str, ...] = ()
    run_names: Mapping[int, str] = field(default_factory=dict)
    own_settings: Mapping[int, Settings] = field(default_factory=dict)
    unit: FileUnit = FileUnit()
    notes: tuple[Note, ...] = ()

    @property
    def file_unit(self) -> FileUnit:
        """Unit of the file's coordinates: the settings', or that of the cloud if automatic."""
        chosen = self.settings.input.length_unit
        return self.unit if chosen is LengthUnit.AUTO else FileUnit.of(chosen)

    def settings_of(self, element_id: int) -> Settings:
        """Return the settings with which an element was found."""
        return self.own_settings.get(element_id, self.settings)

    def run_label(self, run_id: int) -> str:
        """What people call a run: its own name, else such as "Run 3"."""
        return self.run_names.get(run_id) or f"Run {run_id}"

    def element(self, element_id: int) -> Element:
        """Return the element with this id; `KeyError` if there is none."""
        return _with_id(self.elements, "element_id", element_id)

    def deformation(self, deformation_id: int) -> Deformation:
        """Return the deformation with this id; `KeyError` if there is none."""
        return _with_id(self.deformations, "deformation_id", deformation_id)

    def deformations_of(self, element_id: int) -> tuple[Deformation, ...]:
        """Return the deformations of one element."""
        return tuple(d for d in self.deformations if d.element_id == element_id)

    # Tables and reports stand above the types in the library: they are reached through the
    # package itself, which imports them when they are first used.

    def elements_table(self) -> Table:
        """Return the elements as ``elements.csv`` has them; see `pipecore.report`."""
        return pipecore.report.elements_table(self)

    def profiles_table(self) -> Table:
        """Return the profiles as ``profiles.csv`` has them."""
        return pipecore.report.profiles_table(self)

    def deformations_table(self) -> Table:
        """Return the deformations as ``deformations.csv`` has them."""
        return pipecore.report.deformations_table(self)

    def save(
        self,
        folder: str | PathLike[str],
        cloud: PointCloud | None = None,
        *,
        overwrite: bool = False,
    ) -> None:
        """Write a report folder, which `pipecore.load` reads back.

        Parameters
        ----------
        folder : path
            Made if it is not there; its parent must be.
        cloud : PointCloud, optional
            The cloud that this was detected in. Without it the folder has the tables,
            ``result.json`` and ``settings.toml``, but neither ``segments.laz`` nor figures.
        overwrite : bool
            Whether the folder may already hold files.

        Raises
        ------
        WriteError
            If the folder holds files and `overwrite` is not set, or cannot be written.
        ValueError
            If the cloud is not the one of this result.
        """
        pipecore.report.write_report(folder, cloud, self, overwrite=overwrite)

    def _title(self) -> str:
        return "Result"

    def _facts(self) -> dict[str, str]:
        kinds = Counter(KIND_LABELS[e.kind].lower() for e in self.elements)
        verdicts = Counter(str(d.verdict) for d in self.deformations)
        facts = {
            "elements": _counted(len(self.elements), kinds),
            "runs": str(len({e.run_id for e in self.elements})),
            "deformations": _counted(len(self.deformations), verdicts),
            "profiles": f"{len(self.profiles):,}",
            "points": f"{self.n_cloud_points:,}",
            "source": self.source.name if self.source else "",
        }
        return {name: text for name, text in facts.items() if text}

    def _repr_html_(self) -> str:
        tables = (self.elements_table(), self.deformations_table())
        shown = [table._repr_html_() for table in tables if table.n_rows]
        return "".join([super()._repr_html_(), *shown])


def _counted(total: int, parts: Counter[str]) -> str:
    """A number with what it is made of, such as "5 (3 review, 2 reject)"."""
    of = ", ".join(f"{n} {name}" for name, n in parts.most_common())
    return f"{total} ({of})" if of else str(total)


Numbered = TypeVar("Numbered", Element, Deformation)


def _with_id(items: tuple[Numbered, ...], name: str, wanted: int) -> Numbered:
    """Find an item by its id among items in the order of their ids."""
    place = bisect_left(items, wanted, key=attrgetter(name))
    if place == len(items) or getattr(items[place], name) != wanted:
        raise KeyError(f"there is no {name} {wanted}")
    return items[place]
