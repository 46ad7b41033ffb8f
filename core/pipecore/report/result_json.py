"""``result.json``: all of a result but its per-point arrays, for programs.

Format version 1. Lengths are metres and angles radians; positions are local
coordinates in metres, and world coordinates in the file's unit are
``(local + origin) / metres_per_unit``. ``null`` stands for what could not be measured.
A kind of axis has its own keys: ``line`` has start, direction and length, ``arc`` has
centre, normal, towards_start, bend_radius and bend_angle,
``curve`` has start and end of its chord, and at equal steps along it offsets to 12:00 (up) and
3:00 (right). Profiles are columns of equal
length, with nine digits after the point. ``settings`` are those of the detection,
``own_settings`` those of elements that were detected again with others, by element id.
``templates`` gives the sentences of ``notes``, ``not_measurable``, ``verdict_reason`` and
``reason`` (of ``candidates``, what was nearly accepted, and of corrections in ``station_check``)
that have values in them as template and values, so that they can be said in another
language. A reader refuses a larger `format_version`; keys may be added within a version.
"""

import dataclasses
import math
from datetime import UTC, datetime
from enum import StrEnum
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import orjson

import pipecore
from pipecore.json_codec import KIND_KEY, KIND_NAMES
from pipecore.progress import NoProgress, Progress
from pipecore.types import Result

FORMAT = "pipecore result"
FORMAT_VERSION = 1
DECIMALS = 9
"""Of the values of profiles: nanometres. Sixteen take nearly twice the time and room."""


def result_to_dict(result: Result) -> dict[str, Any]:
    """Return a result as plain dicts, lists, strings and numbers, ready for JSON.

    Parameters
    ----------
    result : Result

    Returns
    -------
    dict
    """
    plain = _plain(_content(result))
    assert isinstance(plain, dict)
    return plain


def _content(result: Result) -> dict[str, Any]:
    """What ``result.json`` holds; profiles are arrays still, all else is plain."""
    unit = result.file_unit
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": {"pipecore": pipecore.__version__}
        | {name: version(name) for name in ("numpy", "scipy", "numba")},
        "source": result.source.name if result.source else None,
        "length_unit": unit.name,
        "metres_per_unit": unit.metres,
        "height_unit": unit.height_name,
        "metres_per_height_unit": unit.height_metres,
        "notes": [str(note) for note in result.notes],
        "origin": _plain(result.origin),
        "n_cloud_points": result.n_cloud_points,
        "n_element_points": _n_element_points(result),
        "settings": result.settings.to_dict(),
        "seconds": _plain(result.seconds),
        "edits": list(result.edits),
        "run_names": {str(i): name for i, name in result.run_names.items()},
        "own_settings": {str(i): s.to_dict() for i, s in result.own_settings.items()},
        "stacks": _plain(result.stacks),
        "elements": _plain(result.elements),
        "profiles": {
            f.name: np.round(getattr(result.profiles, f.name), DECIMALS)
            for f in dataclasses.fields(result.profiles)
        },
        "deformations": _plain(result.deformations),
        "candidates": _plain(result.candidates),
        "n_more_candidates": result.n_more_candidates,
        "station_check": _plain(result.station_check),
        "templates": _templates(result),
    }


def _templates(result: Result) -> dict[str, Any]:
    """Templates and values of the sentences in a result, by the sentences."""
    found = (result.elements, result.deformations)
    reasons = [why for items in found for item in items for why in item.not_measurable.values()]
    reasons += [d.verdict_reason for d in result.deformations]
    reasons += [c.reason for c in result.candidates]
    if (check := result.station_check) is not None:
        reasons += [s.correction.reason for s in check.stations]
        reasons += [p.correction.reason for p in check.pairs]
    return {
        str(sentence): {"template": sentence.template, "values": _plain(sentence.values)}
        for sentence in [*result.notes, *reasons]
        if sentence.values
    }


def _n_element_points(result: Result) -> int | None:
    """Points that lie on an element; None if that is not known."""
    is_known = len(result.element_id) == result.n_cloud_points
    return int(np.count_nonzero(result.element_id)) if is_known else None


def write_result_json(path: Path, result: Result, progress: Progress | None = None) -> None:
    """Write ``result.json``, a line for each key, so that a person can look into it too."""
    progress = progress or NoProgress()
    with path.open("wb") as file:
        for i, (key, value) in enumerate(_content(result).items()):
            file.write(b",\n" if i else b"{\n")
            if not isinstance(value, dict):
                file.write(_dumped(key) + b": " + _dumped(value))
                continue
            file.write(_dumped(key) + b": {")
            for j, (name, item) in enumerate(value.items()):
                progress.update("writing result", j / len(value))
                file.write((b",\n " if j else b"\n ") + _dumped(name) + b": " + _dumped(item))
            file.write(b"}")
        file.write(b"\n}\n")


def _dumped(value: Any) -> bytes:
    """JSON of plain values and of arrays; what is not finite becomes null."""
    return orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY)


def _plain(value: Any) -> Any:
    """Turn the nouns of the pipeline into what JSON knows."""
    if dataclasses.is_dataclass(value):
        plain = {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
        kind = KIND_NAMES.get(type(value))
        return plain if kind is None else {KIND_KEY: kind} | plain
    if isinstance(value, np.ndarray | np.generic):
        plain_numbers = np.asarray(value).astype(object)
        plain_numbers[~np.isfinite(value)] = None
        return plain_numbers.tolist()
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, StrEnum) else value
