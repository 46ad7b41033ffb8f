"""Project files: all of the user's work in one file, the clouds by reference.

A project is a zip archive of ``project.json`` and the results of its scans, which
`pipecore.report.project` describes, writes and reads. A cloud is named by its path, relative
to the project where that can be, with a fingerprint of what is in it. Version 1 named
classes of the program, and choices of the view by the words shown.
"""

import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

import pipecore
from pipecore.errors import PipecoreError, ReadError
from pipecore.io import write_file
from pipecore.json_codec import from_plain, to_plain
from pipecore.progress import NoProgress, Progress
from pipecore.report.project import (
    CONTENTS,
    FORMAT,
    FORMAT_VERSION,
    read_contents,
    read_scan,
    scan_to_dict,
    write_scan_arrays,
)
from pipecore.settings import InputSettings, Settings
from pipecore.types import Result, Review
from pipegui.i18n.texts import error_text, tr
from pipegui.model.document import Choice, Document, Scan, Selection, ViewOptions
from pipegui.model.fingerprint import Fingerprint
from pipegui.project.cloud_reference import CloudReference, CloudState

SUFFIX = ".pipegui"

Camera = Mapping[str, list[float]]


class ProjectError(PipecoreError):
    """A project file cannot be opened."""


@dataclass(frozen=True, eq=False)
class SavedScan:
    """A scan as it is in the file: without its cloud."""

    name: str
    cloud: CloudReference
    result: Result | None
    reviews: Mapping[int, Review]

    def with_cloud(
        self,
        cloud: pipecore.PointCloud,
        reading: InputSettings,
        fingerprint: Fingerprint | None = None,
        others: tuple[Path, ...] = (),
    ) -> Scan:
        """Return the scan with its cloud; `ProjectError` if that does not fit."""
        if len(cloud) != self.cloud.n_points:
            raise ProjectError(
                tr(
                    "“{source}” holds {cloud:,} points, but “{name}” had {n_points:,} when "
                    "the project was saved: it is another scan."
                ).format(
                    source=cloud.source,
                    cloud=len(cloud),
                    name=self.name,
                    n_points=self.cloud.n_points,
                )
            )
        # Projects of the first versions kept neither unit nor notes.
        result = self.result and replace(
            self.result, source=cloud.source, unit=cloud.unit, notes=cloud.notes
        )
        if result is not None and not np.allclose(result.origin, cloud.origin, rtol=0, atol=1e-6):
            raise ProjectError(
                tr(
                    "“{source}” lies elsewhere than “{name}” did when the project was saved: "
                    "it is another scan, or was read in another unit."
                ).format(source=cloud.source, name=self.name)
            )
        return Scan(self.name, cloud, result, self.reviews, reading, fingerprint, others)


@dataclass(frozen=True, eq=False)
class SavedProject:
    """A project as it is in its file."""

    path: Path
    scans: tuple[SavedScan, ...]
    active: int
    settings: Settings
    selection: Selection = Selection()
    view: ViewOptions = ViewOptions()
    camera: Camera = field(default_factory=dict)
    recovered_from: Path | None = None
    """The project that an autosaved copy was made of."""

    def located(self) -> list[tuple[Path, CloudState]]:
        """Find the cloud of each scan."""
        return [scan.cloud.locate(self.path.parent) for scan in self.scans]

    def other_files(self, number: int, first: Path) -> tuple[Path, ...]:
        """Find the other files of a scan's cloud; `ProjectError` if one is not as it was.

        Where they are not in their places, they may be beside the `first` one, which was found.
        """
        found = []
        for reference in self.scans[number].cloud.others:
            beside = replace(reference, path=first.with_name(reference.path.name), relative="")
            places = [ref.locate(self.path.parent) for ref in (reference, beside)]
            there = [path for path, state in places if state is CloudState.FOUND]
            if not there:
                raise ProjectError(
                    tr("“{file}”, a part of “{name}”, is not there or has changed.").format(
                        file=reference.path, name=self.scans[number].name
                    )
                )
            found.append(there[0])
        return tuple(found)

    def document(self, scans: tuple[Scan, ...]) -> Document:
        """Return the document of the scans with their clouds; some may be left out."""
        names = [s.name for s in self.scans]
        wanted = names[self.active] if names else ""
        active = next((i for i, s in enumerate(scans) if s.name == wanted), 0)
        is_whole = len(scans) == len(self.scans)
        document = Document(scans, active, self.settings)
        if not is_whole or not scans:
            return document
        return replace(document, selection=self.selection, view=self.view)


def work_of(document: Document) -> tuple[Any, ...]:
    """What of a document is worth saving: where one looks is not."""
    return document.scans, document.settings


# Writing


def write_project(
    path: Path,
    document: Document,
    camera: Camera | None = None,
    recovered_from: Path | None = None,
    progress: Progress | None = None,
) -> None:
    """Write a project: the whole file or nothing.

    Parameters
    ----------
    path : Path
        The file; one that is there is replaced.
    document : Document
        What is written.
    camera : mapping, optional
        Where the 3D view looks from.
    recovered_from : Path, optional
        The project that an autosaved copy is made of.
    progress : Progress, optional
        Reports how much is written.

    Raises
    ------
    WriteError
        If the file cannot be written, or a cloud has no file.
    CancelledError
        From `progress`.
    """
    progress = progress or NoProgress()
    folder = Path(os.path.realpath(path)).parent
    scans = [_scan_to_plain(scan, folder) for scan in document.scans]
    contents = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "program": pipecore.__version__,
        "saved": datetime.now(UTC).isoformat(timespec="seconds"),
        "rescued_from": to_plain(recovered_from),
        "active": document.active,
        "settings": to_plain(document.settings),
        "selection": to_plain(document.selection),
        "view": _view_to_plain(document.view),
        "camera": to_plain(dict(camera or {})),
        "scans": scans,
    }
    with (
        write_file(path) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
    ):
        archive.writestr(CONTENTS, json.dumps(contents, allow_nan=False, ensure_ascii=False))
        for i, scan in enumerate(document.scans):
            if scan.result is not None:
                write_scan_arrays(archive, i, scan.result, progress)


