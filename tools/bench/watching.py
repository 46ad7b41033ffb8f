"""What a process takes: time, memory, and both by the stages that it tells of.

Memory is that of a process and of all that it has started, at one time. Pages that several
of them share, or that one has mapped twice, are counted once where the system tells (PSS of
Linux); they are what tiles and their workers are made of.

Imports nothing large: Linux counts what this process had needed as the other's from its start.
"""

import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import psutil

KIBIBYTES = 1 if sys.platform == "darwin" else 1024
"""Unit of ru_maxrss in bytes."""
EVERY = 0.02
"""Between two looks at a process's memory, seconds."""
LONGEST_SHARE = 0.05
"""Of the time, for telling shared pages apart: the system goes through all pages for that."""
STAGE = re.compile(r"^(\w[\w ]*?)\s+(\d+\.\d) s$")
"""What `pipecore` prints when a stage is done."""


@dataclass
class Stage:
    """Seconds of wall and of all cores that a stage took, and its highest memory in bytes."""

    wall: float
    cpu: float
    memory: int


@dataclass
class Cost:
    """What a process took: seconds of wall and of all cores, bytes, and its stages."""

    wall: float
    cpu: float
    memory: int
    stages: dict[str, Stage] = field(default_factory=dict)


def run(command: Sequence[str], cwd: Path | None = None, **environment: str) -> Cost:
    """Run a process to its end and return what it took; it has to end well.

    Lines on its standard error that tell of a finished stage divide its time. Before the
    first one is "start", after the last one "end".
    """
    begin = time.perf_counter()
    process = subprocess.Popen(
        command,
        cwd=cwd,
        env=os.environ | environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    watch = _Watch(process.pid, begin)
    assert process.stderr is not None
    told = []
    with process.stderr:
        for line in process.stderr:
            told.append(line)
            if found := STAGE.match(line.strip()):
                watch.end_stage(found[1].lower(), float(found[2]))
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    wall = time.perf_counter() - begin
    cpu = usage.ru_utime + usage.ru_stime
    watch.end(wall, cpu)
    if process.returncode != 0:
        raise SystemExit(f"This failed: {' '.join(command)}\n{''.join(told[-20:])}")
    # One that was over before it could be looked at has not shared much.
    memory = watch.memory or usage.ru_maxrss * KIBIBYTES
    return Cost(wall, cpu, memory, watch.stages)


class Footprint:
    """The memory of a process and of all that it has started.

    Resident pages are counted at each look. Which of them are counted more than once is found
    out now and then, and taken as the same share until the next time.

    Parameters
    ----------
    pid : int
    """

    def __init__(self, pid: int) -> None:
        self._first = psutil.Process(pid)
        self._all = [self._first]
        self._share = 1.0
        self._next = 0.0

    def memory(self) -> int:
        """Bytes; raises `psutil.Error` when the process is gone."""
        begin = time.monotonic()
        if begin >= self._next:
            self._all = [self._first, *self._first.children(recursive=True)]
            resident, proportional = self._sum(_resident), self._sum(_proportional)
            self._share = proportional / resident if resident else 1.0
            end = time.monotonic()
            self._next = end + (end - begin) / LONGEST_SHARE
            return proportional
        return round(self._share * self._sum(_resident))

    def _sum(self, of: Callable[[psutil.Process], int]) -> int:
        total = of(self._first)
        for process in self._all[1:]:
            with suppress(psutil.Error):  # it has ended
                total += of(process)
        return total


def _resident(process: psutil.Process) -> int:
    return int(process.memory_info().rss)


def _proportional(process: psutil.Process) -> int:
    """Bytes with a page's share only where others hold it too, or all where nobody tells."""
    with suppress(psutil.AccessDenied):
        if told := getattr(process.memory_full_info(), "pss", 0):
            return int(told)
    return _resident(process)


class _Watch:
    """Looks at a process's memory and at the time of its cores, where the system tells them."""

    def __init__(self, pid: int, begin: float) -> None:
        self.stages: dict[str, Stage] = {}
        self._pid, self._begin = pid, begin
        self._seen: list[tuple[float, float, int]] = []
        """Wall and CPU seconds since the start, and memory, at each look."""
        self._last = 0.0
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()

    @property
    def memory(self) -> int:
        """The highest that was seen, bytes."""
        return max((memory for _, _, memory in self._seen), default=0)

    def _look(self) -> None:
        with suppress(psutil.Error):
            footprint, process = Footprint(self._pid), psutil.Process(self._pid)
            while not self._is_over.wait(EVERY):
                memory, times = footprint.memory(), process.cpu_times()
                wall = time.perf_counter() - self._begin
                # With what has ended of its own processes.
                self._seen.append((wall, sum(times[:4]), memory))

    def end_stage(self, name: str, seconds: float) -> None:
        """A stage ends now that began `seconds` ago; what was before is of the start."""
        wall = time.perf_counter() - self._begin
        if not self.stages:
            self._add("start", max(0.0, wall - seconds))
        self._add(name, wall)

    def end(self, wall: float, cpu: float) -> None:
        """The process has ended."""
        self._is_over.set()
        self._thread.join()
        self._seen.append((wall, cpu, 0))
        if self.stages:
            self._add("end", wall)

    def _add(self, name: str, until: float) -> None:
        seen = list(self._seen)
        before = [cpu for at, cpu, _ in seen if at <= self._last]
        within = [(cpu, memory) for at, cpu, memory in seen if self._last < at <= until]
        first = before[-1] if before else 0.0
        cpu = within[-1][0] - first if within else 0.0
        old = self.stages.get(name, Stage(0.0, 0.0, 0))
        memory = max((m for _, m in within), default=0)
        self.stages[name] = Stage(
            old.wall + until - self._last, old.cpu + cpu, max(old.memory, memory)
        )
        self._last = until
