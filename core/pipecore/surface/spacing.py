"""How far apart the points of a cloud usually are."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipecore._kernels import nearest_neighbours as kernels
from pipecore._kernels.grouping import group_by_label
from pipecore._kernels.voxel_hash import HashTable
from pipecore.parallel import for_chunks
from pipecore.progress import NoProgress, Progress
from pipecore.surface.grid import GridFrame, bounds, table_of

CHUNK = 1_000_000
WIDEST_GRID = 2.0**20
"""Cells along the longest side of a grid at most."""
N_ROW_SAMPLE = 256
"""Points whose neighbourhoods are looked at for rows."""
ROW_FLATNESS, FEWEST_ON_ROW = 0.2, 5
"""A neighbourhood is a row if it is this much narrower than long, and known from so many points."""
ROW_GROWTH, WIDEST_ROWS = 1.25, 12.0
"""Factor from one reach that is tried to the next, and the widest: rows are further apart than
points in them, but not so far that no pipe is round between them."""


def median_spacing(
    xyz: NDArray[np.floating],
    n_sample: int = 4000,
    n_neighbours: int = 8,
    among: NDArray[np.bool_] | None = None,
    progress: Progress = NoProgress(),
) -> float:
    """Estimate the median distance between neighbouring points on the scanned surfaces.

    It follows from the radius of the disc that holds `n_neighbours` points around sampled
    points, so that close pairs of overlapping scans do not make it too small.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        Metres.
    n_sample : int
        Points around which the spacing is taken.
    n_neighbours : int
    among : ndarray of bool, shape (n,), optional
        Points that may be sampled, where others lack neighbours.
    progress : Progress

    Returns
    -------
    float
        Metres; 0 for fewer than two points.
    """
    if len(xyz) < 2:
        return 0.0
    places = xyz if among is None or not among.any() else xyz[among]
    n_sample = min(n_sample, len(places))
    sample = np.asarray(places[sample_by_place(places, n_sample, progress)], np.float64)
    n_neighbours = min(n_neighbours, len(xyz) - 1)
    reach = _reach_of_neighbours(xyz, sample, n_neighbours + 1, progress)
    return float(np.median(reach) * np.sqrt(np.pi / (n_neighbours + 1)))


def widen_over_rows(
    xyz: NDArray[np.floating], reach: float, progress: Progress = NoProgress()
) -> float:
    """Return a reach within which most points see more than one row of points.

    Scanners that turn slowly, and those of vehicles, leave rows far wider apart than the
    points in a row: a neighbourhood on one row alone has no normal.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        Metres.
    reach : float
        Of a neighbourhood, metres; the least that is returned.
    progress : Progress

    Returns
    -------
    float
        Metres; `reach` where that will do, or where nothing up to `WIDEST_ROWS` times does.
    """
    sample = np.asarray(xyz[sample_by_place(xyz, min(N_ROW_SAMPLE, len(xyz)), progress)], float)
    low, high = bounds(xyz)
    wide = reach
    while wide <= WIDEST_ROWS * reach:
        frame = GridFrame.around(low, high, max(wide, float((high - low).max()) / WIDEST_GRID))
        near = _around_cells(xyz, sample, frame, progress).points
        if not _is_on_rows(near, sample, wide):
            return wide
        wide *= ROW_GROWTH
    return reach


def _is_on_rows(near: NDArray[np.float64], sample: NDArray[np.float64], reach: float) -> bool:
    """Whether most points see nothing but a row within reach."""
    n_on_rows, n_known = 0, 0
    for place, index in zip(sample, cKDTree(near).query_ball_point(sample, reach), strict=True):
        if len(index) >= FEWEST_ON_ROW:
            off = near[index] - place
            _, second, largest = np.linalg.eigvalsh(np.cov(off.T))
            n_on_rows += bool(second < ROW_FLATNESS**2 * largest)
            n_known += 1
    return n_on_rows > 0.5 * n_known


def sample_by_place(
    xyz: NDArray[np.floating], n_sample: int, progress: Progress = NoProgress()
) -> NDArray[np.intp]:
    """Positions of points drawn by a hash of their coordinates, so in any order the same."""
    # The hashes are spread evenly: those below this bound hold the smallest ones.
    share = min(1.0, (n_sample + 10 * np.sqrt(n_sample)) / len(xyz))
    while True:
        bound = np.uint64(min(share * 2.0**64, 2.0**64 - 2048))
        drawn: dict[int, NDArray[np.intp]] = {}

        def draw(start: int, stop: int) -> None:
            rows = np.empty(stop - start, np.intp)
            n = kernels.draw_places(xyz, start, stop, bound, rows)  # noqa: B023 - in the round
            drawn[start] = rows[:n].copy()  # noqa: B023

        for_chunks(draw, len(xyz), CHUNK, "thinning", progress, (0.0, 0.05))
        rows = np.concatenate([drawn[start] for start in sorted(drawn)])
        if share == 1.0:
            rows = np.arange(len(xyz))
        if len(rows) >= n_sample:
            break
        share = min(1.0, 4 * share)  # Equal points have equal hashes.
    hashes = np.empty(len(rows), np.uint64)
    kernels.hash_places(np.ascontiguousarray(xyz[rows]), 0, len(rows), hashes)
    return rows[np.argpartition(hashes, n_sample - 1)[:n_sample]]


def _reach_of_neighbours(
    xyz: NDArray[np.floating], sample: NDArray[np.float64], k: int, progress: Progress
) -> NDArray[np.float64]:
    """Distance of each sample within which `k` points lie, itself among them.

    Only the cubes around the samples are looked into. They grow until most samples have
    their points within a cube's edge. The others' distance is further than the median, so
    that it need not be known: it is given as infinite.
    """
    low, high = bounds(xyz)
    least = max(float((high - low).max()) / WIDEST_GRID, 1e-9)
    nearest, _ = cKDTree(sample).query(sample, min(2, len(sample)))
    apart = float(np.median(nearest.reshape(len(sample), -1)[:, -1]))
    # Were all points as far apart as the sample's, spread over surfaces; and as much again,
    # so that one look at all points will mostly do.
    edge = max(2.0 * apart * np.sqrt(k * len(sample) / len(xyz)), least)
    while True:
        reach = _within_cells(xyz, sample, k, GridFrame.around(low, high, edge), progress)
        if 2 * np.isfinite(reach).sum() > len(sample) + 1 or edge > 2 * np.linalg.norm(high - low):
            return np.where(np.isfinite(reach), reach, np.inf)
        edge *= 2.0


class _Around(NamedTuple):
    """Points (m, 3) in the cells around samples, by cell; the cells' table; where each begins."""

    points: NDArray[np.float64]
    table: HashTable
    starts: NDArray[np.integer]


