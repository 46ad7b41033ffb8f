"""The report of a detection: tables for programs, a page for people, a cloud for viewers.

>>> from pipecore.report import load, write_report
>>> write_report("report", cloud, result)
>>> result = load("report")

Importing this package imports neither the plot library nor the LAZ writer.
"""

import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from pipecore.errors import ReadError
from pipecore.io import with_fields, write_directory, write_file, write_laz
from pipecore.io.mapped import is_mapped
from pipecore.io.writing import may_have_fields
from pipecore.notes import Note
from pipecore.progress import NoProgress, Progress, Renamed
from pipecore.report.loading import load
from pipecore.report.reading import result_from_dict
from pipecore.report.result_json import result_to_dict, write_result_json
from pipecore.report.station_page import station_sentence
from pipecore.report.stations import pairs_table, stations_table
from pipecore.report.summary import by_verdict, summarise
from pipecore.report.tables import (
    NOT_REVIEWED,
    candidates_table,
    deformations_table,
    elements_table,
    profiles_table,
    write_csv,
    write_deformations_csv,
    write_elements_csv,
    write_profiles_csv,
)
from pipecore.report.world import FileCoordinates
from pipecore.types import PointCloud, Result, Review

__all__ = [
    "by_verdict",
    "candidates_table",
    "deformations_table",
    "elements_table",
    "load",
    "pairs_table",
    "profiles_table",
    "result_from_dict",
    "result_to_dict",
    "station_sentence",
    "stations_table",
    "summarise",
    "write_deformation_mesh",
    "write_deformations_csv",
    "write_element_mesh",
    "write_elements_csv",
    "write_html",
    "write_profiles_csv",
    "write_report",
    "write_segments",
]


