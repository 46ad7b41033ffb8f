"""What the controllers share: the document with its history, the jobs, the stored settings."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from PySide6.QtCore import QObject, QSettings, Signal

from pipecore.errors import PipecoreError
from pipegui.i18n.texts import error_text
from pipegui.model.document import Document
from pipegui.model.history import History
from pipegui.panels.message_bar import MessageBar
from pipegui.work.job_queue import JobQueue

NO_ANSWERS: Mapping[str, Callable[[], object]] = MappingProxyType({})


class Session(QObject):
    """The work of one window.

    Parameters
    ----------
    jobs : JobQueue
        Long work: reading, detecting, writing. It ends with the session.
    stored : QSettings
        What is remembered from one start of the program to the next.
    messages : MessageBar
        Where messages to the user are shown.
    parent : QObject, optional
        What the session ends with.
    """

    changed = Signal(object)
    """The new `Document`."""
    refused = Signal()
    """A command was refused: fields that show what was asked for have to be set back."""

    def __init__(
        self,
        jobs: JobQueue,
        stored: QSettings,
        messages: MessageBar,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(parent)
        self.jobs, self.stored, self._messages = jobs, stored, messages
        # Python does not see the references that Qt's connections hold: the jobs have to
        # go with the session.
        jobs.setParent(self)
        self.history = History(changed=self.changed.emit)

    @property
    def document(self) -> Document:
        """The present document."""
        return self.history.document

    def do(self, command: Callable[..., Document], *args: Any, **kwargs: Any) -> None:
        """Carry out a command; if it is refused, say why and leave the document as it is."""
        try:
            self.history.do(command, *args, **kwargs)
        except PipecoreError as error:
            self.show_message(error_text(error), "warning")
            self.refused.emit()

    def undo(self) -> None:
        """Undo the last step; the message about it is hidden."""
        self.hide_message()
        self.history.undo()

    def redo(self) -> None:
        """Redo the step undone last; the message about it is hidden."""
        self.hide_message()
        self.history.redo()

    def show_message(
        self,
        text: str,
        severity: str = "info",
        details: str = "",
        answers: Mapping[str, Callable[[], object]] = NO_ANSWERS,
    ) -> None:
        """Show a message above the 3D view, as `MessageBar.tell` does."""
        self._messages.tell(text, severity, details, answers)

    def hide_message(self) -> None:
        """Hide the message above the 3D view."""
        self._messages.hide()
