"""Scenes as TOML files: every table is one of the scene's dataclasses, by its fields."""

import dataclasses
import math
import tomllib
import types
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints

import tomli_w

from pipecore.errors import SceneError
from pipecore.simulate.clutter import clutter_parts
from pipecore.simulate.placing import place_runs
from pipecore.simulate.scene import Scene


def load_scene(path: Path) -> Scene:
    """Read a scene from a TOML file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        If the file cannot be read, or names the place in it that is not valid.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise SceneError(f"Cannot read the scene file {path}: {error}.") from error
    try:
        scene = scene_from_dict(table)
        # Errors of what cannot be built name the file, too.
        place_runs(scene)
        clutter_parts(scene.clutter)
        return scene
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from error


def save_scene(scene: Scene, path: Path) -> None:
    """Write a scene as a TOML file that `load_scene` reads back equal.

    Parameters
    ----------
    scene : Scene
    path : Path
    """
    path.write_text(tomli_w.dumps(_to_plain(scene)), encoding="utf-8")


def scene_from_dict(table: Mapping[str, Any]) -> Scene:
    """Return the scene of nested plain tables, as TOML has them.

    Raises
    ------
    SceneError
        If a key is unknown or missing, or a value does not fit.
    """
    scene: Scene = _from_plain(Scene, table, "the scene")
    return scene


def _to_plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        plain = {f.name: _to_plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
        return {"kind": _kind_of(type(value)), **plain}
    if isinstance(value, tuple):
        return [_to_plain(v) for v in value]
    return str(value) if isinstance(value, StrEnum) else value


def _kind_of(cls: type) -> str:
    return cls.__name__.lower()


def _from_plain(kind: Any, value: Any, where: str) -> Any:
    """Turn plain `value` into what the annotation `kind` asks for."""
    if get_origin(kind) in (types.UnionType, Union):
        return _from_plain(_alternative(get_args(kind), value, where), value, where)
    if get_origin(kind) is tuple:
        return _tuple(get_args(kind), value, where)
    if dataclasses.is_dataclass(kind):
        return _dataclass(kind, value, where)
    if isinstance(kind, type) and issubclass(kind, StrEnum):
        if value not in list(kind):
            raise SceneError(f"{where} is {value!r}; it must be one of {', '.join(kind)}.")
        return kind(value)
    return _scalar(kind, value, where)


def _scalar(kind: type, value: Any, where: str) -> Any:
    if kind is str and isinstance(value, str):
        return value
    if kind is int and isinstance(value, int) and not isinstance(value, bool):
        return value
    if kind is float and isinstance(value, int | float) and not isinstance(value, bool):
        if not math.isfinite(value):
            raise SceneError(f"{where} is {value}; it must be finite.")
        return float(value)
    wanted = {str: "a text", int: "a whole number", float: "a number"}[kind]
    raise SceneError(f"{where} is {value!r}; it must be {wanted}.")


def _tuple(kinds: tuple[Any, ...], value: Any, where: str) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise SceneError(f"{where} is {value!r}; it must be a list.")
    if kinds[-1] is Ellipsis:
        kinds = (kinds[0],) * len(value)
    if len(value) != len(kinds):
        raise SceneError(f"{where} has {len(value)} numbers; it must have {len(kinds)}.")
    return tuple(
        _from_plain(k, v, f"{where}[{i}]")
        for i, (k, v) in enumerate(zip(kinds, value, strict=True))
    )


def _alternative(kinds: tuple[Any, ...], value: Any, where: str) -> Any:
    by_name = {_kind_of(k): k for k in kinds}
    name = value.get("kind") if isinstance(value, Mapping) else None
    if name not in by_name:
        raise SceneError(f"{where} needs a “kind”: one of {', '.join(by_name)}.")
    return by_name[name]


def _dataclass(cls: Any, value: Any, where: str) -> Any:
    if not isinstance(value, Mapping):
        raise SceneError(f"{where} is {value!r}; it must be a table.")
    hints = get_type_hints(cls)
    fields = {f.name: f for f in dataclasses.fields(cls)}
    for key in value:
        if key not in fields and key != "kind":
            raise SceneError(f"{where} has no “{key}” (it has {', '.join(fields)}).")
    missing = [
        name
        for name, f in fields.items()
        if name not in value
        and f.default is dataclasses.MISSING
        and f.default_factory is dataclasses.MISSING
    ]
    if missing:
        raise SceneError(f"{where} lacks “{missing[0]}”.")
    return cls(
        **{
            key: _from_plain(hints[key], v, f"{where}: {key}")
            for key, v in value.items()
            if key != "kind"
        }
    )
