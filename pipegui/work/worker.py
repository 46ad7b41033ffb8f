"""Long work in a thread of its own: one job at a time, reported as typed events.

Each job ends in exactly one of `Finished`, `Failed` and `Cancelled`. Starting a job
cancels the one that runs. A cancelled job ends at its next update of progress, and for the
user in half a second at the latest: what it still reports after its end is dropped.
"""

import queue
import threading
import time
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from typing import Any

from PySide6.QtCore import QObject, Qt, QTimer, Signal, Slot

from pipecore.errors import CancelledError, PipecoreError
from pipegui.i18n.texts import error_text, tr


@dataclass(frozen=True)
class Started:
    """A job has begun; `title` says what it does, such as "Detecting"."""

    job: int
    title: str


@dataclass(frozen=True)
class Progressed:
    """A job is in a stage, done to a fraction (0 to 1) of all, as far as it knows its stages."""

    job: int
    stage: str
    fraction: float
    seconds_left: float | None
    """None until it has run long enough for an estimate."""


@dataclass(frozen=True, eq=False)
class PartReady:
    """A part of a job's value can be shown already."""

    job: int
    part: Any


@dataclass(frozen=True)
class Finished:
    """A job has ended with its value."""

    job: int
    value: Any


@dataclass(frozen=True)
class Failed:
    """A job has ended with an error; `details` are for a bug report."""

    job: int
    message: str
    details: str


@dataclass(frozen=True)
class Cancelled:
    """A job was stopped on request."""

    job: int


Event = Started | Progressed | PartReady | Finished | Failed | Cancelled

EVENTS_PER_SECOND = 15
CANCEL_TIMEOUT_MS = 450
"""How long a cancelled job may take to notice before it is reported as ended all the same."""


class JobProgress:
    """The progress of a job: emits at most `EVENTS_PER_SECOND`, raises once cancelled."""

    def __init__(self, job: int, emit: Callable[[Event], None]) -> None:
        self.is_cancelled = threading.Event()
        self._job, self._emit = job, emit
        self._stage, self._since = "", time.monotonic()
        self._last_emitted = 0.0
        self._shares: Mapping[str, float] = {}

    def expect(self, shares: Mapping[str, float]) -> None:
        """Set the stages to come, in their order, with their shares of the time."""
        self._shares, self._since = shares, time.monotonic()

    def update(self, stage: str, fraction: float) -> None:
        """Report that a stage is done to a fraction (0 to 1)."""
        if self.is_cancelled.is_set():
            raise CancelledError
        now = time.monotonic()
        is_new = stage != self._stage
        if is_new:
            self._stage = stage
            if stage not in self._shares:
                self._since = now
        if not is_new and now - self._last_emitted < 1 / EVENTS_PER_SECOND:
            return
        self._last_emitted = now
        done = self._of_all(stage, min(max(fraction, 0.0), 1.0))
        elapsed = now - self._since
        left = elapsed * (1 - done) / done if elapsed > 1.0 and done > 0.05 else None
        self._emit(Progressed(self._job, stage, done, left))

    def show_part(self, part: Any) -> None:
        """Emit a part of the job's value that can be shown already."""
        if not self.is_cancelled.is_set():
            self._emit(PartReady(self._job, part))

    def _of_all(self, stage: str, fraction: float) -> float:
        """Return the fraction done of all stages; of this one where it was not expected."""
        if stage not in self._shares:
            return fraction
        stages = list(self._shares)
        before = sum(self._shares[s] for s in stages[: stages.index(stage)])
        return (before + fraction * self._shares[stage]) / sum(self._shares.values())


Work = Callable[[JobProgress], Any]


class Worker(QObject):
    """Runs jobs one after the other in one thread of its own.

    One thread only, because numba's simplest threading layer ends the process when two
    threads use it.
    """

    happened = Signal(object)
    """An `Event`, delivered in the window's thread."""
    _posted = Signal(object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._numbers = count(1)
        self._current = 0
        self._unended: set[int] = set()
        self._progress: JobProgress | None = None
        self._jobs: queue.SimpleQueue[tuple[JobProgress, int, Work] | None] = queue.SimpleQueue()
        self._posted.connect(self._deliver, Qt.ConnectionType.QueuedConnection)
        self._thread = threading.Thread(target=self._run, name="pipegui-worker", daemon=True)
        self._thread.start()

    @property
    def is_busy(self) -> bool:
        """Whether a job is running or waiting."""
        return self._current != 0

    def start(self, title: str, work: Work) -> int:
        """Begin `work(progress)`, which returns the job's value; returns the job's number."""
        self.cancel()
        job = next(self._numbers)
        self._current, self._progress = job, JobProgress(job, self._posted.emit)
        self._unended.add(job)
        self.happened.emit(Started(job, title))
        self._jobs.put((self._progress, job, work))
        return job

    def cancel(self) -> None:
        """Cancel the job that runs, at its next update of progress."""
        if self._progress is not None and not self._progress.is_cancelled.is_set():
            self._progress.is_cancelled.set()
            late = Cancelled(self._current)
            QTimer.singleShot(CANCEL_TIMEOUT_MS, self, lambda: self._deliver(late))

    def close(self, timeout_s: float = 5.0) -> bool:
        """Cancel, and wait for the thread to end; returns whether it did."""
        self.cancel()
        self._posted.disconnect(self._deliver)
        self._jobs.put(None)
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while (item := self._jobs.get()) is not None:
            progress, job, work = item
            ended = _end_of(progress, job, work)
            # After a timeout of `close` the receiver may be gone.
            with suppress(RuntimeError):
                self._posted.emit(ended)

    @Slot(object)
    def _deliver(self, event: Event) -> None:
        if event.job not in self._unended:
            return
        is_current = event.job == self._current
        is_cancelled = self._progress is None or self._progress.is_cancelled.is_set()
        is_wanted = is_current and not is_cancelled
        if not isinstance(event, Finished | Failed | Cancelled):
            if is_wanted:
                self.happened.emit(event)
            return
        self._unended.remove(event.job)
        if is_current:
            self._current, self._progress = 0, None
        # A value that comes after the cancel is dropped.
        self.happened.emit(event if is_wanted else Cancelled(event.job))


def _end_of(progress: JobProgress, job: int, work: Work) -> Event:
    """Do the work, and return the one event that ends it, whatever happens."""
    try:
        progress.update("", 0.0)
        return Finished(job, work(progress))
    except CancelledError:
        return Cancelled(job)
    except PipecoreError as error:
        return Failed(job, error_text(error), traceback.format_exc())
    except MemoryError:
        return Failed(
            job,
            tr("There is not enough memory for this scan. Close other programs or thin the scan."),
            traceback.format_exc(),
        )
    except BaseException as error:  # a thread must not die of its work
        what = tr("Something went wrong inside the program ({kind}).").format(
            kind=type(error).__name__
        )
        message = tr("{what} Your scans and earlier results are safe.").format(what=what)
        return Failed(job, message, traceback.format_exc())
