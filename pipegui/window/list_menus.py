"""Menus that list what changes: the files opened last, the steps of the history."""

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QMenu, QWidget

from pipegui.i18n.texts import tr


class RecentFilesMenu(QMenu):
    """Lists the files opened last."""

    chosen = Signal(object)
    """Path of a file."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(tr("Open recent"), parent)
        self.setToolTipsVisible(True)

    def show_paths(self, paths: Sequence[Path]) -> None:
        """List files, the one opened last first."""
        self.clear()
        self.setEnabled(bool(paths))
        for path in paths:
            action = self.addAction(path.name)
            action.setToolTip(str(path))
            action.triggered.connect(lambda _=False, path=path: self.chosen.emit(path))


class HistoryMenu(QMenu):
    """Lists the steps that were done and undone; a click goes back or forward to a step."""

    chosen = Signal(int)
    """How many steps shall be done."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(tr("History"), parent)

    def show_steps(self, steps: Sequence[str], n_done: int) -> None:
        """List steps, the first `n_done` of them done, the others undone."""
        self.clear()
        self.setEnabled(bool(steps))
        for n, text in enumerate([tr("Start"), *map(tr, steps)]):
            action = self.addAction(text)
            action.setCheckable(True)
            action.setChecked(n == n_done)
            action.triggered.connect(lambda _=False, n=n: self.chosen.emit(n))
