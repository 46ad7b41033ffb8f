"""Room on the disk for arrays that are mapped into memory."""

import errno
import os
import shutil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def reserve(path: Path, n_bytes: int) -> None:
    """Make a file `n_bytes` long, filled with zeros, and take the disk's room for it.

    Mapped files that merely promise their length end the process when the disk turns out
    to be full.

    Raises
    ------
    OSError
        If there is no room.
    """
    path.touch()
    with path.open("r+b") as file:
        old = file.seek(0, os.SEEK_END)
        if n_bytes <= old:
            file.truncate(n_bytes)
            return
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), old, n_bytes - old)
            return
        if shutil.disk_usage(path.parent).free < n_bytes - old:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        file.truncate(n_bytes)


class MappedFile:
    """An array in a file that grows and is mapped into memory.

    Parameters
    ----------
    path : Path
    dtype : type
    width : int, optional
        Number of columns; None for one dimension.
    """

    def __init__(self, path: Path, dtype: type, width: int | None) -> None:
        self._path = path
        self._dtype = np.dtype(dtype)
        self._row_shape = () if width is None else (width,)

    def resized(self, n_rows: int) -> NDArray[np.generic]:
        """Return the array with so many rows; new ones are zero."""
        shape = (n_rows, *self._row_shape)
        reserve(self._path, int(np.prod(shape)) * self._dtype.itemsize)
        if n_rows == 0:
            return np.empty(shape, self._dtype)
        return np.asarray(np.memmap(self._path, self._dtype, "r+", shape=shape))
