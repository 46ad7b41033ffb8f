"""The long work of the window: reading, detecting, writing a report.

Requests run one after the other. The value of a job is emitted as a signal; nothing here
knows the document.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Signal

from pipecore.errors import ReadError
from pipecore.settings import InputSettings, Settings
from pipecore.types import PointCloud, Result
from pipegui.i18n.texts import tr
from pipegui.model.document import Scan
from pipegui.model.fingerprint import Fingerprint
from pipegui.work.worker import (
    Cancelled,
    Event,
    Failed,
    Finished,
    JobProgress,
    PartReady,
    Progressed,
    Started,
    Worker,
)

if TYPE_CHECKING:
    from pipecore.preview import Plan

ReadFunction = Callable[[tuple[Path, ...], InputSettings, JobProgress], PointCloud]
DetectFunction = Callable[[PointCloud, Settings, JobProgress], Result]
PlanFunction = Callable[[PointCloud, Settings, JobProgress], "Plan | None"]


def read_files(paths: tuple[Path, ...], given: InputSettings, progress: JobProgress) -> PointCloud:
    """Read one cloud from one or several files with pipecore."""
    from pipecore.io import read  # noqa: PLC0415 - laspy and numba take their time

    return read(
        paths,
        length_unit=given.length_unit,
        flagged_points=given.flagged_points,
        stations=given.stations,
        columns=given.columns,
        progress=progress,
        look=progress.show_part,
    )


def detect_pipes(cloud: PointCloud, settings: Settings, progress: JobProgress) -> Result:
    """Detect with pipecore."""
    from pipecore.pipeline import STAGES, detect  # noqa: PLC0415 - numba takes its time

    progress.expect(STAGES)
    return detect(cloud, settings, progress=progress)


@dataclass(frozen=True, eq=False)
class Edited:
    """A scan's result before and after an edit; `text` names the edit."""

    cloud: PointCloud
    before: Result
    after: Result
    text: str


Change = Callable[[JobProgress], Result]
"""Computes the next result."""


def plan_cuts(cloud: PointCloud, settings: Settings, progress: JobProgress) -> "Plan | None":
    """Plan with pipecore what a detection would cut."""
    from pipecore.preview import plan_stacks  # noqa: PLC0415 - numba takes its time

    return plan_stacks(cloud, settings, progress)


@dataclass(frozen=True)
class _Request:
    title: str
    """"" for idle work."""
    work: Callable[[JobProgress], Any]
    done: Callable[[Any], None]
    failed: Callable[[str, str], None] | None = None
    """Takes the message of an error and its details, in place of the queue's own signal."""
    is_reading: bool = False

    @property
    def is_idle_work(self) -> bool:
        return not self.title


