"""Small widgets that several panels use."""

from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QKeyEvent, QWheelEvent
from PySide6.QtWidgets import (
    QComboBox,
    QDoubleSpinBox,
    QLabel,
    QTreeWidget,
    QTreeWidgetItem,
    QWidget,
)

from pipegui.style import theme


class Applying:
    """True while a panel shows a new state: what its widgets then signal is no user's wish.

    Used instead of blocking signals where Qt's own views have to hear them.
    """

    def __init__(self) -> None:
        self._depth = 0

    def __bool__(self) -> bool:
        return self._depth > 0

    def __enter__(self) -> None:
        self._depth += 1

    def __exit__(self, *exc_info: object) -> None:
        self._depth -= 1


def items_of(tree: QTreeWidget) -> list[QTreeWidgetItem]:
    """Return the items at the top of a tree, in their order."""
    items = (tree.topLevelItem(row) for row in range(tree.topLevelItemCount()))
    return [item for item in items if item is not None]


class EmptyHint(QLabel):
    """Says what would fill an empty panel."""

    def __init__(self, text: str, parent: QWidget | None = None) -> None:
        super().__init__(text, parent)
        self.setProperty("muted", True)
        self.setWordWrap(True)
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.setMargin(2 * theme.SPACING)


class QuietSpinBox(QDoubleSpinBox):
    """A number that changes only when meant: not by scrolling past, not at every key."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setKeyboardTracking(False)
        self.setDecimals(1)

    def wheelEvent(self, event: QWheelEvent) -> None:  # noqa: N802
        """Scroll the panel instead, unless the number has the focus."""
        if self.hasFocus():
            super().wheelEvent(event)
        else:
            event.ignore()

    def textFromValue(self, value: float) -> str:  # noqa: N802
        """Write no more decimals than the value has."""
        text = f"{value:.{self.decimals()}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text


class QuietComboBox(QComboBox):
    """A choice that does not change by scrolling past it, and can be typed into.

    Qt turns a `StrEnum` among an item's data into a plain string.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)

    def wheelEvent(self, event: QWheelEvent) -> None:  # noqa: N802
        """Scroll the panel instead, unless the choice has the focus."""
        if self.hasFocus():
            super().wheelEvent(event)
        else:
            event.ignore()

    def event(self, event: QEvent) -> bool:
        """Take letters for the choice, before they become the window's shortcuts."""
        is_key = isinstance(event, QKeyEvent) and event.type() == QEvent.Type.ShortcutOverride
        # Function keys have no text, and "" counts as printable.
        if is_key and event.text() and event.text().isprintable():  # type: ignore[attr-defined]
            event.accept()
            return True
        return super().event(event)
