"""Rows of binary values of one size, as PLY and PCD hold them."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from pipecore.io.source import CHUNK_POINTS, truncated

CHUNK_BYTES = 64_000_000


def read_records(
    file: BinaryIO, path: Path, dtype: np.dtype[Any], n_records: int, file_size: int
) -> Iterator[tuple[NDArray[Any], float]]:
    """Yield records from the file's position on, and the part of the file read with them.

    Raises
    ------
    ReadError
        If the file is too short for them, before anything of their size is allocated.
    """
    check_room(path, file_size - file.tell(), dtype, n_records)
    chunk_size = max(1, min(CHUNK_POINTS, CHUNK_BYTES // max(dtype.itemsize, 1)))
    for start in range(0, n_records, chunk_size):
        n = min(chunk_size, n_records - start)
        records = np.frombuffer(file.read(n * dtype.itemsize), dtype=dtype)
        yield records, (start + n) / n_records


def check_room(path: Path, n_bytes: int, dtype: np.dtype[Any], n_records: int) -> None:
    """Refuse a number of records that do not fit into so many bytes."""
    n_held = n_bytes // max(dtype.itemsize, 1)
    if n_records > n_held:
        raise truncated(path, n_records, max(n_held, 0))
