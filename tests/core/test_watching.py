"""What the bench says of a process's memory."""

import mmap
import os
import sys
from pathlib import Path

import psutil
import pytest

from tools.bench.watching import Footprint, run

MIB = 2**20
SIZE = 200 * MIB
TELLS_SHARED_PAGES = Path("/proc/self/smaps_rollup").exists()
needs_pss = pytest.mark.skipif(not TELLS_SHARED_PAGES, reason="the system does not tell PSS")

SHARING = f"""
import mmap, os, sys
shared = mmap.mmap(-1, {SIZE})
for i in range(0, {SIZE}, 4096):
    shared[i] = 1
for _ in range(int(sys.argv[1])):
    if os.fork() == 0:
        for i in range(0, {SIZE}, 4096):
            shared[i]
        break
# All of them say that they are ready, and stay until they are asked to end.
os.write(1, b".")
sys.stdin.read()
"""


def with_workers(n: int):
    """A process that shares its memory with so many others, all at work."""
    process = psutil.Popen([sys.executable, "-c", SHARING, str(n)], stdin=-1, stdout=-1, bufsize=0)
    for _ in range(n + 1):
        assert process.stdout.read(1) == b"."
    return process


def end(process):
    workers = process.children(recursive=True)
    process.communicate()
    psutil.wait_procs(workers)


@needs_pss
def test_that_pages_that_processes_share_count_once():
    process = with_workers(3)
    alone = with_workers(0)
    try:
        n_resident = sum(p.memory_info().rss for p in (process, *process.children(recursive=True)))
        footprint, single = Footprint(process.pid), Footprint(alone.pid)
        assert n_resident > 4 * SIZE
        # The first look tells them apart, those after it take the same share.
        for _ in range(3):
            assert SIZE < footprint.memory() < SIZE + 60 * MIB
            assert SIZE < single.memory() < SIZE + 30 * MIB
    finally:
        end(process)
        end(alone)


@needs_pss
def test_that_a_file_mapped_twice_counts_once(tmp_path):
    path = tmp_path / "pages"
    path.write_bytes(bytes(SIZE))
    before = Footprint(os.getpid()).memory()
    with path.open("rb") as file:
        maps = [mmap.mmap(file.fileno(), SIZE, access=mmap.ACCESS_READ) for _ in range(2)]
        for mapped in maps:
            assert mapped[::4096] == bytes(SIZE // 4096)
        taken = Footprint(os.getpid()).memory() - before
        for mapped in maps:
            mapped.close()
    assert 0.9 * SIZE < taken < 1.3 * SIZE


def test_that_a_process_that_is_over_at_once_is_told():
    cost = run([sys.executable, "-c", "import sys; print('Reading  0.0 s', file=sys.stderr)"])
    assert cost.memory > MIB
    assert cost.cpu > 0
    assert list(cost.stages) == ["start", "reading", "end"]
    assert sum(stage.wall for stage in cost.stages.values()) == pytest.approx(cost.wall)
