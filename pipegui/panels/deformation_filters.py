"""The row above the deformation table: what is left out, and how much is shown."""

from collections.abc import Mapping, Sequence
from typing import Any

from PySide6.QtCore import QEvent, Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QToolButton, QWidget

from pipecore.types import DeformationKind, ReviewState, Verdict
from pipegui.i18n.texts import mark, tr
from pipegui.panels.deformation_model import REVIEW_ICON
from pipegui.panels.widgets import QuietComboBox, QuietSpinBox
from pipegui.style import theme

TIPS = {
    "kind": (mark("Show only deformations of one kind"), mark("All kinds")),
    "verdict": (mark("Show only deformations of one verdict"), mark("All verdicts")),
    "review": (mark("Show only deformations of one review"), mark("Any review")),
}
"""Tip of each filter by a choice, and what stands for everything."""
NAMES = {
    "kind": mark("Filter by kind"),
    "verdict": mark("Filter by verdict"),
    "review": mark("Filter by review"),
}
NOTHING_LEFT_OUT = {"kind": "", "verdict": "", "review": "", "min_depth_mm": 0.0}


class FilterBar(QWidget):
    """Choices of kind, verdict, review and depth."""

    choices_changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.kind = self._choice("kind", [(tr(k), k, None) for k in DeformationKind])
        verdicts = [(tr(v), v, theme.verdict_icon(v)) for v in Verdict]
        self.verdict = self._choice("verdict", verdicts)
        states = [(tr(s), s, theme.icon(REVIEW_ICON[s])) for s in ReviewState]
        self.review = self._choice("review", states)
        self.min_depth = QuietSpinBox()
        self.min_depth.setAccessibleName(tr("Filter by depth or height"))
        self.min_depth.setToolTip(tr("Hide what is shallower"))
        self.min_depth.setRange(0, 1000)
        self.min_depth.setPrefix("≥ ")
        self.min_depth.setSuffix(" mm")
        self.min_depth.setSpecialValueText(tr("any depth"))
        self.min_depth.valueChanged.connect(self._change)
        self.everything = QToolButton()
        self.everything.setAutoRaise(True)
        theme.set_icon(self.everything, "filter-remove-outline")
        self.everything.setToolTip(tr("Show all deformations again"))
        self.everything.setAccessibleName(tr("Show all deformations again"))
        self.everything.clicked.connect(lambda: self.choose({}))
        self.counts = QLabel()
        self.counts.setProperty("muted", True)
        row = QHBoxLayout(self)
        row.setContentsMargins(theme.SPACING, theme.SPACING // 2, theme.SPACING, 4)
        row.setSpacing(theme.SPACING)
        for widget in (*self._combos().values(), self.min_depth, self.everything):
            row.addWidget(widget)
        row.addStretch()
        row.addWidget(self.counts)
        self._refresh_icons()
        self._offer_everything()

    def _choice(self, what: str, choices: Sequence[tuple[str, Any, Any]]) -> QuietComboBox:
        tip, every = map(tr, TIPS[what])
        combo = QuietComboBox()
        combo.setAccessibleName(tr(NAMES[what]))
        combo.setToolTip(tip)
        combo.addItem(every, None)
        for text, value, icon in choices:
            if icon is None:
                combo.addItem(text, value)
            else:
                combo.addItem(icon, text, value)
        combo.currentIndexChanged.connect(self._change)
        return combo

    def _combos(self) -> dict[str, QuietComboBox]:
        return {"kind": self.kind, "verdict": self.verdict, "review": self.review}

    def _change(self) -> None:
        self._offer_everything()
        self.choices_changed.emit()

    def _offer_everything(self) -> None:
        self.everything.setVisible(self.choices() != NOTHING_LEFT_OUT)

    # Kept from one session to the next

    def choices(self) -> dict[str, Any]:
        """Return the filters chosen, as plain values."""
        chosen = {name: combo.currentData() for name, combo in self._combos().items()}
        plain = {name: str(value) if value else "" for name, value in chosen.items()}
        return plain | {"min_depth_mm": self.min_depth.value()}

    def choose(self, choices: Mapping[str, Any]) -> None:
        """Take choices; what is not among them leaves nothing out."""
        for name, combo in self._combos().items():
            combo.setCurrentIndex(max(combo.findData(choices.get(name) or None), 0))
        depth = choices.get("min_depth_mm", 0.0)
        self.min_depth.setValue(depth if isinstance(depth, int | float) else 0.0)

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802
        """Draw the icons in the colours of a new scheme."""
        if event.type() == QEvent.Type.PaletteChange:
            self._refresh_icons()
        super().changeEvent(event)

    def _refresh_icons(self) -> None:
        for state in ReviewState:
            row = self.review.findData(state)
            self.review.setItemIcon(row, theme.icon(REVIEW_ICON[state]))
