"""Waiting for what a test needs, however slow the machine, and doing as a hand does."""

from collections.abc import Callable
from functools import partialmethod
from typing import Any

from PySide6.QtCore import QCoreApplication, QPoint, Qt, QTimer
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QWidget
from pytestqt.exceptions import TimeoutError as StillNotError
from pytestqt.qtbot import QtBot

PATIENCE = 120_000
"""Milliseconds. Nobody waits so long but for what never comes."""
PATIENCE_S = PATIENCE / 1000
"""For what is not Qt's."""
REST = 2_000
"""For so long the mouse lies still before a hand moves it again."""
APART = 50
"""pyqtgraph takes no notice of moves that come faster than 100 in a second."""
ASIDE = QPoint(3, 3)


class PatientBot(QtBot):
    """Waits `PATIENCE` where pytest-qt waits five seconds; types into windows that can hear it."""

    waitSignal = partialmethod(QtBot.waitSignal, timeout=PATIENCE)  # noqa: N815
    waitSignals = partialmethod(QtBot.waitSignals, timeout=PATIENCE)  # noqa: N815
    waitUntil = partialmethod(QtBot.waitUntil, timeout=PATIENCE)  # noqa: N815
    waitExposed = partialmethod(QtBot.waitExposed, timeout=PATIENCE)  # noqa: N815
    waitActive = partialmethod(QtBot.waitActive, timeout=PATIENCE)  # noqa: N815

    def keyClick(self, widget: QWidget, *args: Any) -> None:  # noqa: N802
        """Press a key in an active window: in others, shortcuts do not hear it."""
        self._activate(widget.window())
        super().keyClick(widget, *args)

    def keyClicks(self, widget: QWidget, *args: Any) -> None:  # noqa: N802
        """Type in an active window."""
        self._activate(widget.window())
        super().keyClicks(widget, *args)

    def _activate(self, window: QWidget) -> None:
        if window.isVisible() and not window.isActiveWindow():
            window.activateWindow()
            self.waitUntil(window.isActiveWindow)


def hover(
    qtbot: QtBot, widget: QWidget, place: Callable[[], QPoint], is_told: Callable[[], bool]
) -> None:
    """Rest the mouse at a place until `is_told`; if that does not come, move it again.

    One move is not enough. The display may hand over several as one, and a move to where the
    mouse has been before is then none: it may have been left there by the test before. And the
    place itself moves while a window is laid out.
    """
    n_tries = PATIENCE // REST
    for i in range(1, n_tries + 1):
        at = place()
        qtbot.mouseMove(widget, at + ASIDE)
        qtbot.wait(APART)
        qtbot.mouseMove(widget, at)
        try:
            qtbot.waitUntil(is_told, timeout=REST)
        except StillNotError:
            if i == n_tries:
                raise
        else:
            return


def seen_after(ms: int, look: Callable[[], Any]) -> list[Any]:
    """Return a list that comes to hold what `look` returns after so many milliseconds.

    Timers fire in their order, however late they are: a test that asks what has happened by
    then, instead of how long it took, has the same answer on a slow machine.
    """
    seen: list[Any] = []
    timer = QTimer(QCoreApplication.instance(), singleShot=True, interval=ms)
    timer.setTimerType(Qt.TimerType.PreciseTimer)
    timer.timeout.connect(lambda: seen.append(look()))
    timer.timeout.connect(timer.deleteLater)
    timer.start()
    return seen


STILL_MS, STILL_LOOKS = 60, 4


def wait_until_still(
    qtbot: QtBot, take: Callable[[], QImage], is_ready: Callable[[], bool] = lambda: True
) -> QImage:
    """Return a picture once several looks at it, some time apart, have been the same."""
    looks = [take()]

    def is_still() -> bool:
        qtbot.wait(STILL_MS)
        looks.append(take())
        if not is_ready() or looks[-1] != looks[-2]:
            del looks[:-1]
        return len(looks) == STILL_LOOKS

    qtbot.waitUntil(is_still)
    return looks[-1]
