from collections.abc import Iterator

import pytest

from pipecore import parallel


@pytest.fixture
def own_threads() -> Iterator[None]:
    """For tests that set the number of threads: the next one finds what was set before."""
    before = parallel.threads()
    yield
    parallel.set_threads(before)
