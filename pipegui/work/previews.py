"""Previews of stacks and profiles before a detection runs.

Remembers what shall be shown, computes it when nothing else runs, and emits it. Values
for another scan or other settings are dropped.
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

DELAY_MS = 250
"""After a change, so that a number still being typed starts nothing."""


@dataclass(frozen=True)
class _Inputs:
    """What a plan is computed from; clouds are compared by identity."""

    cloud: PointCloud
    settings: Settings

    def has_same_plan(self, other: "_Inputs | None") -> bool:
        """Whether the same stacks would be cut."""
        return (
            other is not None
            and self.cloud is other.cloud
            and self.settings.thinning == other.settings.thinning
            and self.settings.stacks == other.settings.stacks
        )


class Previews(QObject):
    """The plan of the active scan, and the profile of it that is shown."""

    planned = Signal(object)
    """A `PlanState`."""
    previewed = Signal(object)
    """A `PreviewState`."""

    def __init__(self, jobs: JobQueue, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._jobs = jobs
        self._inputs: _Inputs | None = None
        self._planned_for: _Inputs | None = None
        self._plan: Plan | None = None
        self._row, self._index = 0, 0
        self._is_list_visible, self._is_profile_visible = False, False
        self._delay = QTimer(self)
        self._delay.setSingleShot(True)
        self._delay.setInterval(DELAY_MS)
        self._delay.timeout.connect(self._compute)

    def set_list_visible(self, is_visible: bool) -> None:
        """Say whether the list of stacks is visible: what is hidden is not computed."""
        self._is_list_visible = is_visible
        self._delay.start()

    def set_profile_visible(self, is_visible: bool) -> None:
        """Say whether the profile is visible."""
        self._is_profile_visible = is_visible
        self._delay.start()

    def apply(self, state: PlanningState) -> None:
        """Plan the active scan with the present settings."""
        cloud, settings, before = state.cloud, state.settings, self._inputs
        self._inputs = _Inputs(cloud, settings) if cloud is not None else None
        if self._inputs is None:
            self._reset("")
        elif not self._inputs.has_same_plan(before):
            self._reset(tr("Looking at the cloud …"))
        elif before is not None and before.settings != settings:
            self._delay.start()

    def choose(self, row: int, index: int | None = None) -> None:
        """Show a profile of the stack in a row of the plan; by default its fullest one."""
        if self._plan is None or not 0 <= row < len(self._plan.stacks):
            return
        planned = self._plan.stacks[row]
        wanted = planned.fullest if index is None else index
        self._row, self._index = row, min(max(wanted, planned.first), planned.last)
        self._emit_profile(None)
        self._delay.start()

    def step(self, by: int) -> None:
        """Show the profile so many further."""
        self.choose(self._row, self._index + by)

    def _reset(self, message: str) -> None:
        self._plan, self._planned_for, self._row = None, None, 0
        self.planned.emit(PlanState(message=message))
        self.previewed.emit(PreviewState(message=message))
        self._delay.start()

    def _compute(self) -> None:
        inputs = self._inputs
        if inputs is None or not (self._is_list_visible or self._is_profile_visible):
            return
        if not inputs.has_same_plan(self._planned_for):
            plan = self._jobs.plan
            self._run(
                lambda progress: plan(inputs.cloud, inputs.settings, progress),
                lambda value: self._on_planned(inputs, value),
            )
        elif self._is_profile_visible and self._plan is not None:
            self._compute_profile(inputs, self._plan)

    def _compute_profile(self, inputs: _Inputs, plan: "Plan") -> None:
        stack, index = plan.stacks[self._row].stack, self._index

        def work(progress: "JobProgress") -> "ProfilePreview":
            from pipecore.preview import preview_profile  # noqa: PLC0415

            return preview_profile(inputs.cloud, inputs.settings, plan, stack, index, progress)

        def done(preview: "ProfilePreview") -> None:
            is_wanted = inputs == self._inputs and plan is self._plan and index == self._index
            if is_wanted and stack is plan.stacks[self._row].stack:
                self._emit_profile(preview)

        self._run(work, done)

    def _run(self, work: Callable[..., object], done: Callable[..., None]) -> None:
        self._jobs.run_when_idle(work, done, self._on_failed)

    def _on_failed(self, message: str) -> None:
        self._planned_for = self._inputs  # computed again only once something changes
        self._plan = None
        self.planned.emit(PlanState(message=message))
        self.previewed.emit(PreviewState(message=message))

    def _on_planned(self, inputs: _Inputs, plan: "Plan | None") -> None:
        if not inputs.has_same_plan(self._inputs):
            return
        self._plan, self._planned_for = plan, inputs
        self.planned.emit(PlanState(plan))
        if plan is not None and plan.stacks:
            self.choose(min(self._row, len(plan.stacks) - 1))

    def _emit_profile(self, preview: "ProfilePreview | None") -> None:
        self.previewed.emit(PreviewState(self._plan, self._row, self._index, preview))
