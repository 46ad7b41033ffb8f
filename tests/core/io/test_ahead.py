"""Several files are read in threads, with the same outcome as one after the other."""

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipecore import io
from pipecore.errors import CancelledError, ReadError
from pipecore.io import ahead
from pipecore.io.registry import Format, identify
from pipecore.io.source import Chunk, OpenOptions, Source
from pipecore.types import PointCloud
from tests.core.io.writers import make_points, write_las

ENDINGS = ("las", "laz", "ply", "e57")


@pytest.fixture
def files(tmp_path: Path, rng: np.random.Generator) -> list[Path]:
    paths = []
    for i in range(8):
        points = make_points(rng, 3_000 + 100 * i)
        path = tmp_path / f"{i}.{ENDINGS[i % 4]}"
        las = write_las(tmp_path / "one.las", points)
        io.write(io.read(las), path)
        paths.append(path)
    return paths


@pytest.fixture(autouse=True)
def no_threads_are_left() -> Iterator[None]:
    yield
    assert not [t.name for t in threading.enumerate() if t.name.startswith("reading")]


@pytest.mark.parametrize(("n_files", "n_chunks"), [(1, 1), (2, 2), (8, 3)])
def test_that_the_outcome_does_not_depend_on_how_much_is_read_ahead(
    files: list[Path], monkeypatch: pytest.MonkeyPatch, n_files: int, n_chunks: int
) -> None:
    whole = io.read(files)
    monkeypatch.setattr(ahead, "FILES_AT_A_TIME", n_files)
    monkeypatch.setattr(ahead, "CHUNKS_AHEAD", n_chunks)
    again = io.read(files)
    for name in ("xyz", "intensity", "rgb", "station", "classification"):
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
    assert again.notes == whole.notes
    each = [io.read(path) for path in files]
    world = np.concatenate([c.world(c.xyz) for c in each])
    np.testing.assert_allclose(whole.world(whole.xyz), world, rtol=0, atol=1e-4)
    assert [name.split(": ")[0] for name in whole.station_names] == [p.name for p in files]


def test_that_a_damaged_file_among_others_is_said_by_name(files: list[Path]) -> None:
    files[5].write_bytes(files[5].read_bytes()[:2000])
    with pytest.raises(ReadError, match=files[5].name):
        io.read(files)


def slow(monkeypatch: pytest.MonkeyPatch, n_chunks: int, seconds: float) -> list[int]:
    """Have files give chunks slowly; the numbers of chunks given and not yet taken."""
    alive: list[int] = []

    def chunks() -> Iterator[Chunk]:
        for i in range(n_chunks):
            time.sleep(seconds)
            alive.append(i)
            yield Chunk(np.full((10, 3), 5.0 + i), (i + 1) / n_chunks)

    def open_slowly(self: Format, path: Path, options: OpenOptions | None = None) -> Any:
        from contextlib import nullcontext

        return nullcontext(Source(chunks(), ("x", "y", "z")))

    monkeypatch.setattr(Format, "open", open_slowly)
    return alive


def test_that_waiting_for_a_slow_file_can_be_cancelled(
    files: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Stop:
        begin = float("inf")

        def update(self, stage: str, fraction: float) -> None:
            self.begin = min(self.begin, time.perf_counter())
            if time.perf_counter() > self.begin + 0.3:
                raise CancelledError

    slow(monkeypatch, 3, 0.9)
    stop = Stop()
    with pytest.raises(CancelledError):
        io.read(files, progress=stop)
    assert time.perf_counter() - stop.begin < 0.3 + 0.5 + 0.5
    time.sleep(1.0)


def test_that_only_some_chunks_are_held_at_a_time(
    files: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    alive = slow(monkeypatch, 30, 0.0)
    most = 0

    def see(cloud: PointCloud) -> None:
        nonlocal most
        time.sleep(0.002)
        alive.pop()
        most = max(most, len(alive))

    cloud = io.read(files, look=see)
    assert len(cloud) == 8 * 30 * 10
    # Those in the queues, one in each thread's hand and the one that is looked at.
    assert most <= ahead.FILES_AT_A_TIME * (ahead.CHUNKS_AHEAD + 1) + 1


def test_that_files_are_opened_in_the_order_given(files: list[Path]) -> None:
    recognised = [(path, identify(path)) for path in files]
    checks = []
    with ahead.read_ahead(
        recognised, OpenOptions(), lambda s: s.chunks, lambda: checks.append(1)
    ) as opened:
        seen = [(file.path, sum(len(chunk) for chunk in file.chunks)) for file in opened]
    assert seen == [(path, 3_000 + 100 * i) for i, path in enumerate(files)]


@pytest.mark.parametrize("is_equal", [True, False])
def test_that_looking_at_many_points_can_be_stopped_at_any_time(
    tmp_path: Path, rng: np.random.Generator, is_equal: bool
) -> None:
    n = 500_000
    xyz = np.full((n, 3), 5.0) if is_equal else rng.uniform(0, 30, (n, 3))
    io.write(PointCloud.from_points(xyz), tmp_path / "a.ply")
    io.info(tmp_path / "a.ply")  # What is imported on first use takes its own time.

    class Watch:
        def __init__(self, stop_at: float = np.inf) -> None:
            self.calls, self.stop_at = [time.perf_counter()], stop_at

        def update(self, stage: str, fraction: float) -> None:
            self.calls.append(time.perf_counter())
            if fraction >= self.stop_at:
                raise CancelledError

    watch = Watch()
    io.info(tmp_path / "a.ply", progress=watch)
    assert np.diff([*watch.calls, time.perf_counter()]).max() < 0.5
    with pytest.raises(CancelledError):
        io.info(tmp_path / "a.ply", progress=Watch(1.0))
