"""A picture of the window without anybody at the screen, for ``pipegui --screenshot``."""

import sys
from pathlib import Path

from PySide6.QtCore import QObject, QTimer, Signal

from pipegui.main_window import MainWindow

SETTLING_MS = 1500
"""The camera's flight and the plots' first drawing, with plenty to spare without a GPU."""


class Screenshot(QObject):
    """Opens, detects, waits until all is drawn, saves the picture and ends."""

    ended = Signal(int)
    """Exit code: 0 if the picture was saved, else 1."""

    def __init__(self, window: MainWindow, path: Path) -> None:
        super().__init__(window)
        self._window, self._path = window, path
        window.jobs.scan_read.connect(lambda _: window.detect())
        window.jobs.detected.connect(lambda *_: QTimer.singleShot(SETTLING_MS, self._save))
        window.jobs.failed.connect(self._fail)

    def _save(self) -> None:
        if not self._window.grab().save(str(self._path)):
            self._fail(f"The picture could not be written to {self._path}.")
        else:
            self.ended.emit(0)

    def _fail(self, message: str, details: str = "") -> None:
        print(message, details, sep="\n", file=sys.stderr)
        self.ended.emit(1)
