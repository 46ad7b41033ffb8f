"""Dark and light: chosen, kept, and as legible as each other."""

import pytest
from PySide6.QtGui import QPalette
from PySide6.QtWidgets import QAbstractButton, QApplication

from pipegui.style import theme

pytestmark = pytest.mark.usefixtures("colours_of_the_system")


def luminance(colour):
    """Relative luminance as WCAG 2 defines it."""
    parts = [colour.redF(), colour.greenF(), colour.blueF()]
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one, other):
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


def test_that_the_chosen_appearance_is_shown_and_kept(make_app):
    app = make_app()
    app.window.actions_["appearance_dark"].trigger()
    assert luminance(QApplication.palette().color(QPalette.ColorRole.Window)) < 0.1
    assert app.window.actions_["appearance_dark"].isChecked()
    assert not app.window.actions_["appearance_system"].isChecked()
    other = make_app()
    assert other.window.actions_["appearance_dark"].isChecked()
    assert theme.is_dark()
    other.window.actions_["appearance_light"].trigger()
    assert luminance(QApplication.palette().color(QPalette.ColorRole.Window)) > 0.8


def drawn(button):
    """Colours of the icon's opaque pixels."""
    image = button.icon().pixmap(32, 32).toImage()
    pixels = (image.pixelColor(x, y) for x in range(32) for y in range(32))
    return [colour for colour in pixels if colour.alpha() > 200]


def test_that_icons_follow_the_colours_everywhere(make_app):
    app = make_app()
    buttons = [b for b in app.window.findChildren(QAbstractButton) if b.property("iconName")]
    assert len(buttons) > 8
    for name in ("appearance_dark", "appearance_light", "appearance_dark"):
        app.window.actions_[name].trigger()
        ground = QApplication.palette().color(QPalette.ColorRole.Window)
        for button in [*buttons, app.window.actions_["undo"], app.window.actions_["open"]]:
            button.setEnabled(True)
            assert max(contrast(c, ground) for c in drawn(button)) > 3, button.toolTip()


@pytest.mark.parametrize("dark", [False, True])
def test_that_text_stands_out_from_what_it_stands_on(dark):
    for text in ("text", "muted"):
        for ground in ("window", "base", "alternate"):
            ratio = contrast(theme.colour(text, dark=dark), theme.colour(ground, dark=dark))
            assert ratio > 4.5, (text, ground)
