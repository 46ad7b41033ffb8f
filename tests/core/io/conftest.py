import numpy as np
import pytest

from tests.core.io.writers import Points, make_points


@pytest.fixture
def points(rng: np.random.Generator) -> Points:
    return make_points(rng)
