"""Whether the stations of a cloud fit together, as its own pipes tell."""

from dataclasses import dataclass
from enum import StrEnum

from pipecore.reasons import Reason
from pipecore.types.arrays import Array
from pipecore.types.ids import find_by_id


class StationVerdict(StrEnum):
    """Whether a station fits; the values are those of the report."""

    FITS = "fits"
    DOES_NOT_FIT = "does not fit"
    NOT_MEASURABLE = "not measurable"


@dataclass(frozen=True, eq=False)
class Correction:
    """How points are to be moved so that they fit: x' = pivot + R (x - pivot) + shift.

    Parameters
    ----------
    pivot : ndarray, shape (3,)
        Centroid of the station's points, local coordinates.
    shift : ndarray, shape (3,)
        Metres; nan in a direction that cannot be told.
    rotation : ndarray, shape (3,)
        Rotation vector, radians; nan about an axis that cannot be told.
    shift_sd, rotation_sd : ndarray, shape (3,)
        Standard deviations of what can be told, else nan.
    untold : tuple of ndarray
        Unit vectors along which the pipes cannot tell the shift.
    distance, distance_sd : float
        Length of the shift along what can be told, and its standard deviation, metres; nan where
        nothing can.
    n_elements : int
        Elements that tell it.
    rms : float
        Of the points about these elements once they are moved, metres.
    verdict : StationVerdict
    reason : Reason
        The verdict in plain words.
    """

    pivot: Array
    shift: Array
    rotation: Array
    shift_sd: Array
    rotation_sd: Array
    untold: tuple[Array, ...]
    distance: float
    distance_sd: float
    n_elements: int
    rms: float
    verdict: StationVerdict
    reason: Reason


@dataclass(frozen=True, eq=False)
class Station:
    """A station with its correction relative to the first one.

    Parameters
    ----------
    station_id : int
        As `PointCloud.station` has it.
    source : str
        The file, or the file and the scan in it.
    n_points : int
    position : ndarray, shape (3,)
        Of the scanner, local coordinates; nan where it is not known.
    correction : Correction
    """

    station_id: int
    source: str
    n_points: int
    position: Array
    correction: Correction


@dataclass(frozen=True, eq=False)
class StationPair:
    """How the second of two stations is to be moved so that it fits the first.

    Parameters
    ----------
    first, second : int
        Ids of the stations.
    correction : Correction
        From the elements that both have seen.
    residual : float
        Length of what is left of it once both stations are moved as the whole adjustment says,
        metres; nan where it cannot be told.
    """

    first: int
    second: int
    correction: Correction
    residual: float


@dataclass(frozen=True, eq=False)
class Disagreement:
    """How far the stations that have seen an element lie apart on it.

    Parameters
    ----------
    element_id : int
    stations : tuple of int
        Ids of those that have seen it.
    before, after : float
        Largest distance between the walls of two of them, across the axis, as scanned and with
        all stations moved, metres.
    """

    element_id: int
    stations: tuple[int, ...]
    before: float
    after: float


@dataclass(frozen=True, eq=False)
class StationCheck:
    """Whether the stations of a cloud fit together.

    Parameters
    ----------
    stations : tuple of Station
        In the order of their ids; the first is held.
    pairs : tuple of StationPair
        Of all stations that have seen elements together.
    disagreements : tuple of Disagreement
        Of the elements that several stations have seen, in the order of their ids.
    """

    stations: tuple[Station, ...]
    pairs: tuple[StationPair, ...]
    disagreements: tuple[Disagreement, ...]

    def station(self, station_id: int) -> Station:
        """Return the station with this id; `KeyError` if there is none.

        Parameters
        ----------
        station_id : int

        Returns
        -------
        Station
        """
        return find_by_id(self.stations, "station_id", station_id)

    @property
    def verdict(self) -> StationVerdict:
        """Of all stations together: the worst of those that are not held."""
        verdicts = {s.correction.verdict for s in self.stations[1:]}
        for worst in (StationVerdict.DOES_NOT_FIT, StationVerdict.NOT_MEASURABLE):
            if worst in verdicts:
                return worst
        return StationVerdict.FITS
