"""A picture of the window without anybody at the screen, for ``pipegui --screenshot``."""

import sys
from pathlib import Path

from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtGui import QImage

from pipegui.window.main_window import MainWindow

LOOK_AGAIN_MS = 700
PATIENCE = 40
"""Looks after which the picture is taken as it is."""


class Screenshot(QObject):
    """Opens, detects, waits until all is drawn, saves the picture and ends."""

    ended = Signal(int)
    """Exit code: 0 if the picture was saved, else 1."""

    def __init__(self, window: MainWindow, path: Path) -> None:
        super().__init__(window)
        self._window, self._path = window, path
        window.jobs.scan_read.connect(lambda _: window.detect())
        window.jobs.detected.connect(lambda *_: self._look_again())
        window.jobs.failed.connect(self._fail)
        self._last: QImage | None = None
        self._n_looks = 0

    def _look_again(self) -> None:
        QTimer.singleShot(LOOK_AGAIN_MS, self, self._look)

    def _look(self) -> None:
        """Save the picture once it does not change any more: camera at rest, all drawn."""
        picture = self._window.grab().toImage()
        self._n_looks += 1
        if picture != self._last and self._n_looks < PATIENCE:
            self._last = picture
            self._look_again()
        elif not picture.save(str(self._path)):
            self._fail(f"The picture could not be written to {self._path}.")
        else:
            self.ended.emit(0)

    def _fail(self, message: str, details: str = "") -> None:
        print(message, details, sep="\n", file=sys.stderr)
        self.ended.emit(1)
