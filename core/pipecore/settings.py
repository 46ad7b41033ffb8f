"""All settings of a detection: one frozen dataclass of small groups.

Each field carries its label, unit, help and bounds in its metadata; the command
line, the TOML file and the app's form are generated from it.
"""

import dataclasses
import math
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any, get_type_hints

import tomli_w

from pipecore.errors import SettingsError


class LengthUnit(StrEnum):
    """Unit of the coordinates in a file."""

    METRE = "m"
    MILLIMETRE = "mm"
    FOOT = "ft"
    US_SURVEY_FOOT = "us-ft"

    @property
    def metres(self) -> float:
        """Metres in one unit."""
        return {"m": 1.0, "mm": 1e-3, "ft": 0.3048, "us-ft": 1200 / 3937}[self.value]


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


def setting(
    default: Any,
    label: str,
    help_text: str,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    zero_means: str = "",
    advanced: bool = False,
) -> Any:
    """Declare a field of a settings group.

    Parameters
    ----------
    default : Any
    label : str
        What a form calls it.
    help_text : str
        One sentence for its tooltip and its flag.
    unit : str
        Shown beside the value.
    minimum, maximum : float, optional
        Inclusive bounds.
    zero_means : str
        What the value 0 stands for, such as "automatic"; "" if it is a plain number.
    advanced : bool
        Whether a form folds it away.
    """
    return field(
        default=default,
        metadata={
            "label": label,
            "help": help_text,
            "unit": unit,
            "minimum": minimum,
            "maximum": maximum,
            "zero_means": zero_means,
            "advanced": advanced,
        },
    )


@dataclass(frozen=True)
class InputSettings:
    """Reading the file."""

    length_unit: LengthUnit = setting(
        LengthUnit.METRE, "Length unit", "Unit of the coordinates in the file."
    )


@dataclass(frozen=True)
class ThinningSettings:
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
class StackSettings:
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
class ProfileSettings:
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
class EllipseSettings:
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
class ElementSettings:
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
    catalogue: SizeCatalogue = setting(
        SizeCatalogue.ASME_B36_10, "Size catalogue", "Where nominal sizes are looked up."
    )
    size_tolerance_pct: float = setting(
        2.0,
        "Size tolerance",
        "A nominal size is given if the measured outside diameter is this close.",
        unit="%",
        minimum=0.1,
        maximum=20.0,
    )