def _around_cells(
    xyz: NDArray[np.floating],
    sample: NDArray[np.float64],
    frame: GridFrame,
    progress: Progress,
) -> _Around:
    """Return the points in the cells of the samples and in those beside them."""
    steps = np.arange(-1, 2)
    around = (
        (steps[:, None, None] * frame.n_y + steps[:, None]) * frame.n_z + steps
    ).ravel()  # fmt: skip
    marked = np.unique(frame.keys(sample)[:, None] + around)
    table = table_of(marked)
    collected: dict[int, tuple[NDArray[np.int64], NDArray[np.int32]]] = {}

    def collect(start: int, stop: int) -> None:
        found, cells = np.empty(stop - start, np.int64), np.empty(stop - start, np.int32)
        n = kernels.collect_marked(xyz, start, stop, frame.numbers, table, found, cells)
        collected[start] = found[:n].copy(), cells[:n].copy()

    for_chunks(collect, len(xyz), CHUNK, "thinning", progress, (0.05, 0.1))
    points = np.concatenate([collected[start][0] for start in sorted(collected)])
    cells = np.concatenate([collected[start][1] for start in sorted(collected)])
    order, starts = group_by_label(cells, len(marked))
    # The points are copied: what lies together is read together.
    return _Around(np.asarray(xyz[points[order]], np.float64), table, starts)


def _within_cells(
    xyz: NDArray[np.floating],
    sample: NDArray[np.float64],
    k: int,
    frame: GridFrame,
    progress: Progress,
) -> NDArray[np.float64]:
    """Distance of each sample to its `k` nearest points; nan where beyond a cell's edge."""
    near, table, starts = _around_cells(xyz, sample, frame, progress)
    reach = np.empty(len(sample))
    kernels.nearest_in_cells(
        near, sample, frame.numbers, table, np.arange(len(near)), starts, k, reach
    )
    return reach
