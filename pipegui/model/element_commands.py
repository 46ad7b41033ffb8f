"""Edits of a result: commands as in `pipegui.model.commands`.

Edits that need the cloud's points are computed in the background and applied by `apply_edit`.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace

from pipecore.rules import QUESTIONS
from pipecore.types import NO_ID, NominalSize, PointCloud, Question, Result
from pipegui.i18n.texts import label_of, mark, run_label, tr
from pipegui.model.commands import step
from pipegui.model.document import Document, Scan
from pipegui.model.selection import carry_over_reviews, carry_over_selection


def _names(document: Document, element_ids: Iterable[int]) -> str:
    labels = (
        {e.element_id: label_of(e) for e in document.result.elements} if document.result else {}
    )
    return ", ".join(labels.get(i, tr("element {i}").format(i=i)) for i in sorted(element_ids))


@step(
    lambda document, element_ids: tr("Delete {names}").format(names=_names(document, element_ids))
)
def delete_elements(document: Document, element_ids: Collection[int]) -> Document:
    """Delete elements and their deformations."""
    from pipecore import editing  # noqa: PLC0415 - loads numba

    if document.result is None or not element_ids:
        return document
    return _with_result(
        document, document.active, editing.delete_elements(document.result, element_ids)
    )


@step(mark("Dismiss what was not accepted"))
def dismiss_candidates(document: Document, candidate_ids: Collection[int]) -> Document:
    """Take candidates from the list of what was not accepted."""
    from pipecore import editing  # noqa: PLC0415 - loads numba

    if document.result is None or not candidate_ids:
        return document
    result = editing.dismiss_candidates(document.result, candidate_ids)
    return _with_result(document, document.active, result)


def dismiss_all_candidates(document: Document) -> Document:
    """Empty the list of what was not accepted."""
    candidates = document.result.candidates if document.result is not None else ()
    return dismiss_candidates(document, [c.candidate_id for c in candidates])


@step(
    lambda document, element_id, name: tr("Rename {names}").format(
        names=_names(document, [element_id])
    )
)
def rename_element(document: Document, element_id: int, name: str) -> Document:
    """Name an element; "" restores its kind and number."""
    from pipecore.editing import name_element  # noqa: PLC0415 - loads numba

    if document.result is None or label_of(document.result.element(element_id)) == name.strip():
        return document
    return _with_result(document, document.active, name_element(document.result, element_id, name))


@step(
    lambda document, run_id, name: tr("Rename {names}").format(
        names=run_label(document.result, run_id) if document.result else ""
    )
)
def rename_run(document: Document, run_id: int, name: str) -> Document:
    """Name a run; "" restores its number."""
    from pipecore.editing import name_run  # noqa: PLC0415 - loads numba

    if document.result is None or run_label(document.result, run_id) == name.strip():
        return document
    return _with_result(document, document.active, name_run(document.result, run_id, name))


@step(
    lambda document, element_id, size: tr("Change size of {names}").format(
        names=_names(document, [element_id])
    )
)
def set_nominal_size(document: Document, element_id: int, size: NominalSize | None) -> Document:
    """Set the catalogue size of an element."""
    from pipecore import editing  # noqa: PLC0415 - loads numba

    if document.result is None:
        return document
    element = document.result.element(element_id)
    if element.nominal == size and element.is_nominal_confirmed == (size is not None):
        return document
    return _with_result(
        document, document.active, editing.set_nominal_size(document.result, element_id, size)
    )


@step(mark("Answer"))
def answer(
    document: Document,
    deformation_id: int,
    element_id: int,
    answers: Mapping[Question, bool | None],
) -> Document:
    """Answer what the rules ask of a deformation, or of its element where they ask of that."""
    from pipecore import editing  # noqa: PLC0415 - loads numba

    result = document.result
    assert result is not None
    for question, said in answers.items():
        if deformation_id and not QUESTIONS[question].is_of_element:
            result = editing.answer_for_deformation(result, deformation_id, question, said)
        else:
            result = editing.answer_for_element(result, element_id, question, said)
    return _with_result(document, document.active, result)


@step(mark("Rename scan"))
def rename_scan(document: Document, index: int, name: str) -> Document:
    """Rename a scan; its file keeps its name."""
    name = " ".join(name.split())
    if not name or name == document.scans[index].name:
        return document
    return _with_scan(document, index, replace(document.scans[index], name=name))


@step(lambda document, cloud, before, after, text: text)
def apply_edit(
    document: Document, cloud: PointCloud, before: Result, after: Result, text: str
) -> Document:
    """Replace a scan's result by an edited one, unless it has been changed meanwhile."""
    index = scan_index_of(document, cloud, before)
    return document if index is None else _with_result(document, index, after)


def scan_index_of(document: Document, cloud: PointCloud, result: Result) -> int | None:
    """Return the index of the scan with this cloud and result, None if there is none."""
    return next(
        (i for i, s in enumerate(document.scans) if s.cloud is cloud and s.result is result), None
    )


def mark_elements(document: Document, element_ids: Iterable[int]) -> Document:
    """Select more elements in addition to the selected one."""
    selection = document.selection
    others = frozenset(element_ids) - {selection.element_id, NO_ID}
    if not selection.element_id or others == selection.others:
        return document
    return replace(document, selection=replace(selection, others=others))


def _with_scan(document: Document, index: int, scan: Scan) -> Document:
    scans = list(document.scans)
    scans[index] = scan
    return replace(document, scans=tuple(scans))


def _with_result(document: Document, index: int, result: Result) -> Document:
    """A scan with its result changed by hand: what was not touched stays selected and hidden."""
    scan = document.scans[index]
    reviews = carry_over_reviews(scan.reviews, scan.result, result)
    changed = _with_scan(document, index, replace(scan, result=result, reviews=reviews))
    if index != document.active:
        return changed
    ids = {e.element_id for e in result.elements}
    view = document.view
    return replace(
        changed,
        selection=carry_over_selection(document.selection, scan.result, result),
        view=replace(
            view,
            hidden_elements=view.hidden_elements & ids,
            pinned_elements=tuple(i for i in view.pinned_elements if i in ids),
        ),
    )
