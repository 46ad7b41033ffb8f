"""Stacks and profiles looked at before a detection: worker, controller, panel and plot."""

import threading

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QSignalSpy

from pipecore.preview import plan_stacks, preview_profile
from pipecore.settings import ProfileMethod, Settings
from pipegui.model import commands
from pipegui.model.document import Document, Measurement, Scan, Tool
from pipegui.panels.stacks_panel import NAME, PROFILES, SHARE, StacksPanel
from pipegui.plots.preview_view import PreviewView, summary_of, upright
from pipegui.states.preview_state import PlanningState, PlanState, PreviewState
from pipegui.states.view_state import resolve
from pipegui.work.job_queue import JobQueue
from pipegui.work.previews import Previews
from tests.factories import make_cloud
from tests.gui.patience import PATIENCE_S

LEFT = Qt.MouseButton.LeftButton
AXES = Settings().replace({"stacks.preset": "axes"})
CLOUD = make_cloud()


@pytest.fixture(scope="module")
def plan():
    return plan_stacks(CLOUD, AXES)


@pytest.fixture(scope="module")
def preview(plan):
    return preview_profile(CLOUD, AXES, plan, plan.stacks[0].stack, plan.stacks[0].fullest)


def shown(qtbot, widget, size=(420, 480)):
    qtbot.addWidget(widget)
    widget.resize(*size)
    with qtbot.waitActive(widget):
        widget.show()
        widget.activateWindow()
    return widget


# The worker


@pytest.fixture
def jobs(qtbot, no_leaks):
    jobs = JobQueue(read=lambda *_: CLOUD, detect=lambda *_: "result")
    yield jobs
    jobs.close()


def test_that_idle_work_is_told_to_its_caller_only(jobs, qtbot):
    told, spies = [], [QSignalSpy(s) for s in (jobs.started, jobs.ended, jobs.cancelled)]
    jobs.run_when_idle(lambda progress: 42, told.append, told.append)
    assert not jobs.is_busy
    qtbot.waitUntil(lambda: told == [42])
    assert [spy.count() for spy in spies] == [0, 0, 0]


def test_that_idle_work_makes_way_for_work_and_comes_back_after_it(jobs, qtbot):
    told, running = [], threading.Event()

    def slow(progress):
        running.set()
        while True:  # until it has to make way
            progress.update("thinning", 0.5)
            threading.Event().wait(0.01)

    def quick(progress):
        return slow(progress) if not running.is_set() else "again"

    jobs.run_when_idle(quick, told.append, told.append)
    assert running.wait(PATIENCE_S)
    started = QSignalSpy(jobs.started)
    with qtbot.waitSignal(jobs.detected):
        jobs.detect(CLOUD, Settings())
        assert jobs.is_busy  # though it has to wait for the idle work to end
    assert [started.at(i) for i in range(started.count())] == [["Detecting"]]
    qtbot.waitUntil(lambda: told == ["again"])


def test_that_newer_idle_work_replaces_what_waits(jobs, qtbot):
    told, release = [], threading.Event()
    jobs.run("Waiting", lambda _: release.wait(PATIENCE_S), told.append)
    jobs.run_when_idle(lambda _: "old", told.append, told.append)
    jobs.run_when_idle(lambda _: "new", told.append, told.append)
    release.set()
    qtbot.waitUntil(lambda: told == [True, "new"])


def test_that_idle_work_that_fails_says_why(jobs, qtbot):
    none = Settings().replace({"stacks.preset": "none"})
    told = []
    jobs.run_when_idle(
        lambda p: plan_stacks(CLOUD, none, p), lambda _: told.append("?"), told.append
    )
    qtbot.waitUntil(lambda: bool(told))
    assert "no stacks to cut" in told[0]


# The controller


class Seen:
    """Previews over the real core, and what they said last."""

    def __init__(self, jobs):
        self.previews = Previews(jobs)
        self.plans, self.profiles = [], []
        self.previews.planned.connect(self.plans.append)
        self.previews.previewed.connect(self.profiles.append)

    @property
    def plan(self):
        return self.plans[-1].plan if self.plans else None

    @property
    def profile(self):
        return self.profiles[-1].preview if self.profiles else None


def test_that_nothing_is_planned_while_nobody_looks(jobs, qtbot):
    seen = Seen(jobs)
    seen.previews.apply(PlanningState(CLOUD, AXES))
    qtbot.wait(500)
    assert seen.plan is None
    seen.previews.set_list_visible(True)
    qtbot.waitUntil(lambda: seen.plan is not None)
    assert [s.stack.name for s in seen.plan.stacks][:3] == ["X", "Y", "Z"]
    assert seen.profile is None  # nobody looks at the profile


