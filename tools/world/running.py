"""Detections in parallel processes of one thread each, each kept so that a run can go on."""

import hashlib
import json
import multiprocessing
import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import pipecore
from tools.world.judging import judge

Row = dict[str, Any]
Job = tuple[str, Callable[..., Row], tuple[Any, ...]]
"""Name, what measures it, and its arguments: a module's function and plain values."""


OUT = Path(__file__).parents[2] / "out" / "world"
MEASURES_NOTHING = ("__main__.py", "pictures.py", "tables.py")


@cache
def sources_digest() -> str:
    """Name of the sources that decide what is measured: the core's and this package's."""
    core = Path(pipecore.__file__).parent
    here = [p for p in Path(__file__).parent.glob("*.py") if p.name not in MEASURES_NOTHING]
    digest = hashlib.sha256()
    for path in [*sorted(core.rglob("*.py")), *sorted(here)]:
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:8]


def run_all(jobs: Sequence[Job], n_processes: int) -> list[Row]:
    """Return what the jobs measured, in their order, now or in an earlier run."""
    results: dict[str, Row] = {}
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(n_processes, context, initializer=_one_thread) as pool:
        futures = {pool.submit(_measured, job): job[0] for job in jobs}
        for future in as_completed(futures):
            results[futures[future]] = future.result()
    return [results[name] for name, _, _ in jobs]


def _one_thread() -> None:
    from pipecore.parallel import set_threads

    os.environ["NUMBA_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"
    set_threads(1)


def _measured(job: Job) -> Row:
    name, measure, arguments = job
    path = OUT / sources_digest() / f"{name}.json"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_suffix(".part")
        unfinished.write_text(json.dumps(plain(measure(*arguments))), encoding="utf-8")
        unfinished.rename(path)
    row: Row = json.loads(path.read_text(encoding="utf-8"))
    return row


def plain(value: Any) -> Any:
    """Return numbers and texts that JSON can hold; nan becomes None."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value


def measure_scene(seed: int, family: str) -> Row:
    """Detect in one scene and judge the result."""
    import time

    from pipecore import detect
    from tools.world import scene

    drawn = scene(seed, family)
    begin = time.process_time()
    result = detect(drawn.cloud)
    row = judge(drawn, result)
    return row | {"seed": seed, "family": family, "seconds": time.process_time() - begin}


def seeds_of(text: str) -> Iterable[int]:
    """Return the seeds that a text such as "7" or "100-119" names."""
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)
