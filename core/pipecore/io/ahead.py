"""Reading files in threads, some chunks ahead of whoever takes them, in their order.

Two files are read at a time, so that one unpacks while another waits for the disk, and chunks
are taken while more are unpacked. What comes out does not depend on how the threads run.
"""

import queue
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from pipecore.io.registry import Format
from pipecore.io.source import Chunk, OpenOptions, Source

FILES_AT_A_TIME, CHUNKS_AHEAD = 2, 2
"""Bound what is held in memory, however many files there are."""
WAIT = 0.1
"""Seconds until a thread that waits looks whether it should stop."""

T = TypeVar("T")
TakeChunks = Callable[[Source], Iterator[Chunk]]


@dataclass(frozen=True, eq=False)
class OpenFile:
    """A file that is read in a thread.

    Parameters
    ----------
    path : Path
    source : Source
        Its chunks are those of `chunks`.
    overview : Chunk or None
        A few points from all over the file, if they were asked for and can be had.
    chunks : iterator of Chunk
        Raises what reading raises. The source is complete when it ends.
    """

    path: Path
    source: Source
    overview: Chunk | None
    chunks: Iterator[Chunk]


@contextmanager
def read_ahead(
    files: Sequence[tuple[Path, Format]],
    options: OpenOptions,
    take_chunks: TakeChunks,
    check: Callable[[], None],
    *,
    has_overview: bool = False,
) -> Iterator[Iterator[OpenFile]]:
    """Read files, each in a thread, and yield them in their order.

    Parameters
    ----------
    files : sequence of (Path, Format)
    options : OpenOptions
    take_chunks : callable
        Gives the chunks of a source that are to be read.
    check : callable
        Called about ten times a second while there is nothing to take; may raise.
    has_overview : bool
        Whether to take an overview of each file, where there is one.
    """
    stop = threading.Event()
    waiting = deque(files)
    readers: deque[_Reader] = deque()

    def opened() -> Iterator[OpenFile]:
        while waiting or readers:
            while waiting and len(readers) < FILES_AT_A_TIME:
                path, file_format = waiting.popleft()
                readers.append(_Reader(path, file_format, options, take_chunks, has_overview, stop))
            yield readers[0].open_file(check)
            readers.popleft().join()

    try:
        yield opened()
    finally:
        stop.set()
        for reader in readers:
            reader.join(5 * WAIT)


def run_checked(work: Callable[[], T], check: Callable[[], None]) -> T:
    """Return what work returns, done in a thread, so that it can be left while it runs.

    Parameters
    ----------
    work : callable
    check : callable
        Called about ten times a second; if it raises, the work is left to end by itself.
    """
    done: queue.Queue[T | BaseException] = queue.Queue()

    def run() -> None:
        try:
            done.put(work())
        except BaseException as error:
            done.put(error)

    threading.Thread(target=run, name="work that is checked", daemon=True).start()
    while True:
        try:
            outcome = done.get(timeout=WAIT)
        except queue.Empty:
            check()
            continue
        if isinstance(outcome, BaseException):
            raise outcome
        return outcome


class _Reader:
    """A thread that reads a file."""

    def __init__(
        self,
        path: Path,
        file_format: Format,
        options: OpenOptions,
        take_chunks: TakeChunks,
        has_overview: bool,
        stop: threading.Event,
    ) -> None:
        self._path, self._stop = path, stop
        self._queue: queue.Queue[Source | Chunk | BaseException | None] = queue.Queue(CHUNKS_AHEAD)

        def run() -> None:
            try:
                with file_format.open(path, options) as source:
                    self._put(source)
                    self._put(source.overview() if has_overview and source.overview else None)
                    for chunk in take_chunks(source):
                        if not self._put(chunk):
                            return
            except BaseException as error:
                self._put(error)
            else:
                self._put(None)

        self._thread = threading.Thread(target=run, name=f"reading {path.name}", daemon=True)
        self._thread.start()

    def _put(self, item: Source | Chunk | BaseException | None) -> bool:
        """Hand something over; return False if nobody wants it any more."""
        while not self._stop.is_set():
            try:
                self._queue.put(item, timeout=WAIT)
            except queue.Full:
                continue
            return True
        return False

    def _get(self, check: Callable[[], None]) -> Source | Chunk | None:
        while True:
            try:
                item = self._queue.get(timeout=WAIT)
            except queue.Empty:
                check()
                continue
            if isinstance(item, BaseException):
                raise item
            return item

    def open_file(self, check: Callable[[], None]) -> OpenFile:
        """The file, when it is open."""
        source, overview = self._get(check), self._get(check)
        assert isinstance(source, Source)
        assert not isinstance(overview, Source)

        def chunks() -> Iterator[Chunk]:
            while isinstance(chunk := self._get(check), Chunk):
                yield chunk

        return OpenFile(self._path, source, overview, chunks())

    def join(self, timeout: float | None = None) -> None:
        """Wait until the thread has closed the file."""
        self._thread.join(timeout)
