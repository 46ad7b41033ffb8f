"""Edits and reviews of the selected elements.

Edits that need the cloud's points run in the background.
"""

from collections.abc import Callable

from PySide6.QtCore import QObject, Qt
from PySide6.QtWidgets import QInputDialog, QWidget

from pipecore.catalogues import sizes_of_all
from pipecore.rules import QUESTIONS, questions_of
from pipecore.types import ElementKind, PointCloud, Question, Result, ReviewState
from pipegui.controllers.session import Session
from pipegui.i18n.texts import (
    candidate_label,
    first_capital,
    format_measure,
    label_of,
    mark,
    tr,
)
from pipegui.model import commands, element_commands
from pipegui.model.document import Scan
from pipegui.model.result_queries import rules_of
from pipegui.model.selection import elements_of
from pipegui.panels.answers_dialog import AnswersDialog
from pipegui.panels.project_tree import NodeKind
from pipegui.work.job_queue import Edited
from pipegui.work.worker import JobProgress

NO_SIZE = mark("No nominal size")
Edit = Callable[[PointCloud, Result, JobProgress], Result]


class ElementEdits(QObject):
    """Edits and reviews what is selected in the session's document."""

    def __init__(self, session: Session, window: QWidget) -> None:
        super().__init__(session)
        self._session, self._window = session, window

    def _targets(self) -> tuple[Scan, Result, list[int]]:
        """The active scan, its result, and the ids of the selected elements."""
        document = self._session.document
        assert document.scan is not None
        assert document.scan.result is not None
        result = document.scan.result
        return document.scan, result, elements_of(result, document.selection)

    # Immediate

    def delete(self) -> None:
        """Delete the selected elements."""
        _, _, ids = self._targets()
        self._session.do(element_commands.delete_elements, ids)

    def name(self, scan_index: int, kind: NodeKind, item_id: int, name: str) -> None:
        """Name a scan, or a run or an element of the active one."""
        match kind:
            case NodeKind.SCAN:
                self._session.do(element_commands.rename_scan, scan_index, name)
            case NodeKind.RUN:
                self._session.do(element_commands.rename_run, item_id, name)
            case NodeKind.ELEMENT:
                self._session.do(element_commands.rename_element, item_id, name)

    def hide(self) -> None:
        """Hide the selected elements."""
        self._session.do(commands.set_hidden, self._targets()[2], True)

    def size(self) -> None:
        """Ask for the catalogue size of the selected element."""
        _, result, [element_id] = self._targets()
        element = result.element(element_id)
        sizes = sizes_of_all(result.settings.elements.catalogue)
        names = [tr(NO_SIZE)]
        for s in sizes:
            od = tr("OD {od:.1f} mm").format(od=1000 * s.outside_diameter)
            names.append(f"{s.name} · {od}")
        nearest = min(sizes, key=lambda s: abs(s.outside_diameter - 2 * element.radius))
        here = 1 + sizes.index(element.nominal if element.nominal in sizes else nearest)
        measured = format_measure(2000 * element.radius, 2000 * element.radius_sd, "mm")
        self._choose(
            tr("Nominal size"),
            tr("{label} measures OD {measured}. It is:").format(
                label=label_of(element), measured=measured
            ),
            names,
            here,
            lambda i: self._session.do(
                element_commands.set_nominal_size, element_id, sizes[i - 1] if i else None
            ),
        )

    def answer(self) -> None:
        """Ask what the rules ask of the selected deformation, or of the selected element."""
        _, result, _ = self._targets()
        selection = self._session.document.selection
        element = result.element(selection.element_id)
        rules = rules_of(result, element.element_id)
        deformation_id = selection.deformation_id
        if deformation_id:
            deformation = result.deformation(deformation_id)
            title = tr("{kind} on {label}").format(
                kind=first_capital(tr(deformation.kind)), label=label_of(element)
            )
            asked = questions_of(rules, deformation.kind, element)
            known = {**element.answers, **deformation.answers}
        else:
            title = label_of(element)
            asked = [q for q, text in QUESTIONS.items() if text.is_of_element]
            known = dict(element.answers)
        asked = [q for q in QUESTIONS if q in {*asked, Question.CLAD} and q is not Question.WALL]
        dialog = AnswersDialog(title, asked, known, self._window)
        dialog.answered.connect(
            lambda answers: self._session.do(
                element_commands.answer, deformation_id, element.element_id, answers
            )
        )
        dialog.open()

    def review(self, state: ReviewState) -> None:
        """Accept or reject the selected deformation, or leave it open."""
        deformation_id = self._session.document.selection.deformation_id
        if deformation_id:
            self._session.do(commands.set_review, [deformation_id], state)

    def dismiss_candidate(self) -> None:
        """Take the selected candidate from the list of what was not accepted."""
        candidate_id = self._session.document.selection.candidate_id
        self._session.do(element_commands.dismiss_candidates, [candidate_id])

    # In the background

    def accept_candidate(self) -> None:
        """Make an element of the selected candidate, measured like any other."""
        from pipecore.editing import accept_candidate  # noqa: PLC0415 - loads numba

        _, result, _ = self._targets()
        candidate_id = self._session.document.selection.candidate_id
        self._run_edit(
            tr("Measuring"),
            tr("Accept {name}").format(name=candidate_label(result.candidate(candidate_id))),
            lambda c, r, p: accept_candidate(c, r, candidate_id, p),
        )

    def merge(self) -> None:
        """Make one element of the selected ones."""
        from pipecore.editing import merge_elements  # noqa: PLC0415 - loads numba

        _, result, ids = self._targets()
        names = tr(" and ").join(label_of(result.element(i)) for i in ids)
        self._run_edit(
            tr("Merging"),
            tr("Merge {names}").format(names=names),
            lambda c, r, p: merge_elements(c, r, ids, p),
        )

    def split(self) -> None:
        """Ask where to split the selected element."""
        _, result, [element_id] = self._targets()
        element = result.element(element_id)
        length = element.axis.length
        dialog = QInputDialog(self._window)
        dialog.setWindowTitle(tr("Split element"))
        dialog.setInputMode(QInputDialog.InputMode.DoubleInput)
        dialog.setLabelText(
            tr("Split {label} ({length:.3f} m long) at chainage, m:").format(
                label=label_of(element), length=length
            )
        )
        dialog.setDoubleRange(0.0, length)
        dialog.setDoubleDecimals(3)
        dialog.setDoubleStep(0.01)
        dialog.setDoubleValue(self._shown_chainage(result, length / 2))
        dialog.doubleValueSelected.connect(lambda s: self._split_at(element_id, s))
        self._open(dialog)

    def _shown_chainage(self, result: Result, otherwise: float) -> float:
        """Chainage of the selected profile or deformation."""
        selection = self._session.document.selection
        if selection.profile is not None:
            rows = result.profiles.of_element(selection.element_id, selection.profile.stack_id)
            return float(rows.chainage[rows.profile_index == selection.profile.profile_index][0])
        if selection.deformation_id:
            return result.deformation(selection.deformation_id).chainage
        return otherwise

    def _split_at(self, element_id: int, chainage: float) -> None:
        from pipecore.editing import split_element  # noqa: PLC0415 - loads numba

        self._run_edit(
            tr("Splitting"),
            tr("Split {label}").format(label=self._label(element_id)),
            lambda c, r, p: split_element(c, r, element_id, chainage, p),
        )

    def kind(self) -> None:
        """Ask what the selected element is."""
        from pipecore.editing import kinds_of  # noqa: PLC0415 - loads numba

        _, result, [element_id] = self._targets()
        element = result.element(element_id)
        kinds = kinds_of(element)
        self._choose(
            tr("Kind of element"),
            tr("{label} is a:").format(label=label_of(element)),
            [tr(kind) for kind in kinds],
            kinds.index(element.kind) if element.kind in kinds else 0,
            lambda i: self._change_kind(element_id, kinds[i]),
        )

    def _change_kind(self, element_id: int, kind: ElementKind) -> None:
        from pipecore.editing import change_kind  # noqa: PLC0415 - loads numba

        _, result, _ = self._targets()
        if result.element(element_id).kind is not kind:
            self._run_edit(
                tr("Measuring"),
                tr("Change {label} to {kind}").format(label=self._label(element_id), kind=kind),
                lambda c, r, p: change_kind(c, r, element_id, kind, p),
            )

    def detect_around(self) -> None:
        """Detect again around the selected elements, with the present settings."""
        from pipecore import editing  # noqa: PLC0415 - loads numba
        from pipecore.pipeline import STAGES  # noqa: PLC0415

        _, result, ids = self._targets()
        names = ", ".join(label_of(result.element(i)) for i in ids[:3]) + (
            "…" if len(ids) > 3 else ""
        )
        settings = self._session.document.detection_settings

        def change(cloud: PointCloud, result: Result, progress: JobProgress) -> Result:
            progress.expect(STAGES)
            index = editing.points_around(cloud, result, ids)
            return editing.detect_again(cloud, result, index, settings, progress, ids)

        self._run_edit(
            tr("Detecting again"),
            tr("Detect again around {names}").format(names=names),
            change,
            expected=False,
        )

    def detect_in_box(self) -> None:
        """Detect again in the clipping box, with the present settings."""
        from pipecore import editing  # noqa: PLC0415 - loads numba
        from pipecore.pipeline import STAGES  # noqa: PLC0415

        document = self._session.document
        box, settings = document.view.clip_box, document.detection_settings
        assert box is not None

        def change(cloud: PointCloud, result: Result, progress: JobProgress) -> Result:
            progress.expect(STAGES)
            index = editing.points_in_box(cloud, box.low, box.high)
            return editing.detect_again(cloud, result, index, settings, progress)

        self._run_edit(
            tr("Detecting in the box"), tr("Detect again in the box"), change, expected=False
        )

    def on_edited(self, edited: Edited) -> None:
        """Take an edit that ran in the background, unless the result was changed meanwhile."""
        document = self._session.document
        if element_commands.scan_index_of(document, edited.cloud, edited.before) is None:
            self._session.show_message(
                tr(
                    "“{text}” was dropped: the elements were changed meanwhile. Do it again."
                ).format(text=edited.text),
                "warning",
            )
            return
        before, after = edited.before, edited.after
        self._session.do(element_commands.apply_edit, edited.cloud, before, after, edited.text)
        self._session.show_message(
            tr("{text}: done. {difference}")
            .format(text=edited.text, difference=_difference(before, after))
            .strip()
        )

    def _run_edit(self, title: str, text: str, edit: Edit, *, expected: bool = True) -> None:
        scan, result, _ = self._targets()
        cloud = scan.cloud

        def work(progress: JobProgress) -> Result:
            from pipecore.editing import STAGES  # noqa: PLC0415 - loads numba

            if expected:
                progress.expect(STAGES)
            return edit(cloud, result, progress)

        self._session.jobs.edit(title, text, cloud, result, work)

    # Asking

    def _label(self, element_id: int) -> str:
        _, result, _ = self._targets()
        return label_of(result.element(element_id))

    def _choose(
        self, title: str, label: str, names: list[str], here: int, take: Callable[[int], object]
    ) -> None:
        dialog = QInputDialog(self._window)
        dialog.setWindowTitle(title)
        dialog.setLabelText(label)
        dialog.setComboBoxItems(names)
        dialog.setTextValue(names[here])
        dialog.textValueSelected.connect(lambda name: take(names.index(name)))
        self._open(dialog)

    def _open(self, dialog: QInputDialog) -> None:
        dialog.setObjectName("ask")
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.open()


def _difference(before: Result, after: Result) -> str:
    """Say which elements are new, with their measures."""
    known = {id(e) for e in before.elements}
    new = [e for e in after.elements if id(e) not in known]
    if not 1 <= len(new) <= 3:
        return ""
    return "; ".join(
        f"{label_of(e)}: r {format_measure(1000 * e.radius, 1000 * e.radius_sd, 'mm')}, "
        f"{e.axis.length:.2f} m"
        for e in new
    )
