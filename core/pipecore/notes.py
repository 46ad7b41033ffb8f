"""Notes on what was read: sentences that keep their templates and values."""

from typing import Any

from pipecore.reasons import Reason


class Note(Reason):
    """One sentence for the person at the screen, such as a warning about a file.

    Parameters are those of `Reason`.
    """

    __slots__ = ()

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self.template, self.values)


def _restored(template: str, values: dict[str, Any]) -> Note:
    note = Note(template, **values)
    assert isinstance(note, Note)
    return note
