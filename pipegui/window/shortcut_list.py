"""The list of all shortcuts, by menu, and of those that work inside a panel."""

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QGridLayout,
    QLabel,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from pipegui.i18n.texts import mark, plain_title, tr
from pipegui.style import theme
from pipegui.window.action_table import MENUS
from pipegui.window.actions import Actions

IN_PANELS = {
    mark("Deformations"): (
        ("↑ ↓", mark("Previous and next deformation")),
        ("F2", mark("Write a comment, choose a review")),
        ("Ctrl+A", mark("Select all rows")),
        ("Ctrl+C", mark("Copy rows for a spreadsheet")),
    ),
    mark("Plots"): (
        ("← →", mark("Previous and next profile")),
        (mark("Page Up, Page Down"), mark("Ten profiles further")),
        (mark("Home, End"), mark("First and last profile")),
        ("Ctrl+C", mark("Copy the numbers")),
        ("Ctrl+Shift+C", mark("Copy the picture")),
    ),
}
"""Shortcuts that are not in the menus: they work while the panel has the focus."""
N_COLUMNS = 3


class ShortcutList(QDialog):
    """Shows all shortcuts; Esc closes it."""

    def __init__(self, parent: QWidget, actions: Actions) -> None:
        super().__init__(parent)
        self.setObjectName("shortcuts")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle(tr("Keyboard shortcuts"))
        groups = {
            plain_title(tr(menu)): [
                (_text(actions[spec.name].shortcut()), tr(spec.text).rstrip("…"))
                for spec in specs
                if spec is not None and spec.shortcut
            ]
            for menu, specs in MENUS.items()
        }
        groups |= {
            tr("In the panel: {name}").format(name=tr(name)): [
                (_key(key), tr(what)) for key, what in keys
            ]
            for name, keys in IN_PANELS.items()
        }
        body = QWidget()
        grid = QGridLayout(body)
        grid.setHorizontalSpacing(4 * theme.SPACING)
        columns = _balanced({title: keys for title, keys in groups.items() if keys})
        for place, titles in enumerate(columns):
            column = QVBoxLayout()
            for title in titles:
                column.addWidget(_group(title, groups[title]))
            column.addStretch()
            grid.addLayout(column, 0, place)
        area = QScrollArea()
        area.setWidget(body)
        area.setWidgetResizable(True)
        area.setFocusPolicy(Qt.FocusPolicy.StrongFocus)  # the arrows scroll
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        buttons.rejected.connect(self.close)
        whole = QVBoxLayout(self)
        whole.addWidget(area)
        whole.addWidget(buttons)
        room = parent.screen().availableGeometry().size() * 0.9
        wanted = body.sizeHint()
        self.resize(
            min(wanted.width() + 6 * theme.SPACING, room.width(), parent.width()),
            min(wanted.height() + 10 * theme.SPACING, room.height(), parent.height()),
        )


def _text(shortcut: QKeySequence) -> str:
    return shortcut.toString(QKeySequence.SequenceFormat.NativeText)


def _key(key: str) -> str:
    return _text(QKeySequence(key)) if "+" in key else tr(key)


def _group(title: str, keys: list[tuple[str, str]]) -> QWidget:
    group = QWidget()
    grid = QGridLayout(group)
    grid.setContentsMargins(0, 0, 0, theme.SPACING)
    grid.setVerticalSpacing(theme.SPACING // 2)
    heading = QLabel(title)
    heading.setProperty("heading", True)
    grid.addWidget(heading, 0, 0, 1, 2)
    for row, (key, what) in enumerate(keys, start=1):
        name = QLabel(key)
        name.setProperty("muted", True)
        grid.addWidget(name, row, 0)
        grid.addWidget(QLabel(what), row, 1)
    grid.setColumnStretch(1, 1)
    return group


def _balanced(groups: dict[str, list[tuple[str, str]]]) -> list[list[str]]:
    """Titles of the groups in columns of about one height, in their order."""
    height = sum(len(keys) + 2 for keys in groups.values()) / N_COLUMNS
    columns: list[list[str]] = [[]]
    filled = 0.0
    for title, keys in groups.items():
        if columns[-1] and filled + (len(keys) + 2) / 2 > height * len(columns):
            columns.append([])
        columns[-1].append(title)
        filled += len(keys) + 2
    return columns
