"""The pipeline for clouds larger than memory: `pipecore.pipeline` in a workspace of files."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from pipecore.io import Corners
from pipecore.pipeline import detect_in
from pipecore.progress import NoProgress, Progress
from pipecore.rules import load_rules
from pipecore.settings import Settings
from pipecore.tiling import curves, slabs
from pipecore.tiling.engine import start_engine
from pipecore.tiling.memory import GIB, MAX_SHARE_OF_FREE, free_memory, keeping_within, tile_bytes
from pipecore.tiling.parallel_reading import read_into_store
from pipecore.tiling.store import temporary_store
from pipecore.tiling.tiled_workspace import InTiles
from pipecore.types import PointCloud, Result


@contextmanager
def detect_in_tiles(
    paths: Sequence[Path],
    settings: Settings = Settings(),
    progress: Progress = NoProgress(),
    folder: Path | None = None,
    box: Corners | None = None,
) -> Iterator[tuple[PointCloud, Result]]:
    """Read scans of any size and find their elements and deformations.

    The result is that of `pipecore.detect` on the whole cloud, to the last bit. The cloud
    and the result's arrays with a value a point are files, mapped into memory: they are
    there until the context ends.

    Parameters
    ----------
    paths : sequence of Path
        Several files are taken as one cloud.
    settings : Settings
        `settings.tiling` says how much memory may be used and where tiles are processed.
    progress : Progress
        Receives the stages of `pipecore.pipeline.STAGES`, and "reading".
    folder : Path, optional
        For temporary files, unless the settings name one; else that of the system.
    box : (2, 3) numbers, optional
        Only points in it; see `pipecore.read`.

    Yields
    ------
    (PointCloud, Result)

    Raises
    ------
    ReadError, SettingsError, CancelledError
        As from reading and `pipecore.detect`.
    WriteError
        If the disk has no room for the temporary files.
    """
    load_rules(settings.deformation.rule)  # what would fail at the end fails now
    beside = Path(settings.tiling.folder) if settings.tiling.folder else folder
    limit = int(settings.tiling.memory_gib * GIB) or int(MAX_SHARE_OF_FREE * free_memory())
    with (
        keeping_within(limit),
        temporary_store(beside) as store,
        start_engine(settings.tiling.scheduler, store) as engine,
    ):
        cloud = read_into_store(engine, paths, settings.input, progress, box)
        sizes = _sizes(settings, tile_bytes(len(cloud), limit, engine.n_at_once))
        yield cloud, detect_in(InTiles(engine, cloud, *sizes), settings, progress)


def _sizes(settings: Settings, room: int) -> tuple[int, int]:
    """Bytes that a slab and a batch of profiles may take."""
    points = int(settings.tiling.tile_mpoints * 1e6)
    if not points:
        return room, room
    return points * slabs.BYTES_PER_POINT, points * curves.BYTES_PER_POINT
