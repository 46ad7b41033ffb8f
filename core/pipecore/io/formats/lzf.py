"""Marc Lehmann's LZF, by which PCD files are compressed."""

import numba
import numpy as np
from numpy.typing import NDArray

BEST_RATIO = 132
"""No LZF stream expands to more: 264 bytes take at least 2 and a bit."""


@numba.njit(cache=True, nogil=True)
def decompress(
    packed: NDArray[np.uint8], plain: NDArray[np.uint8], read: int, written: int, stop: int
) -> tuple[int, int]:
    """Decompress until at least `stop` bytes are written or the stream ends.

    Parameters
    ----------
    packed, plain : ndarray of uint8
        The stream, and where to write.
    read, written : int
        Where to go on in either.
    stop : int

    Returns
    -------
    read, written : int
        Where it ended; `read` is -1 if the stream is damaged.
    """
    n_packed, n_plain = len(packed), len(plain)
    while read < n_packed and written < stop:
        control = int(packed[read])
        read += 1
        if control < 32:  # So many literal bytes, and one more, follow.
            count = control + 1
            if read + count > n_packed or written + count > n_plain:
                return -1, written
            for k in range(count):
                plain[written + k] = packed[read + k]
            read += count
            written += count
            continue
        count = (control >> 5) + 2
        if count == 9:
            if read >= n_packed:
                return -1, written
            count += int(packed[read])
            read += 1
        if read >= n_packed:
            return -1, written
        source = written - ((control & 31) << 8) - int(packed[read]) - 1
        read += 1
        if source < 0 or written + count > n_plain:
            return -1, written
        for k in range(count):  # Byte by byte: source and target may overlap.
            plain[written + k] = plain[source + k]
        written += count
    return read, written
