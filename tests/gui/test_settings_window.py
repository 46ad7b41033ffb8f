"""The settings alone, as other programs ask for them."""

from PySide6.QtWidgets import QDialog, QDialogButtonBox

from pipecore.settings import Settings
from pipegui.window.settings_window import SettingsWindow


def button(window: SettingsWindow, role: QDialogButtonBox.ButtonRole):
    box = window.findChild(QDialogButtonBox)
    return next(b for b in box.buttons() if box.buttonRole(b) is role)


def test_that_what_is_accepted_stands_in_the_file(qtbot, no_leaks, tmp_path):
    path = tmp_path / "settings.toml"
    window = SettingsWindow(path)
    window.show()
    window.form.changed.emit("elements.min_radius_mm", 75.0)
    button(window, QDialogButtonBox.ButtonRole.AcceptRole).click()
    assert window.result() == QDialog.DialogCode.Accepted
    assert Settings.from_toml(path).elements.min_radius_mm == 75.0
    again = SettingsWindow(path)
    assert again.settings.elements.min_radius_mm == 75.0
    again.form.keys_reset.emit(["elements.min_radius_mm"])
    assert again.settings == Settings()
    button(again, QDialogButtonBox.ButtonRole.RejectRole).click()
    assert Settings.from_toml(path).elements.min_radius_mm == 75.0
    for each in (window, again):
        each.deleteLater()


def test_that_mistakes_are_told_and_change_nothing(qtbot, no_leaks, tmp_path):
    path = tmp_path / "settings.toml"
    path.write_text("[elements]\nmin_radius_mm = 'wide'\n", encoding="utf-8")
    window = SettingsWindow(path)
    window.show()
    assert "min_radius_mm" in window.message.text()
    assert window.settings == Settings()
    window.form.changed.emit("elements.min_radius_mm", -1.0)
    assert window.message.isVisible()
    assert window.settings == Settings()
    window.deleteLater()
