"""What every format gives: a source, whose points come in chunks."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.errors import PipecoreError, ReadError
from pipecore.io.crs import NO_SYSTEM, ReferenceSystem
from pipecore.notes import Note
from pipecore.settings import FlaggedPoints
from pipecore.types import Array, Storage

CHUNK_POINTS = 250_000
"""Points of one chunk: read in well under half a second in every binary format."""

Rows = NDArray[np.bool_] | NDArray[np.intp] | slice
"""Which points of a chunk."""


@dataclass(frozen=True)
class OpenOptions:
    """How a file is to be read.

    Parameters
    ----------
    columns : str
        What the columns of a text file hold; see `InputSettings.columns`.
    flagged_points : FlaggedPoints
        What becomes of points that a file marks as withheld or as noise.
    has_fields : bool
        Whether chunks hold all values of a point.
    """

    columns: str = ""
    flagged_points: FlaggedPoints = FlaggedPoints.LEAVE_OUT
    has_fields: bool = False


DEFAULT = OpenOptions()


@dataclass(frozen=True, eq=False)
class Chunk:
    """Some points as they stand in the file.

    Parameters
    ----------
    xyz : ndarray
        World coordinates in the file's unit, float64, shape (m, 3); may be nan or infinite.
    fraction : float
        The part of the file that is read with this chunk, 0 to 1.
    intensity : ndarray, optional
        Shape (m,).
    rgb : ndarray, optional
        uint8, or uint16 of which only the whole file shows whether all bits are used;
        shape (m, 3).
    classification : ndarray, optional
        uint8, shape (m,).
    station : ndarray or int, optional
        The file's own number of the station of each point, integer, shape (m,), or of all.
    fields : mapping of str to ndarray
        All other values of each point, if they were asked for, shapes (m,) or (m, k).
    """

    xyz: Array
    fraction: float
    intensity: NDArray[np.float32] | None = None
    rgb: NDArray[np.uint8] | NDArray[np.uint16] | None = None
    classification: NDArray[np.uint8] | None = None
    station: NDArray[Any] | int | None = None
    fields: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.xyz)

    def take(self, rows: Rows) -> "Chunk":
        """Return some of the points."""
        return Chunk(
            self.xyz[rows],
            self.fraction,
            None if self.intensity is None else self.intensity[rows],
            None if self.rgb is None else self.rgb[rows],
            None if self.classification is None else self.classification[rows],
            self.station[rows] if isinstance(self.station, np.ndarray) else self.station,
            {name: values[rows] for name, values in self.fields.items()},
        )


@dataclass(frozen=True)
class FieldInfo:
    """How the values of a field are stored; see `pipecore.types.Field`."""

    scale: float = 1.0
    offset: float = 0.0
    no_data: float | None = None
    description: str = ""


@dataclass(frozen=True, eq=False)
class ScanInfo:
    """A scan in a file: its name, and the scanner's position in the file's unit, shape (3,).

    The position is nan where the file does not know it.
    """

    name: str
    position: Array


@dataclass(frozen=True, eq=False)
class Source:
    """An open file: what its header says, and its points.

    Parameters
    ----------
    chunks : iterator of Chunk
        The points, to be taken once.
    fields : tuple of str
        What the file calls the values of a point.
    n_points : int, optional
        As the header says, held against the file's size; None if it does not say.
    bounds : ndarray, optional
        Lowest and highest world coordinates as the header says, shape (2, 3).
    system : ReferenceSystem
    scans : list of ScanInfo
        The scans of a file that consists of scans, each of which is a station; the chunks'
        `station` is the place in this list. Grows until the last chunk is read. Empty for
        other files, whose `station` only tells stations apart where it varies.
    guid : str
        What identifies the project that the file is a part of, or "".
    step : float
        Steps of the coordinates as the header says, in the file's unit; 0 if it does not say.
    storage : Storage, optional
        How the file keeps coordinates, where it says so.
    field_infos : mapping of str to FieldInfo
        Of fields that are not stored as they are.
    notes : list of Note
        What is to be said of the file; grows until the last chunk is read.
    left_out : Counter of str
        How many points were left out by the format, by the reasons of `pipecore.io.left_out`.
    overview : callable, optional
        Gives a few points from all over the file, where they can be had without the others.
    within : callable, optional
        Gives the chunks that may hold points between two corners (2, 3), both included, where
        they can be had without the others.
    count_within : callable, optional
        Gives the number of points in those chunks.
    neighbourhood : callable, optional
        Gives the coordinates of all points in some small place, in the same case.
    """

    chunks: Iterator[Chunk]
    fields: tuple[str, ...]
    n_points: int | None = None
    bounds: Array | None = None
    system: ReferenceSystem = NO_SYSTEM
    scans: list[ScanInfo] = field(default_factory=list)
    guid: str = ""
    step: float = 0.0
    storage: Storage | None = None
    field_infos: Mapping[str, FieldInfo] = field(default_factory=dict)
    notes: list[Note] = field(default_factory=list)
    left_out: Counter[str] = field(default_factory=Counter)
    overview: Callable[[], Chunk] | None = None
    within: Callable[[Array], Iterator[Chunk]] | None = None
    count_within: Callable[[Array], int] | None = None
    neighbourhood: Callable[[], Array] | None = None


NO_SENSE = "its contents make no sense"
IO_ERROR = "input/output error"
CAUSES = {
    "ErrorBadChecksum": "its checksum does not match its contents",
    "ErrorBadFileLength": "it is not as long as it should be",
    "failed to fill whole buffer": "it is truncated",
}
"""What libraries say of the commonest damages, and what we do."""


@contextmanager
def raise_read_errors(path: Path, format_name: str) -> Iterator[None]:
    """Turn whatever a format's library raises on a damaged file into a `ReadError`."""
    try:
        yield
    except (PipecoreError, GeneratorExit):
        raise
    except MemoryError as error:
        raise ReadError("“{name}” does not fit into memory.", name=path.name) from error
    except OSError as error:
        raise ReadError(
            "“{name}” cannot be read ({reason}).",
            name=path.name,
            reason=error.strerror or IO_ERROR,
        ) from error
    except Exception as error:
        text = str(error)
        causes = [cause for mark, cause in CAUSES.items() if mark in text]
        raise damaged(path, format_name, *causes[:1]) from error
    except BaseException as error:
        # The Rust decoder of LAZ reports its own defects by an exception outside Exception.
        if type(error).__name__ != "PanicException":
            raise
        raise damaged(path, format_name) from error


def damaged(path: Path, format_name: str, cause: str = NO_SENSE) -> ReadError:
    """Return the error of a file that is not what its format asks for."""
    return ReadError(
        "“{name}” is damaged or no whole {format_name} file: {cause}.",
        name=path.name,
        format_name=format_name,
        cause=cause,
    )


def truncated(path: Path, announced: int, held: int) -> ReadError:
    """Return the error of a file that ends too early or lies about its number of points."""
    return ReadError(
        "“{name}” is truncated: it announces {announced:,} points but holds {held:,}.",
        name=path.name,
        announced=announced,
        held=held,
    )


def truncated_note(path: Path, announced: int, held: int) -> Note:
    """Return the note on a file that ends too early, of which the whole points were read."""
    return Note(
        "“{name}” is truncated: it announces {announced:,} points; the {held:,} that are whole "
        "were read.",
        name=path.name,
        announced=announced,
        held=held,
    )
