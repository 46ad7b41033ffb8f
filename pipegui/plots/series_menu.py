"""A menu of what a plot shows, each with a check mark."""

from collections.abc import Collection, Mapping

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QWidget

from pipegui.i18n.texts import tr


class SeriesMenu(QMenu):
    """Check marks by name.

    Parameters
    ----------
    texts : mapping of str to str
        What each is called, by its name; marked for translation.
    at_first : collection of str
        Names of those that are shown until the user chooses.
    groups : collection of str, optional
        Names of those that begin a group.
    """

    changed = Signal()

    def __init__(
        self,
        texts: Mapping[str, str],
        at_first: Collection[str],
        groups: Collection[str] = (),
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.series: dict[str, QAction] = {}
        for name, text in texts.items():
            if name in groups:
                self.addSeparator()
            action = self.series[name] = self.addAction(tr(text))
            action.setCheckable(True)
            action.setChecked(name in at_first)
            action.toggled.connect(lambda _: self.changed.emit())

    def shows(self, name: str) -> bool:
        """Return whether a series is to be shown."""
        return self.series[name].isChecked()

    @property
    def shown(self) -> list[str]:
        """Names of what is to be shown."""
        return [name for name in self.series if self.shows(name)]

    def choose(self, names: object) -> None:
        """Show these and no others; what is no list of names changes nothing."""
        if not isinstance(names, list):
            return
        for name, action in self.series.items():
            with QSignalBlocker(action):
                action.setChecked(name in names)
        self.changed.emit()
