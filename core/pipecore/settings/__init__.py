"""All settings of a detection: one frozen dataclass of small groups.

Each field carries its label, unit, help and bounds in its metadata; the command
line, the TOML file and the app's form are generated from it.
"""

import dataclasses
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, get_type_hints

import tomli_w

from pipecore.display import Summarised
from pipecore.errors import SettingsError
from pipecore.notes import Note
from pipecore.settings.fields import FieldSpec, Group, choices_of, convert, specs_of
from pipecore.settings.groups import (
    DeformationSettings,
    DirectionPreset,
    ElementSettings,
    EllipseFit,
    EllipseSettings,
    FlaggedPoints,
    InputSettings,
    LengthUnit,
    ProfileMethod,
    ProfileSettings,
    SizeCatalogue,
    StackSettings,
    StationSettings,
    StationSource,
    ThinningSettings,
    TilingSettings,
)

__all__ = [
    "JUDGING_KEYS",
    "SCHEDULER",
    "DeformationSettings",
    "DirectionPreset",
    "ElementSettings",
    "EllipseFit",
    "EllipseSettings",
    "FieldSpec",
    "FlaggedPoints",
    "InputSettings",
    "LengthUnit",
    "ProfileMethod",
    "ProfileSettings",
    "Settings",
    "SizeCatalogue",
    "StackSettings",
    "StationSettings",
    "StationSource",
    "ThinningSettings",
    "TilingSettings",
    "choices_of",
    "iterate_fields",
]


SCHEDULER = "tiling.scheduler"
"""The key of the address of a cluster, which no file may set."""

JUDGING_KEYS = (
    "deformation.rule",
    "deformation.wall_thickness_mm",
    "elements.catalogue",
    "elements.size_tolerance_pct",
)
"""Settings that change what is said of a result, and nothing that was measured."""


@dataclass(frozen=True, repr=False)
class Settings(Summarised):
    """All settings of a detection, in groups: ``settings.stacks.width_mm``.

    Immutable; what is not given keeps its default:

    >>> Settings(stacks=StackSettings(width_mm=15), elements=ElementSettings(min_radius_mm=30))
    >>> Settings().replace({"stacks.width_mm": 15, "elements.min_radius_mm": 30})

    Parameters
    ----------
    input : InputSettings
    thinning : ThinningSettings
    stacks : StackSettings
    profiles : ProfileSettings
    ellipses : EllipseSettings
    elements : ElementSettings
    deformation : DeformationSettings
    stations : StationSettings
    tiling : TilingSettings

    Raises
    ------
    SettingsError
        From the constructor of any group, if a value is of the wrong kind or outside its
        bounds.
    """

    input: InputSettings = InputSettings()
    thinning: ThinningSettings = ThinningSettings()
    stacks: StackSettings = StackSettings()
    profiles: ProfileSettings = ProfileSettings()
    ellipses: EllipseSettings = EllipseSettings()
    elements: ElementSettings = ElementSettings()
    deformation: DeformationSettings = DeformationSettings()
    stations: StationSettings = StationSettings()
    tiling: TilingSettings = TilingSettings()

    def __post_init__(self) -> None:
        """Check that each group is one; the groups check their values."""
        for name, kind in _groups().items():
            value = getattr(self, name)
            if not isinstance(value, kind):
                raise SettingsError(
                    "“{group}” must be {kind}, not {value!r}.",
                    group=name,
                    kind=kind.__name__,
                    value=value,
                )

    def _title(self) -> str:
        return "Settings"

    def _facts(self) -> dict[str, str]:
        changed = {
            key: f"{self.get(key)!s} {spec.unit}".rstrip()
            for key, spec in iterate_fields()
            if self.get(key) != spec.default
        }
        return changed or {"all": "defaults"}

    def get(self, key: str) -> Any:
        """Return a value by its dotted key, such as "stacks.width_mm".

        Parameters
        ----------
        key : str

        Returns
        -------
        object
        """
        group, name = key.split(".")
        return getattr(getattr(self, group), name)

    def replace(self, changes: Mapping[str, Any]) -> "Settings":
        """Return settings with some values changed, by dotted key; text is converted.

        Parameters
        ----------
        changes : mapping of str to object
            New values by dotted key.

        Returns
        -------
        Settings

        Raises
        ------
        SettingsError
            If a key is unknown or a value does not fit.
        """
        grouped: dict[str, dict[str, Any]] = {}
        specs = dict(iterate_fields())
        for key, value in changes.items():
            if key not in specs:
                raise SettingsError("There is no setting “{key}”.", key=key)
            group, name = key.split(".")
            grouped.setdefault(group, {})[name] = convert(value, specs[key])
        return dataclasses.replace(
            self,
            **{g: dataclasses.replace(getattr(self, g), **kw) for g, kw in grouped.items()},
        )

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Return plain nested dicts of numbers, strings and lists.

        Returns
        -------
        dict
            Without the address of a cluster, see `from_dict`.
        """
        result: dict[str, dict[str, Any]] = {}
        for key, spec in iterate_fields():
            group, name = key.split(".")
            value = self.get(key)
            if choices_of(spec.kind) is not None:
                value = ", ".join(value)
            elif isinstance(value, tuple):
                value = [list(v) for v in value]
            result.setdefault(group, {})[name] = str(value) if isinstance(value, StrEnum) else value
        result["tiling"]["scheduler"] = ""
        return result

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Settings":
        """Return settings from nested dicts; what is absent keeps its default.

        The address of a cluster is left out: who answers there runs code on this computer, so
        that no file may name one, only a person.

        Parameters
        ----------
        data : mapping
            Groups by name, each a mapping of its fields.

        Returns
        -------
        Settings

        Raises
        ------
        SettingsError
            If a key is unknown or a value does not fit.
        """
        changes = {}
        for group, values in data.items():
            if not isinstance(values, Mapping):
                raise SettingsError("“{group}” is not a group of settings.", group=group)
            changes.update({f"{group}.{name}": value for name, value in values.items()})
        changes.pop(SCHEDULER, None)
        return cls().replace(changes)

    def to_toml(self) -> str:
        """Return the settings as TOML text.

        Returns
        -------
        str
        """
        return tomli_w.dumps(self.to_dict())

    @classmethod
    def from_toml(
        cls, path: Path, warn: Callable[[Note], object] = lambda note: None
    ) -> "Settings":
        """Read settings from a TOML file.

        Parameters
        ----------
        path : Path
        warn : callable
            Called with what was not taken from it: the address of a cluster, see `from_dict`.

        Returns
        -------
        Settings

        Raises
        ------
        SettingsError
            If the file cannot be read or a key or value does not fit.
        """
        try:
            data = tomllib.loads(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise SettingsError(
                "Cannot read the settings file {path}: {error}.", path=path, error=error
            ) from error
        group, name = SCHEDULER.split(".")
        named = data.get(group)
        if isinstance(named, Mapping) and named.get(name):
            warn(
                Note(
                    "“{path}” names a dask scheduler, which is ignored: whoever answers there runs "
                    "code on this computer. Give it with --tiling-scheduler if you trust it.",
                    path=path,
                )
            )
        try:
            return cls.from_dict(data)
        except SettingsError as error:
            raise SettingsError("{path}: {error}", path=path, error=error) from error


def _groups() -> dict[str, type[Group]]:
    return get_type_hints(Settings)


def iterate_fields() -> Iterator[tuple[str, FieldSpec]]:
    """Yield (dotted key, spec) of every setting, in order."""
    for kind in _groups().values():
        for spec in specs_of(kind):
            yield spec.key, spec
