"""The command palette: find an action by a few letters of its name, and run it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from PySide6.QtCore import QEvent, QObject, QPoint, Qt
from PySide6.QtGui import QAction, QKeyEvent, QKeySequence
from PySide6.QtWidgets import QFrame, QLineEdit, QTreeWidget, QTreeWidgetItem, QVBoxLayout, QWidget

from pipegui.i18n.texts import tr
from pipegui.style.theme import SPACING

WIDTH, ROWS = 60 * SPACING, 10


@dataclass(frozen=True)
class MatchRank:
    """How well an action matches what was typed: lower is better."""

    gaps: int
    start: int


def match(typed: str, text: str) -> MatchRank | None:
    """Whether the letters of `typed` occur in `text` in their order, and how scattered.

    Letters that begin words count as less scattered than others: "sa" ranks "Show all"
    before "Isolate". Case and spaces do not matter.
    """
    wanted = "".join(typed.lower().split())
    lower = text.lower()
    if not wanted:
        return MatchRank(0, 0)
    best: MatchRank | None = None
    for first in (i for i, letter in enumerate(lower) if letter == wanted[0]):
        place, gaps = first, 0 if _begins_word(lower, first) else 1
        for letter in wanted[1:]:
            following = lower.find(letter, place + 1)
            if following < 0:
                break
            if following > place + 1:
                gaps += 1 if _begins_word(lower, following) else 2
            place = following
        else:
            found = MatchRank(gaps, first)
            if best is None or (found.gaps, found.start) < (best.gaps, best.start):
                best = found
    return best


def _begins_word(text: str, i: int) -> bool:
    return i == 0 or not text[i - 1].isalnum()


@dataclass(frozen=True)
class Entry:
    """An action as it is listed."""

    action: QAction
    menu: str

    @property
    def name(self) -> str:
        """What people read, without marks."""
        return self.action.text().replace("&", "")


class CommandPalette(QFrame):
    """A field over a list of actions; typed letters filter it, Return runs the chosen one.

    Parameters
    ----------
    parent : QWidget
        The window over whose upper edge it opens.
    entries : callable
        Returns all actions with their menus' names; called whenever the list is filtered.
    """

    def __init__(self, parent: QWidget, entries: Callable[[], Iterable[Entry]]) -> None:
        super().__init__(parent, Qt.WindowType.Popup)
        self.setObjectName("command_search")
        self.setFrameShape(QFrame.Shape.StyledPanel)
        self._window, self._entries = parent, entries
        self.field = QLineEdit()
        self.field.setPlaceholderText(tr("Search actions"))
        self.field.setAccessibleName(tr("Search actions"))
        self.field.setClearButtonEnabled(True)
        self.list = QTreeWidget()
        self.list.setAccessibleName(tr("Actions found"))
        self.list.setHeaderHidden(True)
        self.list.setRootIsDecorated(False)
        self.list.setColumnCount(3)
        self.list.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.list.setUniformRowHeights(True)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(SPACING, SPACING, SPACING, SPACING)
        layout.addWidget(self.field)
        layout.addWidget(self.list)
        self.field.textChanged.connect(self._filter)
        self.field.installEventFilter(self)
        self.list.itemClicked.connect(self._run)

    def open(self) -> None:
        """Show all actions under an empty field."""
        window = self._window
        self.resize(WIDTH, self.field.sizeHint().height() + ROWS * 3 * SPACING + 4 * SPACING)
        corner = QPoint((window.width() - self.width()) // 2, 6 * SPACING)
        self.move(window.mapToGlobal(corner))
        self.field.clear()
        self._filter("")
        self.show()
        self.field.setFocus()

    def _filter(self, typed: str) -> None:
        ranked = []
        for i, entry in enumerate(self._entries()):
            found = match(typed, entry.name) or match(typed, f"{entry.menu} {entry.name}")
            if found is not None:
                ranked.append((not entry.action.isEnabled(), found.gaps, found.start, i, entry))
        ranked.sort(key=lambda row: row[:4])
        self.list.clear()
        for *_, entry in ranked:
            action = entry.action
            item = QTreeWidgetItem([entry.name, entry.menu, _key_of(action)])
            item.setIcon(0, action.icon())
            item.setData(0, Qt.ItemDataRole.UserRole, action)
            item.setToolTip(0, action.statusTip())
            item.setDisabled(not action.isEnabled())
            self.list.addTopLevelItem(item)
        if not ranked:
            item = QTreeWidgetItem([tr("No action is called that"), "", ""])
            item.setDisabled(True)
            self.list.addTopLevelItem(item)
        self._choose_row(0)
        self.list.setColumnWidth(0, 34 * SPACING)
        self.list.setColumnWidth(1, 9 * SPACING)

    def _run(self, item: QTreeWidgetItem) -> None:
        action = item.data(0, Qt.ItemDataRole.UserRole)
        if isinstance(action, QAction) and action.isEnabled():
            self.close()
            action.trigger()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802
        """Up, down and Return in the field are for the list."""
        if isinstance(event, QKeyEvent) and event.type() == QEvent.Type.KeyPress:
            key = event.key()
            if key in (Qt.Key.Key_Up, Qt.Key.Key_Down):
                self._step(1 if key == Qt.Key.Key_Down else -1)
                return True
            if key in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
                if (item := self.list.currentItem()) is not None:
                    self._run(item)
                return True
        return super().eventFilter(watched, event)

    def _step(self, by: int) -> None:
        item = self.list.currentItem()
        if item is not None:
            self._choose_row(self.list.indexOfTopLevelItem(item) + by)

    def _choose_row(self, row: int) -> None:
        """Choose a row, or the first or last if there is none of that number."""
        item = self.list.topLevelItem(min(max(row, 0), self.list.topLevelItemCount() - 1))
        if item is not None:
            self.list.setCurrentItem(item)


def _key_of(action: QAction) -> str:
    return action.shortcut().toString(QKeySequence.SequenceFormat.NativeText)
