"""Starting the app: ``pipegui [FILE ...] [--detect] [--screenshot PNG]``."""

import argparse
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import pipecore

if TYPE_CHECKING:
    from PySide6.QtWidgets import QApplication


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the app; returns its exit code."""
    options = _parser().parse_args(arguments)

    # Qt and VTK take their time: `--help` does without them.
    from PySide6.QtCore import QSettings  # noqa: PLC0415
    from PySide6.QtWidgets import QApplication  # noqa: PLC0415

    from pipegui.style import theme  # noqa: PLC0415
    from pipegui.window.main_window import MainWindow  # noqa: PLC0415
    from pipegui.window.views import make_parts  # noqa: PLC0415
    from pipegui.work.crash_guard import CrashGuard  # noqa: PLC0415
    from pipegui.work.job_queue import Jobs  # noqa: PLC0415
    from pipegui.work.kernel_warmup import Warming  # noqa: PLC0415

    app = QApplication.instance() or QApplication(sys.argv[:1])
    assert isinstance(app, QApplication)
    app.setApplicationName("PipeGUI")
    app.setOrganizationName("PipeGUI")
    app.setApplicationVersion(pipecore.__version__)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    with TemporaryDirectory() as scratch:
        # A picture is the same on every machine: no layout of an earlier session.
        is_shot = options.screenshot is not None
        ini = QSettings.Format.IniFormat
        stored = QSettings(f"{scratch}/layout.ini", ini) if is_shot else QSettings()
        _speak(app, "en" if is_shot else str(stored.value("language", "")))
        theme.apply_theme(app)
        window = MainWindow(make_parts(), Jobs(), stored, None if is_shot else _rescue_folder())
        guard = CrashGuard(window)
        guard.happened.connect(window.tell_crash)
        guard.install()
        window.show()
        warming = Warming(stored)
        warming.started.connect(window.status.start_warming)
        warming.ended.connect(window.status.end_warming)
        if not is_shot:
            warming.start()
        if is_shot:
            from pipegui.screenshot import Screenshot  # noqa: PLC0415

            Screenshot(window, options.screenshot).ended.connect(app.exit)
        elif options.detect:
            window.jobs.scan_read.connect(lambda _: window.detect())
        window.open_files(options.files)
        if window.projects.rescue is not None:
            window.projects.rescue.offer()
        code = app.exec()
        warming.close()
        guard.uninstall()
        window.projects.discard()
        window.close()
        window.deleteLater()
        return code


def _speak(app: "QApplication", chosen: str) -> None:
    """Choose the language of all texts, Qt's own too; numbers keep the decimal point."""
    from PySide6.QtCore import QLibraryInfo, QLocale, QTranslator  # noqa: PLC0415

    from pipegui.i18n import texts  # noqa: PLC0415

    texts.use_language(chosen, QLocale.system().uiLanguages()[0])
    QLocale.setDefault(QLocale.c())
    if texts.language() != "en":
        translator = QTranslator(app)
        folder = QLibraryInfo.path(QLibraryInfo.LibraryPath.TranslationsPath)
        if translator.load(f"qtbase_{texts.language()}", folder):
            app.installTranslator(translator)


def _rescue_folder() -> Path:
    from PySide6.QtCore import QStandardPaths  # noqa: PLC0415

    data = QStandardPaths.StandardLocation.AppDataLocation
    return Path(QStandardPaths.writableLocation(data)) / "unsaved"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="pipegui", description=pipecore.__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE", help="laser scans to open")
    parser.add_argument("--detect", action="store_true", help="detect as soon as they are read")
    parser.add_argument(
        "--screenshot",
        type=Path,
        metavar="PNG",
        help="open, detect, select the worst deformation, save a picture of the window and quit",
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {pipecore.__version__}")
    return parser
