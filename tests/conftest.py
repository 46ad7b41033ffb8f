"""Fixtures that all tests share: seeds that can be repeated, and the folder of real scans."""

import hashlib
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import numpy as np
import pytest

from tests.seeds import SEED_VARIABLE, given_seed, without_seed

SHARED_DATA = Path(__file__).parents[2] / "shared" / "data"

# The first call of a kernel compiles it, which takes longer than any deadline.
hypothesis.settings.register_profile("fixed", deadline=None, print_blob=True, derandomize=True)
hypothesis.settings.register_profile("explore", deadline=None, print_blob=True)
hypothesis.settings.load_profile("fixed")


def pytest_report_header() -> str:
    return f"seed: {given_seed()} (another by {SEED_VARIABLE}; `make explore` draws new ones)"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    report = yield
    if report.failed and "session_seed" in getattr(item, "fixturenames", ()):
        seed = item.funcargs.get("session_seed", given_seed())
        report.sections.append(("Seed", f"Repeat with {SEED_VARIABLE}={seed}"))
    return report


@pytest.fixture(scope="session")
def session_seed() -> int:
    """The seed that the head of the session's report prints."""
    return given_seed()


@pytest.fixture
def seed(session_seed: int, request: pytest.FixtureRequest) -> int:
    """A seed of this test alone, the same in whatever file and beside whatever else it runs."""
    text = f"{session_seed} {without_seed(request.node.name)}"
    digest = hashlib.sha256(text.encode()).digest()
    return int.from_bytes(digest[:8], "little")


@pytest.fixture
def rng(seed: int) -> np.random.Generator:
    """Random numbers from `seed`."""
    return np.random.default_rng(seed)


@pytest.fixture
def shared_data(request: pytest.FixtureRequest) -> Path:
    """The folder of real scans and odd files; without it the test is skipped and says what is lost.

    What such a test is about stands in another one too, on a file that it writes itself.
    """
    if not SHARED_DATA.is_dir():
        name = without_seed(request.node.name)
        lost = name.removeprefix("test_that_").replace("_", " ")
        pytest.skip(f"not seen without the files of other programs: that {lost}")
    return SHARED_DATA
