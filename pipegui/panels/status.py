"""The status bar: what is looked at, where the cursor is, how far the work is."""

from PySide6.QtCore import QTimer, Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QProgressBar, QStatusBar, QToolButton, QWidget

from pipegui.i18n.texts import tr
from pipegui.states import descriptions
from pipegui.states.unit_texts import unit_text
from pipegui.states.view_state import WindowState
from pipegui.style import theme
from pipegui.work.worker import Progressed

STEPS = 1000
"""Of the progress bar."""
SILENT_MS = 3000
"""After this long without a sign the bar only shows that work goes on."""


class StatusBar(QStatusBar):
    """Points and coordinates on the left, the running job on the right."""

    cancel_requested = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._title = ""
        self.scan = QLabel()
        self.cursor_position = QLabel()
        self.cursor_position.setAccessibleName(tr("Coordinates under the cursor"))
        self.job = QLabel()
        self.bar = QProgressBar()
        self.bar.setTextVisible(False)
        self.bar.setFixedWidth(16 * theme.SPACING)
        self.cancel = QToolButton()
        self.cancel.setText(tr("Cancel"))
        self.cancel.setAutoRaise(True)
        self.cancel.clicked.connect(self.cancel_requested)
        self._job_box = QWidget()
        row = QHBoxLayout(self._job_box)
        row.setContentsMargins(0, 0, theme.SPACING, 0)
        row.setSpacing(theme.SPACING)
        for widget in (self.job, self.bar, self.cancel):
            row.addWidget(widget)
        self.warming = QLabel(tr("Preparing the detection for this computer (once)…"))
        self.warming.setToolTip(tr("You can work meanwhile; a detection started now takes longer."))
        self.warming.hide()
        self.addPermanentWidget(self.warming)
        self.addWidget(self.scan)
        self.addWidget(self.cursor_position)
        self.addPermanentWidget(self._job_box)
        self._job_box.hide()
        self._silence = QTimer(self)
        self._silence.setSingleShot(True)
        self._silence.setInterval(SILENT_MS)
        self._silence.timeout.connect(self._show_working)

    def apply(self, state: WindowState) -> None:
        """Show which scan is looked at."""
        if state.scan is None:
            self.scan.setText(tr("No scan open"))
            self.cursor_position.clear()
            return
        cloud = state.scan.cloud
        parts = (descriptions.point_count(len(cloud)), cloud.crs, unit_text(cloud.unit))
        self.scan.setText(" · ".join(filter(None, parts)))
        self.scan.setToolTip(tr("Points, reference system and unit of the file"))

    def start(self, title: str) -> None:
        """Show that a job has begun."""
        self._title = title
        self.job.setText(f"{title}…")
        self.bar.setRange(0, 0)
        self.cancel.setEnabled(True)
        self._job_box.show()
        self._silence.start()

    def progress(self, event: Progressed) -> None:
        """Show how far a job is."""
        if not event.stage or not self.cancel.isEnabled():
            return
        self.bar.setRange(0, STEPS)
        self.bar.setValue(round(STEPS * event.fraction))
        parts = [f"{self._title}: {tr(event.stage)} {100 * event.fraction:.0f} %"]
        if event.seconds_left is not None:
            parts.append(_time_left(event.seconds_left))
        self.job.setText(" · ".join(parts))
        self._silence.start()

    def _show_working(self) -> None:
        """Show that the work goes on though it says nothing, as when kernels are compiled."""
        self.bar.setRange(0, 0)
        self.job.setText(
            tr("{job} · working (the first run takes longer)").format(
                job=self.job.text().split(" · ")[0]
            )
        )

    def show_beside(self, title: str) -> None:
        """Show what goes on beside the running job."""
        if title:
            self.showMessage(f"{title}…")
        else:
            self.clearMessage()

    def show_cancelling(self) -> None:
        """Answer a cancel at once, before the work has stopped."""
        if self._job_box.isVisible():
            self.cancel.setEnabled(False)
            self.job.setText(tr("Cancelling…"))
            self._silence.stop()

    def start_warming(self) -> None:
        """Say that the program gets ready for its first detection."""
        self.warming.show()

    def end_warming(self) -> None:
        """Say no more of it."""
        self.warming.hide()

    def end(self) -> None:
        """Show that nothing runs any more."""
        self._job_box.hide()
        self._silence.stop()


def _time_left(seconds: float) -> str:
    if seconds < 1:
        return tr("almost done")
    if seconds < 90:
        return tr("{seconds:.0f} s left").format(seconds=seconds)
    return tr("{seconds:.0f} min left").format(seconds=seconds / 60)
