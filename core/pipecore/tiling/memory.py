"""How much memory a detection takes in one piece, and how large tiles may be."""

import ctypes
import math
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from pipecore.io import Corners, corners_of, identify
from pipecore.io.mapped import drop_pages
from pipecore.io.source import OpenOptions
from pipecore.settings import TilingSettings

GIB = 2**30

BYTES_PER_POINT_UNTILED = 150
"""What a detection in one piece may take a point; 110 to 120 were seen at 4 and 16 million."""
BASE_BYTES = 400 * 2**20
"""The program itself with its libraries and compiled kernels."""
KEPT_BYTES_PER_POINT = 16
"""What a point costs whatever the tiles: tables of cells, flags, lists of elements' points."""
TEXT_BYTES_PER_POINT = 25
"""A point takes at least about this much in a file that does not say how many it holds."""
MAX_SHARE_OF_FREE = 2 / 3
MIN_TILE_BYTES = 32 * 2**20
"""Tiles of less memory than this cost more than they save."""


@dataclass(frozen=True)
class Need:
    """What a detection needs and may have.

    Parameters
    ----------
    n_points : int
        As the files' headers say, or as their sizes suggest.
    bytes_in_one_piece : int
    limit : int
        Bytes.
    """

    n_points: int
    bytes_in_one_piece: int
    limit: int

    @property
    def is_too_large(self) -> bool:
        """Whether the cloud has to be processed in tiles."""
        return self.bytes_in_one_piece > self.limit


def estimate_need(
    paths: Sequence[Path],
    settings: TilingSettings,
    box: Corners | None = None,
    columns: str = "",
) -> Need:
    """Estimate the memory that a detection in one piece takes, beside the limit.

    Parameters
    ----------
    paths : sequence of Path
    settings : TilingSettings
    box : Box, optional
        Only the points within are counted, where a file has an octree.
    columns : str
        Of text files; see `InputSettings.columns`.

    Returns
    -------
    Need

    Raises
    ------
    ReadError
        If a file cannot be read.
    """
    n_points = 0
    for path in paths:
        with identify(path).open(path, OpenOptions(columns)) as source:
            n_most = source.n_points or path.stat().st_size // TEXT_BYTES_PER_POINT
            if box is not None and source.count_within is not None:
                n_most = source.count_within(corners_of(box))
            n_points += n_most
    limit = int(settings.memory_gib * GIB) or int(MAX_SHARE_OF_FREE * free_memory())
    return Need(n_points, BASE_BYTES + BYTES_PER_POINT_UNTILED * n_points, limit)


def free_memory() -> int:
    """Bytes of memory that the computer has free."""
    import psutil  # noqa: PLC0415

    return int(psutil.virtual_memory().available)


def tile_bytes(n_points: int, limit: int, n_at_once: int) -> int:
    """Memory that one of several tiles may take beside what is always there."""
    left = limit - BASE_BYTES - KEPT_BYTES_PER_POINT * n_points
    return max(MIN_TILE_BYTES, math.floor(left / n_at_once))


POLL_SECONDS, POLL_SECONDS_IN_VAIN = 0.1, 2.0
"""Between two readings of the memory in use, and after one that could not be lowered."""
MAX_USED_SHARE = 0.8
"""From this share of the limit on, pages of files are given back."""


@contextmanager
def keeping_within(limit: int) -> Iterator[None]:
    """Give memory back whenever the process nears a limit.

    That is what files are mapped into, which is read again when it is needed, mostly from
    the system's own cache; and what the C library keeps of arrays that are gone.
    """
    import psutil  # noqa: PLC0415

    process, is_over = psutil.Process(), threading.Event()
    trim = _trimmer()

    def look() -> None:
        pause = POLL_SECONDS
        while not is_over.wait(pause):
            pause = POLL_SECONDS
            if process.memory_info().rss > MAX_USED_SHARE * limit:
                drop_pages()
                trim()
                if process.memory_info().rss > MAX_USED_SHARE * limit:
                    pause = POLL_SECONDS_IN_VAIN

    watch = threading.Thread(target=look, name="pipecore memory", daemon=True)
    watch.start()
    try:
        yield
    finally:
        is_over.set()
        watch.join()


def _trimmer() -> Callable[[], object]:
    """What makes the C library give freed memory back; only GNU's keeps much of it."""
    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):
        return lambda: None
    return lambda: trim(0)
