"""Results in project files of the app.

A project is a zip archive. Of scan `i`, counted from 0, ``project.json`` holds the name as
``scans[i]["name"]`` and as ``scans[i]["result"]`` what ``result.json`` of a report holds but
for the profiles. These are NumPy arrays, never pickled, a column each in
``scans/i/profiles``; beside them lie ``segment_id``, ``element_id`` and ``deviation`` by point.
"""

import dataclasses
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.consistency import check_result
from pipecore.errors import CancelledError, ReadError
from pipecore.progress import Progress
from pipecore.report.reading import result_from_dict
from pipecore.report.result_json import result_to_dict
from pipecore.types import Profiles, Result

CONTENTS = "project.json"
FORMAT = "pipegui project"
FORMAT_VERSION = 2
"""Keys may be added within a version; a reader refuses a larger one."""

POINT_ARRAYS = {"segment_id": np.int32, "element_id": np.int32, "deviation": np.float32}

BYTES_AT_A_TIME = 1 << 22


def load_project(path: Path, scan: str | None, progress: Progress) -> Result:
    """Read the result of one scan of a project.

    Parameters
    ----------
    path : Path
    scan : str or None
        The scan's name in the project; None where only one of the scans has a result.
    progress : Progress
        Receives updates of the stage "opening"; may cancel.

    Returns
    -------
    Result

    Raises
    ------
    ReadError
        If there is no such scan or several, or the file is no project that can be read.
    CancelledError
        From `progress`.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            contents = read_contents(archive)
            with_result = {
                str(plain["name"]): i
                for i, plain in enumerate(contents["scans"])
                if plain["result"] is not None and scan in (None, plain["name"])
            }
            if len(with_result) != 1:
                raise ReadError(
                    "“{path}” holds results of {n} scans{names}: name one of them.",
                    path=path,
                    n=len(with_result),
                    names="".join(f" “{name}”" for name in with_result),
                )
            (number,) = with_result.values()
            return read_scan(archive, number, contents["scans"][number]["result"], progress)
    except (ReadError, CancelledError):
        raise
    except OSError as error:
        raise ReadError(
            "“{path}” cannot be read: {error}.", path=path, error=error.strerror or error
        ) from error
    except Exception as error:  # whatever a damaged file makes zip, JSON or NumPy raise
        raise ReadError("The project “{path}” is damaged: {error}.", path=path, error=error) from (
            error
        )


def read_contents(archive: zipfile.ZipFile) -> dict[str, Any]:
    """Return what ``project.json`` holds.

    Parameters
    ----------
    archive : ZipFile

    Returns
    -------
    dict

    Raises
    ------
    ReadError
        If it is of a newer version.
    ValueError
        If it is no project.
    """
    contents = json.loads(archive.read(CONTENTS))
    if not isinstance(contents, dict) or contents.get("format") != FORMAT:
        raise ValueError("it says that it is something else")
    version = contents.get("format_version")
    if type(version) is not int or version < 1:
        raise ValueError("it has no version")
    if version > FORMAT_VERSION:
        raise ReadError(
            "“{name}” was saved by a newer PipeGUI ({program}). Update this program to open it.",
            name=Path(archive.filename or "").name,
            program=contents.get("program"),
        )
    return contents


def scan_to_dict(result: Result) -> dict[str, Any]:
    """Return what ``project.json`` holds of a result.

    Parameters
    ----------
    result : Result

    Returns
    -------
    dict
    """
    plain = result_to_dict(dataclasses.replace(result, profiles=Profiles.empty()))
    del plain["profiles"]
    return plain


def write_scan_arrays(
    archive: zipfile.ZipFile, number: int, result: Result, progress: Progress
) -> None:
    """Write the arrays of a result into a project.

    Parameters
    ----------
    archive : ZipFile
        Open for writing.
    number : int
        Of the scan, from 0.
    result : Result
    progress : Progress
        Receives updates of the stage "saving"; may cancel.
    """
    columns = {f.name: getattr(result.profiles, f.name) for f in dataclasses.fields(Profiles)}
    arrays = {name: getattr(result, name) for name in POINT_ARRAYS}
    arrays |= {f"profiles/{name}": column for name, column in columns.items()}
    for i, (name, values) in enumerate(arrays.items()):
        array = np.ascontiguousarray(values)
        with archive.open(f"scans/{number}/{name}.npy", "w", force_zip64=True) as file:
            header = np.lib.format.header_data_from_array_1_0(array)
            np.lib.format.write_array_header_1_0(file, header)
            data = array.reshape(-1).view(np.uint8)
            for start in range(0, len(data), BYTES_AT_A_TIME):
                progress.update("saving", i / len(arrays))
                file.write(data[start : start + BYTES_AT_A_TIME].data)


def read_scan(
    archive: zipfile.ZipFile, number: int, plain: Mapping[str, Any], progress: Progress
) -> Result:
    """Read the result of one scan of a project.

    Parameters
    ----------
    archive : ZipFile
    number : int
        Of the scan, from 0.
    plain : mapping
        What ``project.json`` holds of the result.
    progress : Progress
        Receives updates of the stage "opening"; may cancel.

    Returns
    -------
    Result

    Raises
    ------
    Exception
        Whatever a damaged file makes zip, JSON or NumPy raise.
    """
    result = result_from_dict({**plain, "profiles": _profile_columns(archive, number)})
    arrays: dict[str, Any] = {}
    for name, dtype in POINT_ARRAYS.items():
        progress.update("opening", 0.0)
        shape = (result.n_cloud_points,)
        arrays[name] = _array(archive, f"scans/{number}/{name}", np.dtype(dtype), shape)
    result = dataclasses.replace(result, **arrays)
    check_result(result)
    return result


def _profile_columns(archive: zipfile.ZipFile, number: int) -> dict[str, NDArray[Any]]:
    """Columns of the profiles; one that came with a later version is not among them."""
    empty, names, columns = Profiles.empty(), set(archive.namelist()), {}
    for f in dataclasses.fields(Profiles):
        name = f"scans/{number}/profiles/{f.name}"
        if f"{name}.npy" in names:
            model = getattr(empty, f.name)
            columns[f.name] = _array(archive, name, model.dtype, (None, *model.shape[1:]))
    return columns


def _array(
    archive: zipfile.ZipFile, name: str, dtype: np.dtype[Any], shape: tuple[int | None, ...]
) -> NDArray[Any]:
    with archive.open(f"{name}.npy") as file:
        if np.lib.format.read_magic(file) != (1, 0):
            raise ValueError(f"{name} is of an unknown kind")
        found, is_fortran, stored = np.lib.format.read_array_header_1_0(file)
        fits = len(found) == len(shape) and all(
            want in (None, have) for want, have in zip(shape, found, strict=True)
        )
        n_bytes = int(np.prod(found, dtype=object)) * dtype.itemsize
        # Checked before anything of that size is asked of the memory.
        n_stored = archive.getinfo(f"{name}.npy").file_size
        if stored != dtype or is_fortran or not fits or n_bytes > n_stored:
            raise ValueError(f"{name} has another shape")
        data = file.read(n_bytes)
        if len(data) != n_bytes or file.read(1):
            raise ValueError(f"{name} is cut short")
    return np.frombuffer(bytearray(data), dtype).reshape(found)
