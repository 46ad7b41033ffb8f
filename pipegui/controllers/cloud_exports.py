"""Exports of points: a whole cloud, what is shown of it, or the selected elements."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject
from PySide6.QtWidgets import QWidget

from pipecore.errors import ReadError
from pipecore.notes import Note
from pipecore.types import PointCloud
from pipegui.controllers import file_dialogs
from pipegui.controllers.session import Session
from pipegui.i18n.reason_texts import reason_text
from pipegui.i18n.texts import count, mark, tr
from pipegui.model.document import Document, Scan
from pipegui.model.selection import elements_of
from pipegui.scene.colouring import visible_points
from pipegui.states import descriptions
from pipegui.work.worker import JobProgress

STAGES = {"reading": 0.5, "writing": 0.5}
NO_FIELDS = mark("Only what the window holds of each point was written: its file has gone.")

Rows = NDArray[np.bool_] | None
"""Which points; None for all."""


class CloudExports(QObject):
    """Asks where to, and writes points in the background, with all that their files hold."""

    def __init__(self, session: Session, window: QWidget) -> None:
        super().__init__(session)
        self._session, self._window = session, window

    def export_cloud(self) -> None:
        """Write the whole cloud of the active scan."""
        self._export(tr("Export cloud"), tr("copy"), lambda scan: None)

    def export_shown(self) -> None:
        """Write what is shown of the cloud: in the clip box, and not hidden."""
        view = self._session.document.view

        def shown(scan: Scan) -> Rows:
            hidden, box = view.hidden_elements, view.clip_box
            stations = view.hidden_stations
            return visible_points(scan.cloud, scan.result, hidden, box, hidden_stations=stations)

        self._export(tr("Export what is shown"), tr("part"), shown)

    def export_selection(self) -> None:
        """Write the points of the selected elements."""
        document = self._session.document
        if document.result is None:
            return
        ids = elements_of(document.result, document.selection)

        def selected(scan: Scan) -> Rows:
            assert scan.result is not None
            return np.isin(scan.result.element_id, ids)

        name = descriptions.title(document.result, document.selection).replace(" · ", " ")
        self._export(tr("Export the selection"), name, selected)

    def _export(self, title: str, what: str, choose: Callable[[Scan], Rows]) -> None:
        scan = self._session.document.scan
        if scan is None:
            return
        path = self._ask(title, scan, what)
        if path is None:
            return
        if any(_is_same(path, source) for source in _open_files(self._session.document)):
            refused = tr("“{path}” is open as a scan: choose another name.").format(path=path)
            self._session.show_message(refused, "warning")
            return

        def work(progress: JobProgress) -> tuple[int, tuple[Note | str, ...]]:
            return _write(scan, path, choose, progress)

        self._session.jobs.run(
            tr("Exporting {name}").format(name=path.name),
            work,
            lambda done: self._tell(path, *done),
        )

    def _ask(self, title: str, scan: Scan, what: str) -> Path | None:
        source = scan.cloud.source
        suffix = source.suffix.lower() if source is not None else ""
        name = f"{Path(scan.name).stem} {what}"
        return file_dialogs.ask_cloud_target(
            self._window, self._session.stored, title, name, suffix, beside=source
        )

    def _tell(self, path: Path, n_points: int, notes: tuple[Note | str, ...]) -> None:
        points = count("{n:,} point", "{n:,} points", n_points)
        saved = tr("Saved {points} as “{path}”.").format(points=points, path=path)
        lines = [saved, *map(reason_text, notes)]
        self._session.show_message("\n".join(lines), "warning" if notes else "info")


def _write(
    scan: Scan, path: Path, choose: Callable[[Scan], Rows], progress: JobProgress
) -> tuple[int, tuple[Note | str, ...]]:
    """Write points of a scan; returns their number and what could not be kept."""
    from pipecore.io import with_fields, write  # noqa: PLC0415 - laspy takes its time

    progress.expect(STAGES)
    notes: tuple[Note | str, ...] = ()
    cloud: PointCloud = scan.cloud
    try:
        cloud = with_fields(cloud, progress=progress)
    except ReadError:
        notes = (NO_FIELDS,)
    rows = choose(scan)
    if rows is not None:
        cloud = cloud.take(rows)
    if not len(cloud):
        raise ReadError(tr("There are no points to export."))
    return len(cloud), (*notes, *write(cloud, path, progress=progress))


def _open_files(document: Document) -> list[Path]:
    return [path for scan in document.scans for path in scan.files]


def _is_same(path: Path, other: Path) -> bool:
    try:
        return path.samefile(other)
    except OSError:
        return False