def test_that_the_profile_follows_stack_index_and_settings(jobs, qtbot):
    seen = Seen(jobs)
    seen.previews.set_profile_visible(True)
    seen.previews.apply(PlanningState(CLOUD, AXES))
    qtbot.waitUntil(lambda: seen.profile is not None)
    first = seen.profile
    assert first.profile_index == seen.plan.stacks[0].fullest
    seen.previews.step(1)
    assert seen.profile is None
    qtbot.waitUntil(lambda: seen.profile is not None)
    assert seen.profile.profile_index == first.profile_index + 1
    seen.previews.choose(2)
    qtbot.waitUntil(lambda: seen.profile is not None)
    assert seen.profile.stack.name == "Z"
    before = seen.profile
    by_proximity = AXES.replace({"profiles.method": "proximity", "profiles.gap_mm": 500.0})
    seen.previews.apply(PlanningState(CLOUD, by_proximity))
    qtbot.waitUntil(lambda: seen.profile is not None and seen.profile is not before)
    assert seen.plan is seen.plans[-1].plan  # the stacks are the same
    assert seen.profile.n_curves < before.n_curves


def test_that_steps_end_at_the_ends(jobs, qtbot):
    seen = Seen(jobs)
    seen.previews.set_profile_visible(True)
    seen.previews.apply(PlanningState(CLOUD, AXES))
    qtbot.waitUntil(lambda: seen.profile is not None)
    seen.previews.step(10**6)
    assert seen.profiles[-1].index == seen.plan.stacks[0].last
    seen.previews.step(-(10**6))
    assert seen.profiles[-1].index == seen.plan.stacks[0].first


def test_that_a_closed_scan_is_forgotten(jobs, qtbot):
    seen = Seen(jobs)
    seen.previews.set_list_visible(True)
    seen.previews.apply(PlanningState(CLOUD, AXES))
    seen.previews.apply(PlanningState(None, AXES))
    qtbot.wait(600)
    assert seen.plan is None
    assert seen.plans[-1] == PlanState()


# The panel


def panel_of(qtbot, document, plan=None):
    panel = shown(qtbot, StacksPanel(), (280, 480))
    panel.apply(resolve(document).stacks)
    panel.show_plan(PlanState(plan))
    return panel


def test_that_planned_stacks_are_listed_before_a_detection(qtbot, plan):
    document = Document(scans=(Scan("a", CLOUD),), settings=AXES)
    panel = panel_of(qtbot, document, plan)
    item = panel.list.topLevelItem(0)
    assert [item.text(c) for c in (NAME, PROFILES)] == ["X", f"{plan.stacks[0].n_profiles:,}"]
    assert item.text(SHARE) == f"{100 * plan.stacks[0].share:.0f} %"
    assert "of the surface" in panel.note.text()


def test_that_cut_stacks_keep_the_share_of_their_plan(qtbot, document, plan):
    panel = panel_of(qtbot, document, plan)
    for row in range(panel.list.topLevelItemCount()):
        item = panel.list.topLevelItem(row)
        name = item.text(NAME)
        planned = next(p for p in plan.stacks if p.stack.name == name)
        if abs(planned.stack.width / 0.02 - 1) < 0.2:
            assert item.text(SHARE) == f"{100 * planned.share:.0f} %"


def test_that_the_selected_stack_is_previewed(qtbot, plan):
    document = Document(scans=(Scan("a", CLOUD),), settings=AXES)
    panel = panel_of(qtbot, document, plan)
    panel.list.setCurrentItem(panel.list.topLevelItem(2))
    with qtbot.waitSignal(panel.preview_wanted) as told:
        qtbot.mouseClick(panel.preview_button, LEFT)
    assert told.args == [2]


def test_that_width_gap_and_method_are_set_here(qtbot, document):
    panel = panel_of(qtbot, document)
    told = []
    panel.setting_changed.connect(lambda *args: told.append(args))
    for field, text in ((panel.cutting.width_mm, "25"), (panel.cutting.gap_mm, "40")):
        field.setFocus()
        field.selectAll()
        qtbot.keyClicks(field, text)
        qtbot.keyClick(field, Qt.Key.Key_Return)
    qtbot.keyClicks(panel.cutting.method, "Prox")
    assert told == [
        ("stacks.width_mm", 25.0),
        ("profiles.gap_mm", 40.0),
        ("profiles.method", ProfileMethod.PROXIMITY),
    ]
    changed = commands.change_settings(document, {"profiles.gap_mm": 33.0})
    panel.apply(resolve(changed).stacks)
    assert panel.cutting.gap_mm.value() == 33.0
    assert len(told) == 3


