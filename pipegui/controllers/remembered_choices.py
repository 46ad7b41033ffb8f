"""What the user chose to see in plots and table, kept from one session to the next.

A view with preferences returns them as plain values, and takes them again. They are stored
as JSON, since an INI file cannot hold lists of one item or none.
"""

import json
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Protocol

from PySide6.QtCore import QSettings, SignalInstance
from PySide6.QtWidgets import QTabWidget


class HasPreferences(Protocol):
    """A view whose choices are remembered."""

    choices_changed: SignalInstance

    def choices(self) -> dict[str, Any]:
        """Return what is chosen, as plain values."""
        ...

    def choose(self, choices: Mapping[str, Any]) -> None:
        """Take choices; unknown and invalid ones are ignored."""
        ...


def remember_choices(stored: QSettings, views: Mapping[str, HasPreferences]) -> None:
    """Give each view its stored choices, and store those to come under its name.

    Parameters
    ----------
    stored : QSettings
        Where choices are stored.
    views : mapping
        Views by the names under which their choices are stored.
    """
    for name, view in views.items():
        key = f"choices/{name}"
        choices: Any = None
        with suppress(ValueError):
            choices = json.loads(str(stored.value(key, "")))
        if isinstance(choices, dict):
            view.choose(choices)

        def store(view: HasPreferences = view, key: str = key) -> None:
            stored.setValue(key, json.dumps(view.choices()))

        view.choices_changed.connect(store)


def remember_tab(stored: QSettings, tabs: QTabWidget) -> None:
    """Show the tab shown last time, and store which one is shown from now on."""
    key = f"choices/{tabs.objectName()}"
    with suppress(ValueError):
        tabs.setCurrentIndex(int(str(stored.value(key, 0))))
    tabs.currentChanged.connect(lambda i: stored.setValue(key, i))