def write_report(
    directory: str | os.PathLike[str],
    cloud: PointCloud | None,
    result: Result,
    *,
    reviews: Mapping[int, Review] = NOT_REVIEWED,
    segments: Path | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> tuple[Note, ...]:
    """Write the whole report into a folder: all of it or nothing.

    It holds ``elements.csv``, ``profiles.csv``, ``deformations.csv``, ``candidates.csv``,
    ``result.json``, ``segments.laz``, ``report.html`` and ``settings.toml``, and
    ``deformations.ply`` if the settings ask for a mesh; ``stations.csv`` and ``pairs.csv`` if
    the cloud is of several stations.

    Parameters
    ----------
    directory : path
        Made if it is not there; its parent must be.
    cloud : PointCloud or None
        The cloud that `result` was detected in. Without it there is no ``segments.laz``,
        ``report.html`` or ``deformations.ply``.
    result : Result
    reviews : mapping of int to Review
        What a person said of the deformations, by their ids.
    segments : Path, optional
        ``segments.laz`` of a former report with the same ids by point; it is copied.
    overwrite : bool
        Whether the folder may already hold files; those of a former report are replaced.
    progress : Progress, optional
        May cancel; then nothing was written.

    Returns
    -------
    tuple of Note
        What could not be written as it is; see `write_segments`.

    Raises
    ------
    ValueError
        If the cloud is not the one of the result.
    WriteError
        If the folder holds files and `overwrite` is not set, or a file cannot be written.
    SettingsError
        If the settings' acceptance rule is no longer there.
    CancelledError
        From `progress`.
    """
    progress = progress or NoProgress()
    if cloud is not None and not len(cloud) == len(result.element_id) == result.n_cloud_points:
        raise ValueError(
            f"the cloud has {len(cloud):,} points, but the result has values for "
            f"{len(result.element_id):,} of {result.n_cloud_points:,}"
        )
    with write_directory(directory, overwrite=overwrite) as folder:
        (folder / "settings.toml").write_text(result.settings.to_toml(), encoding="utf-8")
        write_elements_csv(folder / "elements.csv", result, cloud)
        write_deformations_csv(folder / "deformations.csv", result, reviews)
        write_csv(folder / "candidates.csv", candidates_table(result))
        if result.station_check is not None:
            write_csv(folder / "stations.csv", stations_table(result))
            write_csv(folder / "pairs.csv", pairs_table(result))
        write_profiles_csv(folder / "profiles.csv", result, progress)
        write_result_json(folder / "result.json", result, progress)
        if cloud is None:
            return ()
        write_html(folder / "report.html", cloud, result, progress)
        notes: tuple[Note, ...] = ()
        if segments is not None:
            shutil.copyfile(segments, folder / "segments.laz")
        else:
            notes = write_segments(folder / "segments.laz", cloud, result, progress)
        if result.settings.deformation.mesh_exaggeration > 0:
            write_deformation_mesh(folder / "deformations.ply", cloud, result)
        return notes


def write_deformation_mesh(
    path: str | os.PathLike[str],
    cloud: PointCloud,
    result: Result,
    deformation_ids: Sequence[int] | None = None,
) -> None:
    """Write the surfaces around deformations (all if None) as a mesh, .ply or .obj.

    Deviations are exaggerated as the settings say. Errors as for `write_report`.

    Parameters
    ----------
    path : path
        Ends in ``.ply`` or ``.obj``.
    cloud : PointCloud
        The cloud that `result` was detected in.
    result : Result
    deformation_ids : sequence of int, optional
        All if None.

    Raises
    ------
    WriteError
        If the ending is neither, or the file cannot be written.
    """
    from pipecore.deformation import mesh_deformations  # noqa: PLC0415 - compiled kernels
    from pipecore.report.meshes import write_meshes  # noqa: PLC0415

    exaggeration = result.settings.deformation.mesh_exaggeration or 1.0
    meshes = mesh_deformations(cloud, result, deformation_ids, exaggeration)
    write_meshes(path, meshes, FileCoordinates.of(result))


def write_element_mesh(
    path: str | os.PathLike[str], cloud: PointCloud, result: Result, element_ids: Sequence[int]
) -> None:
    """Write the surfaces of whole elements as a mesh; see `write_deformation_mesh`.

    Parameters
    ----------
    path : path
        Ends in ``.ply`` or ``.obj``.
    cloud : PointCloud
        The cloud that `result` was detected in.
    result : Result
    element_ids : sequence of int

    Raises
    ------
    WriteError
        If the ending is neither, or the file cannot be written.
    """
    from pipecore.deformation import mesh_elements  # noqa: PLC0415
    from pipecore.report.meshes import write_meshes  # noqa: PLC0415

    exaggeration = result.settings.deformation.mesh_exaggeration or 1.0
    meshes = mesh_elements(cloud, result, element_ids, exaggeration)
    write_meshes(path, meshes, FileCoordinates.of(result))


def write_html(
    path: str | os.PathLike[str],
    cloud: PointCloud,
    result: Result,
    progress: Progress | None = None,
) -> None:
    """Write the report as one HTML page; errors as for `write_report`.

    Parameters
    ----------
    path : path
    cloud : PointCloud
        The cloud that `result` was detected in.
    result : Result
    progress : Progress, optional
        May cancel; then nothing was written.

    Raises
    ------
    WriteError
        If the file cannot be written; what stood there before still does.
    SettingsError
        If the settings' acceptance rule is no longer there.
    CancelledError
        From `progress`.
    """
    progress = progress or NoProgress()
    progress.update("drawing figures", 0.0)  # importing what draws them takes a while
    from pipecore.report.html import render_html  # noqa: PLC0415

    page = render_html(cloud, result, progress)
    with write_file(path) as temporary:
        temporary.write_text(page, encoding="utf-8")


def write_segments(
    path: str | os.PathLike[str],
    cloud: PointCloud,
    result: Result,
    progress: Progress | None = None,
) -> tuple[Note, ...]:
    """Write the cloud as LAZ with segment_id, element_id and deviation_mm of each point.

    Ids are 0 and deviations nan for points of none. The other values are those of the files
    that the cloud came from, which are read again for them; `point_source_id` is the station.
    Errors as for `write_report`.

    Parameters
    ----------
    path : path
    cloud : PointCloud
        The cloud that `result` was detected in.
    result : Result
    progress : Progress, optional
        May cancel; then nothing was written.

    Returns
    -------
    tuple of Note
        What LAS could not hold, and why values of the files are missing, if they are.

    Raises
    ------
    WriteError
        If the file cannot be written; what stood there before still does.
    CancelledError
        From `progress`.
    """
    with _with_fields(path, cloud, progress or NoProgress()) as (full, notes):
        return notes + write_laz(
            path,
            full,
            {
                "segment_id": result.segment_id,
                "element_id": result.element_id,
                "deviation_mm": result.deviation,
            },
            factors={"deviation_mm": 1000.0},
            kinds={
                "segment_id": _narrowest(result.segment_id),
                "element_id": _narrowest(result.element_id),
            },
            unit=result.file_unit,
            progress=progress,
        )


@contextmanager
def _with_fields(
    path: str | os.PathLike[str], cloud: PointCloud, progress: Progress
) -> Iterator[tuple[PointCloud, tuple[Note, ...]]]:
    """A cloud with all that its files hold, if they are still there and hold more."""
    if not may_have_fields(cloud):
        yield cloud, ()
        return
    # A cloud that is larger than memory is kept in files; so are its values.
    with (
        TemporaryDirectory(dir=Path(path).parent)
        if is_mapped(cloud.xyz)
        else nullcontext() as beside
    ):
        notes: tuple[Note, ...] = ()
        folder = None if beside is None else Path(beside)
        try:
            cloud = with_fields(cloud, folder=folder, progress=Renamed(progress, "writing"))
        except ReadError as error:
            notes = (
                Note(
                    "“{name}” has no other values of the scan’s own file: {why}",
                    name=Path(path).name,
                    why=error,
                ),
            )
        yield cloud, notes


def _narrowest(ids: NDArray[np.int32]) -> np.dtype[np.unsignedinteger]:
    """As few bytes as hold these ids: each byte of a point takes its time to compress."""
    return np.dtype(np.min_scalar_type(int(ids.max(initial=0))))
