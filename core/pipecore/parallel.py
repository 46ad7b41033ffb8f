"""Running a kernel over chunks of its items in threads, with progress and cancel."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed

from pipecore.progress import Progress

_n_threads = os.cpu_count() or 1


def set_threads(n_threads: int) -> None:
    """Set how many threads kernels may use."""
    global _n_threads  # noqa: PLW0603 - one setting of the process, like numba's own
    _n_threads = max(1, n_threads)


def threads() -> int:
    """How many threads kernels may use."""
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
    begin, end = span
    progress.update(stage, begin)
    with ThreadPoolExecutor(_n_threads) as pool:
        futures = [pool.submit(work, s, min(s + chunk_size, n_items)) for s in starts]
        try:
            for done, future in enumerate(as_completed(futures), start=1):
                future.result()
                progress.update(stage, begin + (end - begin) * done / len(starts))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
