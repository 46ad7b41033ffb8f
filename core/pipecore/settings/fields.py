"""How a setting is declared, and how a value for it is converted and checked."""

import dataclasses
import math
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, ClassVar, get_args, get_origin, get_type_hints

from pipecore.errors import SettingsError


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


def _describe(declared: dataclasses.Field[Any]) -> str:
    """The help of a setting, with its unit and what 0 means."""
    of = declared.metadata
    notes = [of["unit"]] if of["unit"] else []
    notes += [f"0: {of['zero_means']}"] if of["zero_means"] else []
    return str(of["help"]) + (f" ({'; '.join(notes)})" if notes else "")


@dataclass(frozen=True)
class FieldSpec:
    """What a form or a flag needs to know of one setting.

    Parameters
    ----------
    group, name : str
        Its dotted key is made of the two.
    kind : type
    default : Any
    label : str
        What a form calls it.
    help : str
        One sentence for its tooltip and its flag.
    unit : str
        Shown beside the value; "" if it has none.
    minimum, maximum : float or None
        Inclusive bounds.
    zero_means : str
        What 0 stands for, such as "automatic"; "" if it is a plain number.
    advanced : bool
        Whether a form folds it away.
    """

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

    @property
    def key(self) -> str:
        """The dotted key, such as "stacks.width_mm"."""
        return f"{self.group}.{self.name}"


class Group:
    """A group of settings: a frozen dataclass whose fields are declared by `setting`.

    Raises
    ------
    SettingsError
        If a value is of the wrong kind or outside its bounds.
    """

    name_in_settings: ClassVar[str]

    def __init_subclass__(cls, *, name: str) -> None:
        """Take the name of the group in `Settings`; document its parameters by their help."""
        cls.name_in_settings = name
        entries = [
            f"{key} : {kind if isinstance(kind, str) else kind.__name__}\n    {_describe(value)}"
            for key, kind in cls.__annotations__.items()
            if isinstance(value := cls.__dict__.get(key), dataclasses.Field)
        ]
        cls.__doc__ = f"{cls.__doc__}\n\nParameters\n----------\n" + "\n".join(entries) + "\n"

    def __post_init__(self) -> None:
        """Bring every value to its type, and check it."""
        for spec in specs_of(type(self)):
            value = getattr(self, spec.name)
            # Text stands for a number in files and flags only.
            if not (spec.kind is float and isinstance(value, str)):
                value = convert(value, spec)
                object.__setattr__(self, spec.name, value)
            check(value, spec)


def choices_of(kind: Any) -> type[StrEnum] | None:
    """Return the choices of a setting that takes several of them, in an order.

    Parameters
    ----------
    kind : type
        Of the setting.

    Returns
    -------
    type of StrEnum or None
        None if the setting takes something else.
    """
    args = get_args(kind)
    if get_origin(kind) is tuple and isinstance(args[0], type) and issubclass(args[0], StrEnum):
        return args[0]
    return None


def specs_of(group: type[Group]) -> tuple[FieldSpec, ...]:
    """Return the specs of the fields of a group, in order."""
    kinds = get_type_hints(group)
    return tuple(
        FieldSpec(group.name_in_settings, f.name, kinds[f.name], f.default, **f.metadata)
        for f in dataclasses.fields(group)  # type: ignore[arg-type]
    )


def convert(value: Any, spec: FieldSpec) -> Any:
    """Return text (from a flag) or a plain TOML value in the type of its setting.

    Raises
    ------
    SettingsError
        If it does not fit.
    """
    try:
        if isinstance(spec.kind, type) and issubclass(spec.kind, StrEnum):
            return spec.kind(value)
        if choices := choices_of(spec.kind):
            names = value.split(",") if isinstance(value, str) else value
            return tuple(dict.fromkeys(choices(name.strip()) for name in names))
        if spec.kind is float and not isinstance(value, bool):
            return float(value)
        if spec.kind is str and isinstance(value, str):
            return value
        if spec.key == "stacks.directions":
            if isinstance(value, str):
                value = [vector.split(",") for vector in value.split(";") if vector.strip()]
            return tuple(tuple(float(c) for c in vector) for vector in value)
    except (ValueError, TypeError, AttributeError):
        pass
    raise _misfit(value, spec)


def _misfit(value: object, spec: FieldSpec) -> SettingsError:
    key = spec.key
    several = choices_of(spec.kind)
    if several is not None:
        return SettingsError(
            "“{value}” does not fit the setting “{key}” (one or several of: {choices}).",
            value=value,
            key=key,
            choices=", ".join(several),
        )
    if isinstance(spec.kind, type) and issubclass(spec.kind, StrEnum):
        return SettingsError(
            "“{value}” does not fit the setting “{key}” (one of: {choices}).",
            value=value,
            key=key,
            choices=", ".join(spec.kind),
        )
    if spec.kind is float:
        return SettingsError(
            "“{value}” does not fit the setting “{key}” (a number).", value=value, key=key
        )
    return SettingsError("“{value}” does not fit the setting “{key}”.", value=value, key=key)


def check(value: Any, spec: FieldSpec) -> None:
    """Raise `SettingsError` unless a value is of its setting's type and within its bounds."""
    key = spec.key
    if spec.kind is float:
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not math.isfinite(value):
            raise SettingsError(
                "The setting “{key}” must be a number, not {value!r}.", key=key, value=value
            )
        if spec.minimum is not None and value < spec.minimum:
            raise SettingsError(
                "The setting “{key}” is {value:g}; it must be at least {minimum:g}.",
                key=key,
                value=value,
                minimum=spec.minimum,
            )
        if spec.maximum is not None and value > spec.maximum:
            raise SettingsError(
                "The setting “{key}” is {value:g}; it must be at most {maximum:g}.",
                key=key,
                value=value,
                maximum=spec.maximum,
            )
    elif spec.key == "stacks.directions":
        for vector in value:
            usable = len(vector) in (3, 4) and all(map(math.isfinite, vector))
            if not usable or not any(vector[:3]) or vector[3:] < (0.0,) * len(vector[3:]):
                raise SettingsError(
                    "The stack {stack} is not a direction x, y, z with an optional width.",
                    stack=list(vector),
                )
    elif choices_of(spec.kind) is not None:
        if not value:
            raise _misfit("", spec)
    elif not isinstance(value, spec.kind):
        raise _misfit(value, spec)
