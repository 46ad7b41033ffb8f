"""Compiling the detection's kernels once, in the background, before they are needed.

numba caches what it compiles on disk; a separate process fills that cache, so that the
window stays responsive. It is repeated whenever the program or numba has changed.
"""

import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

from PySide6.QtCore import QObject, QProcess, QSettings, Signal

import pipecore
from pipecore.resources import resource

KEY = "kernels/compiled"


def stamp() -> str:
    """Return what compiled kernels depend on: versions of program, numba, Python and kernels."""
    kernels = Path(pipecore.__file__).parent / "_kernels"
    newest = max((int(f.stat().st_mtime) for f in kernels.glob("*.py")), default=0)
    return f"{pipecore.__version__} {version('numba')} {newest} {sys.version_info[:2]}"


def detect_demo(folder: str) -> list[str]:
    """Return the command that compiles all: a detection on the demo scan."""
    demo = str(resource("demo", "demo.laz"))
    return [sys.executable, "-m", "pipecore", "detect", demo, "-o", f"{folder}/report", "--quiet"]


class KernelWarmup(QObject):
    """Runs the command once for each `stamp`."""

    started = Signal()
    ended = Signal()

    def __init__(
        self, stored: QSettings, command: Sequence[str] | None = None, parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self._stored = stored
        self._folder = TemporaryDirectory()
        self._command = list(command or detect_demo(self._folder.name))
        self._process = QProcess(self)
        self._process.finished.connect(self._finish)
        self._process.started.connect(self._lower_priority)

    def start(self) -> None:
        """Compile unless that was done before; not in a bundle, which has no interpreter."""
        if self._stored.value(KEY) == stamp() or getattr(sys, "frozen", False):
            return
        self.started.emit()
        self._process.start(self._command[0], self._command[1:])

    @property
    def is_running(self) -> bool:
        """Whether the command runs."""
        return self._process.state() == QProcess.ProcessState.Running

    def close(self) -> None:
        """Stop the command; what is compiled already stays cached."""
        self._process.finished.disconnect(self._finish)
        if self._process.state() != QProcess.ProcessState.NotRunning:
            self._process.kill()
            self._process.waitForFinished(3000)
        self._folder.cleanup()

    def _finish(self, code: int, status: QProcess.ExitStatus) -> None:
        if code == 0 and status == QProcess.ExitStatus.NormalExit:
            self._stored.setValue(KEY, stamp())
        self.ended.emit()

    def _lower_priority(self) -> None:
        """Give the process a low priority."""
        if hasattr(os, "setpriority"):
            with suppress(OSError):  # it has ended already
                os.setpriority(os.PRIO_PROCESS, self._process.processId(), 10)