def _view_to_plain(view: ViewOptions) -> dict[str, Any]:
    """The view with the names of what was chosen: the words shown may change."""
    values = {f.name: getattr(view, f.name) for f in fields(view)}
    names = {k: v.name.lower() for k, v in values.items() if isinstance(v, Choice)}
    return {name: to_plain(value) for name, value in values.items()} | names


def _scan_to_plain(scan: Scan, folder: Path) -> dict[str, Any]:
    result = scan.result
    plain: dict[str, Any] = {
        "name": scan.name,
        "cloud": to_plain(CloudReference.to(scan, folder)),
        "reviews": to_plain(scan.reviews),
        "result": None,
    }
    if result is not None:
        plain["result"] = scan_to_dict(result)
    return plain


# Reading


def read_project(path: Path, progress: Progress | None = None) -> SavedProject:
    """Read a project file, without its clouds.

    Parameters
    ----------
    path : Path
        The file.
    progress : Progress, optional
        Reports how much is read.

    Returns
    -------
    SavedProject

    Raises
    ------
    ProjectError
        If the file is not there, not a project, damaged, or of a newer program.
    CancelledError
        From `progress`.
    """
    progress = progress or NoProgress()
    try:
        with zipfile.ZipFile(path) as archive:
            return _read(Path(os.path.realpath(path)), archive, progress)
    except ReadError as error:
        raise ProjectError(error_text(error)) from error
    except PipecoreError:
        raise
    except FileNotFoundError as error:
        raise ProjectError(tr("There is no file “{path}”.").format(path=path)) from error
    except OSError as error:
        raise ProjectError(
            tr("“{path}” cannot be read ({reason}).").format(
                path=path, reason=error.strerror or error
            )
        ) from error
    except Exception as error:  # whatever a damaged file makes zip, JSON or NumPy raise
        raise ProjectError(
            tr("“{name}” is not a project, or is damaged ({error}).").format(
                name=path.name, error=error
            )
        ) from error


def _read(path: Path, archive: zipfile.ZipFile, progress: Progress) -> SavedProject:
    contents = read_contents(archive)
    plain_scans = contents["scans"]
    scans = []
    for i, plain in enumerate(plain_scans):
        progress.update("opening", i / len(plain_scans))
        scans.append(_scan_from_plain(plain, i, archive, progress))
    active = from_plain(int, contents["active"])
    if not 0 <= active < max(len(scans), 1):
        raise ValueError("its active scan is not there")
    selection, view = Selection(), ViewOptions()
    try:
        view = from_plain(ViewOptions, contents.get("view", {}))
        selection = from_plain(Selection, contents.get("selection", {}))
        _check_selection(selection, view, scans[active].result if scans else None)
    except (ValueError, KeyError):
        # Where one looked is not worth a project.
        selection, view = Selection(), ViewOptions()
    return SavedProject(
        path,
        tuple(scans),
        active,
        from_plain(Settings, contents["settings"]),
        selection,
        view,
        _camera(contents.get("camera")),
        from_plain(Path | None, contents.get("rescued_from")),
    )


def _scan_from_plain(
    plain: Mapping[str, Any], number: int, archive: zipfile.ZipFile, progress: Progress
) -> SavedScan:
    reference = from_plain(CloudReference, plain["cloud"])
    reviews = from_plain(Mapping[int, Review], plain["reviews"])
    result = None
    if plain["result"] is not None:
        result = read_scan(archive, number, plain["result"], progress)
        if result.n_cloud_points != reference.n_points:
            raise ValueError("the result is of another cloud")
        known = {d.deformation_id for d in result.deformations}
        if not set(reviews) <= known:
            raise ValueError("a review is of a deformation that is not there")
    elif reviews:
        raise ValueError("there are reviews without deformations")
    return SavedScan(from_plain(str, plain["name"]), reference, result, reviews)


def _check_selection(selection: Selection, view: ViewOptions, result: Result | None) -> None:
    """Raise `KeyError` if something is selected or shown that is not there."""
    wanted = {selection.element_id, *selection.others, *view.hidden_elements}
    wanted = (wanted | {*view.pinned_elements}) - {0}
    if result is None:
        if wanted or selection != Selection():
            raise KeyError("selection")
        return
    for element_id in wanted:
        result.element(element_id)
    if selection.deformation_id:
        result.deformation(selection.deformation_id)
    if selection.candidate_id:
        result.candidate(selection.candidate_id)
    if selection.element_id and result.element(selection.element_id).run_id != selection.run_id:
        raise KeyError("selection")
    key = selection.profile
    if key is not None:
        rows = result.profiles.of_element(selection.element_id, key.stack_id)
        if key.profile_index not in rows.profile_index:
            raise KeyError("selection")


def _camera(plain: Any) -> Camera:
    try:
        camera: Camera = from_plain(dict[str, list[float]], plain)
    except ValueError:
        return {}
    return camera if all(np.isfinite(v).all() for v in camera.values()) else {}
