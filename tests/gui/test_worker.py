"""The worker: every job ends once, a cancel is answered, stale values are dropped."""

import threading
import time

import pytest

from pipecore.errors import ReadError
from pipegui.work.worker import Cancelled, Failed, Finished, Progressed, Started, Worker
from tests.gui.patience import PATIENCE_S, seen_after

ENDS = (Finished, Failed, Cancelled)


@pytest.fixture
def worker(qtbot):
    worker = Worker()
    worker.events = []
    worker.happened.connect(worker.events.append)
    yield worker
    assert worker.close(PATIENCE_S)


def ends(worker):
    return [event for event in worker.events if isinstance(event, ENDS)]


def report_until_stopped(progress):
    """Work that never ends by itself but reports as often as pipecore promises."""
    while True:
        progress.update("profiles", 0.5)
        time.sleep(0.02)


def test_that_a_job_tells_its_start_its_stages_and_its_value(worker, qtbot):
    def work(progress):
        for stage in ("stacks", "profiles"):
            progress.update(stage, 0.5)
        return 42

    job = worker.start("Detecting", work)
    qtbot.waitUntil(lambda: bool(ends(worker)))
    assert worker.events[0] == Started(job, "Detecting")
    stages = [e.stage for e in worker.events if isinstance(e, Progressed) and e.stage]
    assert stages == ["stacks", "profiles"]
    assert worker.events[-1] == Finished(job, 42)
    assert not worker.is_busy


def test_that_work_runs_beside_the_window(worker, qtbot):
    threads = []
    worker.start("Working", lambda _: threads.append(threading.current_thread()))
    qtbot.waitUntil(lambda: bool(ends(worker)))
    assert threads[0] is not threading.main_thread()


def test_that_a_cancel_is_answered_within_half_a_second(worker, qtbot):
    job = worker.start("Detecting", report_until_stopped)
    qtbot.waitUntil(lambda: any(isinstance(e, Progressed) for e in worker.events))
    worker.cancel()
    seen = seen_after(500, lambda: ends(worker))
    qtbot.waitUntil(lambda: bool(seen))
    assert seen == [[Cancelled(job)]]


def test_that_even_work_that_gives_no_sign_is_let_go_in_half_a_second_and_ends_once(worker, qtbot):
    running, go = threading.Event(), threading.Event()
    silent = worker.start("Detecting", lambda _: (running.set(), go.wait(PATIENCE_S)))
    assert running.wait(PATIENCE_S)
    worker.cancel()
    early, late = (seen_after(ms, lambda: ends(worker)) for ms in (300, 500))
    qtbot.waitUntil(lambda: bool(late))
    assert early == [[]]
    assert late == [[Cancelled(silent)]]
    waiting = worker.start("Next", lambda _: "value")
    qtbot.wait(100)
    assert ends(worker) == [Cancelled(silent)]
    go.set()
    qtbot.waitUntil(lambda: len(ends(worker)) == 2)
    assert ends(worker) == [Cancelled(silent), Finished(waiting, "value")]


def test_that_a_value_made_after_the_cancel_is_not_wanted(worker, qtbot):
    go = threading.Event()

    def finish_anyway(progress):
        go.wait(PATIENCE_S)
        return "too late"

    job = worker.start("Detecting", finish_anyway)
    worker.cancel()
    go.set()
    qtbot.waitUntil(lambda: bool(ends(worker)))
    assert ends(worker) == [Cancelled(job)]


def test_that_a_new_job_ends_the_one_before_which_says_nothing_more(worker, qtbot):
    first = worker.start("First", report_until_stopped)
    qtbot.waitUntil(lambda: any(isinstance(e, Progressed) for e in worker.events))
    second = worker.start("Second", lambda _: "value")
    qtbot.waitUntil(lambda: len(ends(worker)) == 2)
    assert ends(worker) == [Cancelled(first), Finished(second, "value")]
    after = worker.events[worker.events.index(Started(second, "Second")) :]
    assert not [e for e in after if isinstance(e, Progressed) and e.job == first]


def test_that_an_expected_error_is_told_in_its_own_words(worker, qtbot):
    def work(progress):
        raise ReadError("“scan.laz” is damaged.")

    worker.start("Reading", work)
    qtbot.waitUntil(lambda: bool(ends(worker)))
    (failed,) = ends(worker)
    assert failed.message == "“scan.laz” is damaged."
    assert "ReadError" in failed.details


def test_that_a_bug_ends_its_job_and_not_the_worker(worker, qtbot):
    worker.start("Broken", lambda _: 1 / 0)
    qtbot.waitUntil(lambda: bool(ends(worker)))
    assert "ZeroDivisionError" in ends(worker)[0].details
    worker.start("Next", lambda _: 1)
    qtbot.waitUntil(lambda: len(ends(worker)) == 2)
    assert isinstance(ends(worker)[1], Finished)


def test_that_thousands_of_reports_do_not_flood_the_window(worker, qtbot):
    def work(progress):
        for i in range(20_000):
            progress.update("reading", i / 20_000)

    worker.start("Reading", work)
    qtbot.waitUntil(lambda: bool(ends(worker)))
    assert len(worker.events) < 200


def test_that_time_left_is_told_once_it_can_be_known(worker, qtbot, monkeypatch):
    clock = [100.0]
    monkeypatch.setattr("pipegui.work.worker.time.monotonic", lambda: clock[0])

    def work(progress):
        progress.update("profiles", 0.0)
        clock[0] += 4.0
        progress.update("profiles", 0.25)

    worker.start("Detecting", work)
    qtbot.waitUntil(lambda: bool(ends(worker)))
    told = [e.seconds_left for e in worker.events if isinstance(e, Progressed) and e.stage]
    assert told == [None, pytest.approx(12.0)]


def test_that_the_stages_shares_make_one_progress_of_the_whole(worker, qtbot, monkeypatch):
    clock = [100.0]
    monkeypatch.setattr("pipegui.work.worker.time.monotonic", lambda: clock[0])

    def work(progress):
        progress.expect({"thinning": 0.2, "profiles": 0.6, "elements": 0.2})
        clock[0] += 2.0
        progress.update("profiles", 0.0)
        clock[0] += 3.0
        progress.update("profiles", 0.5)

    worker.start("Detecting", work)
    qtbot.waitUntil(lambda: bool(ends(worker)))
    told = [(e.fraction, e.seconds_left) for e in worker.events if isinstance(e, Progressed)]
    assert told[1:] == [
        (pytest.approx(0.2), pytest.approx(8.0)),
        (pytest.approx(0.5), pytest.approx(5.0)),
    ]
