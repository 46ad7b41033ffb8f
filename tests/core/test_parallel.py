"""Work in threads: all of it is done, errors and cancels end it soon."""

import time

import pytest

from pipecore import parallel
from pipecore.errors import CancelledError
from pipecore.parallel import for_chunks, for_items
from pipecore.progress import NoProgress


@pytest.fixture(params=[1, 3])
def n_threads(request):
    before = parallel.threads()
    parallel.set_threads(request.param)
    yield request.param
    parallel.set_threads(before)


class Told:
    """Notes what it is told; cancels when it has been told a number of times."""

    def __init__(self, last: int | None = None) -> None:
        self.fractions: list[float] = []
        self.last = last

    def update(self, stage, fraction):
        assert stage == "work"
        self.fractions.append(fraction)
        if len(self.fractions) == self.last:
            raise CancelledError


@pytest.mark.parametrize("n", [0, 1, 10])
def test_that_every_item_is_done_once_and_told(n_threads, n):
    done, told = [], Told()
    for_items(lambda i, _check: done.append(i), n, "work", told, (0.2, 0.6))
    assert sorted(done) == list(range(n))
    assert told.fractions == sorted(told.fractions)
    assert told.fractions[0] == 0.2
    assert n == 0 or told.fractions[-1] == pytest.approx(0.6)


def test_that_chunks_cover_all_items(n_threads):
    chunks = []
    for_chunks(lambda a, b: chunks.append((a, b)), 25, 10, "work", NoProgress())
    assert sorted(chunks) == [(0, 10), (10, 20), (20, 25)]


def test_that_an_error_in_the_work_is_raised(n_threads):
    def work(i, _check):
        if i == 3:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        for_items(work, 10, "work", NoProgress())


def test_that_a_cancel_is_heard_while_an_item_takes_long(n_threads):
    begun = []

    def work(i, check):
        begun.append(i)
        for _ in range(1000):
            time.sleep(0.01)
            check()

    start = time.perf_counter()
    with pytest.raises(CancelledError):
        # The first update comes before the work, the second by the heartbeat.
        for_items(work, 10, "work", Told(last=2))
    assert time.perf_counter() - start < 5.0
    assert len(begun) == n_threads
