"""What the user chose to see in plots and table, kept from one session to the next.

A part that has choices gives them as plain values, and takes them again. They are kept as
JSON, since a file of settings knows no lists of one or none.
"""

import json
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Protocol

from PySide6.QtCore import QSettings, SignalInstance
from PySide6.QtWidgets import QTabWidget


class Chooser(Protocol):
    """A part of the window with choices."""

    choices_changed: SignalInstance

    def choices(self) -> dict[str, Any]:
        """Return what is chosen, as plain values."""
        ...

    def choose(self, choices: Mapping[str, Any]) -> None:
        """Take choices; what is unknown or does not fit is passed over."""
        ...


def keep(stored: QSettings, parts: Mapping[str, Chooser]) -> None:
    """Give each part the choices of last time, and keep those to come under its name."""
    for name, part in parts.items():
        key = f"choices/{name}"
        choices: Any = None
        with suppress(ValueError):
            choices = json.loads(str(stored.value(key, "")))
        if isinstance(choices, dict):
            part.choose(choices)

        def remember(part: Chooser = part, key: str = key) -> None:
            stored.setValue(key, json.dumps(part.choices()))

        part.choices_changed.connect(remember)


def keep_tab(stored: QSettings, tabs: QTabWidget) -> None:
    """Show the tab that was shown last time, and remember which one is."""
    key = f"choices/{tabs.objectName()}"
    with suppress(ValueError):
        tabs.setCurrentIndex(int(str(stored.value(key, 0))))
    tabs.currentChanged.connect(lambda i: stored.setValue(key, i))
