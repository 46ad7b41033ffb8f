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
    if options.choose_settings is not None:
        return _choose_settings(options.choose_settings)

    # Qt and VTK take their time: `--help` does without them.
    from PySide6.QtCore import QSettings  # noqa: PLC0415
    from PySide6.QtWidgets import QApplication  # noqa: PLC0415

    from pipegui.composition import compose  # noqa: PLC0415
    from pipegui.connections import connect_crash_guard  # noqa: PLC0415
    from pipegui.screenshot import Screenshot  # noqa: PLC0415
    from pipegui.style import theme  # noqa: PLC0415
    from pipegui.window.views import make_views  # noqa: PLC0415
    from pipegui.work.crash_guard import CrashGuard  # noqa: PLC0415
    from pipegui.work.job_queue import JobQueue  # noqa: PLC0415
    from pipegui.work.kernel_warmup import KernelWarmup  # noqa: PLC0415

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
        _use_language(app, "en" if is_shot else str(stored.value("language", "")))
        theme.apply_theme(app)
        application = compose(
            make_views(), JobQueue(), stored, None if is_shot else _folder_for_copies()
        )
        window, session = application.window, application.session
        scans, autosave = application.controllers.scans, application.controllers.autosave
        guard = CrashGuard(window)
        connect_crash_guard(guard, session, application.controllers)
        guard.install()
        window.show()
        warmup = KernelWarmup(stored)
        warmup.started.connect(window.status.start_warming)
        warmup.ended.connect(window.status.end_warming)
        if is_shot:
            Screenshot(window, session.jobs, options.screenshot).ended.connect(app.exit)
        else:
            warmup.start()
        if is_shot or options.detect:
            session.jobs.scan_read.connect(lambda _: scans.detect())
        scans.open_files(options.files)
        if autosave is not None:
            autosave.offer_recovery()
        code = app.exec()
        warmup.close()
        guard.uninstall()
        application.controllers.project.discard_changes()
        window.close()
        window.deleteLater()
        return code


def _choose_settings(path: Path) -> int:
    """Show the settings of a file alone; returns 0 if they were kept, else 1."""
    from PySide6.QtCore import QSettings  # noqa: PLC0415
    from PySide6.QtWidgets import QApplication  # noqa: PLC0415

    from pipegui.style import theme  # noqa: PLC0415

    app = QApplication.instance() or QApplication(sys.argv[:1])
    assert isinstance(app, QApplication)
    app.setApplicationName("PipeGUI")
    app.setOrganizationName("PipeGUI")
    _use_language(app, str(QSettings().value("language", "")))
    theme.apply_theme(app)

    from pipegui.window.settings_window import SettingsWindow  # noqa: PLC0415

    return 0 if SettingsWindow(path).exec() else 1


def _use_language(app: "QApplication", chosen: str) -> None:
    """Translate all texts, Qt's own too; numbers keep the decimal point."""
    from PySide6.QtCore import QLibraryInfo, QLocale, QTranslator  # noqa: PLC0415

    from pipegui.i18n import texts  # noqa: PLC0415

    texts.use_language(chosen, QLocale.system().uiLanguages()[0])
    QLocale.setDefault(QLocale.c())
    if texts.language() != "en":
        translator = QTranslator(app)
        folder = QLibraryInfo.path(QLibraryInfo.LibraryPath.TranslationsPath)
        if translator.load(f"qtbase_{texts.language()}", folder):
            app.installTranslator(translator)


def _folder_for_copies() -> Path:
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
    parser.add_argument(
        "--choose-settings",
        type=Path,
        metavar="TOML",
        help="show the settings of a file alone, keep them there and quit",
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {pipecore.__version__}")
    return parser
