"""Reading a report folder back: the inverse of `write_report`."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from pipecore.consistency import check_result
from pipecore.errors import ReadError
from pipecore.json_codec import from_plain
from pipecore.notes import Note
from pipecore.progress import Progress
from pipecore.reasons import Reason
from pipecore.report.result_json import FORMAT, FORMAT_VERSION
from pipecore.settings import Settings
from pipecore.types import (
    Array,
    Candidate,
    Deformation,
    Element,
    Profiles,
    Result,
    Stack,
    StationCheck,
)
from pipecore.units import FileUnit

POINT_COLUMNS = {"segment_id": np.int32, "element_id": np.int32, "deviation_mm": np.float32}
"""What ``segments.laz`` holds of each point, and as what a result does."""

POINTS_AT_A_TIME = 1_000_000


def load_folder(folder: Path, progress: Progress) -> Result:
    """Read a result from a report folder.

    Parameters
    ----------
    folder : Path
    progress : Progress
        Receives updates of the stage "reading"; may cancel.

    Returns
    -------
    Result

    Raises
    ------
    ReadError
        If there is no report of a version that this program knows, or it contradicts itself.
    CancelledError
        From `progress`.
    """
    progress.update("reading", 0.0)
    path = folder / "result.json"
    try:
        plain = orjson.loads(path.read_bytes())
        check_format(plain)
        result = result_from_dict(plain)
        segments = folder / "segments.laz"
        if segments.is_file():
            columns = _read_point_columns(segments, result.n_cloud_points, progress)
            result = dataclasses.replace(
                result,
                segment_id=columns["segment_id"],
                element_id=columns["element_id"],
                deviation=(columns["deviation_mm"] / 1000).astype(np.float32),
            )
        check_result(result)
    except OSError as error:
        raise ReadError(
            "“{folder}” is not a report that can be read: {error}.",
            folder=folder,
            error=error.strerror or error,
        ) from error
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError) as error:
        raise ReadError(
            "The report in “{folder}” is damaged: {error}.", folder=folder, error=error
        ) from error
    progress.update("reading", 1.0)
    return result


def check_format(plain: Any) -> None:
    """Raise `ValueError` unless a JSON value is a result of a version that is known here.

    Parameters
    ----------
    plain : Any
        As JSON gives it.

    Raises
    ------
    ValueError
        If it is none.
    """
    if not isinstance(plain, dict) or plain.get("format") != FORMAT:
        raise ValueError("result.json holds no result of pipecore")
    if plain.get("format_version") != FORMAT_VERSION:
        raise ValueError(
            f"its format {plain.get('format_version')} is not known to this program, which "
            f"reads {FORMAT_VERSION}"
        )


def result_from_dict(plain: Mapping[str, Any]) -> Result:
    """Return the result that `result_to_dict` made plain; its arrays by point are empty.

    Parameters
    ----------
    plain : mapping
        Keys that are not known are left out, and those that are not there keep their
        defaults, so that a report of another program of the same format can be read.

    Returns
    -------
    Result

    Raises
    ------
    ValueError, KeyError, TypeError
        If it is none.
    """
    templates = plain.get("templates", {})
    elements, deformations = (
        [_with_templates(item, templates) for item in plain[name]]
        for name in ("elements", "deformations")
    )
    return Result(
        settings=from_plain(Settings, plain["settings"]),
        origin=from_plain(Array, plain["origin"]),
        source=from_plain(Path | None, plain["source"]),
        n_cloud_points=from_plain(int, plain["n_cloud_points"]),
        stacks=from_plain(tuple[Stack, ...], plain["stacks"]),
        elements=from_plain(tuple[Element, ...], elements),
        profiles=_profiles(plain["profiles"]),
        deformations=from_plain(tuple[Deformation, ...], deformations),
        segment_id=np.empty(0, np.int32),
        element_id=np.empty(0, np.int32),
        deviation=np.empty(0, np.float32),
        seconds=from_plain(dict[str, float], plain["seconds"]),
        edits=from_plain(tuple[str, ...], plain.get("edits", [])),
        run_names=from_plain(dict[int, str], plain.get("run_names", {})),
        own_settings=from_plain(dict[int, Settings], plain.get("own_settings", {})),
        unit=_unit(plain),
        notes=tuple(_note(templates.get(note, note)) for note in plain.get("notes", [])),
        candidates=from_plain(
            tuple[Candidate, ...],
            [
                {**item, "reason": templates.get(item["reason"], item["reason"])}
                for item in plain.get("candidates", [])
            ],
        ),
        n_more_candidates=from_plain(int, plain.get("n_more_candidates", 0)),
        station_check=_station_check(plain.get("station_check"), templates),
    )


def _station_check(plain: Any, templates: Mapping[str, Any]) -> StationCheck | None:
    """How stations fit, with reasons that have their templates again."""
    if plain is None:
        return None

    def filled(item: Mapping[str, Any]) -> dict[str, Any]:
        reason = item["correction"]["reason"]
        correction = {**item["correction"], "reason": templates.get(reason, reason)}
        return {**item, "correction": correction}

    lists = {name: [filled(item) for item in plain[name]] for name in ("stations", "pairs")}
    found: StationCheck = from_plain(StationCheck, {**plain, **lists})
    return found


def _unit(plain: Mapping[str, Any]) -> FileUnit:
    """The unit of the file's coordinates; heights had no unit of their own at first."""
    name, metres = str(plain.get("length_unit", "m")), float(plain.get("metres_per_unit", 1.0))
    return FileUnit(
        name,
        metres,
        str(plain.get("height_unit", name)),
        float(plain.get("metres_per_height_unit", metres)),
    )


