"""What can be set, in small groups, one for each stage."""

import math
from dataclasses import dataclass
from enum import StrEnum

from pipecore.settings.fields import Group, setting


class LengthUnit(StrEnum):
    """Unit of the coordinates in a file."""

    AUTO = "auto"
    """What the file's reference system names, else metres."""
    METRE = "m"
    MILLIMETRE = "mm"
    INCH = "in"
    FOOT = "ft"
    US_SURVEY_FOOT = "us-ft"

    @property
    def metres(self) -> float:
        """Metres in one unit; AUTO has none (KeyError)."""
        return {"m": 1.0, "mm": 1e-3, "in": 0.0254, "ft": 0.3048, "us-ft": 1200 / 3937}[self.value]


class FlaggedPoints(StrEnum):
    """What becomes of points that a file marks as withheld or as noise."""

    LEAVE_OUT = "leave out"
    KEEP = "keep"


class StationSource(StrEnum):
    """What tells from which station a point was scanned."""

    AUTO = "auto"
    """A column, the scans of a file, point source ids that vary; else each file is a station."""
    FILES = "files"
    ONE = "one"


class DirectionPreset(StrEnum):
    """Which stacks to cut besides the user's own."""

    AUTOMATIC = "automatic"
    AXES = "axes"
    AXES_AND_DIAGONALS = "axes+diagonals"
    NONE = "none"


class ProfileMethod(StrEnum):
    """How the points of a profile are joined to curves (paper, section 3.2)."""

    PROXIMITY = "proximity"
    CURVE_FITTING = "curve fitting"


class EllipseFit(StrEnum):
    """How a free ellipse is fitted (paper, section 3.3.3)."""

    DIRECT = "direct"
    NONLINEAR = "nonlinear"
    ROBUST = "robust"


class SizeCatalogue(StrEnum):
    """Where nominal sizes come from."""

    ASME_B36_10 = "ASME B36.10"
    EN_10220 = "EN 10220"
    EN_10220_SERIES_2 = "EN 10220 series 2"
    EN_10220_SERIES_3 = "EN 10220 series 3"
    EN_10255 = "EN 10255"
    EN_1057 = "EN 1057"
    EN_545 = "EN 545 (ductile iron)"
    ISO_161 = "ISO 161 (plastics)"
    JIS_G3454 = "JIS G3452/G3454"
    DIN_2448 = "DIN 2448 (old)"
    GOST_10704 = "GOST 8732/10704"


@dataclass(frozen=True)
class InputSettings(Group, name="input"):
    """Reading the file."""

    length_unit: LengthUnit = setting(
        LengthUnit.AUTO,
        "Length unit",
        "Unit of the coordinates in the file; auto: what its reference system names, else metres.",
    )
    flagged_points: FlaggedPoints = setting(
        FlaggedPoints.LEAVE_OUT,
        "Withheld and noise points",
        "Points that a LAS file marks as withheld or classes as noise.",
    )
    stations: StationSource = setting(
        StationSource.AUTO,
        "Stations",
        "What tells from which station a point was scanned: the files' own ids and scans, "
        "each file, or all points are of one.",
    )
    columns: str = setting(
        "",
        "Columns of text",
        "What the columns of a text file hold, such as “x,y,z,intensity”; “-” for what is "
        "skipped. Empty: as its header names them or its first lines suggest. Behind it may follow "
        "“|separator=tab|decimal=comma|skip=3”: what separates columns, the sign before decimals, "
        "and how many lines at the top are passed over.",
    )


@dataclass(frozen=True)
class ThinningSettings(Group, name="thinning"):
    """The thinned cloud on which segments are found; measures use all points."""

    voxel_mm: float = setting(
        0.0,
        "Thinning",
        "Edge of the cubes whose points are averaged before segmentation.",
        unit="mm",
        minimum=0.0,
        maximum=500.0,
        zero_means="automatic",
    )


@dataclass(frozen=True)
class StackSettings(Group, name="stacks"):
    """Stacks of parallel profiles."""

    preset: DirectionPreset = setting(
        DirectionPreset.AUTOMATIC,
        "Directions",
        "Directions in which stacks are cut besides your own.",
    )
    directions: tuple[tuple[float, ...], ...] = setting(
        (),
        "Own stacks",
        "More stacks as “x,y,z” or “x,y,z,width in mm”, separated by semicolons.",
    )
    width_mm: float = setting(
        0.0,
        "Profile width",
        "Thickness of a profile along its stack's direction.",
        unit="mm",
        minimum=0.0,
        maximum=1000.0,
        zero_means="automatic",
    )


@dataclass(frozen=True)
class ProfileSettings(Group, name="profiles"):
    """Joining the points of a profile to curves."""

    method: ProfileMethod = setting(
        ProfileMethod.CURVE_FITTING,
        "Method",
        "Proximity alone, or proximity and splitting where the curvature changes sharply.",
    )
    gap_mm: float = setting(
        0.0,
        "Largest gap",
        "Points of one curve are at most this far apart.",
        unit="mm",
        minimum=0.0,
        maximum=1000.0,
        zero_means="automatic",
    )
    corner_deg: float = setting(
        40.0,
        "Sharpest bend of a curve",
        "Neighbours whose normals differ by more do not join.",
        unit="°",
        minimum=5.0,
        maximum=90.0,
        advanced=True,
    )


