"""The present document and the ones before and after it: do, undo, redo."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from pipegui.model.commands import after_undo
from pipegui.model.document import Document


@dataclass(frozen=True)
class Revision:
    """A document to return to, and what the step between it and the present is called."""

    document: Document
    text: str


BUDGET_BYTES = 2 << 30
"""The oldest steps are dropped where they hold more memory than this."""


class History:
    """Holds the document; `changed` is called with the new one after every change."""

    def __init__(
        self,
        document: Document | None = None,
        changed: Callable[[Document], None] = lambda document: None,
        budget_bytes: int = BUDGET_BYTES,
    ) -> None:
        self._budget_bytes = budget_bytes
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
        if callable(text):
            text = text(before, *args, **kwargs)
        if text:
            self._past.append(Revision(before, text))
            self._future.clear()
            while self._past and self._extra_bytes(after) > self._budget_bytes:
                del self._past[0]
        self._show(after)

    def reset(self, document: Document) -> None:
        """Replace the document and clear the history."""
        self._past.clear()
        self._future.clear()
        self._show(document)

    def _extra_bytes(self, present: Document) -> int:
        """Memory of the arrays by point that only past documents hold."""
        own = _arrays_of(present)
        held: dict[int, int] = {}
        for revision in self._past:
            held |= _arrays_of(revision.document)
        return sum(n_bytes for key, n_bytes in held.items() if key not in own)

    def undo(self) -> None:
        """Go back one step, if there is one."""
        self._move(self._past, self._future)

    def redo(self) -> None:
        """Go forward again, if something was undone."""
        self._move(self._future, self._past)

    @property
    def steps(self) -> list[str]:
        """What was done, the first step first, and what was undone after it."""
        return [r.text for r in self._past] + [r.text for r in reversed(self._future)]

    @property
    def n_done(self) -> int:
        """How many of `steps` are done; the others were undone."""
        return len(self._past)

    def go_to(self, n_done: int) -> None:
        """Undo or redo until so many steps are done."""
        while len(self._past) > max(n_done, 0):
            self.undo()
        while len(self._past) < n_done and self._future:
            self.redo()

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


def _arrays_of(document: Document) -> dict[int, int]:
    """Sizes in bytes of a document's arrays by point, by the identity of the array."""
    arrays: list[NDArray[Any]] = []
    for scan in document.scans:
        arrays.append(scan.cloud.xyz)
        if scan.result is not None:
            arrays += [scan.result.segment_id, scan.result.element_id, scan.result.deviation]
    return {id(array): array.nbytes for array in arrays}
