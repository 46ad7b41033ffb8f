"""An order in which the first so many points of a cloud are always spread over all of it."""

import numpy as np
from numpy.typing import NDArray

N_BLOCKS = 8192
N_PATTERNS = 61


class Spread:
    """A permutation of `n` rows that is never written down as a whole.

    The rows are cut into blocks; each round takes one row at random of every block. A
    shuffle of 40 million rows would take seconds and 4 bytes a row.
    """

    def __init__(self, n: int, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        self._n = n
        self._n_blocks = min(N_BLOCKS, n)
        self._n_rounds = n // max(self._n_blocks, 1)
        self._start = np.linspace(0, n, self._n_blocks + 1).astype(np.int64)
        # Blocks are of two sizes; what the larger ones have more comes last.
        size = np.diff(self._start)
        self._last = self._start[1:][size > self._n_rounds] - 1
        # A round that is cut off must not favour one part of the cloud either.
        self._turn = rng.permutation(self._n_blocks)
        self._pattern = rng.integers(0, N_PATTERNS, self._n_blocks)
        # A round to a line: its patterns lie side by side in memory.
        self._within = np.stack(
            [rng.permutation(self._n_rounds) for _ in range(N_PATTERNS)], axis=1
        ).astype(np.int32)

    def __len__(self) -> int:
        return self._n

    def rows(self, start: int, stop: int) -> NDArray[np.intp]:
        """Return the rows from place `start` to `stop` (at most the number of rows)."""
        place = np.arange(start, min(stop, self._n))
        in_rounds = place[place < self._n_rounds * self._n_blocks]
        round_, place_in_round = np.divmod(in_rounds, max(self._n_blocks, 1))
        block = self._turn[place_in_round]
        rows = self._start[block] + self._within[round_, self._pattern[block]]
        rest = place[len(in_rounds) :] - self._n_rounds * self._n_blocks
        return np.concatenate([rows, self._last[rest]]).astype(np.intp, copy=False)
