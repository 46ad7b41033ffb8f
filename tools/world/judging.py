"""What a detection made of a scene: `pipecore.simulate.scoring`, and what it does not tell.

An element is whole if one reported element stands for it from end to end of what was seen;
a false element is named by the body that most of its points lie on.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.simulate import TrueElement
from pipecore.simulate.scoring import score
from pipecore.types import NO_ID, DeformationKind, Element, ElementKind, Result
from tools.world.assembly import Role
from tools.world.scenes import WorldScene

MIN_VISIBLE = 0.5
"""Share of an element's length that must be seen for it to be judged."""
MAIN_SHARE = 0.5
"""Share of a true element's claimed points that make a reported element stand for it."""
PIECE_SHARE = 0.05
WHOLE_LENGTH = 0.85
RADIUS_RATIO, RADIUS_SDS = 0.003, 3.0
OVALITY_RATIO, OVALITY_SDS = 0.1, 3.0
MIN_OVALITY_ARC = np.deg2rad(200.0)
CAP_KINDS = ("sphere", "cap")

Row = dict[str, Any]


def judge(drawn: WorldScene, result: Result) -> Row:
    """Return the figures of one scene as plain numbers.

    Parameters
    ----------
    drawn : WorldScene
    result : Result
        Of a detection on the scene's cloud.

    Returns
    -------
    dict
        `properties` of the scene; lengths (metres) `visible`, `found`, `reported`, `real`;
        `elements`, a row per true element that is seen; `false`, the names of the bodies that
        elements were wrongly found on.
    """
    owners = {e.element_id: _owner(drawn, result, e) for e in result.elements}
    kept = tuple(e for e in result.elements if not _is_ignored(drawn, owners[e.element_id], e))
    measured = score(replace(result, elements=kept, deformations=()), drawn.truth)
    false = [
        _name(drawn, owners[e.element_id])
        for e in kept
        if _is_false(drawn, owners[e.element_id], e, measured.false)
    ]
    rows = [
        _element_row(drawn, result, e, measured.radius_errors, measured.radius_sds)
        for e in drawn.truth.elements
        if _visible_length(e) >= MIN_VISIBLE * e.axis.length
    ]
    recall = 0.0 if np.isnan(measured.recall) else measured.recall
    precision = 0.0 if np.isnan(measured.precision) else measured.precision
    return {
        "properties": drawn.properties,
        "visible": measured.visible_length,
        "found": recall * measured.visible_length,
        "reported": measured.reported_length,
        "real": precision * measured.reported_length,
        "doubled": measured.doubled_length,
        "n_reported": len(kept),
        "elements": rows,
        "false": false,
        "deformations": _deformation_row(drawn, result),
    }


def _visible_length(element: TrueElement) -> float:
    return sum(end - start for start, end in element.visible_ranges())


def _owner(drawn: WorldScene, result: Result, element: Element) -> int:
    """Index of the body that most of a reported element's points lie on.

    Of an element without points it is that of the points nearest to its axis.
    """
    bodies = drawn.body[result.element_id == element.element_id]
    if not len(bodies):
        shift = result.origin - drawn.cloud.origin
        along = element.axis.at(np.linspace(0.0, element.axis.length, 9)) + shift
        off = [np.linalg.norm(drawn.cloud.xyz - p, axis=1).argmin() for p in along]
        bodies = drawn.body[off]
    return int(np.bincount(bodies).argmax())


def _name(drawn: WorldScene, body: int) -> str:
    named = drawn.bodies[body]
    return f"beside {named.name}" if named.role is Role.PIPE else named.name


def _is_ignored(drawn: WorldScene, body: int, element: Element) -> bool:
    role = drawn.bodies[body].role
    return role is Role.IGNORE or (role is Role.CAP and str(element.kind) in CAP_KINDS)


def _is_false(drawn: WorldScene, body: int, element: Element, false: tuple[Any, ...]) -> bool:
    """Whether more than half of a reported element is nothing that is there."""
    if drawn.bodies[body].role is Role.CLUTTER:
        return True
    length = sum(s.length for s in false if s.element_id == element.element_id)
    return bool(length > 0.5 * element.axis.length)


