"""The settings as a form, made from the metadata of `pipecore.settings`."""

from collections.abc import Callable
from enum import StrEnum
from typing import Any

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QScrollArea,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from pipecore.rules import list_rules
from pipecore.settings import FieldSpec, Settings, choices_of, iterate_fields
from pipegui.i18n.texts import mark, tr
from pipegui.panels.preset_bar import PresetBar
from pipegui.panels.several_field import SeveralField
from pipegui.panels.widgets import Applying, QuietComboBox, QuietSpinBox
from pipegui.style import theme

ELSEWHERE = {"stacks.preset", "stacks.directions"} | {
    key for key, spec in iterate_fields() if spec.group == "tiling"
}
"""Set in the stacks panel; or on the command line, for scans that the app cannot show whole."""

GROUP_TITLES = {
    "input": mark("File"),
    "thinning": mark("Thinning"),
    "stacks": mark("Stacks"),
    "profiles": mark("Profiles"),
    "ellipses": mark("Ellipses"),
    "elements": mark("Elements"),
    "deformation": mark("Deformations"),
    "stations": mark("Stations"),
}
LARGEST = 1e6


class SettingsForm(QScrollArea):
    """One line a setting, in groups; the advanced ones are folded away."""

    changed = Signal(str, object)
    """Dotted key and new value."""
    reset_requested = Signal()
    keys_reset = Signal(list)
    """Dotted keys that are to go back to their defaults."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName(tr("Settings"))
        self.setWidgetResizable(True)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._applying = Applying()
        self._show: dict[str, Callable[[Any], None]] = {}
        self.labels: dict[str, QLabel] = {}
        self.resets: dict[str, QToolButton] = {}
        self.group_resets: list[tuple[list[str], QToolButton]] = []
        self._specs = {key: spec for key, spec in iterate_fields() if key not in ELSEWHERE}
        body = QWidget()
        column = QVBoxLayout(body)
        column.setContentsMargins(theme.SPACING, theme.SPACING, theme.SPACING, theme.SPACING)
        column.setSpacing(theme.SPACING)
        self.presets = PresetBar()
        column.addWidget(self.presets)
        self._add_groups(column, advanced=False)
        self.advanced = _Fold(tr("Advanced"))
        self._add_groups(self.advanced.content, advanced=True)
        column.addWidget(self.advanced)
        self.reset = QToolButton()
        self.reset.setText(tr("Reset to defaults"))
        self.reset.setToolTip(tr("All settings back to the defaults; own stacks stay"))
        self.reset.clicked.connect(self.reset_requested)
        column.addWidget(self.reset)
        column.addStretch()
        self.setWidget(body)
        self.apply(Settings())

    def _add_groups(self, column: QVBoxLayout, *, advanced: bool) -> None:
        for group, title in GROUP_TITLES.items():
            specs = {
                key: spec
                for key, spec in self._specs.items()
                if spec.group == group and spec.advanced == advanced
            }
            if not specs:
                continue
            column.addLayout(self._heading(tr(title), list(specs)))
            form = QFormLayout()
            form.setContentsMargins(0, 0, 0, theme.SPACING // 2)
            form.setSpacing(theme.SPACING // 2)
            form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
            for key, spec in specs.items():
                label, field = QLabel(tr(spec.label)), self._field(key, spec)
                label.setMinimumWidth(16 * theme.SPACING)
                field.setMinimumWidth(10 * theme.SPACING)
                field.setObjectName(key)
                field.setAccessibleName(tr(spec.label))
                label.setBuddy(field)
                for widget in (label, field):
                    widget.setToolTip(_help(spec))
                self.labels[key] = label
                row = QHBoxLayout()
                row.setSpacing(0)
                row.addWidget(field, 1)
                tip = tr("Set “{label}” back to its default").format(label=tr(spec.label))
                self.resets[key] = self._reset_button(tip, [key])
                row.addWidget(self.resets[key])
                form.addRow(label, row)
            column.addLayout(form)

    def _heading(self, title: str, keys: list[str]) -> QHBoxLayout:
        heading = QLabel(title)
        heading.setProperty("heading", True)
        button = self._reset_button(
            tr("Set all of “{title}” back to the defaults").format(title=title), keys
        )
        self.group_resets.append((keys, button))
        row = QHBoxLayout()
        row.addWidget(heading, 1)
        row.addWidget(button)
        return row

    def _reset_button(self, tip: str, keys: list[str]) -> QToolButton:
        button = QToolButton()
        theme.set_icon(button, "restore", "muted")
        button.setIconSize(theme.icon_size(1.75))
        button.setAutoRaise(True)
        button.setToolTip(tip)
        button.setAccessibleName(tip)
        policy = button.sizePolicy()
        policy.setRetainSizeWhenHidden(True)  # fields must not move when one is changed
        button.setSizePolicy(policy)
        button.clicked.connect(lambda: self.keys_reset.emit(keys))
        return button

    def _field(self, key: str, spec: FieldSpec) -> QWidget:
        if isinstance(spec.kind, type) and issubclass(spec.kind, StrEnum):
            return self._choice(key, [(tr(value), value) for value in spec.kind])
        if key == "deformation.rule":
            return self._several(
                key,
                [(tr(rule.title), rule.name) for rule in list_rules()],
                file_filter=tr("Acceptance rules") + " (*.toml)",
            )
        if choices := choices_of(spec.kind):
            return self._several(key, [(tr(value), value) for value in choices])
        if spec.kind is float:
            return self._number(key, spec)
        return self._text(key)

    def _choice(self, key: str, choices: list[tuple[str, Any]]) -> QWidget:
        field = QuietComboBox()
        for text, value in choices:
            field.addItem(text, value)
        # A long title must not widen the panel; the list shows it in full.
        field.setSizeAdjustPolicy(field.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        field.setMinimumContentsLength(8)
        values = [value for _, value in choices]

        def show(value: Any) -> None:
            if value not in values:
                field.addItem(str(value), value)
                values.append(value)
            field.setCurrentIndex(values.index(value))

        self._show[key] = show
        field.currentIndexChanged.connect(lambda i: self._tell(key, values[i]))
        return field

    def _several(self, key: str, choices: list[tuple[str, str]], file_filter: str = "") -> QWidget:
        """A field of several choices; a setting that is a text has them between commas."""
        field = SeveralField(choices, file_filter)
        is_text = self._specs[key].kind is str

        def show(value: Any) -> None:
            names = [name.strip() for name in value.split(",")] if is_text else value
            field.show_values(names)

        self._show[key] = show
        field.changed.connect(
            lambda values: self._tell(key, ", ".join(values) if is_text else values)
        )
        return field

    def _number(self, key: str, spec: FieldSpec) -> QWidget:
        field = QuietSpinBox()
        field.setDecimals(3 if spec.maximum is not None and spec.maximum <= 1 else 1)
        lowest = -LARGEST if spec.minimum is None else spec.minimum
        field.setRange(lowest, LARGEST if spec.maximum is None else spec.maximum)
        field.setSingleStep(0.01 if field.decimals() == 3 else 1.0)
        if spec.unit:
            field.setSuffix(f" {spec.unit}" if spec.unit != "°" else "°")
        if spec.zero_means:
            field.setSpecialValueText(tr(spec.zero_means))
        self._show[key] = field.setValue
        field.valueChanged.connect(lambda value: self._tell(key, value))
        return field

    def _text(self, key: str) -> QWidget:
        field = QLineEdit()
        self._show[key] = lambda value: field.setText(str(value))
        field.editingFinished.connect(lambda: self._tell(key, field.text()))
        return field

    def _tell(self, key: str, value: Any) -> None:
        if not self._applying:
            self.changed.emit(key, value)

    def apply(self, settings: Settings) -> None:
        """Show settings; what differs from the default stands in bold."""
        with self._applying:
            for key, spec in self._specs.items():
                self._show[key](settings.get(key))
                font = self.labels[key].font()
                font.setBold(settings.get(key) != spec.default)
                self.labels[key].setFont(font)
        changed = {k for k, spec in self._specs.items() if settings.get(k) != spec.default}
        for key, button in self.resets.items():
            button.setVisible(key in changed)
        for keys, button in self.group_resets:
            button.setVisible(len(keys) > 1 and not changed.isdisjoint(keys))
        self.reset.setEnabled(bool(changed))
        self.presets.apply(settings)


def _help(spec: FieldSpec) -> str:
    lines = [tr(spec.help)]
    unit = f" {spec.unit}" if spec.unit else ""
    if spec.minimum is not None and spec.maximum is not None:
        lines.append(f"{spec.minimum:g} … {spec.maximum:g}{unit}")
    elif spec.minimum is not None:
        lines.append(tr("at least {minimum:g}{unit}").format(minimum=spec.minimum, unit=unit))
    default = tr(spec.zero_means) if spec.zero_means and spec.default == 0 else None
    if default is None:
        default = f"{spec.default:.4g}{unit}" if spec.kind is float else _named(spec.default)
    lines.append(tr("Default: {default}").format(default=default))
    return "\n".join(lines)


def _named(default: Any) -> str:
    """A default that is a text, a choice or several."""
    return ", ".join(map(tr, default)) if isinstance(default, tuple) else tr(str(default))


class _Fold(QWidget):
    """A heading that folds what is below it away."""

    def __init__(self, title: str) -> None:
        super().__init__()
        self.button = QToolButton()
        self.button.setText(title)
        self.button.setCheckable(True)
        self.button.setAutoRaise(True)
        self.button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        body = QWidget()
        self.content = QVBoxLayout(body)
        self.content.setContentsMargins(0, 0, 0, 0)
        self.content.setSpacing(theme.SPACING)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.button)
        column.addWidget(body)
        self._body = body
        self.button.toggled.connect(self._fold)
        self._fold(False)

    def _fold(self, is_open: bool) -> None:
        self._body.setVisible(is_open)
        arrow = Qt.ArrowType.DownArrow if is_open else Qt.ArrowType.RightArrow
        self.button.setArrowType(arrow)
