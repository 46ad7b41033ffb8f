"""Refining pieces ahead of their turn, in threads, as if each had waited for the ones before."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.pieces import Piece
from pipecore.elements.refine import Fitted
from pipecore.parallel import for_chunks
from pipecore.progress import Progress

Indices = NDArray[np.intp]

AHEAD = 24
"""So many pieces are refined at once; more would lose their points to those before them."""


def refine_in_turn(
    pieces: Sequence[Piece],
    refine: Callable[[Piece, list[Indices]], Fitted | None],
    is_free: NDArray[np.bool_],
    progress: Progress,
    span: tuple[float, float],
) -> Iterator[tuple[Piece, Fitted | None]]:
    """Yield each piece with what `refine` finds of it when its turn comes.

    Whoever takes what is yielded takes its points from `is_free` before asking for the next.
    Pieces are refined ahead of that, in threads; one that used points which have been taken
    since is refined again. The result is that of one after the other.

    Parameters
    ----------
    pieces : sequence of Piece
    refine : callable
        Refines a piece with the points that are free now, and adds all points that it
        used to a list.
    is_free : ndarray of bool
        Thinned points that no element has taken; changes between what is yielded.
    progress : Progress
    span : (float, float)
        Which part of the stage these pieces are.
    """
    known: dict[int, tuple[Fitted | None, Indices]] = {}

    def holds(i: int) -> bool:
        return i in known and bool(is_free[known[i][1]].all())

    for turn, piece in enumerate(pieces):
        if not holds(turn):
            ahead = [i for i in range(turn, min(turn + AHEAD, len(pieces))) if not holds(i)]

            def work(start: int, _stop: int, ahead: list[int] = ahead) -> None:
                used: list[Indices] = []
                found = refine(pieces[ahead[start]], used)
                known[ahead[start]] = found, np.concatenate([*used, np.empty(0, np.intp)])

            share = tuple(span[0] + (span[1] - span[0]) * i / len(pieces) for i in (turn, turn + 1))
            for_chunks(work, len(ahead), 1, "elements", progress, (share[0], share[1]))
        found, _ = known.pop(turn)
        yield piece, found
