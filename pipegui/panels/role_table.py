"""The beginning of a text file as a table whose columns are given their roles."""

from collections.abc import Sequence

from PySide6.QtCore import QEvent, QMimeData, QObject, QPoint, QSize, Qt, Signal
from PySide6.QtGui import (
    QDrag,
    QDragEnterEvent,
    QDragMoveEvent,
    QDropEvent,
    QMouseEvent,
)
from PySide6.QtWidgets import (
    QAbstractItemView,
    QApplication,
    QHeaderView,
    QLabel,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from pipecore.io import TextPreview
from pipegui.i18n.texts import tr
from pipegui.panels.widgets import Applying, QuietComboBox
from pipegui.states.text_roles import ROLES, SKIP, role_text
from pipegui.style import theme

MIME = "application/x-pipegui-column"
WIDEST = 22 * theme.SPACING
"""Of a column, pixels."""
MOST_COLUMNS = 40


class RoleChip(QLabel):
    """The name of a role, to be dragged onto a column."""

    def __init__(self, role: str, parent: QWidget | None = None) -> None:
        super().__init__(role_text(role), parent)
        self.role = role
        self.setObjectName("chip")
        self.setCursor(Qt.CursorShape.OpenHandCursor)
        self.setToolTip(tr("Drag it onto a column"))
        self._pressed_at: QPoint | None = None

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: N802
        """Take hold of it."""
        self._pressed_at = event.position().toPoint()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:  # noqa: N802
        """Drag it once it is moved for some way."""
        if self._pressed_at is None:
            return
        way = (event.position().toPoint() - self._pressed_at).manhattanLength()
        if way < QApplication.startDragDistance():
            return
        drag = QDrag(self)
        mime = QMimeData()
        mime.setData(MIME, self.role.encode())
        drag.setMimeData(mime)
        drag.setPixmap(self.grab())
        drag.setHotSpot(self._pressed_at)
        self._pressed_at = None
        drag.exec(Qt.DropAction.CopyAction)


class _RoleHeader(QHeaderView):
    """A header that holds a choice for each column."""

    chosen = Signal(int, str)
    """Number of a column, and its role."""
    entered = Signal(int)
    """Number of the column whose choice has the keyboard now."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(Qt.Orientation.Horizontal, parent)
        self._applying = Applying()
        self.choices: list[QuietComboBox] = []
        self.setSectionsClickable(False)
        self.setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        self.sectionResized.connect(lambda *_: self._place())
        self.geometriesChanged.connect(self._place)

    def show_roles(self, roles: Sequence[str]) -> None:
        """Show the roles of the columns."""
        while len(self.choices) > len(roles):
            choice = self.choices.pop()
            choice.hide()
            choice.deleteLater()
        while len(self.choices) < len(roles):
            self._add(len(self.choices))
        with self._applying:
            for choice, role in zip(self.choices, roles, strict=True):
                known = role if role in ROLES else SKIP
                choice.setCurrentIndex(choice.findData(known))
                choice.setProperty("skipped", known == SKIP)
                choice.style().unpolish(choice)
                choice.style().polish(choice)
        self._place()

    def _add(self, column: int) -> None:
        choice = QuietComboBox(self)
        choice.setObjectName("role")
        choice.setAccessibleName(tr("Column {n} holds").format(n=column + 1))
        choice.setMaxVisibleItems(len(ROLES))
        for role in ROLES:
            choice.addItem(role_text(role), role)
        choice.currentIndexChanged.connect(lambda _: self._tell(column))
        if self.choices:
            QWidget.setTabOrder(self.choices[-1], choice)
        choice.installEventFilter(self)
        choice.show()
        self.choices.append(choice)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802
        """Tell which choice has the keyboard now."""
        if event.type() == QEvent.Type.FocusIn and watched in self.choices:
            self.entered.emit(self.choices.index(watched))
        return super().eventFilter(watched, event)

    def _tell(self, column: int) -> None:
        if not self._applying:
            self.chosen.emit(column, str(self.choices[column].currentData()))

    @property
    def narrowest(self) -> int:
        """Width at which every role can be read."""
        return self.choices[0].sizeHint().width() + 2 * theme.SPACING if self.choices else 0

    def sizeHint(self) -> QSize:  # noqa: N802
        """Return a size with room for the choices."""
        size = super().sizeHint()
        return QSize(size.width(), self._height() + theme.SPACING)

    def _height(self) -> int:
        return self.choices[0].sizeHint().height() if self.choices else 3 * theme.SPACING

    def _place(self) -> None:
        """Keep each choice over its column."""
        for column, choice in enumerate(self.choices):
            left, width = self.sectionViewportPosition(column), self.sectionSize(column)
            choice.setGeometry(left + 2, theme.SPACING // 2, width - 4, self._height())


class RoleTable(QTableWidget):
    """Shows the lines of a preview; roles are chosen in its header or dropped on its columns."""

    role_chosen = Signal(int, str)
    """Number of a column, and its role."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName(tr("The first lines of the file"))
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setObjectName("roleTable")
        self.setShowGrid(False)
        self.setTabKeyNavigation(False)
        self.setAcceptDrops(True)
        self.setHorizontalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.roles = _RoleHeader(self)
        self.setHorizontalHeader(self.roles)
        self.roles.chosen.connect(self.role_chosen)
        self.roles.entered.connect(lambda i: self.scrollTo(self.model().index(0, i)))
        self.horizontalScrollBar().valueChanged.connect(lambda _: self.roles._place())
        self.verticalHeader().setDefaultAlignment(
            Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        )
        self.verticalHeader().setDefaultSectionSize(3 * theme.SPACING)
        self.verticalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Fixed)

    def apply(self, preview: TextPreview) -> None:
        """Show a preview."""
        columns = preview.columns[:MOST_COLUMNS]
        is_other_shape = len(columns) != self.columnCount()
        self.clearSpans()
        self.clearContents()
        self.setRowCount(len(preview.lines))
        self.setColumnCount(len(columns))
        for row, line in enumerate(preview.lines):
            if not line.is_point:
                self._put(row, 0, line.text.strip(), is_read=False)
                if len(columns) > 1:
                    self.setSpan(row, 0, 1, len(columns))
                continue
            for column, value in enumerate(line.values[: len(columns)]):
                self._put(row, column, value, is_read=columns[column] in ROLES_READ)
        self.roles.show_roles(columns)
        if is_other_shape:
            self._fit_columns(preview)

    def _put(self, row: int, column: int, text: str, *, is_read: bool) -> None:
        item = QTableWidgetItem(text)
        item.setToolTip(text)
        if not is_read:
            item.setForeground(theme.colour("muted"))
        self.setItem(row, column, item)

    def _fit_columns(self, preview: TextPreview) -> None:
        metrics = self.fontMetrics()
        for column in range(self.columnCount()):
            texts = [
                line.values[column]
                for line in preview.lines
                if line.is_point and column < len(line.values)
            ]
            needed = max((metrics.horizontalAdvance(t) for t in texts), default=0)
            widest = WIDEST if self.columnCount() > 2 else 3 * WIDEST
            width = min(max(needed + 3 * theme.SPACING, self.roles.narrowest), widest)
            self.setColumnWidth(column, width)

    # Dropping roles

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:  # noqa: N802
        """Accept a role."""
        if event.mimeData().hasFormat(MIME):
            event.acceptProposedAction()

    def dragMoveEvent(self, event: QDragMoveEvent) -> None:  # noqa: N802
        """Accept a role over a column."""
        column = self.columnAt(event.position().toPoint().x())
        event.setAccepted(event.mimeData().hasFormat(MIME) and column >= 0)

    def dropEvent(self, event: QDropEvent) -> None:  # noqa: N802
        """Give the column its role."""
        column = self.columnAt(event.position().toPoint().x())
        role = bytes(event.mimeData().data(MIME).data()).decode()
        if column >= 0 and role in ROLES:
            event.acceptProposedAction()
            self.role_chosen.emit(column, role)


ROLES_READ = set(ROLES) - {SKIP, "nx", "ny", "nz"}
"""Roles of columns that are read for what they are."""
