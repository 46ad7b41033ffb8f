"""Room on the disk for arrays that are mapped into memory."""

import errno
import mmap
import os
import shutil
import threading
from pathlib import Path
from typing import Any
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

_maps: "WeakSet[mmap.mmap]" = WeakSet()
_lock = threading.Lock()


def as_mapped(array: np.memmap[Any, Any]) -> NDArray[Any]:
    """Take a mapped array as any other; `drop_pages` knows of it as long as it is there.

    Parameters
    ----------
    array : memmap

    Returns
    -------
    ndarray
        The same memory.
    """
    owner: Any = getattr(array, "_mmap", None)
    if owner is not None:
        with _lock:
            _maps.add(owner)
    return np.asarray(array)


def is_mapped(array: NDArray[Any]) -> bool:
    """Return whether an array is kept in a file.

    Parameters
    ----------
    array : ndarray

    Returns
    -------
    bool
    """
    owner: Any = array
    while isinstance(owner, np.ndarray):
        owner = owner.base
    return isinstance(owner, mmap.mmap)


def drop_pages() -> None:
    """Give the memory into which files are mapped back; what they hold stays on the disk."""
    if not hasattr(mmap, "MADV_DONTNEED"):
        return
    with _lock:
        maps = list(_maps)
    for mapped in maps:
        mapped.madvise(mmap.MADV_DONTNEED)


def reserve(path: Path, n_bytes: int) -> None:
    """Make a file `n_bytes` long, filled with zeros, and take the disk's room for it.

    Mapped files that merely promise their length end the process when the disk turns out
    to be full.

    Parameters
    ----------
    path : Path
        Made if it is not there.
    n_bytes : int

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
    dtype : dtype or type
    width : int, optional
        Number of columns; None for one dimension.
    """

    def __init__(self, path: Path, dtype: np.dtype[Any] | type, width: int | None) -> None:
        self._path = path
        self._dtype = np.dtype(dtype)
        self._row_shape = () if width is None else (width,)

    def resized(self, n_rows: int) -> NDArray[Any]:
        """Return the array with so many rows; new ones are zero.

        Parameters
        ----------
        n_rows : int

        Returns
        -------
        ndarray
            Shape (n_rows,) or (n_rows, width).
        """
        shape = (n_rows, *self._row_shape)
        reserve(self._path, int(np.prod(shape)) * self._dtype.itemsize)
        if n_rows == 0:
            return np.empty(shape, self._dtype)
        return as_mapped(np.memmap(self._path, self._dtype, "r+", shape=shape))