@dataclass(frozen=True)
class DeformationSettings:
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
        "Needed for the indicative dent strain.",
        unit="mm",
        minimum=0.0,
        zero_means="not known",
    )
    rule: str = setting(
        "asme-6pct",
        "Acceptance rule",
        "The rule that judges each deformation: the name of one that comes with the program, "
        "or the path of your own .toml file.",
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
class TilingSettings:
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


@dataclass(frozen=True)
class Settings:
    """All settings of a detection. Immutable; see `replace`.

    Raises
    ------
    SettingsError
        From any constructor, if a value is of the wrong kind or outside its bounds.
    """

    input: InputSettings = InputSettings()
    thinning: ThinningSettings = ThinningSettings()
    stacks: StackSettings = StackSettings()
    profiles: ProfileSettings = ProfileSettings()
    ellipses: EllipseSettings = EllipseSettings()
    elements: ElementSettings = ElementSettings()
    deformation: DeformationSettings = DeformationSettings()
    tiling: TilingSettings = TilingSettings()

    def __post_init__(self) -> None:
        """Check every value."""
        for key, spec in iterate_fields():
            _check(key, self.get(key), spec)

    def get(self, key: str) -> Any:
        """Return a value by its dotted key, such as "stacks.width_mm"."""
        group, name = key.split(".")
        return getattr(getattr(self, group), name)

    def replace(self, changes: Mapping[str, Any]) -> "Settings":
        """Return settings with some values changed, by dotted key; text is converted.

        Raises
        ------
        SettingsError
            If a key is unknown or a value does not fit.
        """
        grouped: dict[str, dict[str, Any]] = {}
        specs = dict(iterate_fields())
        for key, value in changes.items():
            if key not in specs:
                raise SettingsError(f"There is no setting “{key}”.")
            group, name = key.split(".")
            grouped.setdefault(group, {})[name] = _convert(key, value, specs[key])
        return dataclasses.replace(
            self,
            **{g: dataclasses.replace(getattr(self, g), **kw) for g, kw in grouped.items()},
        )

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Return plain nested dicts of numbers, strings and lists."""
        result: dict[str, dict[str, Any]] = {}
        for key, _ in iterate_fields():
            group, name = key.split(".")
            value = self.get(key)
            if isinstance(value, tuple):
                value = [list(v) for v in value]
            result.setdefault(group, {})[name] = str(value) if isinstance(value, StrEnum) else value
        return result

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Settings":
        """Return settings from nested dicts; what is absent keeps its default.

        Raises
        ------
        SettingsError
            If a key is unknown or a value does not fit.
        """
        changes = {}
        for group, values in data.items():
            if not isinstance(values, Mapping):
                raise SettingsError(f"“{group}” is not a group of settings.")
            changes.update({f"{group}.{name}": value for name, value in values.items()})
        return cls().replace(changes)

    def to_toml(self) -> str:
        """Return the settings as TOML text."""
        return tomli_w.dumps(self.to_dict())

    @classmethod
    def from_toml(cls, path: Path) -> "Settings":
        """Read settings from a TOML file.

        Raises
        ------
        SettingsError
            If the file cannot be read or a key or value does not fit.
        """
        try:
            data = tomllib.loads(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise SettingsError(f"Cannot read the settings file {path}: {error}.") from error
        try:
            return cls.from_dict(data)
        except SettingsError as error:
            raise SettingsError(f"{path}: {error}") from error


@dataclass(frozen=True)
class FieldSpec:
    """What a form or a flag needs to know of one setting."""

    group: str
    name: str
    kind: Any
    default: Any
    label: str
    help: str
    unit: str
    minimum: float | None
    maximum: float | None
    zero_means: str
    advanced: bool


def iterate_fields() -> Iterator[tuple[str, FieldSpec]]:
    """Yield (dotted key, spec) of every setting, in order."""
    groups = get_type_hints(Settings)
    for group in dataclasses.fields(Settings):
        kinds = get_type_hints(groups[group.name])
        for f in dataclasses.fields(groups[group.name]):
            spec = FieldSpec(group.name, f.name, kinds[f.name], f.default, **f.metadata)
            yield f"{group.name}.{f.name}", spec


def _convert(key: str, value: Any, spec: FieldSpec) -> Any:
    """Turn text (from a flag) or plain TOML values into the field's type."""
    try:
        if isinstance(spec.kind, type) and issubclass(spec.kind, StrEnum):
            return spec.kind(value)
        if spec.kind is float and not isinstance(value, bool):
            return float(value)
        if spec.kind is str and isinstance(value, str):
            return value
        if key == "stacks.directions":
            if isinstance(value, str):
                value = [vector.split(",") for vector in value.split(";") if vector.strip()]
            return tuple(tuple(float(c) for c in vector) for vector in value)
    except (ValueError, TypeError):
        pass
    raise SettingsError(f"“{value}” does not fit the setting “{key}”{_expected(spec)}.")


def _expected(spec: FieldSpec) -> str:
    if isinstance(spec.kind, type) and issubclass(spec.kind, StrEnum):
        return " (one of: " + ", ".join(spec.kind) + ")"
    return " (a number)" if spec.kind is float else ""


def _check(key: str, value: Any, spec: FieldSpec) -> None:
    if spec.kind is float:
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not math.isfinite(value):
            raise SettingsError(f"The setting “{key}” must be a number, not {value!r}.")
        if spec.minimum is not None and value < spec.minimum:
            raise SettingsError(
                f"The setting “{key}” is {value:g}; it must be at least {spec.minimum:g}."
            )
        if spec.maximum is not None and value > spec.maximum:
            raise SettingsError(
                f"The setting “{key}” is {value:g}; it must be at most {spec.maximum:g}."
            )
    elif key == "stacks.directions":
        for vector in value:
            usable = len(vector) in (3, 4) and all(map(math.isfinite, vector))
            if not usable or not any(vector[:3]) or vector[3:] < (0.0,) * len(vector[3:]):
                raise SettingsError(
                    f"The stack {list(vector)} is not a direction x, y, z with an optional width."
                )
    elif not isinstance(value, spec.kind):
        raise SettingsError(f"{value!r} does not fit the setting “{key}”{_expected(spec)}.")
