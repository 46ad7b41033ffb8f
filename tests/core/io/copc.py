"""A writer of COPC files, after the specification 1.0, without the code under test."""

import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import laspy
import lazrs
import numpy as np
from laspy._compression import lazrsbackend
from numpy.typing import NDArray

from tests.core.io.writers import write_las

ENTRY = struct.Struct("<4iQii")
INFO = struct.Struct("<5d2Q2d88x")
FIRST_VLR, FIRST_EVLR = 375 + 54, struct.Struct("<QI")

Key = tuple[int, int, int, int]


class UnequalChunks(lazrsbackend.LazrsPointWriter):
    """Ends a chunk with each call, as writers of COPC do for each node of their octree."""

    def __init__(self, dest, point_format, parallel):
        super().__init__(dest, point_format, False)
        self.vlr = lazrs.LazVlr.new_for_compression(
            point_format.id, point_format.num_extra_bytes, True
        )

    def write_points(self, points):
        super().write_points(points)
        self.compressor.finish_current_chunk()


@dataclass
class Tree:
    """What a written file's octree says: to be changed by those who test with wrong ones."""

    centre: NDArray[np.float64]
    half: float
    rows: dict[Key, NDArray[np.intp]]
    """Of the points written, by the node's level and cell."""
    pages: list[list[tuple[int, ...]]] = field(default_factory=list)
    """Entries of the pages in their order; the first one is the root's."""
    place: int = 0
    """Where the pages begin in the file."""

    def place_of(self, page: int) -> int:
        return self.place + sum(ENTRY.size * len(p) for p in self.pages[:page])


def grow(xyz: NDArray[np.float64], per_node: int, rng: np.random.Generator) -> Tree:
    """Put points into an octree: some at random into each node, the others further down."""
    low, high = xyz.min(axis=0), xyz.max(axis=0)
    tree = Tree((low + high) / 2, float((high - low).max()) / 2 + 1e-3, {})
    left: dict[Key, NDArray[np.intp]] = {(0, 0, 0, 0): rng.permutation(len(xyz))}
    while left:
        (level, *cell), rows = left.popitem()
        tree.rows[(level, *cell)] = np.sort(rows[:per_node])
        rows = rows[per_node:]
        edge = 2 * tree.half / 2 ** (level + 1)
        cells = np.floor((xyz[rows] - (tree.centre - tree.half)) / edge).astype(int)
        for child in np.unique(cells, axis=0):
            inside = (cells == child).all(axis=1)
            left[(level + 1, *child.tolist())] = rows[inside]
    return tree


def write_copc(
    path: Path, points: Any, monkeypatch: Any, per_node: int = 500, seed: int = 1
) -> Tree:
    """Write points as COPC; the nodes in the order of their keys, pages by their levels."""
    plain = laspy.read(write_las(path.with_name("plain.las"), points))
    tree = grow(np.asarray(plain.xyz), per_node, np.random.default_rng(len(plain.points)))
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales, header.offsets = plain.header.scales, plain.header.offsets
    header.vlrs.append(laspy.VLR("copc", 1, "", bytes(INFO.size)))
    keys = sorted(tree.rows)
    with monkeypatch.context() as patch:
        patch.setattr(lazrsbackend, "LazrsPointWriter", UnequalChunks)
        with laspy.open(path, "w", header=header, laz_backend=laspy.LazBackend.Lazrs) as writer:
            for key in keys:
                writer.write_points(plain.points[tree.rows[key]])
    with path.open("rb") as file:
        header = laspy.LasHeader.read_from(file)
        packing = lazrs.LazVlr(header.vlrs[header.vlrs.index("LasZipVlr")].record_data)
        file.seek(header.offset_to_point_data)
        chunks = lazrs.read_chunk_table(file, packing)[: len(keys)]
    places = header.offset_to_point_data + 8 + np.cumsum([0, *(n for _, n in chunks)])
    entries = [
        (*key, int(place), n_bytes, n)
        for key, place, (n, n_bytes) in zip(keys, places, chunks, strict=False)
    ]
    # The root's page has two levels and tells where the branches' pages are.
    tree.place = path.stat().st_size + 60
    upper = [e for e in entries if e[0] < 2]
    branches = [e for e in entries if e[0] == 2]
    tree.pages = [upper, *([e for e in entries if is_below(e, b)] for b in branches)]
    n_upper = len(upper) + len(branches)
    place = tree.place + ENTRY.size * n_upper
    for branch, page in zip(branches, tree.pages[1:], strict=True):
        upper.append((*branch[:4], place, ENTRY.size * len(page), -1))
        place += ENTRY.size * len(page)
    write_tree(path, tree)
    return tree


def is_below(entry: tuple[int, ...], branch: tuple[int, ...]) -> bool:
    """Whether a node is another one or below it."""
    steps = entry[0] - branch[0]
    return steps >= 0 and all(c >> steps == b for c, b in zip(entry[1:4], branch[1:4], strict=True))


def write_tree(path: Path, tree: Tree) -> None:
    """Write what the tree says into the file, over what it said before."""
    data = b"".join(ENTRY.pack(*entry) for page in tree.pages for entry in page)
    root = ENTRY.size * len(tree.pages[0])
    with path.open("r+b") as file:
        file.seek(235)
        file.write(FIRST_EVLR.pack(tree.place - 60, 1))
        file.seek(FIRST_VLR)
        spacing = tree.half / 64
        file.write(INFO.pack(*tree.centre, tree.half, spacing, tree.place, root, 0.0, 0.0))
        file.seek(tree.place - 60)
        file.write(struct.pack("<H16sHQ32s", 0, b"copc", 1000, len(data), b"") + data)
        file.truncate()