def _with_templates(plain: Mapping[str, Any], templates: Mapping[str, Any]) -> dict[str, Any]:
    """An element or a deformation whose reasons have their templates again."""
    reasons = plain.get("not_measurable", {})
    filled = {**plain, "not_measurable": {k: templates.get(w, w) for k, w in reasons.items()}}
    if "verdict_reason" in plain:
        filled["verdict_reason"] = templates.get(plain["verdict_reason"], plain["verdict_reason"])
    return filled


def _note(plain: Any) -> Note:
    reason: Reason = from_plain(Reason, plain)
    return Note(reason.template, **reason.values)


def _profiles(plain: Mapping[str, Any]) -> Profiles:
    empty = Profiles.empty()
    columns = {}
    n_rows = len(plain["element_id"])
    for f in dataclasses.fields(Profiles):
        if f.name not in plain:
            continue
        like = getattr(empty, f.name)
        column = np.array(plain[f.name], like.dtype)
        if column.size == 0:
            column = column.reshape(like.shape)
        if column.shape != (n_rows, *like.shape[1:]):
            raise ValueError(f"the column {f.name} of its profiles has shape {column.shape}")
        columns[f.name] = column
    return Profiles(**columns)


def _read_point_columns(path: Path, n_points: int, progress: Progress) -> dict[str, NDArray[Any]]:
    """Read what ``segments.laz`` says of each point, in the order of the cloud."""
    import laspy  # noqa: PLC0415 - slow to import
    from laspy.errors import LaspyException  # noqa: PLC0415
    from lazrs import LazrsError  # type: ignore[import-untyped]  # noqa: PLC0415

    try:
        with laspy.open(path) as reader:
            n_held = reader.header.point_count
            missing = POINT_COLUMNS.keys() - set(reader.header.point_format.extra_dimension_names)
            if n_held != n_points or missing:
                raise ValueError(
                    f"segments.laz does not belong to it ({n_held:,} points, not {n_points:,}"
                    + "".join(f"; no {name}" for name in sorted(missing))
                    + ")"
                )
            columns: dict[str, NDArray[Any]] = {
                name: np.empty(n_points, dtype) for name, dtype in POINT_COLUMNS.items()
            }
            start = 0
            for points in reader.chunk_iterator(POINTS_AT_A_TIME):
                progress.update("reading", start / n_points)
                for name, column in columns.items():
                    column[start : start + len(points)] = points[name]
                start += len(points)
    except (LaspyException, LazrsError) as error:
        raise ValueError(f"segments.laz: {error}") from error
    if start != n_points:
        raise ValueError(f"segments.laz ends after {start:,} points")
    return columns
