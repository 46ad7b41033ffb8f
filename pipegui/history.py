"""The present document and the ones before and after it: do, undo, redo. Qt-free."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pipegui.commands import after_undo
from pipegui.document import Document


@dataclass(frozen=True)
class Revision:
    """A document to return to, and what the step between it and the present is called."""

    document: Document
    text: str


class History:
    """Holds the document; `changed` is called with the new one after every change."""

    def __init__(
        self,
        document: Document | None = None,
        changed: Callable[[Document], None] = lambda document: None,
    ) -> None:
        self.document = document if document is not None else Document()
        self.changed = changed
        self._past: list[Revision] = []
        self._future: list[Revision] = []

    def do(self, command: Callable[..., Document], *args: Any, **kwargs: Any) -> None:
        """Carry out a command; a step (see `commands.step`) can be undone."""
        before = self.document
        after = command(before, *args, **kwargs)
        if after is before:
            return
        text = getattr(command, "undo_text", "")
        if text:
            self._past.append(Revision(before, text))
            self._future.clear()
        self._show(after)

    def undo(self) -> None:
        """Go back one step, if there is one."""
        self._move(self._past, self._future)

    def redo(self) -> None:
        """Go forward again, if something was undone."""
        self._move(self._future, self._past)

    def _move(self, source: list[Revision], target: list[Revision]) -> None:
        if not source:
            return
        revision = source.pop()
        target.append(Revision(self.document, revision.text))
        self._show(after_undo(self.document, revision.document))

    def _show(self, document: Document) -> None:
        self.document = document
        self.changed(document)

    @property
    def undo_text(self) -> str:
        """What would be undone, or ""."""
        return self._past[-1].text if self._past else ""

    @property
    def redo_text(self) -> str:
        """What would be done again, or ""."""
        return self._future[-1].text if self._future else ""
