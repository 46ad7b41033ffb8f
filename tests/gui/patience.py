"""Waiting for what a test needs, however slow the machine, and moving the mouse as a hand does."""

from collections.abc import Callable
from functools import partialmethod

from PySide6.QtCore import QPoint
from PySide6.QtWidgets import QWidget
from pytestqt.exceptions import TimeoutError as StillNotError
from pytestqt.qtbot import QtBot

PATIENCE = 120_000
"""Milliseconds. Nobody waits so long but for what never comes."""
REST = 2_000
"""For so long the mouse lies still before a hand moves it again."""
ASIDE = QPoint(3, 3)


class PatientBot(QtBot):
    """Waits `PATIENCE` where pytest-qt waits five seconds."""

    waitSignal = partialmethod(QtBot.waitSignal, timeout=PATIENCE)  # noqa: N815
    waitSignals = partialmethod(QtBot.waitSignals, timeout=PATIENCE)  # noqa: N815
    waitUntil = partialmethod(QtBot.waitUntil, timeout=PATIENCE)  # noqa: N815
    waitExposed = partialmethod(QtBot.waitExposed, timeout=PATIENCE)  # noqa: N815
    waitActive = partialmethod(QtBot.waitActive, timeout=PATIENCE)  # noqa: N815


def hover(qtbot: QtBot, widget: QWidget, position: QPoint, is_told: Callable[[], bool]) -> None:
    """Rest the mouse at `position` until `is_told`; if that does not come, move it again.

    One move is not enough. The display may hand over several as one, and a move to where the
    mouse has been before is then none: it may have been left there by the test before.
    """
    n_tries = PATIENCE // REST
    for i in range(1, n_tries + 1):
        qtbot.mouseMove(widget, position + ASIDE)
        qtbot.mouseMove(widget, position)
        try:
            qtbot.waitUntil(is_told, timeout=REST)
        except StillNotError:
            if i == n_tries:
                raise
        else:
            return
