"""Unexpected exceptions: shown in the window, without ending the program."""

import platform
import sys
import threading
import traceback
from types import TracebackType

from PySide6.QtCore import QObject, Signal, qVersion

import pipecore
from pipegui.i18n.texts import tr


class CrashGuard(QObject):
    """Reports exceptions that Python would only print, from any thread, while it is installed."""

    happened = Signal(str, str)
    """Message, and details for a bug report; in the window's thread."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._hooks = sys.excepthook, threading.excepthook

    def install(self) -> None:
        """Report exceptions from now on; they are printed as well."""
        self._hooks = sys.excepthook, threading.excepthook
        sys.excepthook = self.report
        threading.excepthook = self._report_from_thread

    def uninstall(self) -> None:
        """Restore the hooks that were there before."""
        sys.excepthook, threading.excepthook = self._hooks

    def report(
        self, kind: type[BaseException], error: BaseException, trace: TracebackType | None
    ) -> None:
        """Report an exception of the main thread."""
        self._hooks[0](kind, error, trace)
        if issubclass(kind, Exception):
            self._report(kind, error, trace)

    def _report_from_thread(self, args: threading.ExceptHookArgs) -> None:
        self._hooks[1](args)
        if issubclass(args.exc_type, Exception) and args.exc_value is not None:
            self._report(args.exc_type, args.exc_value, args.exc_traceback)

    def _report(
        self, kind: type[BaseException], error: BaseException, trace: TracebackType | None
    ) -> None:
        message = tr(
            "Something went wrong inside the program ({kind}). Your work is still "
            "here; save it, and send the details to the developers."
        ).format(kind=kind.__name__)
        lines = traceback.format_exception(kind, error, trace)
        self.happened.emit(message, f"{describe_system()}\n\n{''.join(lines)}")


def describe_system() -> str:
    """Return versions of program, Python, Qt and operating system."""
    return (
        f"PipeGUI {pipecore.__version__}, Python {platform.python_version()}, "
        f"Qt {qVersion()}, {platform.platform()}"
    )
