"""The dialog in which a person answers what the rules ask."""

from collections.abc import Iterable

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QIcon
from PySide6.QtWidgets import (
    QButtonGroup,
    QDialog,
    QDialogButtonBox,
    QGridLayout,
    QLabel,
    QRadioButton,
    QVBoxLayout,
    QWidget,
)

from pipecore.rules import QUESTIONS
from pipecore.types import Answers, Question
from pipegui.i18n.texts import tr
from pipegui.style import theme

Button = QDialogButtonBox.StandardButton
ANSWERS = True, False, None


class AnswersDialog(QDialog):
    """Asks questions that are answered by yes, no, or not yet.

    Parameters
    ----------
    title : str
        Of what is asked.
    questions : iterable of Question
    answers : mapping of Question to bool
        What is answered already.
    parent : QWidget, optional
        It opens over this one.
    """

    answered = Signal(object)
    """What was changed: yes, no or None by question."""

    def __init__(
        self,
        title: str,
        questions: Iterable[Question],
        answers: Answers,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("answers")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle(title)
        self._before = answers
        self.groups: dict[Question, QButtonGroup] = {}
        heading = QLabel(
            tr("A scan cannot tell this. What is open is named in the verdict where it matters.")
        )
        heading.setWordWrap(True)
        grid = QGridLayout()
        grid.setHorizontalSpacing(2 * theme.SPACING)
        grid.setColumnStretch(0, 1)
        texts = tr("Yes"), tr("No"), tr("Not known")
        for row, question in enumerate(questions):
            asked = tr(QUESTIONS[question].question)
            label = QLabel(asked)
            label.setWordWrap(True)
            label.setMinimumWidth(40 * theme.SPACING)
            grid.addWidget(label, row, 0)
            group = self.groups[question] = QButtonGroup(self)
            for column, (answer, text) in enumerate(zip(ANSWERS, texts, strict=True)):
                button = QRadioButton(text)
                button.setAccessibleName(f"{asked} {text}")
                button.setChecked(answers.get(question) is answer)
                group.addButton(button, column)
                grid.addWidget(button, row, column + 1)
        buttons = QDialogButtonBox(Button.Ok | Button.Cancel)
        for standard, text in ((Button.Ok, tr("Judge")), (Button.Cancel, tr("Cancel"))):
            buttons.button(standard).setText(text)
            buttons.button(standard).setIcon(QIcon())
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        column_layout = QVBoxLayout(self)
        column_layout.setSpacing(2 * theme.SPACING)
        column_layout.addWidget(heading)
        column_layout.addLayout(grid)
        column_layout.addWidget(buttons)

    def accept(self) -> None:
        """Close, and tell what was changed."""
        given = {q: ANSWERS[group.checkedId()] for q, group in self.groups.items()}
        changed = {q: answer for q, answer in given.items() if answer is not self._before.get(q)}
        super().accept()
        if changed:
            self.answered.emit(changed)
