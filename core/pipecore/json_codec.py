"""Frozen dataclasses to what JSON knows, and back by their type hints: results and projects.

Files live longer than a version of the program. Fields that are not in the file keep their
defaults, unknown fields are ignored, and classes are not named: where several are possible,
a "kind" says which one is meant. A value that does not fit its type is a `ValueError`.
"""

import dataclasses
import math
import types
from collections.abc import Mapping
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from pipecore.errors import SettingsError
from pipecore.geometry import ArcAxis, CurveAxis, LineAxis
from pipecore.reasons import Reason
from pipecore.settings import Settings

KIND_KEY = "kind"
KIND_NAMES: dict[type, str] = {LineAxis: "line", ArcAxis: "arc", CurveAxis: "curve"}
"""How files name the dataclasses that stand where several are possible."""
VERSION_1_NAMES = {"LineAxis": "line", "ArcAxis": "arc"}
"""How files of version 1 name them under "type"."""


def to_plain(value: Any) -> Any:  # noqa: PLR0911 - one for each type
    """Turn a value into dicts, lists, strings and numbers; nan becomes None.

    Parameters
    ----------
    value : dataclass, array, enum, path, settings, or a container of such
        What is to be written.

    Returns
    -------
    dict, list, str, int, float, bool or None
    """
    if isinstance(value, Settings):
        return value.to_dict()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {f.name: to_plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
        name = KIND_NAMES.get(type(value))
        return fields if name is None else {KIND_KEY: name} | fields
    if isinstance(value, np.ndarray | np.generic):
        return to_plain(value.tolist())
    if isinstance(value, StrEnum | Path):
        return str(value)
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, frozenset | set):
        return sorted(to_plain(v) for v in value)
    if isinstance(value, tuple | list):
        return [to_plain(v) for v in value]
    if isinstance(value, Mapping):
        return {str(k): to_plain(v) for k, v in value.items()}
    return value


def _number(value: float) -> float | str | None:
    if math.isnan(value):
        return None
    return value if math.isfinite(value) else str(value)


def from_plain(kind: Any, plain: Any) -> Any:  # noqa: PLR0911 - one for each type
    """Turn plain values into a value of a type.

    Parameters
    ----------
    kind : type
        The type wanted, which may be a union or generic.
    plain : dict, list, str, int, float, bool or None
        What was read.

    Returns
    -------
    object
        A value of that type.

    Raises
    ------
    ValueError
        If they do not fit.
    """
    origin = get_origin(kind)
    if origin in (Union, types.UnionType):
        return _from_union(get_args(kind), plain)
    if origin is not None:
        return _from_container(origin, get_args(kind), plain)
    if kind is Settings:
        _expect(isinstance(plain, dict), kind, plain)
        try:
            return Settings.from_dict(plain)
        except SettingsError as error:
            raise ValueError(str(error)) from error
    if dataclasses.is_dataclass(kind):
        return _from_fields(kind, plain)
    if isinstance(kind, type) and issubclass(kind, StrEnum):
        _expect(isinstance(plain, str), kind, plain)
        return kind(plain)
    if kind is Reason:
        return _reason(plain)
    if kind is float:
        return _float(plain)
    if kind is Path:
        _expect(isinstance(plain, str), kind, plain)
        return Path(plain)
    _expect(type(plain) is kind, kind, plain)
    return plain


def _from_union(kinds: tuple[Any, ...], plain: Any) -> Any:
    if plain is None and type(None) in kinds:
        return None
    rest = [k for k in kinds if k is not type(None)]
    if len(rest) == 1:
        return from_plain(rest[0], plain)
    _expect(isinstance(plain, dict), kinds, plain)
    name = plain.get(KIND_KEY, VERSION_1_NAMES.get(plain.get("type")))
    chosen = [kind for kind in rest if name is not None and KIND_NAMES.get(kind) == name]
    _expect(len(chosen) == 1, kinds, plain)
    return from_plain(chosen[0], plain)


def _from_container(origin: Any, args: tuple[Any, ...], plain: Any) -> Any:
    if issubclass(origin, np.ndarray):
        _expect(isinstance(plain, list), origin, plain)
        return np.array([_float(v) for v in plain], dtype=np.float64)
    if issubclass(origin, Mapping):
        _expect(isinstance(plain, dict), origin, plain)
        key_kind, value_kind = args
        keys = {k: int(k) if key_kind is int else from_plain(key_kind, k) for k in plain}
        return {keys[k]: from_plain(value_kind, v) for k, v in plain.items()}
    _expect(isinstance(plain, list), origin, plain)
    if origin is tuple and args[-1] is not Ellipsis:
        _expect(len(plain) == len(args), args, plain)
        return tuple(from_plain(k, v) for k, v in zip(args, plain, strict=True))
    return origin(from_plain(args[0], v) for v in plain)


def _from_fields(kind: Any, plain: Any) -> Any:
    _expect(isinstance(plain, dict), kind, plain)
    hints = _hints(kind)
    known = {f.name for f in dataclasses.fields(kind)} & plain.keys()
    try:
        return kind(**{name: from_plain(hints[name], plain[name]) for name in known})
    except TypeError as error:
        raise ValueError(str(error)) from error


@cache
def _hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind)


def _reason(plain: Any) -> Reason:
    if isinstance(plain, str):
        return Reason(plain)
    _expect(isinstance(plain, dict) and {"template", "values"} <= plain.keys(), Reason, plain)
    template, values = plain["template"], plain["values"]
    _expect(isinstance(template, str) and isinstance(values, dict), Reason, plain)
    try:
        return Reason(template, **values)
    except (LookupError, ValueError, TypeError) as error:
        raise ValueError(f"{template[:40]!r} is not a reason") from error


def _float(plain: Any) -> float:
    if plain is None:
        return math.nan
    if isinstance(plain, str) and plain in ("inf", "-inf"):
        return float(plain)
    _expect(isinstance(plain, int | float) and not isinstance(plain, bool), float, plain)
    return float(plain)


def _expect(fits: bool, kind: Any, plain: Any) -> None:
    if not fits:
        name = getattr(kind, "__name__", str(kind))
        raise ValueError(f"{str(plain)[:40]!r} is not a {name}")
