"""Random draws, against whole numbers of Python."""

import numpy as np
import pytest

from pipecore._kernels.random_draws import draw, draw_fast, next_random, seeded

# Random numbers wrap around on purpose, which plain numpy warns of.
pytestmark = [pytest.mark.kernels, pytest.mark.filterwarnings("ignore:overflow encountered")]

WORD = 2**64


def unsigned(state):
    """A state as the kernels keep it: on its way out to Python it loses its type."""
    return np.uint64(int(state))


def test_that_states_are_those_of_knuths_generator():
    state = unsigned(seeded(7))
    expected = (7 * 2862933555777941757 + 3037000493) % WORD
    for _ in range(100):
        assert int(state) == expected
        state = unsigned(next_random(state))
        expected = (expected * 6364136223846793005 + 1442695040888963407) % WORD


@pytest.mark.parametrize("n", [1, 2, 10, 1_000_003])
def test_that_indices_come_from_the_upper_bits(n):
    state = unsigned(seeded(3))
    for _ in range(50):
        following = int(next_random(state))
        other, fast = draw_fast(state, n)
        state, index = draw(state, n)
        assert int(state) == int(other) == following
        assert index == (following >> 33) % n
        assert fast == ((following >> 33) * n) >> 31
        assert 0 <= fast < n
        state = unsigned(state)


def test_that_bits_look_random():
    state, ones = unsigned(seeded(1)), np.zeros(31)
    for _ in range(4000):
        state = unsigned(next_random(state))
        ones += [(int(state) >> (33 + bit)) & 1 for bit in range(31)]
    # Always the same draws: within 4.5 standard deviations of a fair coin.
    assert np.abs(ones / 4000 - 0.5).max() < 4.5 * 0.5 / np.sqrt(4000)
