"""A dask cluster by its address: two workers, and what becomes of tiles when some are lost."""

import os
import signal
import socket
import time

import dask
import numpy as np
import pytest
from distributed import Client, LocalCluster
from numpy.testing import assert_array_equal

from pipecore import io
from pipecore.cli import main
from pipecore.errors import CancelledError, PipecoreError, SettingsError
from pipecore.pipeline import detect
from pipecore.progress import NoProgress
from pipecore.settings import Settings
from pipecore.tiling import detect_in_tiles, engine
from pipecore.tiling.engine import start_engine
from pipecore.tiling.store import temporary_store
from tests.core.tiling.test_tiling_parts import pipe_cloud

CSVS = "elements.csv", "profiles.csv", "deformations.csv"


@pytest.fixture(scope="module")
def scanned(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("scan") / "pipe.laz"
    io.write_laz(path, pipe_cloud(np.random.default_rng(5)))
    return path


@pytest.fixture(scope="module")
def whole(scanned):
    expected = detect(io.read(scanned), Settings())
    assert len(expected.elements) >= 1
    return expected


def start_cluster() -> LocalCluster:
    """Two workers, processes that are started again when they are lost."""
    return LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", host="127.0.0.1"
    )


@pytest.fixture(scope="module")
def cluster():
    # A tile that ends a worker is given to one other: each takes seconds to come back.
    with dask.config.set({"distributed.scheduler.allowed-failures": 1}), start_cluster() as started:
        yield started


def in_tiles(cluster: LocalCluster) -> Settings:
    scheduler = cluster.scheduler_address
    return Settings().replace({"tiling.tile_mpoints": 0.004, "tiling.scheduler": scheduler})


def assert_same(found, expected):
    assert_array_equal(found.element_id, expected.element_id)
    assert_array_equal(found.segment_id, expected.segment_id)
    assert_array_equal(found.deviation, expected.deviation)
    assert [e.radius for e in found.elements] == [e.radius for e in expected.elements]


class InTheMiddle:
    """Does something once, in the middle of a stage."""

    def __init__(self, stage: str, act) -> None:
        self.stage, self.act, self.is_done = stage, act, False

    def update(self, stage: str, fraction: float) -> None:
        if stage == self.stage and not self.is_done:
            self.is_done = True
            self.act()


def test_that_the_command_writes_the_same_tables_on_a_cluster(scanned, cluster, tmp_path, capsys):
    limits = ["--tiling-memory-gib", "0.3", "--tiling-tile-mpoints", "0.004"]
    address = ["--tiling-scheduler", cluster.scheduler_address]
    for name, flags in {"whole": [], "tiles": [*limits, *address]}.items():
        assert main(["detect", str(scanned), "-o", str(tmp_path / name), *flags]) == 0
        assert ("processed in tiles" in capsys.readouterr().err) == bool(flags)
    for name in CSVS:
        assert (tmp_path / "tiles" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    assert {p.name for p in tmp_path.iterdir()} == {"whole", "tiles"}


@pytest.mark.parametrize("stage", ["thinning", "profiles"])
def test_that_a_lost_worker_changes_nothing(scanned, whole, cluster, tmp_path, stage):
    with Client(cluster) as client:
        client.wait_for_workers(2)
        lost = min(client.run(os.getpid).values())
    progress = InTheMiddle(stage, lambda: os.kill(lost, signal.SIGKILL))
    with detect_in_tiles([scanned], in_tiles(cluster), progress, tmp_path) as (_, found):
        assert_same(found, whole)
    with Client(cluster) as client:
        client.wait_for_workers(2)
        assert lost not in client.run(os.getpid).values()
    assert not list(tmp_path.iterdir())


def test_that_a_tile_that_ends_its_workers_is_told(cluster, tmp_path):
    def end(store, tile):
        os._exit(1)

    with Client(cluster) as client:
        client.wait_for_workers(2)
    with (
        temporary_store(tmp_path) as store,
        start_engine(cluster.scheduler_address, store) as workers,
        pytest.raises(PipecoreError, match="lower the memory limit"),
    ):
        workers.run(end, [(1,)], "normals", NoProgress())


def lose_workers(cluster: LocalCluster) -> None:
    cluster.scale(0)
    while cluster.scheduler.workers:
        time.sleep(0.02)


def lose_scheduler(cluster: LocalCluster) -> None:
    cluster.close()


@pytest.mark.parametrize(
    ("lose", "told"),
    [(lose_workers, "All workers .* were lost"), (lose_scheduler, "no longer answers")],
)
def test_that_a_cluster_that_is_gone_is_told_and_leaves_nothing(
    scanned, tmp_path, monkeypatch, lose, told
):
    monkeypatch.setattr(engine, "MAX_SECONDS_WITHOUT_WORKERS", 0.5)
    with start_cluster() as cluster:
        progress = InTheMiddle("profiles", lambda: lose(cluster))
        with (
            pytest.raises(PipecoreError, match=told) as caught,
            detect_in_tiles([scanned], in_tiles(cluster), progress, tmp_path),
        ):
            pytest.fail("nobody is there")
    assert not isinstance(caught.value, CancelledError)
    assert not list(tmp_path.iterdir())


def test_that_a_scheduler_that_does_not_answer_is_told(scanned, tmp_path):
    with socket.socket() as taken, temporary_store(tmp_path) as store:
        taken.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(SettingsError, match=address), start_engine(address, store):
            pytest.fail("nobody is there")
