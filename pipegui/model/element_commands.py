"""What the user changes by hand in a result: commands as in `pipegui.model.commands`.

What needs the cloud's points is worked out elsewhere and taken by `take_edit`. Qt-free.
"""

from collections.abc import Collection, Iterable
from dataclasses import replace

from pipecore.types import NO_ID, NominalSize, PointCloud, Result
from pipegui.i18n.texts import label_of, mark, run_label, tr
from pipegui.model import selection as selecting
from pipegui.model.commands import step
from pipegui.model.document import Document, Scan


def _names(document: Document, element_ids: Iterable[int]) -> str:
    labels = (
        {e.element_id: label_of(e) for e in document.result.elements} if document.result else {}
    )
    return ", ".join(labels.get(i, tr("element {i}").format(i=i)) for i in sorted(element_ids))


@step(
    lambda document, element_ids: tr("Delete {names}").format(names=_names(document, element_ids))
)
def delete_elements(document: Document, element_ids: Collection[int]) -> Document:
    """Take elements away, with their deformations."""
    from pipecore.editing import delete_elements as deleted  # noqa: PLC0415 - loads numba

    if document.result is None or not element_ids:
        return document
    return _with_result(document, document.active, deleted(document.result, element_ids))


@step(
    lambda document, element_id, name: tr("Rename {names}").format(
        names=_names(document, [element_id])
    )
)
def rename_element(document: Document, element_id: int, name: str) -> Document:
    """Call an element by a name; "" goes back to its kind and number."""
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
    """Call a run by a name; "" goes back to its number."""
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
    """Say which catalogue size an element has."""
    from pipecore.editing import set_nominal_size as sized  # noqa: PLC0415 - loads numba

    if document.result is None or document.result.element(element_id).nominal == size:
        return document
    return _with_result(document, document.active, sized(document.result, element_id, size))


@step(mark("Rename scan"))
def rename_scan(document: Document, index: int, name: str) -> Document:
    """Call a scan by another name; its file keeps its own."""
    name = " ".join(name.split())
    if not name or name == document.scans[index].name:
        return document
    return _with_scan(document, index, replace(document.scans[index], name=name))


@step(lambda document, cloud, before, after, text: text)
def take_edit(
    document: Document, cloud: PointCloud, before: Result, after: Result, text: str
) -> Document:
    """Take what became of a result; nothing changes if it is no longer the scan's."""
    index = place_of(document, cloud, before)
    return document if index is None else _with_result(document, index, after)


def place_of(document: Document, cloud: PointCloud, result: Result) -> int | None:
    """Return which scan has this cloud and result, None if there is none."""
    return next(
        (i for i, s in enumerate(document.scans) if s.cloud is cloud and s.result is result), None
    )


def mark_elements(document: Document, element_ids: Iterable[int]) -> Document:
    """Select more elements besides the selected one, to do something with all of them."""
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
    reviews = selecting.reviews_carried_over(scan.reviews, scan.result, result)
    changed = _with_scan(document, index, replace(scan, result=result, reviews=reviews))
    if index != document.active:
        return changed
    ids = {e.element_id for e in result.elements}
    view = document.view
    return replace(
        changed,
        selection=selecting.carried_over(document.selection, scan.result, result),
        view=replace(
            view,
            hidden_elements=view.hidden_elements & ids,
            pinned_elements=tuple(i for i in view.pinned_elements if i in ids),
        ),
    )
