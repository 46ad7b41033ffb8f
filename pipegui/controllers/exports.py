"""Exports: tables, pictures, plots and the whole report, as files."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtGui import QImage
from PySide6.QtWidgets import QWidget

import pipecore
from pipecore.errors import WriteError
from pipecore.progress import Progress
from pipegui.controllers import file_dialogs
from pipegui.controllers.session import Session
from pipegui.i18n.texts import inside, mark, tr
from pipegui.plots.chart import Chart
from pipegui.states import descriptions

CSV = mark("Tables (*.csv)")
EXPORT = {
    "deformations": mark("Export deformations"),
    "elements": mark("Export elements"),
    "profiles": mark("Export profiles"),
}


class Exports:
    """Asks where to, and writes.

    Parameters
    ----------
    session : Session
        Its active scan is exported.
    window : QWidget
        Dialogs open over it.
    screenshot : callable
        Returns what the 3D view shows.
    """

    def __init__(self, session: Session, window: QWidget, screenshot: Callable[[], QImage]) -> None:
        self._session, self._window = session, window
        self._screenshot = screenshot

    def export_table(self, table: str) -> None:
        """Write a table as CSV: "deformations", "elements" or "profiles"."""
        from pipecore import report  # noqa: PLC0415 - matplotlib and jinja2 take their time

        scan = self._session.document.scan
        if scan is None or scan.result is None:
            return
        more = {"deformations": scan.reviews, "elements": scan.cloud}
        content = (scan.result, more[table]) if table in more else (scan.result,)
        write = getattr(report, f"write_{table}_csv")
        name = f"{self._stem()} {table}.csv"
        self._save(tr(EXPORT[table]), name, tr(CSV), lambda path: write(path, *content))

    def export_picture(self) -> None:
        """Save what the 3D view shows."""

        def write(path: Path) -> None:
            if not self._screenshot().save(str(path)):
                raise WriteError(tr("the folder cannot be written to."))

        self._save(tr("Save picture"), f"{self._stem()}.png", tr("Pictures (*.png)"), write)

    def save_plot(self, plot: Chart, ending: str) -> None:
        """Save a plot as a picture ("png", "svg") or as numbers ("csv")."""
        document, what = self._session.document, plot.accessibleName()
        selected = descriptions.title(document.result, document.selection)
        name = f"{self._stem()} {selected.replace(' · ', ' ')} {what.lower()}.{ending}"
        names = {"png": tr("Pictures (*.png)"), "svg": tr("Drawings (*.svg)"), "csv": tr(CSV)}

        def write(path: Path) -> None:
            with pipecore.io.write_file(path) as temporary:
                temporary.write_bytes(plot.as_file(ending))

        self._save(tr("Save {what}").format(what=inside(what)), name, names[ending], write)

    def export_report(self) -> None:
        """Write the whole report in the background."""
        from pipecore import report  # noqa: PLC0415 - matplotlib and jinja2 take their time

        session, scan = self._session, self._session.document.scan
        if scan is None or scan.result is None:
            return
        folder = file_dialogs.ask_report_folder(
            self._window, session.stored, f"{self._stem()} report"
        )
        if folder is None:
            return
        cloud, result, reviews = scan.cloud, scan.result, scan.reviews

        def write(progress: Progress) -> None:
            report.write_report(folder, cloud, result, reviews=reviews, progress=progress)

        session.jobs.write(folder, write)

    def _stem(self) -> str:
        scan = self._session.document.scan
        return Path(scan.name).stem if scan else "pipes"

    def _save(self, title: str, name: str, name_filter: str, write: Callable[[Path], None]) -> None:
        file_dialogs.save_as(self._session, self._window, title, name, name_filter, write)
