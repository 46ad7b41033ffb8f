"""What an empty window shows: where to drop a scan, and two buttons."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from pipecore.io import formats
from pipegui.i18n.texts import tr
from pipegui.style import theme


class Welcome(QWidget):
    """The first thing that a new user sees."""

    open_requested = Signal()
    demo_requested = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("welcome")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._area = QFrame()
        self._area.setObjectName("dropArea")
        self._area.setMaximumWidth(70 * theme.SPACING)
        self._icon = QLabel()
        title = QLabel(tr("Drop a laser scan here"))
        font = title.font()
        font.setPointSizeF(1.5 * font.pointSizeF())
        title.setFont(font)
        endings = [f.endings[0].lstrip(".").upper() for f in formats()]
        known = QLabel(", ".join(dict.fromkeys(endings)) + tr(" and more"))
        explanation = QLabel(
            tr("PipeGUI finds the pipes, measures their radii and shows where they are deformed.")
        )
        explanation.setWordWrap(True)
        for label in (known, explanation):
            label.setProperty("muted", True)
        for label in (self._icon, title, known, explanation):
            label.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.open_button = QPushButton(tr("Open a scan"))
        self.open_button.setObjectName("primaryButton")
        self.open_button.clicked.connect(self.open_requested)
        self.demo_button = QPushButton(tr("Try the demo"))
        self.demo_button.clicked.connect(self.demo_requested)
        buttons = QHBoxLayout()
        buttons.setSpacing(theme.SPACING)
        buttons.addStretch()
        buttons.addWidget(self.open_button)
        buttons.addWidget(self.demo_button)
        buttons.addStretch()
        inside = QVBoxLayout(self._area)
        inside.setContentsMargins(*[5 * theme.SPACING] * 4)
        inside.setSpacing(theme.SPACING)
        inside.addWidget(self._icon)
        inside.addWidget(title)
        inside.addWidget(known)
        inside.addSpacing(theme.SPACING)
        inside.addWidget(explanation)
        inside.addSpacing(2 * theme.SPACING)
        inside.addLayout(buttons)
        row = QHBoxLayout()
        row.addStretch(1)
        row.addWidget(self._area, 8)
        row.addStretch(1)
        column = QVBoxLayout(self)
        column.addStretch(2)
        column.addLayout(row)
        column.addStretch(3)
        self.refresh_icons()

    def refresh_icons(self) -> None:
        """Draw the icon in the colours of the current scheme."""
        size = theme.icon_size(8)
        self._icon.setPixmap(theme.icon("tray-arrow-down", "accent").pixmap(size))

    def show_dragging(self, is_dragging: bool) -> None:
        """Answer a file that is held over the window."""
        self._area.setProperty("dragging", is_dragging)
        self._area.style().unpolish(self._area)
        self._area.style().polish(self._area)