def test_that_two_points_give_a_direction(qtbot, document):
    panel = panel_of(qtbot, document)
    qtbot.mouseClick(panel.add_button, LEFT)
    with qtbot.waitSignal(panel.points_wanted):
        qtbot.mouseClick(panel.editor.from_points, LEFT)
    measurement = Measurement((1.0, 1.0, 0.0), (1.0, 3.0, 0.0))
    picked = commands.set_view(document, measurements=(measurement,))
    with qtbot.waitSignal(panel.points_taken):
        panel.apply(resolve(picked).stacks)
    with qtbot.waitSignal(panel.added) as told:
        qtbot.mouseClick(panel.editor.accept_button, LEFT)
    assert told.args == [(0.0, 1.0, 0.0)]


def test_that_points_picked_for_other_ends_are_left_alone(qtbot, document):
    panel = panel_of(qtbot, document)
    qtbot.mouseClick(panel.add_button, LEFT)
    measurement = Measurement((0.0, 0.0, 0.0), (0.0, 3.0, 0.0))
    picked = commands.set_view(document, measurements=(measurement,))
    panel.apply(resolve(picked).stacks)
    assert [c.value() for c in panel.editor.components] == [1, 0, 0]


def test_that_in_the_window_two_clicks_make_a_stack(detected, qtbot):
    stacks = detected.window.panels.stacks
    detected.window.actions_["add_stack"].trigger()
    stacks.editor.from_points.click()
    assert detected.session.document.view.tool is Tool.MEASURE
    xyz = detected.session.document.scan.cloud.xyz
    detected.window.views.scene.picked.emit(0)
    detected.window.views.scene.picked.emit(len(xyz) - 1)
    qtbot.waitUntil(lambda: detected.session.document.view.tool is Tool.SELECT)
    assert detected.session.document.view.measurements == ()
    stacks.editor.accept_button.click()
    direction = np.array(detected.session.document.settings.stacks.directions[0])
    offset = xyz[-1] - xyz[0]
    assert direction == pytest.approx(offset / np.linalg.norm(offset), abs=1e-3)


# The plot


def test_that_the_preview_shows_points_curves_and_ellipses(qtbot, plan, preview):
    view = shown(qtbot, PreviewView())
    view.apply(PreviewState(plan, 0, preview.profile_index, preview))
    assert len(view.plot.items) >= 1 + len(preview.ellipses)
    assert view.summary.text() == summary_of(preview)
    assert len(view.numbers()["curve"]) == len(preview.uv)
    assert view.number.text().endswith(f"of {plan.stacks[0].n_profiles}")


def test_that_up_is_up_in_the_preview(plan, preview):
    turn = upright(preview)
    assert turn @ turn.T == pytest.approx(np.eye(2))
    along_z = turn @ (preview.frame[:2] @ np.array([0, 0, 1.0]))
    assert along_z[0] == pytest.approx(0, abs=1e-9)
    assert along_z[1] > 0.9
    vertical = preview_profile(CLOUD, AXES, plan, plan.stacks[2].stack, plan.stacks[2].fullest)
    north = upright(vertical) @ (vertical.frame[:2] @ np.array([0, 1.0, 0]))
    assert north == pytest.approx([0, 1], abs=1e-9)


def test_that_arrow_keys_slider_and_choice_ask_for_other_profiles(qtbot, plan, preview):
    view = shown(qtbot, PreviewView())
    view.apply(PreviewState(plan, 0, preview.profile_index, preview))
    view.setFocus()
    for key, step in ((Qt.Key.Key_Right, 1), (Qt.Key.Key_Left, -1), (Qt.Key.Key_PageUp, 10)):
        with qtbot.waitSignal(view.step_requested) as told:
            qtbot.keyClick(view, key)
        assert told.args == [step]
    view.place.setFocus()
    with qtbot.waitSignal(view.chosen) as told:
        qtbot.keyClick(view.place, Qt.Key.Key_Right)
    assert told.args == [0, preview.profile_index + 1]
    view.stacks.setFocus()
    with qtbot.waitSignal(view.chosen) as told:
        qtbot.keyClick(view.stacks, Qt.Key.Key_Down)
    assert told.args == [1, None]


def test_that_a_message_stands_where_there_is_no_plan(qtbot):
    view = shown(qtbot, PreviewView())
    view.apply(PreviewState(message="There are no stacks to cut."))
    assert view.empty.isVisible()
    assert view.empty.text() == "There are no stacks to cut."
