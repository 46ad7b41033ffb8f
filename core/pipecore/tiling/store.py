"""A folder of arrays that are too large for memory, mapped into it."""

import errno
import json
import os
import secrets
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pipecore.errors import CancelledError, WriteError
from pipecore.io.mapped import as_mapped, reserve

_MARK = "running"
"""While this file is there, the detection that owns the folder wants its results."""

HEADER_BYTES = 128
"""Kind and shape of an array, before its values.

Not numpy's own header: reading that in several threads at once fails now and then before
Python 3.11.9 (its issue 106905).
"""


@dataclass(frozen=True)
class Store:
    """A temporary folder that all tiles read and write; only its path travels to workers.

    Parameters
    ----------
    folder : Path
    """

    folder: Path

    def path(self, name: str) -> Path:
        """Path of the array of this name."""
        return self.folder / f"{name}.array"

    def create(self, name: str, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
        """Make an array of zeros on the disk and map it.

        Raises
        ------
        OSError
            If the disk has no room for it: before anything is written, not on the way.
        """
        # Not into the file of a former array, which may still be mapped.
        self.remove(name)
        n_bytes = int(np.prod(shape)) * np.dtype(dtype).itemsize
        self.path(name).write_bytes(_header(shape, dtype))
        reserve(self.path(name), HEADER_BYTES + n_bytes)
        return self.open(name)

    def open(self, name: str) -> NDArray[Any]:
        """Map an array; it is unmapped when the last reference to it is gone."""
        try:
            with self.path(name).open("rb") as file:
                facts = json.loads(file.read(HEADER_BYTES))
        except FileNotFoundError:
            if self.is_wanted:
                raise
            raise CancelledError from None
        dtype, shape = np.dtype(facts["dtype"]), tuple(facts["shape"])
        if 0 in shape:
            return np.empty(shape, dtype)
        # To be written even where it is only read: kernels are compiled for such arrays.
        return as_mapped(np.memmap(self.path(name), dtype, "r+", HEADER_BYTES, shape))

    def open_coordinates(self) -> NDArray[Any]:
        """Map the coordinates that `pipecore.io.read` left in the folder, shape (n, 3)."""
        for dtype in (np.float64, np.float32):
            path = self.folder / f"xyz.{np.dtype(dtype).name}"
            if path.exists():
                return as_mapped(np.memmap(path, dtype, "r+")).reshape(-1, 3)
        raise CancelledError

    def save(self, name: str, values: NDArray[Any]) -> None:
        """Write a whole array."""
        self.remove(name)
        with self.path(name).open("wb") as file:
            file.write(_header(values.shape, values.dtype))
            file.write(np.ascontiguousarray(values).data)

    def remove(self, *names: str) -> None:
        """Delete arrays; those that are mapped somewhere go when that is over."""
        for name in names:
            with suppress(OSError):
                self.path(name).unlink(missing_ok=True)

    @property
    def is_wanted(self) -> bool:
        """Whether the detection that owns the folder is still at work."""
        return (self.folder / _MARK).exists()

    def give_up(self) -> None:
        """Let all tiles know that they are wanted no longer."""
        (self.folder / _MARK).unlink(missing_ok=True)


def _header(shape: tuple[int, ...], dtype: DTypeLike) -> bytes:
    facts = {"dtype": np.dtype(dtype).str, "shape": shape}
    return json.dumps(facts).encode().ljust(HEADER_BYTES)


@contextmanager
def temporary_store(beside: Path | None) -> Iterator[Store]:
    """Make a folder for a detection's arrays; it is gone at the end, whatever happened.

    Parameters
    ----------
    beside : Path, optional
        The folder to make it in; by default the system's for temporary files.

    Raises
    ------
    WriteError
        If it cannot be made, or the disk turns out to be full.
    """
    parent = beside or Path(tempfile.gettempdir())
    folder = parent / f".pipecore-{secrets.token_hex(6)}"
    try:
        folder.mkdir()
    except OSError as error:
        raise WriteError(
            "The folder for temporary files “{parent}” cannot be used ({reason}).",
            parent=parent,
            reason=error.strerror,
        ) from error
    store = Store(folder)
    try:
        (folder / _MARK).touch()
        yield store
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        free = shutil.disk_usage(parent).free / 2**30
        raise WriteError(
            "The disk is full: in “{parent}”, where temporary files go, {free:.1f} GiB are "
            "free; choose another folder (tiling.folder) or thin the cloud more.",
            parent=parent,
            free=free,
        ) from error
    finally:
        store.give_up()
        _remove(folder)


def _remove(folder: Path) -> None:
    """Delete a folder; tiles that are still ending may write into it meanwhile."""
    for _ in range(50):
        shutil.rmtree(folder, ignore_errors=True)
        if not folder.exists():
            return
        time.sleep(0.1)


@dataclass
class StopWhenUnwanted:
    """The progress of a tile: nobody sees it, but the tile ends when its store is given up."""

    store: Store
    _asked: float = 0.0

    def update(self, stage: str, fraction: float) -> None:
        """Raise `CancelledError` if the store was given up; look ten times a second."""
        now = time.monotonic()
        if now - self._asked > 0.1:
            self._asked = now
            if not self.store.is_wanted:
                raise CancelledError


def check_access(store: Store) -> bool:
    """Whether this process can read and write the store: asked of every worker."""
    return store.is_wanted and os.access(store.folder, os.W_OK)
