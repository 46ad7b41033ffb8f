"""Starting the app: ``pipegui [FILE ...] [--detect] [--screenshot PNG]``."""

import argparse
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import pipecore


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the app; returns its exit code."""
    options = _parser().parse_args(arguments)

    # Qt and VTK take their time: `--help` does without them.
    from PySide6.QtCore import QSettings  # noqa: PLC0415
    from PySide6.QtWidgets import QApplication  # noqa: PLC0415

    from pipegui import theme  # noqa: PLC0415
    from pipegui.jobs import Jobs  # noqa: PLC0415
    from pipegui.main_window import MainWindow  # noqa: PLC0415
    from pipegui.parts import make_parts  # noqa: PLC0415

    app = QApplication.instance() or QApplication(sys.argv[:1])
    assert isinstance(app, QApplication)
    app.setApplicationName("PipeGUI")
    app.setOrganizationName("PipeGUI")
    app.setApplicationVersion(pipecore.__version__)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    theme.apply_theme(app)
    with TemporaryDirectory() as scratch:
        # A picture is the same on every machine: no layout of an earlier session.
        is_shot = options.screenshot is not None
        ini = QSettings.Format.IniFormat
        stored = QSettings(f"{scratch}/layout.ini", ini) if is_shot else QSettings()
        window = MainWindow(make_parts(), Jobs(), stored)
        window.show()
        if is_shot:
            from pipegui.screenshot import Screenshot  # noqa: PLC0415

            Screenshot(window, options.screenshot).ended.connect(app.exit)
        elif options.detect:
            window.jobs.scan_read.connect(lambda _: window.detect())
        window.open_files(options.files)
        code = app.exec()
        window.close()
        window.deleteLater()
        return code


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
