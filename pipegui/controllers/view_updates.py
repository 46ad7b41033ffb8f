"""From a new document to the views: resolve it, and hand each view what changed for it."""

from collections.abc import Callable, Mapping
from typing import Any

from PySide6.QtCore import QObject

from pipegui.controllers.session import Session
from pipegui.model.action_conditions import action_conditions
from pipegui.model.document import Document
from pipegui.states.view_state import resolve


class ViewUpdates(QObject):
    """Keeps the views showing the session's document.

    Parameters
    ----------
    session : Session
        Its document is shown.
    consumers : mapping
        Takes each part of a `ViewState`, by the part's name.
    show_actions : callable
        Takes what actions may need, and the names of the steps to undo and redo.
    """

    def __init__(
        self,
        session: Session,
        consumers: Mapping[str, Callable[[Any], object]],
        show_actions: Callable[[Mapping[str, bool], str, str], object],
    ) -> None:
        super().__init__(session)
        self._session, self._consumers = session, dict(consumers)
        self._show_actions = show_actions
        self._state = resolve(session.document)

    def show(self, document: Document) -> None:
        """Show a document: views whose part of the state is as before are left alone."""
        before, self._state = self._state, resolve(document)
        for name, consume in self._consumers.items():
            if getattr(self._state, name) != getattr(before, name):
                consume(getattr(self._state, name))
        self.update_actions()

    def refresh(self) -> None:
        """Hand every view its part of the state again."""
        for name, consume in self._consumers.items():
            consume(getattr(self._state, name))
        self.update_actions()

    def update_actions(self) -> None:
        """Enable the actions that make sense now."""
        session = self._session
        conditions = action_conditions(session.document, is_busy=session.jobs.is_busy)
        self._show_actions(conditions, session.history.undo_text, session.history.redo_text)
