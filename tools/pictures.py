"""The pictures of README and user guide: `python -m tools.pictures`, in a display of any kind.

Drives the real window through the demo as a user would, and saves it to docs/images at each
station of the way, so that the pictures stay true.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PySide6.QtCore import QCoreApplication, QSettings, Qt
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QApplication

from pipecore.io import read
from pipecore.resources import resource
from pipegui.composition import Application, compose
from pipegui.panels.text_columns_dialog import TextColumnsDialog
from pipegui.style import theme
from pipegui.window.views import make_views
from pipegui.work.job_queue import JobQueue

IMAGES = Path(__file__).parents[1] / "docs" / "images"
SIZE = 1600, 1000
LOOK_AGAIN, PATIENCE = 0.7, 180.0
"""Seconds between looks at the window, and until it has to be at rest."""


def wait_for(condition: Callable[[], bool]) -> None:
    """Let the window live until something is so."""
    end = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError("the window did not get there")
        QCoreApplication.processEvents()
        time.sleep(0.01)


def linger(seconds: float) -> None:
    """Let the window live for a while."""
    end = time.monotonic() + seconds
    wait_for(lambda: time.monotonic() > end)


def picture(app: Application, name: str) -> None:
    """Save the window once it does not change any more."""
    last = QImage()
    end = time.monotonic() + PATIENCE
    while (now := app.window.grab().toImage()) != last and time.monotonic() < end:
        last = now
        linger(LOOK_AGAIN)
    save(now, name)


def save(image: QImage, name: str) -> None:
    """Save a picture."""
    path = IMAGES / f"{name}.png"
    if not image.save(str(path)):
        raise SystemExit(f"{path} could not be written")
    print(path.name, flush=True)


def walk(app: Application) -> None:
    """Go through the demo, with a picture at each station."""
    window, session = app.window, app.session
    panels, views, actions = window.panels, window.views, window.actions_
    picture(app, "guide-welcome")

    actions["demo"].trigger()
    wait_for(lambda: session.document.scan is not None and not session.jobs.is_busy)
    picture(app, "guide-opened")

    actions["detect"].trigger()
    wait_for(lambda: session.document.result is not None and not session.jobs.is_busy)
    picture(app, "main-window")

    panels.message.hide()
    panels.plots.setCurrentWidget(views.map)
    picture(app, "guide-map")

    panels.plots.setCurrentWidget(views.section)
    picture(app, "guide-section")

    panels.plots.setCurrentWidget(views.radius_plot)
    actions["show_surfaces"].setChecked(True)
    actions["fit"].trigger()
    picture(app, "guide-surfaces")
    actions["show_surfaces"].setChecked(False)

    actions["next_deformation"].trigger()
    actions["clip_to_selection"].trigger()
    picture(app, "guide-clip")
    actions["clip"].setChecked(False)

    panels.stacks.list.topLevelItem(0).setCheckState(0, Qt.CheckState.Checked)
    actions["fit"].trigger()
    picture(app, "guide-stacks")

    actions["appearance_dark"].trigger()
    panels.stacks.list.topLevelItem(0).setCheckState(0, Qt.CheckState.Unchecked)
    actions["previous_deformation"].trigger()
    picture(app, "guide-dark")


def text_columns(app: Application, folder: Path) -> None:
    """Show the dialog for the columns of a text file: the demo's points, the station first."""
    cloud = read(resource("demo", "demo.laz"))
    rows = np.arange(0, len(cloud), len(cloud) // 3000)
    station = 1 + np.arange(len(rows)) % 2
    grey = np.full(len(rows), 255)
    path = folder / "export.txt"
    world = cloud.world(cloud.xyz[rows].astype(float))
    np.savetxt(path, np.column_stack([station, world, grey]), fmt="%d %.3f %.3f %.3f %d")
    app.controllers.columns.open([path])
    dialog = app.window.findChild(TextColumnsDialog)
    for column, role in enumerate(("station", "x", "y", "z", "-")):
        dialog.table.role_chosen.emit(column, role)
    linger(LOOK_AGAIN)
    save(dialog.grab().toImage(), "guide-columns")
    dialog.reject()


def main() -> None:
    """Take all pictures."""
    qt = QApplication(sys.argv[:1])
    theme.apply_theme(qt)
    with TemporaryDirectory() as scratch:
        stored = QSettings(f"{scratch}/layout.ini", QSettings.Format.IniFormat)
        app = compose(make_views(), JobQueue(), stored)
        app.window.actions_["appearance_light"].trigger()
        app.window.resize(*SIZE)
        app.window.show()
        text_columns(app, Path(scratch))
        walk(app)
        app.controllers.project.discard_changes()
        app.window.close()
        app.window.deleteLater()


if __name__ == "__main__":
    main()
