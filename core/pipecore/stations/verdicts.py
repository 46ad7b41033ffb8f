"""A station's correction with its verdict, in numbers and in plain words."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipecore.reasons import Reason
from pipecore.stations.adjustment import UNTOLD_SD, Solution, told_part
from pipecore.stations.element_fit import Equations
from pipecore.types import Correction, StationVerdict

Array = NDArray[np.float64]

HELD = "It is held: the others are compared with it."
NONE_SHARED = "No pipe was seen by it and another station at the same place: nothing can be told."
DOES_NOT = "It is off by {distance} ± {sd} mm: radii, bows and ovality suffer"
FITS = "It is off by {distance} ± {sd} mm, which is within {limit} mm"
TURNED = "; it is turned by {turn} mrad, {far} mm at {reach} m"
ALL_TOLD = "."
ONE_UNTOLD = ". Along {direction} nothing can be told: all pipes that it shares run that way."
TWO_UNTOLD = ". Nothing can be told but along one direction."
TEXTS = (
    HELD,
    NONE_SHARED,
    *(
        first + turned + told
        for first in (DOES_NOT, FITS)
        for turned in ("", TURNED)
        for told in (ALL_TOLD, ONE_UNTOLD, TWO_UNTOLD)
    ),
)
"""All sentences that a correction may have."""


def correction_of(
    solution: Solution,
    k: int,
    pivot: Array,
    equations: Sequence[Equations],
    places: Sequence[int],
    tolerance: float,
) -> Correction:
    """Return the correction of a station, with its verdict.

    Parameters
    ----------
    solution : Solution
    k : int
        Place of the station in it; the first is held.
    pivot : ndarray, shape (3,)
    equations : sequence of Equations
        Of the elements that tell it.
    places : sequence of int
        Places of the stations whose residuals count.
    tolerance : float
        Metres.

    Returns
    -------
    Correction
    """
    shift, rotation = solution.values[k, :3], solution.values[k, 3:]
    own = slice(6 * k, 6 * k + 6)
    covariance = solution.covariance[own, own]
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    projector, untold = told_part(covariance[:3, :3])
    if k > 0 and not equations:
        projector, untold = np.zeros((3, 3)), tuple(np.eye(3))
    is_told = sd[:3] <= UNTOLD_SD
    # A turn matters by what it does at the far end of what the station has seen.
    reach = max(1.0, _reach(equations, pivot))
    is_told_turn = sd[3:] * reach <= UNTOLD_SD
    off = projector @ shift
    distance = float(np.linalg.norm(off))
    along = off / distance if distance > 0 else np.zeros(3)
    distance_sd = float(np.sqrt(along @ covariance[:3, :3] @ along))
    if len(untold) == 3:
        distance = distance_sd = np.nan
    verdict = _verdict(k, distance, distance_sd, untold, tolerance)
    return Correction(
        pivot=pivot,
        shift=np.where(is_told, shift, np.nan),
        rotation=np.where(is_told_turn, rotation, np.nan),
        shift_sd=np.where(is_told, sd[:3], np.nan),
        rotation_sd=np.where(is_told_turn, sd[3:], np.nan),
        untold=untold,
        distance=distance,
        distance_sd=distance_sd,
        n_elements=len(equations),
        rms=_rms(equations, places),
        verdict=verdict,
        reason=_reason(k, verdict, distance, distance_sd, untold, tolerance, rotation, reach),
    )


def _verdict(
    k: int, distance: float, sd: float, untold: tuple[Array, ...], tolerance: float
) -> StationVerdict:
    if k > 0 and distance > max(2 * sd, tolerance):
        return StationVerdict.DOES_NOT_FIT
    return StationVerdict.NOT_MEASURABLE if untold else StationVerdict.FITS


def _reason(
    k: int,
    verdict: StationVerdict,
    distance: float,
    sd: float,
    untold: tuple[Array, ...],
    tolerance: float,
    rotation: Array,
    reach: float,
) -> Reason:
    if k == 0:
        return Reason(HELD)
    if not np.isfinite(distance):
        return Reason(NONE_SHARED)
    values = {
        "distance": f"{1e3 * distance:.2f}",
        "sd": f"{1e3 * sd:.2f}",
        "limit": f"{1e3 * max(2 * sd, tolerance):.1f}",
    }
    template = DOES_NOT if verdict is StationVerdict.DOES_NOT_FIT else FITS
    turn = float(np.linalg.norm(rotation))
    if turn * reach > tolerance:
        template += TURNED
        values |= {
            "turn": f"{1e3 * turn:.2f}", "far": f"{1e3 * turn * reach:.1f}", "reach": f"{reach:.0f}"
        }  # fmt: skip
    if len(untold) == 1:
        values["direction"] = "({:.2f}, {:.2f}, {:.2f})".format(*untold[0])
    template += (ALL_TOLD, ONE_UNTOLD, TWO_UNTOLD)[len(untold)]
    return Reason(template, **values)


def _reach(equations: Sequence[Equations], pivot: Array) -> float:
    """How far from the pivot the furthest element is that tells a correction, metres."""
    return max((float(np.linalg.norm(e.middle - pivot)) for e in equations), default=0.0)


def _rms(equations: Sequence[Equations], places: Sequence[int]) -> float:
    """Of the residuals of some stations' points on the elements, metres."""
    squares = weights = 0.0
    for e in equations:
        own = np.isin(e.stations, places)
        squares += float(e.square_sum[own].sum())
        weights += float(e.weight_sum[own].sum())
    return float(np.sqrt(squares / weights)) if weights > 0 else np.nan