@dataclass(frozen=True)
class EllipseSettings(Group, name="ellipses"):
    """How ellipses are fitted, and which curves count as one."""

    fit: EllipseFit = setting(
        EllipseFit.DIRECT,
        "Free ellipses",
        "Where the points cover 240° or more, ellipses are fitted freely: directly (fast), by "
        "true distances, or by true distances with outliers weighed down (both slow).",
        advanced=True,
    )
    max_flattening: float = setting(
        1 - 1 / math.sqrt(2),
        "Largest flattening",
        "Flatter ellipses are cut too obliquely to be used.",
        minimum=0.0,
        maximum=0.9,
        advanced=True,
    )
    min_arc_deg: float = setting(
        35.0,
        "Smallest arc",
        "Ellipses seen over less of their circumference are not used; below 80° only those "
        "whose points carry the radius.",
        unit="°",
        minimum=30.0,
        maximum=360.0,
    )
    max_rms_mm: float = setting(
        0.0,
        "Largest residual",
        "Curves whose points are further from their ellipse (root mean square) are not used.",
        unit="mm",
        minimum=0.0,
        maximum=100.0,
        zero_means="automatic",
        advanced=True,
    )


@dataclass(frozen=True)
class ElementSettings(Group, name="elements"):
    """Sizes of the elements looked for."""

    min_radius_mm: float = setting(
        15.0, "Smallest radius", "Thinner pipes are not reported.", unit="mm", minimum=2.0
    )
    max_radius_mm: float = setting(
        5000.0, "Largest radius", "Thicker pipes and vessels are not reported.", unit="mm"
    )
    min_length_mm: float = setting(
        100.0,
        "Shortest pipe",
        "Shorter straight pieces are reported only as part of a run.",
        unit="mm",
        minimum=0.0,
    )
    catalogue: tuple[SizeCatalogue, ...] = setting(
        (SizeCatalogue.ASME_B36_10,),
        "Size catalogues",
        "Where nominal sizes are looked up; several are separated by commas, the first one goes "
        "before the others.",
    )
    size_tolerance_pct: float = setting(
        2.0,
        "Size tolerance",
        "A nominal size is given if the measured outside diameter is surely this close.",
        unit="%",
        minimum=0.1,
        maximum=20.0,
    )

    @property
    def max_radius(self) -> float:
        """Largest radius in metres."""
        return self.max_radius_mm / 1e3


@dataclass(frozen=True)
class DeformationSettings(Group, name="deformation"):
    """Which deviations count as deformations, and how they are judged."""

    min_depth_mm: float = setting(
        3.0, "Smallest depth", "Shallower deviations are not reported.", unit="mm", minimum=0.1
    )
    significance: float = setting(
        5.5,
        "Significance",
        "A deviation counts if it is this many times its own noise.",
        minimum=2.0,
        maximum=50.0,
        advanced=True,
    )
    min_ovality_pct: float = setting(
        2.0, "Smallest ovality", "Rounder stretches are not reported.", unit="%", minimum=0.1
    )
    wall_thickness_mm: float = setting(
        0.0,
        "Wall thickness",
        "Needed for the indicative dent strain and for limits by D/t.",
        unit="mm",
        minimum=0.0,
        zero_means="not known",
    )
    rule: str = setting(
        "asme-6pct",
        "Acceptance rule",
        "The rule that judges each deformation: the name of one that comes with the program, "
        "or the path of your own .toml file; several are separated by commas.",
    )
    mesh_exaggeration: float = setting(
        0.0,
        "Mesh of deformations",
        "Reports have deformations.ply: dented surfaces, deviations this many times larger.",
        minimum=0.0,
        maximum=100.0,
        zero_means="no mesh",
        advanced=True,
    )


@dataclass(frozen=True)
class StationSettings(Group, name="stations"):
    """Whether the stations of a scan fit together, as its pipes tell."""

    tolerance_mm: float = setting(
        2.0,
        "Stations fit within",
        "A station whose points lie off those of the others by more, and surely so, does not fit.",
        unit="mm",
        minimum=0.1,
        maximum=100.0,
    )


@dataclass(frozen=True)
class TilingSettings(Group, name="tiling"):
    """Scans that do not fit into memory."""

    memory_gib: float = setting(
        0.0,
        "Memory limit",
        "Scans that would take more are processed in tiles, with the same result.",
        unit="GiB",
        minimum=0.0,
        zero_means="two thirds of the free memory",
    )
    tile_mpoints: float = setting(
        0.0,
        "Tile size",
        "Millions of thinned points that are processed together.",
        minimum=0.0,
        zero_means="as the memory limit allows",
        advanced=True,
    )
    scheduler: str = setting(
        "",
        "Dask scheduler",
        "Address of a dask.distributed scheduler whose workers process the tiles, such as "
        "“tcp://10.0.0.5:8786”; empty: this computer.",
        advanced=True,
    )
    folder: str = setting(
        "",
        "Temporary folder",
        "Where tiles are kept meanwhile; workers elsewhere must share it. Empty: beside the "
        "report.",
        advanced=True,
    )
