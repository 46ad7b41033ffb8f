"""Whether stations fit together: corrections, pairs, and what pipes cannot tell of them."""

from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pipecore.elements import NearbyPoints
from pipecore.parallel import for_items
from pipecore.progress import Progress
from pipecore.stations.adjustment import Solution, pair_equations, solve
from pipecore.stations.element_fit import Equations, Motion, element_equations
from pipecore.stations.samples import Samples, collect_samples
from pipecore.stations.verdicts import correction_of
from pipecore.types import (
    Disagreement,
    Element,
    PointCloud,
    Station,
    StationCheck,
    StationPair,
)

Array = NDArray[np.float64]
Ids = NDArray[np.uint16]

N_ROUNDS = 3
"""Offsets of a few centimetres are found to a hundredth by the second round."""
NOISE_SDS, NEGLIGIBLE = 2.0, 5e-4
"""A wall is whole if it lies within the samples' reach by its noise. What is off by half a
millimetre loses nothing that matters."""
POINTS_AT_A_TIME = 1_000_000
LOCAL_SD = 2e-3
"""How far an element alone may be thought to be off from what all say, metres, where it does not
tell."""


def check_stations(
    cloud: PointCloud,
    elements: Sequence[Element],
    nearby: NearbyPoints,
    tolerance: float,
    progress: Progress,
) -> StationCheck | None:
    """Tell from elements that several stations have seen how these fit together.

    Parameters
    ----------
    cloud : PointCloud
    elements : sequence of Element
        Found in the cloud.
    nearby : NearbyPoints
        Of the cloud.
    tolerance : float
        Stations fit that are off by no more, metres.
    progress : Progress
        Receives fractions of the stage "stations"; may cancel.

    Returns
    -------
    StationCheck or None
        None where the cloud is not known to be of several stations.
    """
    if cloud.station is None:
        return None
    ids, counts, centroids = _stations_of(cloud)
    if len(ids) < 2:
        return None
    positions = np.full((len(ids), 3), np.nan)
    known = ids <= len(cloud.stations)
    positions[known] = cloud.stations[ids[known] - 1]
    spread = max(1.0, float(np.ptp(centroids, axis=0).max()), _half_extent(elements))
    samples = collect_samples(cloud, ids, elements, nearby, progress)
    motion, solution, equations = _adjust(samples, centroids, positions, spread, progress)
    whole = Solution(
        np.concatenate([motion.shift, motion.rotation], axis=1),
        solution.covariance,
        solution.weights,
    )
    stations = []
    for k, station_id in enumerate(ids.tolist()):
        own = [e for e in equations if k in e.stations]
        name = cloud.station_names[station_id - 1 : station_id]
        stations.append(
            Station(
                station_id,
                name[0] if name else f"Station {station_id}",
                int(counts[k]),
                positions[k],
                correction_of(whole, k, centroids[k], own, [k], tolerance),
            )
        )
    pairs = _pairs(ids, equations, whole, centroids, spread, tolerance)
    by_id = {e.element_id: e for e in elements}
    disagreements = tuple(_disagreement(by_id[e.element_id], e, ids, motion) for e in equations)
    return StationCheck(tuple(stations), pairs, disagreements)


def _stations_of(cloud: PointCloud) -> tuple[Ids, NDArray[np.int64], Array]:
    """Ids of the stations that have points, how many, and the points' centroids."""
    assert cloud.station is not None
    n = 1 + int(cloud.station.max(initial=0))
    counts, sums = np.zeros(n, np.int64), np.zeros((n, 3))
    for start in range(0, len(cloud), POINTS_AT_A_TIME):
        rows = slice(start, start + POINTS_AT_A_TIME)
        station, xyz = cloud.station[rows], cloud.xyz[rows]
        counts += np.bincount(station, minlength=n)
        for axis in range(3):
            sums[:, axis] += np.bincount(station, xyz[:, axis], n)
    ids = np.flatnonzero(counts[1:]).astype(np.uint16) + np.uint16(1)
    return ids, counts[ids], sums[ids] / counts[ids, None]


def _half_extent(elements: Sequence[Element]) -> float:
    if not elements:
        return 0.0
    ends = np.array([p for e in elements for p in (e.axis.start, e.axis.end)])
    return float(np.ptp(ends, axis=0).max()) / 2


