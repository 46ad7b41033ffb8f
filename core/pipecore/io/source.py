"""What every format gives: a source, whose points come in chunks."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipecore.errors import PipecoreError, ReadError
from pipecore.types import Array

CHUNK_POINTS = 250_000
"""Points of one chunk: read in well under half a second in every binary format."""


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
    """

    xyz: Array
    fraction: float
    intensity: NDArray[np.float32] | None = None
    rgb: NDArray[np.uint8] | NDArray[np.uint16] | None = None
    classification: NDArray[np.uint8] | None = None


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
    crs : str
        The coordinate reference system's name, or "".
    n_scans : int
    stations : ndarray
        Scanner positions, world coordinates in the file's unit, shape (k, 3).
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
    crs: str = ""
    n_scans: int = 1
    stations: Array = field(default_factory=lambda: np.empty((0, 3)))
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
def told_as_read_errors(path: Path, format_name: str) -> Iterator[None]:
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
