"""Fixtures that all tests share: seeds that can be repeated, and the folder of real scans."""

import hashlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import numpy as np
import pytest

SEED_VARIABLE = "PIPEGUI_TEST_SEED"
SESSION_SEED = pytest.StashKey[int]()
SHARED_DATA = Path(__file__).parents[2] / "shared" / "data"

# The first call of a kernel compiles it, which takes longer than any deadline.
hypothesis.settings.register_profile("pipegui", deadline=None, print_blob=True)
hypothesis.settings.load_profile("pipegui")


def pytest_configure(config: pytest.Config) -> None:
    given = os.environ.get(SEED_VARIABLE)
    config.stash[SESSION_SEED] = secrets.randbelow(2**32) if given is None else int(given)


def pytest_report_header(config: pytest.Config) -> str:
    return f"seed: {config.stash[SESSION_SEED]} (repeat with {_how_to_repeat(config)})"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    report = yield
    if report.failed and "seed" in getattr(item, "fixturenames", ()):
        report.sections.append(("Seed", f"Repeat with {_how_to_repeat(item.config)}"))
    return report


def _how_to_repeat(config: pytest.Config) -> str:
    return f"{SEED_VARIABLE}={config.stash[SESSION_SEED]}"


@pytest.fixture
def seed(request: pytest.FixtureRequest) -> int:
    """A seed of this test alone: new in each session, the same whatever runs beside it."""
    text = f"{request.config.stash[SESSION_SEED]} {request.node.nodeid}"
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "little")


@pytest.fixture
def rng(seed: int) -> np.random.Generator:
    """Random numbers from `seed`."""
    return np.random.default_rng(seed)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real scans and odd files; skips the test on a machine without it."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"the folder of real scans is not here ({SHARED_DATA})")
    return SHARED_DATA
