"""A picture of the window without anybody at the screen, for ``pipegui --screenshot``."""

import sys
from pathlib import Path

from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QWidget

from pipegui.work.job_queue import JobQueue

LOOK_AGAIN_MS = 700
MAX_LOOKS = 40
"""Pictures taken in vain, after which the next is saved as it is."""


class Screenshot(QObject):
    """Once a detection has ended, waits until all is drawn, saves the picture and ends.

    Parameters
    ----------
    window : QWidget
        What the picture is of.
    jobs : JobQueue
        Detects.
    path : Path
        Where the picture is saved.
    """

    ended = Signal(int)
    """Exit code: 0 if the picture was saved, else 1."""

    def __init__(self, window: QWidget, jobs: JobQueue, path: Path) -> None:
        super().__init__(window)
        self._window, self._path = window, path
        jobs.detected.connect(lambda *_: self._look_again())
        jobs.failed.connect(self._fail)
        jobs.read_failed.connect(lambda _, message, details: self._fail(message, details))
        self._last: QImage | None = None
        self._n_looks = 0

    def _look_again(self) -> None:
        QTimer.singleShot(LOOK_AGAIN_MS, self, self._look)

    def _look(self) -> None:
        """Save the picture once it does not change any more: camera at rest, all drawn."""
        picture = self._window.grab().toImage()
        self._n_looks += 1
        if picture != self._last and self._n_looks < MAX_LOOKS:
            self._last = picture
            self._look_again()
        elif not picture.save(str(self._path)):
            self._fail(f"The picture could not be written to {self._path}.")
        else:
            self.ended.emit(0)

    def _fail(self, message: str, details: str = "") -> None:
        print(message, details, sep="\n", file=sys.stderr)
        self.ended.emit(1)
