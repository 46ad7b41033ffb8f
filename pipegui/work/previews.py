"""Looking at stacks and profiles before a detection runs.

Keeps what is looked at, asks the worker for it when nothing else runs, and hands the
answers on. Answers for another scan or other settings are dropped.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, QTimer, Signal

from pipecore.settings import Settings
from pipecore.types import PointCloud
from pipegui.i18n.texts import tr
from pipegui.states.preview_state import PlanningState, PlanState, PreviewState
from pipegui.work.job_queue import JobQueue

if TYPE_CHECKING:
    from pipecore.preview import Plan, ProfilePreview
    from pipegui.work.worker import JobProgress

PATIENCE_MS = 250
"""After a change, so that a number that is still being typed asks for nothing."""


@dataclass(frozen=True)
class _Wish:
    """What a plan stands on; clouds are compared by identity."""

    cloud: PointCloud
    settings: Settings

    def has_same_plan(self, other: "_Wish | None") -> bool:
        """Whether the same stacks would be cut."""
        return (
            other is not None
            and self.cloud is other.cloud
            and self.settings.thinning == other.settings.thinning
            and self.settings.stacks == other.settings.stacks
        )


class Previews(QObject):
    """The plan of the active scan, and the profile of it that is looked at."""

    planned = Signal(object)
    """A `PlanState`."""
    previewed = Signal(object)
    """A `PreviewState`."""

    def __init__(self, jobs: JobQueue, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._jobs = jobs
        self._wish: _Wish | None = None
        self._planned_for: _Wish | None = None
        self._plan: Plan | None = None
        self._row, self._index = 0, 0
        self._is_list_seen, self._is_profile_seen = False, False
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.setInterval(PATIENCE_MS)
        self._soon.timeout.connect(self._ask)

    def watch_list(self, is_seen: bool) -> None:
        """Take note whether anybody sees the list of stacks: what nobody sees is not made."""
        self._is_list_seen = is_seen
        self._soon.start()

    def watch_profile(self, is_seen: bool) -> None:
        """Take note whether anybody sees the profile."""
        self._is_profile_seen = is_seen
        self._soon.start()

    def apply(self, state: PlanningState) -> None:
        """Look at the active scan with the present settings."""
        cloud, settings, before = state.cloud, state.settings, self._wish
        self._wish = _Wish(cloud, settings) if cloud is not None else None
        if self._wish is None:
            self._forget("")
        elif not self._wish.has_same_plan(before):
            self._forget(tr("Looking at the cloud …"))
        elif before is not None and before.settings != settings:
            self._soon.start()

    def choose(self, row: int, index: int | None = None) -> None:
        """Look at a profile of the stack in a row of the plan; by default its fullest one."""
        if self._plan is None or not 0 <= row < len(self._plan.stacks):
            return
        planned = self._plan.stacks[row]
        wanted = planned.fullest if index is None else index
        self._row, self._index = row, min(max(wanted, planned.first), planned.last)
        self._tell_profile(None)
        self._soon.start()

    def step(self, by: int) -> None:
        """Look at the profile so many further."""
        self.choose(self._row, self._index + by)

    def _forget(self, message: str) -> None:
        self._plan, self._planned_for, self._row = None, None, 0
        self.planned.emit(PlanState(message=message))
        self.previewed.emit(PreviewState(message=message))
        self._soon.start()

    def _ask(self) -> None:
        wish = self._wish
        if wish is None or not (self._is_list_seen or self._is_profile_seen):
            return
        if not wish.has_same_plan(self._planned_for):
            plan = self._jobs.plan
            self._look(
                lambda progress: plan(wish.cloud, wish.settings, progress),
                lambda value: self._take_plan(wish, value),
            )
        elif self._is_profile_seen and self._plan is not None:
            self._ask_for_profile(wish, self._plan)

    def _ask_for_profile(self, wish: _Wish, plan: "Plan") -> None:
        stack, index = plan.stacks[self._row].stack, self._index

        def work(progress: "JobProgress") -> "ProfilePreview":
            from pipecore.preview import preview_profile  # noqa: PLC0415

            return preview_profile(wish.cloud, wish.settings, plan, stack, index, progress)

        def done(preview: "ProfilePreview") -> None:
            is_wanted = wish == self._wish and plan is self._plan and index == self._index
            if is_wanted and stack is plan.stacks[self._row].stack:
                self._tell_profile(preview)

        self._look(work, done)

    def _look(self, work: Callable[..., object], done: Callable[..., None]) -> None:
        self._jobs.run_when_idle(work, done, self._fail)

    def _fail(self, message: str) -> None:
        self._planned_for = self._wish  # asked again only once something changes
        self._plan = None
        self.planned.emit(PlanState(message=message))
        self.previewed.emit(PreviewState(message=message))

    def _take_plan(self, wish: _Wish, plan: "Plan | None") -> None:
        if not wish.has_same_plan(self._wish):
            return
        self._plan, self._planned_for = plan, wish
        self.planned.emit(PlanState(plan))
        if plan is not None and plan.stacks:
            self.choose(min(self._row, len(plan.stacks) - 1))

    def _tell_profile(self, preview: "ProfilePreview | None") -> None:
        self.previewed.emit(PreviewState(self._plan, self._row, self._index, preview))
