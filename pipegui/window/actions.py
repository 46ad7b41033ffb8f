"""The window's actions and menus, made from the table in `pipegui.window.action_table`."""

from collections.abc import Callable, Mapping

from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QMainWindow, QMenu

from pipegui.i18n.texts import plain_title, tr
from pipegui.style import theme
from pipegui.window.action_table import MENUS, SPECS, ActionSpec
from pipegui.window.command_palette import Entry


class Actions:
    """The window's `QAction`s by name, in its menus."""

    def __init__(self, window: QMainWindow) -> None:
        self.menus: dict[str, QMenu] = {}
        self._actions: dict[str, QAction] = {}
        for name, specs in MENUS.items():
            menu = self.menus[name] = window.menuBar().addMenu(_with_key(tr(name)))
            for spec in specs:
                if spec is None:
                    menu.addSeparator()
                    continue
                self._actions[spec.name] = action = _make(spec, window)
                (self._submenu(menu, spec.submenu) if spec.submenu else menu).addAction(action)

    def connect(self, handlers: Mapping[str, Callable[..., object]]) -> None:
        """Call a handler when its action is triggered; those with a check mark get it as `bool`.

        Parameters
        ----------
        handlers : mapping
            One for each action, by the action's name.
        """
        for spec in SPECS:
            handler = handlers[spec.name]
            if spec.is_checkable:
                self._actions[spec.name].toggled.connect(handler)
            else:
                # `triggered` hands over a check mark all the same.
                self._actions[spec.name].triggered.connect(
                    lambda _=False, handler=handler: handler()
                )

    def _submenu(self, menu: QMenu, title: str) -> QMenu:
        if title not in self.menus:
            self.menus[title] = menu.addMenu(tr(title))
        return self.menus[title]

    def __getitem__(self, name: str) -> QAction:
        return self._actions[name]

    def entries(self) -> list[Entry]:
        """All actions with the names of their menus."""
        return [
            Entry(self._actions[spec.name], plain_title(tr(menu)))
            for menu, specs in MENUS.items()
            for spec in specs
            if spec is not None
        ]

    def update(self, conditions: Mapping[str, bool]) -> None:
        """Enable the actions whose needs are met."""
        for spec in SPECS:
            self._actions[spec.name].setEnabled(
                all(conditions[need] for need in spec.needs.split())
            )

    def set_checked(self, name: str, checked: bool) -> None:
        """Show a check mark without acting on it."""
        action = self._actions[name]
        action.blockSignals(True)
        action.setChecked(checked)
        action.blockSignals(False)


def _with_key(title: str) -> str:
    """A menu's title with the mark of its key: the first letter, if the translation has none."""
    return title if "&" in title else f"&{title}"


def _make(spec: ActionSpec, window: QMainWindow) -> QAction:
    tip = tr(spec.tip)
    action = QAction(tr(spec.text), window)
    action.setObjectName(spec.name)
    action.setCheckable(spec.is_checkable)
    if spec.icon:
        theme.set_icon(action, spec.icon)
    action.setShortcut(QKeySequence(spec.shortcut))
    shortcut = action.shortcut().toString(QKeySequence.SequenceFormat.NativeText)
    action.setToolTip(f"{tip} ({shortcut})" if shortcut else tip)
    action.setStatusTip(tip)
    return action
