"""The settings alone, in a window of their own: for programs that call ours."""

from pathlib import Path

from PySide6.QtWidgets import QDialog, QDialogButtonBox, QLabel, QVBoxLayout, QWidget

from pipecore.errors import PipecoreError
from pipecore.io.atomic import write_file
from pipecore.settings import Settings
from pipegui.i18n.texts import error_text, tr
from pipegui.panels.settings_form import SettingsForm

SIZE = 460, 720


class SettingsWindow(QDialog):
    """Shows the settings of a file; accepting keeps them there.

    Parameters
    ----------
    path : Path
        A settings file; where there is none, the defaults are shown.
    parent : QWidget, optional
    """

    def __init__(self, path: Path, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._path = path
        self.setWindowTitle(tr("Settings of the detection"))
        self.resize(*SIZE)
        self.message = QLabel()
        self.message.setWordWrap(True)
        self.form = SettingsForm()
        self.form.changed.connect(lambda key, value: self._change({key: value}))
        self.form.keys_reset.connect(self._reset)
        self.form.reset_requested.connect(lambda: self._show(Settings()))
        self.form.presets.chosen.connect(self._show)
        self.form.presets.failed.connect(self._warn)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Cancel)
        buttons.addButton(tr("Detect"), QDialogButtonBox.ButtonRole.AcceptRole)
        buttons.accepted.connect(self._keep)
        buttons.rejected.connect(self.reject)
        column = QVBoxLayout(self)
        column.addWidget(self.message)
        column.addWidget(self.form)
        column.addWidget(buttons)
        self.message.hide()
        self.settings = Settings()
        try:
            self._show(Settings.from_toml(path) if path.exists() else Settings())
        except PipecoreError as error:
            self._show(Settings())
            self._warn(error_text(error))

    def _show(self, settings: Settings) -> None:
        self.settings = settings
        self.form.apply(settings)

    def _reset(self, keys: list[str]) -> None:
        self._change({key: Settings().get(key) for key in keys})

    def _change(self, values: dict[str, object]) -> None:
        try:
            self._show(self.settings.replace(values))
            self.message.hide()
        except PipecoreError as error:
            self._warn(error_text(error))
            self.form.apply(self.settings)

    def _warn(self, text: str) -> None:
        self.message.setText(text)
        self.message.show()

    def _keep(self) -> None:
        try:
            with write_file(self._path) as temporary:
                temporary.write_text(self.settings.to_toml(), encoding="utf-8")
        except PipecoreError as error:
            self._warn(error_text(error))
            return
        self.accept()
