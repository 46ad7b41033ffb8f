"""Which columns the deformation table shows, in which order and how wide."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QTableView

from pipegui.i18n.texts import tr
from pipegui.panels.deformation_columns import COLUMNS, EXPENDABLE, INDEX, SHOWN_FIRST
from pipegui.panels.widgets import Applying
from pipegui.style import theme

ROOM = {"review": 12 * theme.SPACING, "comment": 12 * theme.SPACING}
"""Least widths of the columns that are still to be filled, in pixels."""


class TableColumns(QObject):
    """Columns by choice of the user, or as suits the room while there is none."""

    choices_changed = Signal()

    def __init__(self, view: QTableView) -> None:
        super().__init__(view)
        self._view, self._header = view, view.horizontalHeader()
        self._applying = Applying()
        self._follows_room = True
        self.menu = QMenu(tr("Columns"), view)
        self.actions: dict[str, QAction] = {}
        for column in COLUMNS:
            title = tr("Number") if column.title == "#" else tr(column.title)
            action = self.actions[column.key] = self.menu.addAction(title)
            action.setCheckable(True)
            action.toggled.connect(lambda on, key=column.key: self._set_one(key, on))
        self.menu.addSeparator()
        self.menu.addAction(tr("Reset columns"), self._reset)
        self._prepare_header()
        self.show(())
        view.viewport().installEventFilter(self)

    def _prepare_header(self) -> None:
        header = self._header
        header.setHighlightSections(False)
        header.setStretchLastSection(True)
        header.setSectionsMovable(True)
        # No column: the model's own order, which is by verdict, the deepest first.
        header.setSortIndicator(-1, Qt.SortOrder.AscendingOrder)
        header.setSortIndicatorClearable(True)
        header.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        header.customContextMenuRequested.connect(
            lambda at: self.menu.popup(header.mapToGlobal(at))
        )
        self._view.setSortingEnabled(True)
        header.sectionMoved.connect(self._choose_shown)
        header.sortIndicatorChanged.connect(lambda *_: self.fit())

    @property
    def shown(self) -> list[str]:
        """Keys of the columns that are shown, in their order."""
        order = [self._header.logicalIndex(i) for i in range(self._header.count())]
        return [COLUMNS[i].key for i in order if not self._header.isSectionHidden(i)]

    @property
    def first(self) -> int:
        """Index of the leftmost column in the model."""
        return INDEX[self.shown[0]]

    def show(self, keys: Sequence[str]) -> None:
        """Show these columns in this order; unknown ones are passed over.

        Without any, those are shown that the room allows.
        """
        known = [key for key in dict.fromkeys(keys) if key in INDEX]
        self._follows_room = not known
        order = list(known or SHOWN_FIRST)
        for i, column in enumerate(COLUMNS):
            if column.key not in order:  # hidden ones stay next to their neighbours
                order.insert(order.index(COLUMNS[i - 1].key) + 1 if i else 0, column.key)
        with self._applying:
            for place, key in enumerate(order):
                self._header.moveSection(self._header.visualIndex(INDEX[key]), place)
            self._set_shown(known or SHOWN_FIRST)
        self.fit()

    def _set_shown(self, keys: Collection[str]) -> None:
        for key, column in INDEX.items():
            self._view.setColumnHidden(column, key not in keys)
            self.actions[key].setChecked(key in keys)

    # What the user does

    def _set_one(self, key: str, shown: bool) -> None:
        if self._applying:
            return
        self._view.setColumnHidden(INDEX[key], not shown)
        if not self.shown:  # a table without columns could not be mended
            self.actions[key].setChecked(True)
            return
        self._choose_shown()
        self.fit()

    def _choose_shown(self, *_: object) -> None:
        if not self._applying:
            self._follows_room = False
            self.choices_changed.emit()

    def _reset(self) -> None:
        self.show(())
        self.choices_changed.emit()

    # Widths

    def fit(self) -> None:
        """Make the columns as wide as what is in them, and choose them if that is left to us."""
        with self._applying:
            if self._follows_room:
                self._set_shown(SHOWN_FIRST)
            self._fit_widths()
            if self._follows_room:
                self._set_shown(self._suiting())

    def _fit_widths(self) -> None:
        # Room for its arrow is made only in the column that the table is sorted by.
        self._header.setSortIndicatorShown(False)
        self._view.resizeColumnsToContents()
        self._header.setSortIndicatorShown(True)
        if 0 <= (sorted_by := self._header.sortIndicatorSection()) < self._header.count():
            self._view.resizeColumnToContents(sorted_by)
        for key, width in ROOM.items():
            column = INDEX[key]
            self._view.setColumnWidth(column, max(self._view.columnWidth(column), width))

    def _suiting(self) -> list[str]:
        """Return the default columns, less the least important until no scrolling is needed."""
        widths = {key: self._view.columnWidth(INDEX[key]) for key in SHOWN_FIRST}
        # The last one takes what is left.
        widths["comment"] = ROOM["comment"]
        for key in EXPENDABLE:
            if sum(widths.values()) <= self._view.viewport().width():
                break
            del widths[key]
        return list(widths)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802
        """Choose the columns anew when the table has become wider or narrower."""
        if event.type() == QEvent.Type.Resize and self._follows_room:
            self.fit()
        return super().eventFilter(watched, event)

    # Kept from one session to the next

    def choices(self) -> dict[str, Any]:
        """Return the columns that the user chose; none where that is left to the width."""
        return {"columns": [] if self._follows_room else self.shown}

    def choose(self, choices: Mapping[str, Any]) -> None:
        """Take the columns of last time; those of another version do no harm."""
        columns = choices.get("columns")
        self.show([str(key) for key in columns] if isinstance(columns, list) else [])
