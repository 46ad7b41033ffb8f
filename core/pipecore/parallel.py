"""Running a kernel over chunks of its items in threads, with progress and cancel."""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from threading import Event
from typing import Any

from pipecore.errors import CancelledError
from pipecore.progress import Progress

HEARTBEAT = 0.15
"""Progress is reported at least this often, seconds, so that a cancel takes effect soon."""

_n_threads = os.cpu_count() or 1


def set_threads(n_threads: int) -> None:
    """Set the number of threads that kernels use.

    Parameters
    ----------
    n_threads : int
        At least one is used.
    """
    global _n_threads  # noqa: PLW0603 - one setting of the process, like numba's own
    _n_threads = max(1, n_threads)
    # Heard by the compressor of LAZ if it has not begun yet.
    os.environ["RAYON_NUM_THREADS"] = str(_n_threads)


def threads() -> int:
    """Return the number of threads that kernels use.

    Returns
    -------
    int
    """
    return _n_threads


def for_chunks(
    work: Callable[[int, int], None],
    n_items: int,
    chunk_size: int,
    stage: str,
    progress: Progress,
    span: tuple[float, float] = (0.0, 1.0),
) -> None:
    """Call `work(start, stop)` for chunks of `n_items`, in threads.

    Chunks must be independent: which thread runs which chunk, and when, must not
    change the result.

    Parameters
    ----------
    work : callable
        Usually a closure around a compiled kernel that releases the GIL.
    n_items, chunk_size : int
    stage : str
        Reported to `progress` after each chunk.
    progress : Progress
        If it raises, the remaining chunks are dropped.
    span : (float, float)
        Which part of the stage's fraction these items are.
    """
    starts = range(0, n_items, chunk_size)

    def chunk(k: int, _check: Callable[[], None]) -> None:
        work(starts[k], min(starts[k] + chunk_size, n_items))

    for_items(chunk, len(starts), stage, progress, span)


def for_items(
    work: Callable[[int, Callable[[], None]], None],
    n_items: int,
    stage: str,
    progress: Progress,
    span: tuple[float, float] = (0.0, 1.0),
) -> None:
    """Call `work(item, check)` for each of `n_items`, in threads.

    Items must be independent, as the chunks of `for_chunks`.

    Parameters
    ----------
    work : callable
        Takes an item's number and `check`, which is to be called now and then by work that takes
        long: it raises where the work is cancelled.
    n_items : int
    stage : str
        Reported to `progress` after each item.
    progress : Progress
        If it raises, the remaining items are dropped.
    span : (float, float)
        Which part of the stage's fraction these items are.
    """
    begin, end = span
    progress.update(stage, begin)
    is_over = Event()

    def check() -> None:
        if is_over.is_set():
            raise CancelledError

    ended: SimpleQueue[Future[None]] = SimpleQueue()
    with ThreadPoolExecutor(_n_threads) as pool:
        for i in range(n_items):
            pool.submit(work, i, check).add_done_callback(ended.put)
        n_left = n_items
        try:
            while n_left > 0:
                with suppress(Empty):
                    ended.get(timeout=HEARTBEAT).result()
                    n_left -= 1
                progress.update(stage, begin + (end - begin) * (1.0 - n_left / n_items))
        except BaseException:
            is_over.set()
            pool.shutdown(cancel_futures=True)
            raise


@contextmanager
def pool() -> Iterator[ThreadPoolExecutor]:
    """As many threads as kernels may use; what has not begun is dropped at the end."""
    executor = ThreadPoolExecutor(_n_threads)
    try:
        yield executor
    finally:
        executor.shutdown(cancel_futures=True)


def wait_for(work: Future[Any], stage: str, progress: Progress, fraction: float) -> None:
    """Wait until submitted work is done, with progress and cancel.

    Parameters
    ----------
    work : Future
    stage : str
    progress : Progress
        Updated while waiting; if it raises, the wait ends.
    fraction : float
        Reported of the stage.
    """
    progress.update(stage, fraction)
    while not wait([work], HEARTBEAT).done:
        progress.update(stage, fraction)
