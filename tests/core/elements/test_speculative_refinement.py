"""Pieces refined ahead of their turn come out as if each had waited for those before it."""

import numpy as np
import pytest

from pipecore import parallel
from pipecore.elements.speculative_refinement import LOOKAHEAD_PER_THREAD, refine_speculatively
from pipecore.errors import CancelledError
from pipecore.progress import NoProgress

N_POINTS = 400


def wants(rng, n):
    """Pieces that want some points; many want the same ones."""
    return [rng.choice(N_POINTS, rng.integers(3, 12), replace=False) for _ in range(n)]


def what_is_left(piece, is_free, used):
    """Refine a piece: what it wants and can have, if that is at least half."""
    own = piece[is_free[piece]]
    used += [own[:2], own[2:]]
    return own if len(own) >= 0.5 * len(piece) else None


@pytest.mark.parametrize("n_threads", [1, 3])
@pytest.mark.parametrize("n", [0, 1, LOOKAHEAD_PER_THREAD, 5 * LOOKAHEAD_PER_THREAD + 3])
def test_that_the_result_is_that_of_one_after_the_other(rng, n_threads, n):
    pieces = wants(rng, n)
    is_free = np.ones(N_POINTS, np.bool_)
    expected = []
    for piece in pieces:
        own = what_is_left(piece, is_free, [])
        expected.append(None if own is None else own.tolist())
        if own is not None:
            is_free[own] = False
    assert n <= LOOKAHEAD_PER_THREAD or None in expected

    is_free[:] = True
    found = []
    before = parallel.threads()
    try:
        parallel.set_threads(n_threads)
        for piece, own in refine_speculatively(
            pieces,
            lambda piece, used: what_is_left(piece, is_free, used),
            is_free,
            NoProgress(),
            (0.0, 1.0),
        ):
            assert piece is pieces[len(found)]
            found.append(None if own is None else own.tolist())
            if own is not None:
                is_free[own] = False
    finally:
        parallel.set_threads(before)
    assert found == expected


def test_that_it_can_be_cancelled_between_pieces(rng):
    class Stop:
        def __init__(self):
            self.told = []

        def update(self, stage, fraction):
            self.told.append(fraction)
            if len(self.told) == 5:
                raise CancelledError

    stop, is_free = Stop(), np.ones(N_POINTS, np.bool_)
    with pytest.raises(CancelledError):
        list(
            refine_speculatively(
                wants(rng, LOOKAHEAD_PER_THREAD),
                lambda piece, used: what_is_left(piece, is_free, used),
                is_free,
                stop,
                (0.2, 0.4),
            )
        )
    assert len(stop.told) == 5
    assert all(0.2 <= fraction <= 0.4 for fraction in stop.told)
