"""Reading scans into the store: LAS and LAZ by several workers at once, others in order."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from pipecore import io
from pipecore.io.parts import Part, plan_parts, read_part, remove_parts
from pipecore.progress import Progress
from pipecore.settings import LengthUnit
from pipecore.tiling.engine import Engine
from pipecore.tiling.store import StopWhenUnwanted, Store
from pipecore.types import PointCloud


def read_into_store(
    engine: Engine,
    paths: Sequence[Path],
    length_unit: LengthUnit,
    progress: Progress,
    box: io.Box | None = None,
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
        planned = plan_parts(absolute, length_unit, folder)
    if planned is not None:
        parts, cloud = planned
        tiles = [(part,) for part in parts]
        if all(engine.run(read_part_into_store, tiles, "reading", progress)):
            return replace(cloud, source=Path(paths[0]))
        del cloud
        remove_parts(folder)
    return io.read(paths, length_unit=length_unit, box=box, folder=folder, progress=progress)


def read_part_into_store(store: Store, part: Part) -> bool:
    """Read one part, on a worker."""
    StopWhenUnwanted(store).update("reading", 0.0)
    return read_part(store.folder, part)
