"""Repeats the tests that draw at random with new seeds, and reports how often each fails.

`make explore HOURS=3` goes on where the last run of the same commit stopped.
"""

import argparse
import collections
import contextlib
import json
import os
import secrets
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.seeds import without_seed

OUTCOMES = Path("out/explore.jsonl")
COMMIT = "PIPEGUI_EXPLORE_COMMIT"
SEEDS = "PIPEGUI_EXPLORE_SEEDS"
RULE_OF_THREE = 3.0
"""A rate is below this over the number of draws, with 95 % probability, if none failed."""


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run a test that draws at random once with each seed."""
    if "session_seed" in metafunc.fixturenames:
        seeds = [int(seed) for seed in os.environ[SEEDS].split()]
        ids = [f"seed={seed}" for seed in seeds]
        metafunc.parametrize("session_seed", seeds, ids=ids, scope="session")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the tests that draw nothing: they were run by `make test`."""
    drawn = [i for i in items if {"session_seed", "_hypothesis_inner"} & _names(i)]
    config.hook.pytest_deselected(items=[item for item in items if item not in drawn])
    items[:] = drawn


def _names(item: pytest.Item) -> set[str]:
    names = set(getattr(item, "fixturenames", ()))
    if hasattr(getattr(item, "obj", None), "hypothesis"):
        names.add("_hypothesis_inner")
    return names


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> object:
    """Append what came out of a test to the file of outcomes."""
    report = yield
    if report.when == "call" or report.failed:
        line = {
            "commit": os.environ[COMMIT],
            "test": without_seed(item.nodeid),
            "seed": item.funcargs.get("session_seed"),
            "failed": report.failed,
            "seconds": round(report.duration, 3),
        }
        with OUTCOMES.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
    return report


def explore(tests: list[str], hours: float, at_once: int) -> None:
    """Run `tests` with new seeds, `at_once` of them in a process, until `hours` are over."""
    OUTCOMES.parent.mkdir(exist_ok=True)
    end = time.monotonic() + 3600 * hours
    while (left := end - time.monotonic()) > 0:
        seeds = " ".join(str(secrets.randbelow(2**32)) for _ in range(at_once))
        command = [sys.executable, "-m", "pytest", "-p", "no:pytest-qt", "-p", "tools.explore"]
        command += ["--hypothesis-profile=explore", "-q", "--no-header", "--tb=no", "-rN", *tests]
        environment = os.environ | {SEEDS: seeds, COMMIT: _commit()}
        try:
            subprocess.run(command, env=environment, timeout=left, check=False)
        except subprocess.TimeoutExpired:
            break


def _commit() -> str:
    command = ["git", "describe", "--always", "--dirty"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def summary(lines: list[dict[str, object]]) -> str:
    """Return a table of the tests that failed, with their rates, and a line on all the others."""
    draws: collections.Counter[object] = collections.Counter(line["test"] for line in lines)
    failed = collections.defaultdict(list)
    for line in lines:
        if line["failed"]:
            failed[line["test"]].append(line["seed"])
    rows = [
        f"{len(seeds):5d} of {draws[test]:5d}  {test}  (seeds {', '.join(map(str, seeds[:3]))})"
        for test, seeds in sorted(failed.items(), key=lambda f: -len(f[1]) / draws[f[0]])
    ]
    clean = sorted(n for test, n in draws.items() if test not in failed)
    if clean:
        rows.append(
            f"{len(clean)} tests never failed in {clean[0]} to {clean[-1]} draws each: the rate of "
            f"each is below {RULE_OF_THREE / clean[0]:.2g} (95 %)"
        )
    return "\n".join(rows)


def main() -> None:
    """Explore, and say what came out for this commit."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tests", nargs="*", default=["tests/core"], metavar="TEST")
    parser.add_argument("--hours", type=float, default=1.0, help="0 only reports")
    parser.add_argument("--seeds", type=int, default=5, help="how many seeds a process takes")
    arguments = parser.parse_args()
    with contextlib.suppress(KeyboardInterrupt):
        explore(arguments.tests, arguments.hours, arguments.seeds)
    commit = _commit()
    lines = [json.loads(line) for line in OUTCOMES.read_text(encoding="utf-8").splitlines()]
    print(f"\n{commit}:\n{summary([line for line in lines if line['commit'] == commit])}")


if __name__ == "__main__":
    main()
