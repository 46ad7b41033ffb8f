"""Reading scans into the store: LAS and LAZ by several workers at once, others in order."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from pipecore import io
from pipecore.io.parts import FilePart, finish_parts, plan_parts, read_part, remove_parts
from pipecore.progress import Progress
from pipecore.settings import InputSettings
from pipecore.tiling.engine import Engine
from pipecore.tiling.store import StopWhenUnwanted, Store
from pipecore.types import PointCloud


def read_into_store(
    engine: Engine,
    paths: Sequence[Path],
    settings: InputSettings,
    progress: Progress,
    box: io.Corners | None = None,
) -> PointCloud:
    """Read scans as `pipecore.read` does, into arrays in the store.

    LAS and LAZ are read in parts, found by their tables of chunks (COPC's nodes are such
    chunks); other formats, files that do not keep what their headers say, and what lies in
    a box, in order.
    """
    folder = engine.store.folder
    absolute = [path.absolute() for path in paths]
    planned = None
    if box is None and engine.sees(absolute):
        planned = plan_parts(absolute, folder, **vars(settings))
    if planned is not None:
        tiles = [(part,) for part in planned.parts]
        if all(engine.run(read_part_into_store, tiles, "reading", progress)):
            return replace(finish_parts(folder, planned), source=Path(paths[0]))
        del planned
        remove_parts(folder)
    return io.read(paths, box=box, folder=folder, progress=progress, **vars(settings))


def read_part_into_store(store: Store, part: FilePart) -> bool:
    """Read one part, on a worker."""
    StopWhenUnwanted(store).update("reading", 0.0)
    return read_part(store.folder, part)
