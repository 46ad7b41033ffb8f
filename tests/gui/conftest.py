"""Fixtures of the window's tests: a window over fakes, and a check that nothing is left."""

import gc
import threading
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

import pytest
import shiboken6
from PySide6.QtCore import QCoreApplication, QEvent, QSettings, QStandardPaths
from PySide6.QtGui import QCursor
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from pipegui.composition import Application, compose
from pipegui.i18n import texts
from pipegui.model.document import Document, Scan
from pipegui.style import theme
from pipegui.window.main_window import MainWindow
from pipegui.work.job_queue import JobQueue
from tests.factories import make_cloud, make_result
from tests.gui.fakes import make_fake_views
from tests.gui.patience import PATIENCE, PatientBot


@pytest.fixture(scope="session")
def qapp(qapp: QApplication) -> QApplication:
    QStandardPaths.setTestModeEnabled(True)
    # The letters of a word typed into a choice belong together, however slowly they come.
    qapp.setKeyboardInputInterval(PATIENCE)
    theme.apply_theme(qapp)
    return qapp


@pytest.fixture
def qtbot(qapp: QApplication, request: pytest.FixtureRequest) -> QtBot:
    """In place of pytest-qt's own, which gives up after five seconds."""
    return PatientBot(request)


def _flush() -> None:
    for _ in range(3):
        QCoreApplication.processEvents()
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
        gc.collect()


def _top_level(app: QApplication) -> dict[int, str]:
    """Top-level widgets by their address in C++: Python's own may be a new one each time."""
    return {shiboken6.getCppPointer(w)[0]: repr(w) for w in app.topLevelWidgets()}


def _render_windows() -> set[int]:
    """Ids of the VTK render windows that are alive; without VTK loaded there are none."""
    import sys

    core = sys.modules.get("vtkmodules.vtkRenderingCore")
    if core is None:
        return set()
    return {id(o) for o in gc.get_objects() if isinstance(o, core.vtkRenderWindow)}


def pytest_collection_finish(session: pytest.Session) -> None:
    """Let the collector look at what tests make only: after each it looks several times."""
    gc.collect()
    gc.freeze()


HAS_FAILED = pytest.StashKey[bool]()
ENDING_S = 20.0
"""What a thread is given to end after its test."""


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    report = yield
    item.stash[HAS_FAILED] = item.stash.get(HAS_FAILED, False) or report.failed
    return report


def _clear_away(app: QApplication, windows: Collection[int]) -> None:
    """Close what a test left open: the next one needs the keyboard for itself.

    Nothing is deleted: what holds on to it may still use it.
    """
    while (popup := app.activePopupWidget()) is not None:
        popup.close()
    for widget in app.topLevelWidgets():
        is_new = shiboken6.getCppPointer(widget)[0] not in windows
        if is_new and widget.isVisible():
            if isinstance(widget, MainWindow):
                widget.may_close = lambda: True
            widget.close()
    _flush()


@pytest.fixture(autouse=True)
def no_leaks(request: pytest.FixtureRequest) -> Iterator[None]:
    """Fail a test that leaves a window, a running thread or a VTK render window behind.

    Of a test that failed already this is not asked: the report of its failure holds on to them.
    """
    if "qtbot" not in request.fixturenames:
        yield
        return
    # Made before the test's own fixtures, and so looked at after they are gone.
    app = request.getfixturevalue("qapp")
    # Where no window comes to lie under it, wherever the last test has left it.
    QCursor.setPos(app.primaryScreen().geometry().bottomRight())
    windows = _top_level(app)
    threads, render_windows = set(threading.enumerate()), _render_windows()
    yield
    request.node.funcargs.clear()  # pytest's own references to what the fixtures made
    _flush()
    for thread in set(threading.enumerate()) - threads:
        thread.join(ENDING_S)
    left = [name for address, name in _top_level(app).items() if address not in windows]
    running = [t for t in threading.enumerate() if t not in threads and t.is_alive()]
    rendering = _render_windows() - render_windows
    if left:
        _clear_away(app, windows)
    if request.node.stash.get(HAS_FAILED, False):
        return
    assert not left, f"top-level widgets left behind: {left}"
    assert not running, f"threads left running: {running}"
    assert not rendering, f"{len(rendering)} VTK render windows left behind"


@pytest.fixture
def colours_of_the_system(qapp: QApplication) -> Iterator[None]:
    """For tests that choose dark or light: the next one finds what all others find."""
    yield
    theme.choose(theme.Appearance.SYSTEM)
    theme.apply_theme(qapp)


@pytest.fixture
def german() -> Iterator[None]:
    """The window speaks German."""
    texts.use_language("de")
    yield
    texts.use_language("en")


@pytest.fixture
def document() -> Document:
    """One scan, detected."""
    cloud, result = make_cloud(), make_result()
    return Document(scans=(Scan("plant.laz", cloud, result),))


@pytest.fixture
def make_app(qtbot: QtBot, tmp_path: Path, no_leaks: None) -> Iterator[Callable[..., Application]]:
    """Make windows over fakes; `read` and `detect` replace pipecore's."""
    cloud, result = make_cloud(), make_result()
    apps: list[Application] = []

    def make(
        read=lambda *_: cloud,
        detect=lambda *_: result,
        views=None,
        plan=lambda *_: None,
        copies=None,
    ) -> Application:
        stored = QSettings(str(tmp_path / "window.ini"), QSettings.Format.IniFormat)
        app = compose(views or make_fake_views(), JobQueue(read, detect, plan), stored, copies)
        apps.append(app)
        app.window.resize(1366, 768)
        with qtbot.waitActive(app.window):  # without it keys do not reach the shortcuts
            app.window.show()
            app.window.activateWindow()
        return app

    yield make
    for app in apps:
        app.controllers.project.discard_changes()
        app.window.close()
        app.window.deleteLater()
    apps.clear()
    _flush()


@pytest.fixture
def app(make_app: Callable[..., Application]) -> Application:
    """A window with nothing open."""
    return make_app()


@pytest.fixture
def detected(qtbot: QtBot, app: Application) -> Application:
    """A window with a scan open and detected."""
    app.controllers.scans.open_files([Path("plant.laz")])
    qtbot.waitUntil(lambda: app.session.document.scan is not None)
    app.controllers.scans.detect()
    qtbot.waitUntil(
        lambda: app.session.document.result is not None and not app.session.jobs.is_busy
    )
    return app
