"""How deformations lie to the fittings of their run and to each other.

Distances go along the run: through each element along its axis, and from one element to
the next over the shortest gap. A run is a tree of such links; tees branch it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import minimum_spanning_tree

from pipecore.geometry import ArcAxis, Array
from pipecore.types import Deformation, DeformationKind, Element, ElementKind

FITTINGS = (ElementKind.FLANGE, ElementKind.TORUS, ElementKind.CONE, ElementKind.TEE)
PATCHES = (DeformationKind.DENT, DeformationKind.BULGE)

PARALLEL_COS = np.cos(np.deg2rad(10.0))
"""Straight elements of one run that turn less are on one line: their clock goes on."""


@dataclass(frozen=True, eq=False)
class RunLinks:
    """The elements of one run and how they hang together.

    Parameters
    ----------
    elements : tuple of Element
    place : ndarray, shape (n, n)
        Chainage on element i that is nearest to an end of element j.
    gap : ndarray, shape (n, n)
        Distance of the axes there, metres.
    neighbours : tuple of tuple of int
        By element, the elements it is linked with.
    """

    elements: tuple[Element, ...]
    place: Array
    gap: Array
    neighbours: tuple[tuple[int, ...], ...]

    def reached_from(self, element: int, chainage: float) -> tuple[Array, Array]:
        """Distance along the run to every element, metres, and the chainage of arrival on it."""
        distance = np.full(len(self.elements), np.inf)
        arrival = np.zeros(len(self.elements))
        distance[element], arrival[element] = 0.0, chainage
        to_do = [element]
        while to_do:
            i = to_do.pop()
            for j in self.neighbours[i]:
                if not np.isfinite(distance[j]):
                    way = abs(self.place[i, j] - arrival[i]) + self.gap[i, j]
                    distance[j], arrival[j] = distance[i] + way, self.place[j, i]
                    to_do.append(j)
        return distance, arrival


def link_run(elements: Sequence[Element]) -> RunLinks:
    """Link the elements of one run where they come nearest.

    Parameters
    ----------
    elements : sequence of Element
        All of one run.

    Returns
    -------
    RunLinks
    """
    n = len(elements)
    ends = np.array([p for e in elements for p in (e.axis.start, e.axis.end)])
    length = np.array([e.axis.length for e in elements])
    # From an end of j to the axis of i, and the chainage of that end on j.
    place, away, end = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    for i, element in enumerate(elements):
        chainage = np.clip(element.axis.pipe_coordinates(ends)[0], 0.0, element.axis.length)
        distance = np.linalg.norm(element.axis.at(chainage) - ends, axis=1).reshape(n, 2)
        nearer = np.argmin(distance, axis=1)
        rows = np.arange(n)
        place[i], away[i] = chainage.reshape(n, 2)[rows, nearer], distance[rows, nearer]
        end[i] = nearer * length
    # Two elements meet at an end of either: take the one that comes nearer.
    mine = away <= away.T
    at = np.where(mine, place, end.T)
    gap = np.minimum(away, away.T)
    # As a sparse graph, since in a dense one the solver takes a gap of nearly zero for no link.
    upper = np.triu_indices(n, 1)
    tree = minimum_spanning_tree(csr_array((gap[upper] + 1e-9, upper), shape=(n, n)))
    linked = (tree + tree.T).toarray() > 0
    neighbours = tuple(tuple(np.flatnonzero(row).tolist()) for row in linked)
    return RunLinks(tuple(elements), at, gap, neighbours)


def relate_deformations(
    deformations: Sequence[Deformation], elements: Sequence[Element]
) -> tuple[Deformation, ...]:
    """Return numbered deformations with their nearest fitting and their nearest neighbour.

    Parameters
    ----------
    deformations : sequence of Deformation
        With their ids.
    elements : sequence of Element
        All, in the order of their ids.

    Returns
    -------
    tuple of Deformation
        In the order given.
    """
    by_id = {e.element_id: e for e in elements}
    runs = {by_id[d.element_id].run_id for d in deformations}
    links = {run: link_run([e for e in elements if e.run_id == run]) for run in runs}
    return tuple(_related(d, links[by_id[d.element_id].run_id], deformations) for d in deformations)


def _related(
    deformation: Deformation, run: RunLinks, deformations: Sequence[Deformation]
) -> Deformation:
    number = {e.element_id: i for i, e in enumerate(run.elements)}
    index = number[deformation.element_id]
    distance, arrival = run.reached_from(index, deformation.chainage)
    fittings = [i for i, e in enumerate(run.elements) if e.kind in FITTINGS]
    related = deformation
    if fittings:
        nearest = min(fittings, key=lambda i: (distance[i], i))
        related = replace(
            related,
            fitting_id=run.elements[nearest].element_id,
            fitting_distance=float(distance[nearest]),
        )
    if deformation.kind not in PATCHES:
        return related
    others = [
        (number[d.element_id], d)
        for d in deformations
        if d is not deformation and d.kind in PATCHES and d.element_id in number
    ]
    gaps = [
        (_gap((run.elements[index], deformation), (run.elements[i], d), distance[i], arrival[i]), d)
        for i, d in others
    ]
    if not gaps:
        return related
    gap, other = min(gaps, key=lambda pair: (pair[0], pair[1].deformation_id))
    diameter = 2 * float(run.elements[index].radius_at(deformation.chainage))
    return replace(
        related,
        next_id=other.deformation_id,
        next_distance=gap,
        interacts=gap <= diameter,
    )


def _gap(
    first: tuple[Element, Deformation],
    second: tuple[Element, Deformation],
    distance: float,
    arrival: float,
) -> float:
    """Distance over the surface between the edges of two dents or bulges, metres.

    `distance` leads along the run to the other's element and `arrival` is where it does.
    """
    element, deformation = first
    radius = float(element.radius_at(deformation.chainage))
    if element is second[0]:
        along, clock = abs(deformation.chainage - second[1].chainage), second[1].clock
    else:
        along = distance + abs(second[1].chainage - arrival)
        # Beyond a bend clock positions cannot be compared: then the sides count as one.
        clock = deformation.clock
        if _on_one_line(element, second[0]):
            clock = float(element.axis.pipe_coordinates(second[1].peak[None])[2][0])
    turn = abs(np.mod(deformation.clock - clock + np.pi, 2 * np.pi) - np.pi)
    apart = float(np.hypot(along, turn * radius))
    reach = sum(_reach(d, along, turn * radius) for d in (deformation, second[1]))
    return max(apart - reach, 0.0)


def _on_one_line(a: Element, b: Element) -> bool:
    if isinstance(a.axis, ArcAxis) or isinstance(b.axis, ArcAxis):
        return False
    one, other = (e.axis.tangent(e.axis.length / 2) for e in (a, b))
    return bool(abs(one @ other) > PARALLEL_COS)


def _reach(d: Deformation, along: float, around: float) -> float:
    """Half the extent of a dent's ellipse in a direction over the surface, metres."""
    share = float(np.hypot(along / (d.length / 2), around / (d.width / 2)))
    return float(np.hypot(along, around)) / share if share > 0 else d.length / 2
