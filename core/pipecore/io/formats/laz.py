"""The chunks of a LAZ file: where they are, and any of them unpacked by itself."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import laspy


@dataclass(frozen=True, eq=False)
class ChunkTable:
    """What a LAZ file's table of chunks says.

    Parameters
    ----------
    starts, places : ndarray of int64, shape (k + 1,)
        Number of the first point of each chunk, and the chunk's place in the file; the last
        ones are where all end.
    packing : bytes
        How points are packed, as lazrs takes it.
    """

    starts: NDArray[np.int64]
    places: NDArray[np.int64]
    packing: bytes

    @classmethod
    def read_from(cls, file: BinaryIO, header: "laspy.LasHeader") -> "ChunkTable":
        """Read the table of a file that `las_check` has found sound."""
        import lazrs  # type: ignore[import-untyped]  # noqa: PLC0415

        # laspy takes it out of the header once it reads points.
        packing = header.vlrs[header.vlrs.index("LasZipVlr")].record_data
        file.seek(header.offset_to_point_data)
        chunks = lazrs.read_chunk_table(file, lazrs.LazVlr(packing))
        n_points, n_bytes = np.array(chunks, np.int64).reshape(-1, 2).T
        first = header.offset_to_point_data + 8  # behind the table's own place
        # The last of chunks of equal size is said to be as large as the others.
        return cls(
            np.minimum(np.concatenate([[0], np.cumsum(n_points)]), header.point_count),
            first + np.concatenate([[0], np.cumsum(n_bytes)]),
            packing,
        )

    def __len__(self) -> int:
        """Return the number of chunks."""
        return len(self.starts) - 1

    def of_rows(self, rows: tuple[int, int]) -> range:
        """Chunks of a range of points that begins and ends where chunks do."""
        inside = (self.starts[:-1] >= rows[0]) & (self.starts[:-1] < rows[1])
        which = np.flatnonzero(inside & (np.diff(self.starts) > 0))
        return range(int(which[0]), int(which[-1]) + 1) if len(which) else range(0)


def unpack_chunks(
    file: BinaryIO,
    header: "laspy.LasHeader",
    table: ChunkTable,
    which: Sequence[int],
    selection: "laspy.DecompressionSelection",
) -> "laspy.PackedPointRecord":
    """Return the points of some chunks, in the order given.

    lazrs' own seeking misses the place where chunks differ in size.
    """
    import laspy  # noqa: PLC0415
    import lazrs  # noqa: PLC0415

    compressed = bytearray()
    sizes = []
    for chunk in which:
        place, end = table.places[chunk : chunk + 2].tolist()
        file.seek(place)
        compressed += file.read(end - place)
        sizes.append((int(table.starts[chunk + 1] - table.starts[chunk]), end - place))
    raw = np.zeros(sum(n for n, _ in sizes) * header.point_format.size, np.uint8)
    lazrs.decompress_points_with_chunk_table(
        np.frombuffer(compressed, np.uint8), table.packing, raw, sizes, selection.to_lazrs()
    )
    return laspy.PackedPointRecord.from_buffer(raw, header.point_format)
