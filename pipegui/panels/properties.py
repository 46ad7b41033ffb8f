"""The properties panel: what is known of the selection, with its uncertainty."""

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QGuiApplication, QKeySequence
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QStackedLayout,
    QTreeWidget,
    QTreeWidgetItem,
    QWidget,
)

from pipegui.i18n.texts import tr
from pipegui.panels.widgets import EmptyHint, items_of
from pipegui.states.descriptions import Heading, properties
from pipegui.states.view_state import PropertiesState
from pipegui.style import theme


class PropertiesPanel(QWidget):
    """A list of labels and values under headings."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.list = QTreeWidget()
        self.list.setAccessibleName(tr("Properties"))
        self.list.setColumnCount(2)
        self.list.setHeaderHidden(True)
        self.list.setRootIsDecorated(False)
        self.list.setIndentation(0)
        self.list.setUniformRowHeights(True)
        self.list.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.list.header().setSectionResizeMode(0, QHeaderView.ResizeMode.ResizeToContents)
        self.list.header().setStretchLastSection(True)
        copy = QAction(tr("Copy"), self.list)
        theme.set_icon(copy, "content-copy")
        copy.setShortcut(QKeySequence(QKeySequence.StandardKey.Copy))
        copy.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)
        copy.triggered.connect(self.copy)
        self.list.addAction(copy)
        self.list.setContextMenuPolicy(Qt.ContextMenuPolicy.ActionsContextMenu)
        self._empty = EmptyHint(tr("Radius, size and position of what you select appear here."))
        self._layout = QStackedLayout(self)
        self._layout.addWidget(self._empty)
        self._layout.addWidget(self.list)

    def apply(self, state: PropertiesState) -> None:
        """Show a state."""
        self.list.clear()
        for line in properties(state):
            item = QTreeWidgetItem(self.list)
            item.setText(0, line.text if isinstance(line, Heading) else line.label)
            if isinstance(line, Heading):
                item.setFirstColumnSpanned(True)
                font = item.font(0)
                font.setBold(True)
                item.setFont(0, font)
                item.setFlags(Qt.ItemFlag.ItemIsEnabled)
                continue
            item.setForeground(0, theme.colour("muted"))
            item.setText(1, line.text)
            item.setData(1, Qt.ItemDataRole.UserRole, line.plain or line.text)
            if line.verdict is not None:
                item.setIcon(1, theme.verdict_icon(line.verdict))
            if not line.is_measurable:
                item.setForeground(1, theme.colour("muted"))
            item.setToolTip(0, line.hint)
            item.setToolTip(1, line.hint or line.text)
        self._layout.setCurrentWidget(self.list if state.scan else self._empty)

    def copy(self) -> None:
        """Copy the selected lines (all, if none is) as label and plain number."""
        every = items_of(self.list)
        lines = [item for item in every if item.isSelected()] or every
        text = "".join(
            f"{item.text(0)}\t{item.data(1, Qt.ItemDataRole.UserRole) or ''}\n" for item in lines
        )
        QGuiApplication.clipboard().setText(text)