class JobQueue(QObject):
    """Runs requests one after the other and reports what came of them.

    Scans that are opened while something else runs are read in parallel.
    """

    busy_changed = Signal(bool)
    started = Signal(str)
    progressed = Signal(object)
    """A `Progressed` event."""
    part_read = Signal(object)
    """A part of the cloud that is being read."""
    cancelling = Signal()
    ended = Signal()
    cancelled = Signal(str)
    """Title of the job."""
    failed = Signal(str, str)
    """Message, and details for a bug report."""

    parallel_changed = Signal(str)
    """Title of the job that runs in parallel; "" when it has ended."""

    scan_read = Signal(object)
    """A `Scan`."""
    scan_read_again = Signal(object, object)
    """The clouds that it takes the place of, and the `Scan`."""
    read_failed = Signal(object, str, str)
    """Paths of the files that could not be read, message, and details for a bug report."""
    detected = Signal(object, object)
    """The cloud and its `Result`."""
    edited = Signal(object)
    """`Edited`."""
    written = Signal(object)
    """Path of what was written."""

    def __init__(
        self,
        read: ReadFunction = read_files,
        detect: DetectFunction = detect_pipes,
        plan: PlanFunction = plan_cuts,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(parent)
        self.read, self._detect = read, detect
        self.plan = plan
        self._waiting: deque[_Request] = deque()
        self._idle_work: _Request | None = None
        self._parallel: JobQueue | None = None
        self._running: _Request | None = None
        self.worker = Worker(self)
        self.worker.happened.connect(self._take)

    @property
    def is_busy(self) -> bool:
        """Whether requested work runs or waits; idle work does not count."""
        return self._is_requested_work or bool(self._waiting)

    @property
    def _is_requested_work(self) -> bool:
        """Whether what runs was requested, and is not idle work."""
        return self._running is not None and not self._running.is_idle_work

    @property
    def title(self) -> str:
        """Title of the requested work that runs or is next; "" for none."""
        if self._running is not None and self._is_requested_work:
            return self._running.title
        return self._waiting[0].title if self._waiting else ""

    def open_files(self, paths: Sequence[Path], reading: InputSettings) -> None:
        """Read each file as a scan of its own, without waiting for a detection."""
        for path in paths:
            self._read((path,), path.name, reading, self.scan_read.emit)

    def read_again(
        self,
        clouds: Sequence[PointCloud],
        paths: tuple[Path, ...],
        name: str,
        reading: InputSettings,
    ) -> None:
        """Read files as one scan that takes the place of those with these clouds."""
        clouds = tuple(clouds)
        self._read(paths, name, reading, lambda scan: self.scan_read_again.emit(clouds, scan))

    def _read(
        self,
        paths: tuple[Path, ...],
        name: str,
        reading: InputSettings,
        done: Callable[[Scan], None],
    ) -> None:
        can_wait = self._running is None or self._running.is_reading
        queue = self if can_wait else self._parallel_queue()

        def work(progress: JobProgress) -> Scan:
            from pipecore.io import guessed_columns, is_text  # noqa: PLC0415 - as `read_files`

            fingerprint = Fingerprint.if_there(paths[0])
            cloud = self.read(paths, reading, progress)
            if not len(cloud):
                raise ReadError(tr("“{name}” holds no points.").format(name=name))
            return Scan(
                name,
                cloud,
                reading=reading,
                fingerprint=fingerprint,
                others=paths[1:],
                is_text=is_text(paths[0]),
                guessed_columns="" if reading.columns else guessed_columns(paths[0]),
            )

        def failed(message: str, details: str) -> None:
            self.read_failed.emit(paths, message, details)

        title = tr("Reading {name}").format(name=name)
        queue._request(_Request(title, work, done, failed, is_reading=True))

    def _parallel_queue(self) -> "JobQueue":
        if self._running is not None and self._running.is_idle_work:
            return self  # it is cancelled
        if self._parallel is None:
            self._parallel = JobQueue(parent=self)
            self._parallel.started.connect(self.parallel_changed)
            self._parallel.ended.connect(lambda: self.parallel_changed.emit(""))
            self._parallel.cancelled.connect(self.cancelled)
            self._parallel.failed.connect(self.failed)
        return self._parallel

    def detect(self, cloud: PointCloud, settings: Settings) -> None:
        """Detect on a cloud."""

        def work(progress: JobProgress) -> Result:
            return self._detect(cloud, settings, progress)

        self._request(_Request(tr("Detecting"), work, lambda r: self.detected.emit(cloud, r)))

    def edit(
        self, title: str, text: str, cloud: PointCloud, before: Result, change: Change
    ) -> None:
        """Run an edit of a result."""

        def done(after: Result) -> None:
            self.edited.emit(Edited(cloud, before, after, text))

        self._request(_Request(title, change, done))

    def run(
        self, title: str, work: Callable[[JobProgress], Any], done: Callable[[Any], None]
    ) -> None:
        """Run any other work, and hand its value to `done`."""
        self._request(_Request(title, work, done))

    def write(self, path: Path, write: Callable[[JobProgress], None]) -> None:
        """Run an export to a path."""
        self._request(_Request(tr("Exporting"), write, lambda _: self.written.emit(path)))

    def run_when_idle(
        self,
        work: Callable[[JobProgress], Any],
        done: Callable[[Any], None],
        failed: Callable[[str], None],
    ) -> None:
        """Run short work once nothing else runs; only the caller is notified.

        Newer idle work replaces it, and requested work cancels it; then it runs again later.

        Parameters
        ----------
        work : callable
            Runs in the worker's thread.
        done, failed : callable
            Take its value, or the message of its error.
        """
        self._idle_work = _Request("", work, done, lambda message, _: failed(message))
        if self._running is None:
            self._next()
        elif self._running.is_idle_work:
            self.worker.cancel()

    def cancel(self) -> None:
        """Cancel what runs, and drop what waits."""
        self._waiting.clear()
        if self._parallel is not None:
            self._parallel.cancel()
        if self._running is not None:
            if self._is_requested_work:
                self.cancelling.emit()
            self.worker.cancel()

    def close(self) -> None:
        """Stop everything and wait for the worker's thread."""
        self._waiting.clear()
        if self._parallel is not None:
            self._parallel.close()
        self.worker.happened.disconnect(self._take)
        self.worker.close()

    def _request(self, request: _Request) -> None:
        self._waiting.append(request)
        if self._running is None:
            self._next()
        elif self._running.is_idle_work:
            self.worker.cancel()
            self.busy_changed.emit(self.is_busy)

    def _next(self) -> None:
        if self._waiting:
            self._running = self._waiting.popleft()
        elif self._idle_work is not None:
            self._running, self._idle_work = self._idle_work, None
        if self._running is not None:
            self.worker.start(self._running.title, self._running.work)
        self.busy_changed.emit(self.is_busy)

    def _take(self, event: Event) -> None:
        match event:
            case Started() if self._is_requested_work:
                self.started.emit(event.title)
            case Progressed() if self._is_requested_work:
                self.progressed.emit(event)
            case PartReady():
                self.part_read.emit(event.part)
            case Finished() | Failed() | Cancelled():
                self._end(event)

    def _end(self, event: Finished | Failed | Cancelled) -> None:
        request, self._running = self._running, None
        if request is not None and request.is_idle_work:
            if isinstance(event, Cancelled) and self._waiting and self._idle_work is None:
                self._idle_work = request  # it was cancelled for requested work
            _end_idle_work(request, event)
        elif request is not None:
            self.ended.emit()
            match event:
                case Finished():
                    request.done(event.value)
                case Failed():
                    failed = request.failed or self.failed.emit
                    failed(event.message, event.details)
                case Cancelled():
                    self.cancelled.emit(request.title)
        # What was done may have requested more.
        if self._running is None:
            self._next()


def _end_idle_work(request: _Request, event: Finished | Failed | Cancelled) -> None:
    if isinstance(event, Finished):
        request.done(event.value)
    elif isinstance(event, Failed) and request.failed is not None:
        request.failed(event.message, event.details)
