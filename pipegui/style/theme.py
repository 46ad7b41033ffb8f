"""How the window looks: palette and style for light and dark, icons of one family."""

from enum import StrEnum
from functools import cache

import qtawesome
from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import (
    QAction,
    QColor,
    QGuiApplication,
    QIcon,
    QPainter,
    QPalette,
    QPixmap,
)
from PySide6.QtWidgets import QAbstractButton, QApplication, QWidget

from pipecore.resources import resource
from pipecore.types import ElementKind, Verdict
from pipegui.style.colours import ACCENT, VERDICT

SPACING = 8
"""Pixels; everything is a multiple or a half of it."""

SWATCH = 16
"""Pixels of the icon that shows a colour."""

_LIGHT = {
    "window": "#f5f6f8",
    "base": "#ffffff",
    "alternate": "#f8f9fb",
    "button": "#ffffff",
    "text": "#22262b",
    "muted": "#676f7a",
    "border": "#d9dce1",
    "hover": "#e9ebf0",
    "accent": ACCENT,
    "accent_soft": "#ece5fa",
    "warning_soft": "#fdf0dc",
    "error_soft": "#fbe3da",
}
_DARK = {
    "window": "#23262b",
    "base": "#1b1e22",
    "alternate": "#1f2227",
    "button": "#2c3036",
    "text": "#e4e6ea",
    "muted": "#9aa1ab",
    "border": "#3a3f47",
    "hover": "#343941",
    "accent": "#a88bf0",
    "accent_soft": "#3b3358",
    "warning_soft": "#443824",
    "error_soft": "#4b2c22",
}

ELEMENT_ICON = {
    ElementKind.CYLINDER: "pipe",
    ElementKind.CONE: "cone",
    ElementKind.SPHERE: "sphere",
    ElementKind.TORUS: "vector-curve",
    ElementKind.FLANGE: "circle-double",
    ElementKind.TEE: "pipe-disconnected",
    ElementKind.OTHER: "help-circle-outline",
}
VERDICT_ICON = {
    Verdict.REJECT: "close-octagon",
    Verdict.REVIEW: "alert",
    Verdict.ACCEPT_IF: "check-circle-outline",
    Verdict.ACCEPT: "check-circle",
    Verdict.NOT_MEASURABLE: "help-circle",
}


class Appearance(StrEnum):
    """Which colours the window has."""

    SYSTEM = "System"
    LIGHT = "Light"
    DARK = "Dark"


class _ChosenAppearance:
    """What the user chose last; the same for all windows."""

    appearance = Appearance.SYSTEM


def choose(appearance: Appearance) -> None:
    """Have dark or light colours whatever the system asks for, from the next drawing on."""
    _ChosenAppearance.appearance = appearance


def is_dark() -> bool:
    """Return whether the user, or else the system, asks for dark colours."""
    if _ChosenAppearance.appearance is Appearance.SYSTEM:
        return QGuiApplication.styleHints().colorScheme() == Qt.ColorScheme.Dark
    return _ChosenAppearance.appearance is Appearance.DARK


def colour(role: str, *, dark: bool | None = None) -> QColor:
    """Return a colour by its role, such as "muted"; of the current scheme by default."""
    return QColor((_DARK if (is_dark() if dark is None else dark) else _LIGHT)[role])


def apply_theme(app: QApplication) -> None:
    """Give the application its palette and style for the system's current scheme."""
    _tinted.cache_clear()
    app.setStyle("Fusion")
    app.setPalette(_palette())
    style = resource("styles", "app.qss").read_text(encoding="utf-8")
    style = style.replace("@here", resource("styles").as_posix())
    # Longest names first, so that @accent does not eat the start of @accent_soft.
    for role in sorted(_LIGHT, key=len, reverse=True):
        style = style.replace(f"@{role}", colour(role).name())
    app.setStyleSheet(style)


def _palette() -> QPalette:
    palette = QPalette()
    roles = QPalette.ColorRole
    for role, name in (
        (roles.Window, "window"),
        (roles.Base, "base"),
        (roles.AlternateBase, "alternate"),
        (roles.Button, "button"),
        (roles.WindowText, "text"),
        (roles.Text, "text"),
        (roles.ButtonText, "text"),
        (roles.ToolTipBase, "base"),
        (roles.ToolTipText, "text"),
        (roles.PlaceholderText, "muted"),
        (roles.Light, "border"),
        (roles.Midlight, "border"),
        (roles.Mid, "border"),
        (roles.Dark, "border"),
        (roles.Shadow, "border"),
        (roles.Highlight, "accent"),
        (roles.Link, "accent"),
    ):
        palette.setColor(role, colour(name))
    highlighted = QColor("#ffffff") if not is_dark() else colour("base")
    palette.setColor(roles.HighlightedText, highlighted)
    for role in (roles.WindowText, roles.Text, roles.ButtonText):
        dimmed = colour("muted")
        dimmed.setAlpha(150)
        palette.setColor(QPalette.ColorGroup.Disabled, role, dimmed)
    return palette


def icon(name: str, tint: str = "") -> QIcon:
    """Return a Material Design icon; `tint` is a role or "#rrggbb", by default the text's."""
    return _tinted(name, tint)


@cache
def _tinted(name: str, tint: str) -> QIcon:
    shade = tint if tint.startswith("#") else colour(tint or "text").name()
    disabled = colour("muted")
    disabled.setAlpha(110)
    drawn: QIcon = qtawesome.icon(f"mdi6.{name}", color=shade, color_disabled=disabled)
    return drawn


def set_icon(target: QAbstractButton | QAction, name: str, tint: str = "") -> None:
    """Give a button or an action an icon that `refresh_icons` draws anew."""
    target.setProperty("iconName", name)
    target.setProperty("iconTint", tint)
    target.setIcon(icon(name, tint))


def refresh_icons(window: QWidget) -> None:
    """Draw the icons that `set_icon` gave in the colours of the present scheme."""
    targets: list[QAbstractButton | QAction] = [*window.findChildren(QAbstractButton)]
    for target in (*targets, *window.findChildren(QAction)):
        if name := target.property("iconName"):
            target.setIcon(icon(name, target.property("iconTint")))


def verdict_icon(verdict: Verdict) -> QIcon:
    """Return the icon of a verdict in its colour."""
    return icon(VERDICT_ICON[verdict], VERDICT[verdict])


@cache
def swatch_icon(shade: tuple[int, int, int]) -> QIcon:
    """Return a small square of a colour, as legends have it."""
    pixmap = QPixmap(2 * SWATCH, 2 * SWATCH)
    pixmap.setDevicePixelRatio(2)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor(*shade))
    painter.drawRoundedRect(2, 2, SWATCH - 4, SWATCH - 4, 2, 2)
    painter.end()
    return QIcon(pixmap)


def icon_size(multiple: float = 2.25) -> QSize:
    """Return a square size in units of `SPACING`."""
    return QSize(round(SPACING * multiple), round(SPACING * multiple))