def _adjust(
    samples: list[Samples], centroids: Array, positions: Array, spread: float, progress: Progress
) -> tuple[Motion, Solution, list[Equations]]:
    """Corrections of all stations; rounds, each with the points moved by the last."""
    n = len(centroids)
    motion = Motion(centroids, np.zeros((n, 3)), np.zeros((n, 3)))
    solution = solve([], n, spread)
    poses = np.zeros((len(samples), 6))
    equations: list[Equations] = []
    for round_ in range(N_ROUNDS):
        found: dict[int, Equations] = {}

        def work(k: int, _check: Callable[[], None], motion: Motion = motion) -> None:
            if _is_cut_off(samples[k], motion):
                return
            told = element_equations(samples[k], motion, positions, poses[k])
            if told is not None:
                found[k] = told  # noqa: B023

        share = 0.4 / N_ROUNDS
        begin = 0.6 + share * round_
        for_items(work, len(samples), "stations", progress, (begin, begin + share))
        equations = [found[k] for k in sorted(found)]
        solution = solve(equations, n, spread)
        shift, turn = solution.values[:, :3], solution.values[:, 3:]
        motion = Motion(centroids, motion.shift + shift, motion.rotation + turn)
    return motion, solution, equations


def _is_cut_off(samples: Samples, motion: Motion) -> bool:
    """Whether walls lie so far apart that a part of them was beyond the reach of the samples."""
    element = samples.element
    middle = element.axis.at(element.axis.length / 2)
    own = np.unique(samples.station)
    places = motion.shift[own] + np.cross(motion.rotation[own], middle - motion.pivot[own])
    # Elements are fitted to all walls: each lies off by half of what lies between them.
    off = float(np.linalg.norm(np.ptp(places, axis=0))) / 2
    return off + NOISE_SDS * element.rms > samples.reach and off > NEGLIGIBLE


def _pairs(
    ids: Ids,
    equations: Sequence[Equations],
    whole: Solution,
    centroids: Array,
    spread: float,
    tolerance: float,
) -> tuple[StationPair, ...]:
    """How each two stations fit that have seen elements together, by these alone."""
    pairs = []
    for a, b in combinations(range(len(ids)), 2):
        own = pair_equations(equations, a, b)
        if not own:
            continue
        # The equations are of what is left once all stations are moved as the whole says, and
        # each about its own pivot: the first station's motion is carried to that of the second.
        left = solve(own, 2, spread)
        first = whole.values[a]
        carried = first[:3] + np.cross(first[3:], centroids[b] - centroids[a])
        between = whole.values[b] - np.concatenate([carried, first[3:]])
        values = np.stack([np.zeros(6), between + left.values[1]])
        correction = correction_of(
            Solution(values, left.covariance, left.weights), 1, centroids[b], own, [0, 1], tolerance
        )
        is_told = np.isfinite(correction.distance)
        residual = float(np.linalg.norm(left.values[1, :3])) if is_told else np.nan
        pairs.append(StationPair(int(ids[a]), int(ids[b]), correction, residual))
    return tuple(pairs)


def _disagreement(element: Element, told: Equations, ids: Ids, motion: Motion) -> Disagreement:
    """How far the walls of an element's stations lie apart, across its axis at its middle."""
    middle, own = told.middle, told.stations
    offset = middle - motion.pivot[own]
    unit = np.tile(np.concatenate([np.ones(3), np.full(3, 1 / element.axis.length)]), len(own))
    # What this element tells only weakly stays as the adjustment says.
    weak = np.diag(1 / (LOCAL_SD * unit) ** 2)
    left: Array = np.asarray(np.linalg.solve(told.matrix + weak, told.right)).reshape(-1, 6)
    whole: Array = np.concatenate([motion.shift[own], motion.rotation[own]], axis=1)
    together: Array = np.asarray(whole + left)
    along = element.axis.tangent(element.axis.length / 2)

    def widest(moves: Array) -> float:
        places = moves[:, :3] + np.cross(moves[:, 3:], offset)
        places = places - (places @ along)[:, None] * along
        return max(float(np.linalg.norm(p - q)) for p, q in combinations(places, 2))

    return Disagreement(
        told.element_id, tuple(int(ids[k]) for k in own), widest(together), widest(left)
    )