def _element_row(
    drawn: WorldScene,
    result: Result,
    true: TrueElement,
    radius_errors: dict[int, float],
    radius_sds: dict[int, float],
) -> Row:
    rows = np.flatnonzero(drawn.element_id == true.element_id)
    ids = result.element_id[rows]
    counts = np.bincount(ids, minlength=1)
    counts[NO_ID] = 0
    row: Row = {
        "kind": str(true.kind),
        "radius": true.radius,
        "arc": float(np.median(true.arc_seen)),
        "is_branched": true.element_id in drawn.branched,
        "n_pieces": int((counts >= max(PIECE_SHARE * len(rows), 1)).sum()),
        "is_found": False, "is_kind_right": False, "is_radius_right": False, "is_whole": False,
    }  # fmt: skip
    if not counts.sum():
        return row
    main = result.element(int(counts.argmax()))
    share = counts.max() / counts.sum()
    row["is_found"] = bool(share >= MAIN_SHARE and counts.max() >= 0.25 * len(rows))
    row["found_kind"] = str(main.kind)
    row["is_kind_right"] = row["is_found"] and main.kind is true.kind
    error = radius_errors.get(true.element_id)
    if error is not None:
        sd = radius_sds[true.element_id]
        row["radius_error"], row["radius_sd"] = error, sd
        row["is_radius_right"] = bool(
            abs(error) <= max(RADIUS_RATIO * true.radius, RADIUS_SDS * sd)
        )
    claimed = drawn.chainage[rows[ids == main.element_id]]
    # Poles of a sphere may be covered by what it is joined to.
    reaches = true.kind is ElementKind.SPHERE or _spans(claimed, drawn, rows)
    row["is_whole"] = row["is_found"] and row["n_pieces"] == 1 and reaches
    ovality = _true_ovality(drawn, true)
    if ovality is not None and main.kind is true.kind:
        row |= _ovality_row(ovality, main, row["arc"])
    return row


def _spans(claimed: NDArray[np.float64], drawn: WorldScene, rows: NDArray[np.intp]) -> bool:
    """Whether the claimed points reach along most of the element."""
    ends = [np.ptp(np.quantile(c, [0.01, 0.99])) for c in (claimed, drawn.chainage[rows])]
    return bool(ends[0] >= WHOLE_LENGTH * ends[1])


def _true_ovality(drawn: WorldScene, true: TrueElement) -> float | None:
    """Ovality of an element that has no other deformation; None where it has."""
    if true.kind not in (ElementKind.CYLINDER, ElementKind.TORUS):
        return None
    mine = [d for d in drawn.truth.deformations if d.element_id == true.element_id]
    oval = [d for d in mine if d.kind is DeformationKind.OVALITY]
    if len(oval) != len(mine) or (oval and oval[0].length < 0.9 * true.axis.length):
        return None
    if drawn.properties.get("surface") or drawn.properties.get("damage"):
        return None
    return oval[0].ovality if oval else 0.0


def _ovality_row(true: float, main: Element, arc: float) -> Row:
    error = main.ovality - true
    is_right = abs(error) <= max(OVALITY_RATIO * true, OVALITY_SDS * main.ovality_sd)
    if np.isnan(main.ovality):
        return {"ovality": true, "is_ovality_right": arc < MIN_OVALITY_ARC}
    return {"ovality": true, "ovality_error": float(error), "is_ovality_right": bool(is_right)}


def _deformation_row(drawn: WorldScene, result: Result) -> Row:
    """Numbers of dents: true and seen, found; false ones; all others reported by kind."""
    measured = score(replace(result, elements=()), drawn.truth)
    dents = [m for m in measured.deformations if m.true.kind is DeformationKind.DENT]
    return {
        "n_dents": sum(
            d.kind is DeformationKind.DENT and d.seen > 0.4 for d in drawn.truth.deformations
        ),
        "n_dents_found": sum(m.true.seen > 0.4 for m in dents),
        "depth_errors": [m.depth_error / m.true.depth for m in dents],
        "n_false": len(measured.false_deformations),
    }
