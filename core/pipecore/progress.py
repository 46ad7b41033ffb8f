"""Progress of long work: how far it is, and whether it should stop."""

from collections.abc import Iterator
from typing import Protocol


class Progress(Protocol):
    """What a caller implements to see how far work is, and to stop it.

    Stages call `update` at least twice a second. An implementation that wants the
    work to stop raises `pipecore.errors.CancelledError` from it.
    """

    def update(self, stage: str, fraction: float) -> None:
        """Show that `stage` (a short lower-case noun) is done to `fraction` (0 to 1).

        Parameters
        ----------
        stage : str
        fraction : float
        """
        ...


class NoProgress:
    """Progress that shows nothing and never stops the work."""

    def update(self, stage: str, fraction: float) -> None:
        """Do nothing."""


class Renamed:
    """Progress of work that is part of a stage of other work.

    Parameters
    ----------
    progress : Progress
        Of the other work; it is given all updates.
    stage : str
        The stage that it is given with them.
    """

    def __init__(self, progress: Progress, stage: str) -> None:
        self._progress, self._stage = progress, stage

    def update(self, stage: str, fraction: float) -> None:
        """Pass on how far the work is, whatever it calls itself."""
        self._progress.update(self._stage, fraction)


def in_chunks(
    n_items: int, chunk_size: int, stage: str, progress: Progress
) -> Iterator[tuple[int, int]]:
    """Yield (start, stop) over `n_items`, reporting to `progress` around every chunk.

    Parameters
    ----------
    n_items : int
    chunk_size : int
    stage : str
        Name of the stage in the updates of `progress`.
    progress : Progress
        May stop the work by raising.
    """
    for start in range(0, n_items, chunk_size):
        progress.update(stage, start / n_items)
        yield start, min(start + chunk_size, n_items)
    progress.update(stage, 1.0)
