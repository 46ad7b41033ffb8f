"""Tiles on dask: threads of this process by default, any cluster by its address."""

import logging
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent import futures as concurrent
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipecore import parallel
from pipecore.errors import CancelledError, PipecoreError, SettingsError
from pipecore.progress import Progress
from pipecore.tiling.store import Store, check_access

if TYPE_CHECKING:
    from distributed import Client

UPDATE_SECONDS = 0.2
"""Progress is reported, and cancelling noticed, at least this often, seconds."""
MAX_SECONDS_WITHOUT_WORKERS = 20.0
"""A cluster may be without workers for so long, seconds: lost ones are started again."""
_CONNECT_TIMEOUT = "5s"
_CALM = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
}
"""dask looks at its own threads so often that this costs 3 % of a core."""
_NO_ANSWER = "The dask cluster no longer answers (tiling.scheduler); nothing was written."
_NO_WORKERS = "All workers of the dask cluster were lost; nothing was written."
_ANY_PORT = "127.0.0.1:0"


class Engine:
    """Runs the same work on many tiles.

    Parameters
    ----------
    client : distributed.Client
    store : Store
    n_at_once : int
        Tiles that share one computer's memory at a time.
    """

    def __init__(
        self, client: "Client", store: Store, n_at_once: int, *, is_local: bool = False
    ) -> None:
        self._client = client
        self._is_local = is_local
        self.store = store
        self.n_at_once = n_at_once

    def sees(self, paths: Sequence[Path]) -> bool:
        """Whether all workers can read these files."""
        if self._is_local:
            return True
        try:
            can_see = self._client.run(can_read, [path.absolute() for path in paths])
        except OSError as error:
            raise PipecoreError(_NO_ANSWER) from error
        return all(can_see.values())

    def run(
        self,
        work: Callable[..., Any],
        tiles: Sequence[tuple[Any, ...]],
        stage: str,
        progress: Progress,
        span: tuple[float, float] = (0.0, 1.0),
    ) -> list[Any]:
        """Call `work(store, *tile)` for every tile and return the results in their order.

        What a tile returns must be small; what is large it writes to the store. If a worker
        is lost, others do its tiles again.

        Raises
        ------
        CancelledError
            From `progress`; tiles that have begun end soon.
        PipecoreError
            From a tile, if it ends one worker after the other, or if there is no worker or
            no scheduler any more.
        """
        from distributed import wait  # noqa: PLC0415
        from distributed.scheduler import KilledWorker  # noqa: PLC0415

        begin, end = span
        progress.update(stage, begin)
        futures = [self._client.submit(work, self.store, *tile, pure=False) for tile in tiles]
        pending = set(futures)
        watch, results = _WorkerWatch(self._client), {}
        try:
            while pending:
                try:
                    done, pending = wait(
                        pending, timeout=UPDATE_SECONDS, return_when="FIRST_COMPLETED"
                    )
                except TimeoutError:
                    done = set()
                for future in done:
                    results[future] = future.result()
                if not (done or self._is_local):
                    watch.check()
                share = 1.0 - len(pending) / max(len(futures), 1)
                progress.update(stage, begin + (end - begin) * share)
            return [results[future] for future in futures]
        except KilledWorker as error:
            raise PipecoreError(
                "A worker of the dask cluster was lost, most likely for want of memory; lower "
                "the memory limit (tiling.memory_gib) to make tiles smaller."
            ) from error
        except concurrent.CancelledError as error:
            raise PipecoreError(_NO_ANSWER) from error
        except BaseException:
            self.store.give_up()
            self._client.cancel(futures)
            raise


class _WorkerWatch:
    """Looks whether a cluster still has workers."""

    def __init__(self, client: "Client") -> None:
        self._client = client
        self._seen = self._looked = time.monotonic()

    def check(self) -> None:
        """Raise `PipecoreError` if it has had none for too long; ask once a second."""
        now = time.monotonic()
        if now - self._looked < min(1.0, MAX_SECONDS_WITHOUT_WORKERS):
            return
        self._looked = now
        # There is no entry while there is no connection.
        workers = self._client.scheduler_info(n_workers=-1).get("workers")
        if workers:
            self._seen = now
        elif now - self._seen > MAX_SECONDS_WITHOUT_WORKERS:
            raise PipecoreError(_NO_ANSWER if workers is None else _NO_WORKERS)


@contextmanager
def start_engine(scheduler: str, store: Store) -> Iterator[Engine]:
    """Connect to a scheduler, or start threads of this process if `scheduler` is "".

    Raises
    ------
    SettingsError
        If the scheduler does not answer, has no workers, or they cannot use the store.
    """
    import dask  # noqa: PLC0415
    from distributed import Client, LocalCluster  # noqa: PLC0415

    for name in ("", ".worker", ".scheduler", ".client"):
        logging.getLogger(f"distributed{name}").setLevel(logging.CRITICAL)
    with dask.config.set({"distributed.comm.timeouts.connect": _CONNECT_TIMEOUT} | _CALM):
        if not scheduler:
            n_threads = parallel.threads()
            with (
                LocalCluster(
                    n_workers=1,
                    threads_per_worker=n_threads,
                    processes=False,
                    dashboard_address=_ANY_PORT,
                    memory_limit=None,
                ) as cluster,
                Client(cluster) as client,
            ):
                yield Engine(client, store, n_threads, is_local=True)
            return
        try:
            client = Client(scheduler, timeout=_CONNECT_TIMEOUT)
        except (OSError, TimeoutError, ValueError) as error:
            raise SettingsError(
                "No dask scheduler answers at “{scheduler}” (tiling.scheduler).",
                scheduler=scheduler,
            ) from error
        with client:
            yield Engine(client, store, _check_workers(client, scheduler, store))


def can_read(paths: Sequence[Path]) -> bool:
    """Whether this process can read files: asked of every worker."""
    return all(os.access(path, os.R_OK) for path in paths)


def _check_workers(client: "Client", scheduler: str, store: Store) -> int:
    """Make sure that all workers can use the store; return the most threads on one computer."""
    workers = client.scheduler_info(n_workers=-1)["workers"]
    if not workers:
        raise SettingsError(
            "The dask scheduler at “{scheduler}” has no workers.", scheduler=scheduler
        )
    try:
        can_use = client.run(check_access, store)
    except CancelledError:
        raise
    except OSError as error:
        raise PipecoreError(_NO_ANSWER) from error
    except Exception as error:
        raise SettingsError(
            "The workers of “{scheduler}” cannot run pipecore; install the same version there.",
            scheduler=scheduler,
        ) from error
    if not all(can_use.values()):
        raise SettingsError(
            "The workers of “{scheduler}” cannot use “{parent}”; choose a folder that all "
            "of them share (tiling.folder).",
            scheduler=scheduler,
            parent=store.folder.parent,
        )
    threads: dict[str, int] = {}
    for worker in workers.values():
        threads[worker["host"]] = threads.get(worker["host"], 0) + worker["nthreads"]
    return max(threads.values())
