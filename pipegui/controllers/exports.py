"""What menu entries do that ask for a file or show a dialog."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QMenu, QMessageBox

import pipecore
from pipecore.errors import PipecoreError, WriteError
from pipecore.progress import Progress
from pipecore.resources import resource
from pipecore.settings import Settings
from pipegui.controllers import file_dialogs
from pipegui.i18n.texts import LANGUAGES, error_text, inside, mark, tr
from pipegui.model import commands
from pipegui.states import descriptions
from pipegui.style import theme
from pipegui.window.command_palette import CommandSearch
from pipegui.window.shortcut_list import ShortcutList

if TYPE_CHECKING:
    from pipegui.plots.chart import Chart
    from pipegui.window.main_window import MainWindow

CSV = mark("Tables (*.csv)")
EXPORT = {
    "deformations": mark("Export deformations"),
    "elements": mark("Export elements"),
    "profiles": mark("Export profiles"),
}


class MenuActions:
    """The part of the window's actions that talks to the file system and the user."""

    def __init__(self, window: "MainWindow") -> None:
        self._window = window
        self._recent_menu: QMenu | None = None
        self._history_menu: QMenu | None = None
        self._search: CommandSearch | None = None

    # Opening

    def open(self) -> None:
        """Ask for scans and open them."""
        self._window.open_files(file_dialogs.ask_scans(self._window, self._window.stored))

    def open_demo(self) -> None:
        """Open the scan that comes with the program."""
        self._window.open_files([resource("demo", "demo.laz")])

    def list_recent(self) -> None:
        """Bring the menu of recent files up to date."""
        window = self._window
        if self._recent_menu is None:
            self._recent_menu = QMenu(tr("Open recent"), window)
            file_menu = window.actions_.menus["File"]
            file_menu.insertMenu(window.actions_["save"], self._recent_menu)
            file_menu.insertSeparator(window.actions_["save"])
        self._recent_menu.clear()
        paths = file_dialogs.recent(window.stored)
        self._recent_menu.setEnabled(bool(paths))
        for path in paths:
            action = self._recent_menu.addAction(path.name)
            action.setToolTip(str(path))
            action.triggered.connect(lambda _=False, path=path: window.open_files([path]))
        self._recent_menu.setToolTipsVisible(True)

    # History

    def list_history(self) -> None:
        """Bring the menu of steps up to date: a click goes back or forward to a step."""
        window, history = self._window, self._window.history
        if self._history_menu is None:
            self._history_menu = QMenu(tr("History"), window)
            edit_menu = window.actions_.menus["Edit"]
            edit_menu.insertMenu(window.actions_["go_up"], self._history_menu)
            edit_menu.aboutToShow.connect(self.list_history)
        menu = self._history_menu
        menu.clear()
        menu.setEnabled(bool(history.steps))
        for n_done, text in enumerate([tr("Start"), *map(tr, history.steps)]):
            action = menu.addAction(text)
            action.setCheckable(True)
            action.setChecked(n_done == history.n_done)
            action.triggered.connect(lambda _=False, n=n_done: history.go_to(n))

    # Colours

    def choose_appearance(self, appearance: theme.Appearance) -> None:
        """Take other colours, now and when the window is next opened."""
        self._window.stored.setValue("appearance", appearance.name)
        self.restore_appearance()

    def restore_appearance(self) -> None:
        """Take the colours that were chosen last."""
        name = str(self._window.stored.value("appearance", ""))
        chosen = theme.Appearance.__members__.get(name, theme.Appearance.SYSTEM)
        was_dark = theme.is_dark()
        theme.choose(chosen)
        if theme.is_dark() != was_dark:
            self._window.refresh_colours()
        for appearance in theme.Appearance:
            key = f"appearance_{appearance.name.lower()}"
            self._window.actions_.set_checked(key, appearance is chosen)

    # Language

    def choose_language(self, code: str) -> None:
        """Speak another language ("": the system's) when the window is next opened."""
        self._window.stored.setValue("language", code)
        self.show_language()
        self._window.panels.message.tell(tr("The language changes at the next start."))

    def show_language(self) -> None:
        """Check the language that was chosen last."""
        chosen = str(self._window.stored.value("language", ""))
        for code in LANGUAGES:
            key = f"language_{code or 'system'}"
            self._window.actions_.set_checked(key, code == chosen)

    # Settings

    def load_settings(self) -> None:
        """Ask for a settings file and take it."""
        window = self._window
        path = file_dialogs.ask_settings(window, window.stored)
        if path is None:
            return
        try:
            window.do(commands.load_settings, Settings.from_toml(path))
        except PipecoreError as error:
            window.panels.message.tell(error_text(error), "error")

    def save_settings(self) -> None:
        """Ask where to, and keep the settings as a file."""

        def write(path: Path) -> None:
            with pipecore.io.write_file(path) as temporary:
                temporary.write_text(self._window.document.settings.to_toml(), encoding="utf-8")

        self._save(tr("Save settings"), "settings.toml", tr("Settings (*.toml)"), write)

    # Exporting

    def export_table(self, table: str) -> None:
        """Ask where to, and write a table: "deformations", "elements" or "profiles"."""
        from pipecore import report  # noqa: PLC0415

        scan = self._window.document.scan
        if scan is None or scan.result is None:
            return
        content = (scan.result, scan.reviews) if table == "deformations" else (scan.result,)
        write = getattr(report, f"write_{table}_csv")
        name = f"{self._stem()} {table}.csv"
        self._save(tr(EXPORT[table]), name, tr(CSV), lambda path: write(path, *content))

    def export_picture(self) -> None:
        """Ask where to, and save what the 3D view shows."""

        def write(path: Path) -> None:
            if not self._window.parts.scene.screenshot().save(str(path)):
                raise WriteError(tr("the folder cannot be written to."))

        self._save(tr("Save picture"), f"{self._stem()}.png", tr("Pictures (*.png)"), write)

    def save_plot(self, plot: "Chart", ending: str) -> None:
        """Ask where to, and save a plot as a picture or as numbers."""
        what = plot.accessibleName()
        selected = descriptions.title(self._window.document.result, self._window.document.selection)
        name = f"{self._stem()} {selected.replace(' · ', ' ')} {what.lower()}.{ending}"
        names = {"png": tr("Pictures (*.png)"), "svg": tr("Drawings (*.svg)"), "csv": tr(CSV)}

        def write(path: Path) -> None:
            with pipecore.io.write_file(path) as temporary:
                temporary.write_bytes(plot.as_file(ending))

        self._save(tr("Save {what}").format(what=inside(what)), name, names[ending], write)

    def export_report(self) -> None:
        """Ask where to, and write the whole report in the background."""
        from pipecore import report  # noqa: PLC0415

        window, scan = self._window, self._window.document.scan
        if scan is None or scan.result is None:
            return
        folder = file_dialogs.ask_report_folder(window, window.stored, f"{self._stem()} report")
        if folder is None:
            return
        cloud, result, reviews = scan.cloud, scan.result, scan.reviews

        def write(progress: Progress) -> None:
            report.write_report(folder, cloud, result, reviews=reviews, progress=progress)

        window.jobs.write(folder, write)

    def _stem(self) -> str:
        scan = self._window.document.scan
        return Path(scan.name).stem if scan else "pipes"

    def _save(self, title: str, name: str, name_filter: str, write: Callable[[Path], None]) -> None:
        window = self._window
        path = file_dialogs.ask_target(window, window.stored, title, name, name_filter)
        if path is None:
            return
        try:
            write(path)
        except (PipecoreError, OSError) as error:
            window.panels.message.tell(
                tr("“{path}” was not saved: {error}").format(path=path, error=error_text(error)),
                "error",
            )
        else:
            window.panels.message.tell(tr("Saved “{path}”.").format(path=path))

    # Help

    def search_actions(self) -> None:
        """Let the user find an action by its name."""
        if self._search is None:
            self._search = CommandSearch(self._window, self._window.actions_.entries)
        self._search.open()

    def show_shortcuts(self) -> None:
        """List the keys of all actions and panels."""
        ShortcutList(self._window).show()

    def show_about(self) -> None:
        """Say which version this is."""
        box = QMessageBox(self._window)
        box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        box.setWindowTitle(tr("About PipeGUI"))
        box.setText(f"PipeGUI {pipecore.__version__}")
        box.setInformativeText(
            tr(
                "Finds pipes in laser scans, measures them, and shows where they are deformed.\n\n"
                "After Mapurisa and Sithole, “Deformation detection in piping installations using "
                "profiling techniques”."
            )
        )
        box.open()
