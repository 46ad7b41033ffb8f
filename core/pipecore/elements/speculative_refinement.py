"""Refining proposals ahead of their turn, in threads, with the result of one after the other."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future

import numpy as np
from numpy.typing import NDArray

from pipecore import parallel
from pipecore.elements.proposals import Proposal
from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.progress import Progress

Indices = NDArray[np.intp]
Refined = tuple[FittedElement | None, Indices]
"""What was found of a proposal, and the points that were used."""

LOOKAHEAD_PER_THREAD = 8
"""So many proposals a thread are refined at once; more would lose their points to those before
them."""


def refine_speculatively(
    proposals: Sequence[Proposal],
    refine: Callable[[Proposal, list[Indices]], FittedElement | None],
    is_free: NDArray[np.bool_],
    progress: Progress,
    span: tuple[float, float],
) -> Iterator[tuple[Proposal, FittedElement | None]]:
    """Yield each proposal with what `refine` finds of it when its turn comes.

    Whoever takes what is yielded takes its points from `is_free` before asking for the next.
    Proposals are refined ahead of that, in threads; one that used points which have been taken
    since is refined again. The result is that of one after the other.

    Parameters
    ----------
    proposals : sequence of Proposal
    refine : callable
        Refines a proposal with the points that are free now, and adds all points that it
        used to a list. It may look whether a point is free once each time it looks for
        points: some are taken while it works.
    is_free : ndarray of bool
        Downsampled points that no element has taken; changes between what is yielded.
    progress : Progress
    span : (float, float)
        Which part of the stage these proposals are.
    """

    def work(proposal: Proposal) -> Refined:
        used: list[Indices] = []
        found = refine(proposal, used)
        return found, np.concatenate([*used, np.empty(0, np.intp)])

    def has_lost_points(refined: Future[Refined]) -> bool:
        return not is_free[refined.result()[1]].all()

    lookahead = LOOKAHEAD_PER_THREAD * parallel.threads()
    queue: list[Future[Refined]] = []
    with parallel.pool() as pool:
        for turn, proposal in enumerate(proposals):
            fraction = span[0] + (span[1] - span[0]) * turn / len(proposals)
            queue += [pool.submit(work, p) for p in proposals[turn + len(queue) : turn + lookahead]]
            mine = queue.pop(0)
            parallel.wait_for(mine, "elements", progress, fraction)
            if has_lost_points(mine):
                mine = pool.submit(work, proposal)
                parallel.wait_for(mine, "elements", progress, fraction)
            found, _ = mine.result()
            yield proposal, found
            if found is not None:
                # Whatever has lost its points to it goes to work again at once.
                for k, refined in enumerate(queue):
                    if refined.done() and has_lost_points(refined):
                        queue[k] = pool.submit(work, proposals[turn + 1 + k])
