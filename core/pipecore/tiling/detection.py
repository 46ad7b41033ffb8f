"""The pipeline for clouds larger than memory: the steps of `pipecore.pipeline` in tiles."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipecore.axes import join_centres
from pipecore.elements import NearbyPoints, build_elements, find_pieces
from pipecore.elements.sections import tabulate_ellipses
from pipecore.measurement import measure_elements
from pipecore.pipeline import judge_deformations
from pipecore.progress import NoProgress, Progress
from pipecore.rules import load_rule
from pipecore.settings import Settings
from pipecore.stacks import choose_stacks
from pipecore.tiling import curves, thinning
from pipecore.tiling.engine import start_engine
from pipecore.tiling.memory import GIB, SHARE_OF_FREE, free_memory, tile_bytes
from pipecore.tiling.reading import read_into_store
from pipecore.tiling.store import Store, drop_pages, temporary_store
from pipecore.tiling.thinning import TiledSurface, thin_in_slabs
from pipecore.types import PointCloud, Profiles, Result

BLOCK = 2_000_000


@contextmanager
def detect_in_tiles(
    paths: Sequence[Path],
    settings: Settings = Settings(),
    progress: Progress = NoProgress(),
    folder: Path | None = None,
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
        Told the stages of `pipecore.pipeline.STAGES`, and "reading".
    folder : Path, optional
        For temporary files, unless the settings name one; else that of the system.

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
    rule = load_rule(settings.deformation.rule)
    beside = Path(settings.tiling.folder) if settings.tiling.folder else folder
    seconds: dict[str, float] = {}
    with temporary_store(beside) as store:
        length_unit = settings.input.length_unit
        limit = int(settings.tiling.memory_gib * GIB) or int(SHARE_OF_FREE * free_memory())
        with start_engine(settings.tiling.scheduler, store) as engine:
            cloud = read_into_store(engine, paths, length_unit, progress)
            drop_pages(cloud.xyz)
            room = tile_bytes(len(cloud), limit, engine.n_at_once)
            slab_bytes, batch_bytes = _sizes(settings, room)
            with _timed(seconds, "surface"):
                tiled = thin_in_slabs(engine, len(cloud), settings.thinning, slab_bytes, progress)
            with _timed(seconds, "stacks"):
                stacks = choose_stacks(
                    tiled.surface,
                    settings.stacks,
                    progress,
                    lambda _, told: curves.local_axes_in_slabs(engine, tiled, told),
                )
            with _timed(seconds, "profiles"):
                ellipses, segments = curves.ellipses_of_stacks(
                    engine, tiled, stacks, settings, batch_bytes, progress
                )
        _drop_surface(tiled)
        with _timed(seconds, "axes"):
            chains = join_centres(ellipses, progress)
        with _timed(seconds, "elements"):
            pieces = find_pieces(ellipses, chains, progress)
            nearby = NearbyPoints(
                cloud, tiled.surface, (store.open("members"), store.open("starts")), progress
            )
            built = build_elements(pieces, nearby, settings.elements, progress)
            profiles = tabulate_ellipses(built.elements, ellipses)
        _drop_surface(tiled)
        with _timed(seconds, "deformations"):
            measured = measure_elements(
                built,
                nearby,
                len(cloud),
                stacks[0].width,
                settings.deformation,
                settings.ellipses.fit,
                progress,
                per_point=_blank_points(store, len(cloud)),
            )
            deformations = judge_deformations(measured.deformations, measured.elements, rule)
        segment_id = _segments_of_points(store, tiled, segments, len(cloud), progress)
        drop_pages(cloud.xyz, measured.element_id, measured.deviation, segment_id)
        yield (
            cloud,
            Result(
                settings=settings,
                origin=cloud.origin,
                source=cloud.source,
                n_cloud_points=len(cloud),
                stacks=stacks,
                elements=measured.elements,
                profiles=Profiles.concatenate([measured.profiles, profiles]),
                deformations=deformations,
                segment_id=segment_id,
                element_id=measured.element_id,
                deviation=measured.deviation,
                seconds=seconds,
            ),
        )


def _sizes(settings: Settings, room: int) -> tuple[int, int]:
    """Bytes that a slab and a batch of profiles may take."""
    points = int(settings.tiling.tile_mpoints * 1e6)
    if not points:
        return room, room
    return points * thinning.BYTES_PER_POINT, points * curves.BYTES_PER_POINT


def _drop_surface(tiled: TiledSurface) -> None:
    """Give back the memory into which the surface is mapped."""
    drop_pages(tiled.surface.xyz, tiled.surface.normals, tiled.surface.spacing)


def _blank_points(store: Store, n_points: int) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Element and deviation of points that are of no element, in files."""
    element_id = store.create("element_id", (n_points,), np.int32)
    deviation = store.create("deviation", (n_points,), np.float32)
    for start in range(0, n_points, BLOCK):
        deviation[start : start + BLOCK] = np.nan
    drop_pages(deviation)
    return element_id, deviation


def _segments_of_points(
    store: Store,
    tiled: TiledSurface,
    segments: NDArray[np.int32],
    n_points: int,
    progress: Progress,
) -> NDArray[np.int32]:
    """The segment of each point of the cloud, in a file."""
    members, starts = store.open("members"), store.open("starts")
    segment_id = store.create("segment_id", (n_points,), np.int32)
    for slab in tiled.slabs:
        progress.update("segments", 1.0)
        first, last = slab.surface
        sizes = np.diff(starts[first : last + 1])
        segment_id[members[slice(*slab.points)]] = np.repeat(segments[first:last], sizes)
        drop_pages(members, starts, segment_id)
    return segment_id


@contextmanager
def _timed(seconds: dict[str, float], step: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[step] = time.perf_counter() - start
