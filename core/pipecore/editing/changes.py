"""Changes that need no point of the cloud: deleting, naming, sizing."""

from collections.abc import Collection
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.deformation import relate_deformations
from pipecore.errors import EditError, SettingsError
from pipecore.geometry import LineAxis
from pipecore.rules import judge_all
from pipecore.settings import Settings
from pipecore.types import NO_ID, Element, ElementKind, NominalSize, Result

NOT_RELATED: dict[str, Any] = {
    "fitting_id": NO_ID,
    "fitting_distance": np.nan,
    "next_id": NO_ID,
    "next_distance": np.nan,
    "interacts": False,
}


def delete_elements(result: Result, element_ids: Collection[int]) -> Result:
    """Delete elements with their profiles and deformations; their points belong to none.

    Parameters
    ----------
    result : Result
    element_ids : collection of int

    Returns
    -------
    Result
        With the change noted in `edits`.

    Raises
    ------
    EditError
        If there is no such element.
    """
    gone = [find(result, i) for i in sorted(set(element_ids))]
    rest = without(result, {e.element_id for e in gone})
    return noted(rest, f"deleted {Labels(gone)}")


def name_element(result: Result, element_id: int, name: str) -> Result:
    """Set the name of an element; "" restores its kind and number.

    Parameters
    ----------
    result : Result
    element_id : int
    name : str
        Spaces at its ends and repeated ones are removed.

    Returns
    -------
    Result
        With the change noted in `edits`.

    Raises
    ------
    EditError
        If there is no such element.
    """
    element = find(result, element_id)
    name = " ".join(name.split())
    renamed = with_element(result, replace(element, name=name))
    return noted(renamed, f"named {replace(element, name='').label} “{name}”" if name else "")


def name_run(result: Result, run_id: int, name: str) -> Result:
    """Set the name of a run; "" restores its number.

    Parameters
    ----------
    result : Result
    run_id : int
    name : str
        Spaces at its ends and repeated ones are removed.

    Returns
    -------
    Result
        With the change noted in `edits`.

    Raises
    ------
    EditError
        If there is no such run.
    """
    if run_id not in {e.run_id for e in result.elements}:
        raise EditError("There is no run {run_id}.", run_id=run_id)
    name = " ".join(name.split())
    others = {i: other for i, other in result.run_names.items() if i != run_id}
    names = others | ({run_id: name} if name else {})
    return noted(replace(result, run_names=names), f"named run {run_id} “{name}”" if name else "")


def set_nominal_size(result: Result, element_id: int, size: NominalSize | None) -> Result:
    """Set the catalogue size of an element and judge its deformations again.

    Parameters
    ----------
    result : Result
    element_id : int
    size : NominalSize or None
        None for no nominal size.

    Returns
    -------
    Result
        With the change noted in `edits`.

    Raises
    ------
    EditError
        If there is no such element.
    SettingsError
        If the acceptance rule is no longer there.
    """
    element = find(result, element_id)
    sized = replace(
        element, nominal=size, is_nominal_confirmed=size is not None, other_nominal=None
    )
    return noted(
        with_element(result, sized),
        f"{element.label} is {size.name if size else 'of no nominal size'}",
    )


def kinds_of(element: Element) -> tuple[ElementKind, ...]:
    """Return the kinds that an element with its axis can have, its own among them.

    Parameters
    ----------
    element : Element

    Returns
    -------
    tuple of ElementKind
    """
    if element.kind is ElementKind.SPHERE:
        return (ElementKind.SPHERE,)
    if isinstance(element.axis, LineAxis):
        return (
            ElementKind.CYLINDER,
            ElementKind.CONE,
            ElementKind.FLANGE,
            ElementKind.TEE,
            ElementKind.OTHER,
        )
    return ElementKind.TORUS, ElementKind.TEE, ElementKind.OTHER


# For the other modules


def find(result: Result, element_id: int) -> Element:
    """Return an element; `EditError` if it is not there."""
    try:
        return result.element(element_id)
    except KeyError as error:
        raise EditError("There is no element {element_id}.", element_id=element_id) from error


class Labels(tuple[Element, ...]):
    """Elements that are named in a sentence."""

    __slots__ = ()

    def __str__(self) -> str:
        """Return "Pipe 1, Pipe 2 and Bend 3"."""
        *others, last = [e.label for e in self]
        return f"{', '.join(others)} and {last}" if others else last

    def __format__(self, spec: str) -> str:
        """Return the same within a sentence."""
        return str(self)


def noted(result: Result, what: str) -> Result:
    """Record a change, relate the deformations to what is around them now, and judge them."""
    alone = [replace(d, **NOT_RELATED) for d in result.deformations]
    runs = {e.run_id for e in result.elements}
    related = replace(result, deformations=relate_deformations(alone, result.elements))
    try:
        related = judged(related)
    except SettingsError:
        # A person's own rule may be gone since: what it said stands, what is new needs it.
        if not all(d.rule for d in related.deformations):
            raise
    return replace(
        related,
        run_names={i: name for i, name in result.run_names.items() if i in runs},
        edits=(*result.edits, what) if what else result.edits,
    )


def judged(result: Result) -> Result:
    """Judge all deformations anew, by the rules of the settings as they are."""
    found = judge_all(result.deformations, result.elements, result.settings_of)
    return replace(result, deformations=found)


def with_element(result: Result, element: Element) -> Result:
    """Replace the element that has the same id."""
    elements = (element if e.element_id == element.element_id else e for e in result.elements)
    return replace(result, elements=tuple(elements))


def with_settings(result: Result, element_ids: Collection[int], settings: Settings) -> Result:
    """Record the settings with which some elements were found or measured."""
    own = {i: other for i, other in result.own_settings.items() if i not in element_ids}
    if settings != result.settings:
        own |= dict.fromkeys(sorted(element_ids), settings)
    return replace(result, own_settings=own)


def without(result: Result, element_ids: Collection[int]) -> Result:
    """The result without some elements; their points belong to none."""
    of_gone = on_elements(result.element_id, element_ids)
    return replace(
        result,
        elements=tuple(e for e in result.elements if e.element_id not in element_ids),
        deformations=tuple(d for d in result.deformations if d.element_id not in element_ids),
        profiles=result.profiles[~np.isin(result.profiles.element_id, list(element_ids))],
        element_id=np.where(of_gone, np.int32(NO_ID), result.element_id),
        deviation=np.where(of_gone, np.float32(np.nan), result.deviation),
        own_settings={i: s for i, s in result.own_settings.items() if i not in element_ids},
    )


def on_elements(element_id: NDArray[np.int32], element_ids: Collection[int]) -> NDArray[np.bool_]:
    """Which points belong to one of some elements."""
    highest = max([int(element_id.max(initial=NO_ID)), *element_ids])
    table = np.zeros(highest + 1, np.bool_)
    table[list(element_ids)] = True
    return np.asarray(table[element_id])
