"""The header of a LAS or LAZ file: what it says, mended where writers often err.

laspy reads a copy of the header in which known errors of writers are put right; everything
is held against the file's size first, since laspy allocates and loops on the file's word.
"""

import io
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from pipecore.io.crs import NO_SYSTEM, ReferenceSystem, from_geotiff_keys, from_wkt
from pipecore.io.source import damaged
from pipecore.notes import Note

if TYPE_CHECKING:
    import laspy

RECORD_SIZES = (20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)
"""Smallest size of a point record of formats 0 to 10, bytes."""

_HEADER_SIZES = {2: 227, 3: 235, 4: 375, 5: 393}
_COMPRESSED = 0x80
_RECORD_HEAD, _EXTENDED_HEAD = 54, 60
_LONGEST_EXTENDED = 1_000_000
"""Larger extended records name no reference system."""
_KEPT = {(b"laszip encoded", 22204), (b"copc", 1), (b"LASF_Spec", 4)}
"""Records that laspy has to understand; it may fail on others."""
_EXTRA_BYTES = 192
_HAS_NO_DATA = 1
_NO_DATA_KINDS = ("<Q", "<q") * 4 + ("<d", "<d")
"""How the values that stand for none are stored, for each kind of extra value."""
_RESERVED_NAMES = {"x", "y", "z"}
_LAYERED_VERSIONS = (3, 4)
_LAYERED = 3


@dataclass(frozen=True, eq=False)
class LasHead:
    """What the header of a LAS or LAZ file says.

    Parameters
    ----------
    header : laspy.LasHeader
        Its point count is that of the header, held against the file's size if uncompressed.
    system : ReferenceSystem
    announced : int
        Points that the header announces; more than there are in a truncated file.
    packing : bytes
        How points are packed, as lazrs takes it; b"" if they are not.
    has_new_items : bool
        Whether points are packed in version 4, which is version 3 with one scanner channel.
    no_data : dict of str to float
        Stored extra values that stand for none, by name.
    notes : list of Note
        What was mended.
    projection : tuple of (int, bytes)
        The records that name the reference system, by their numbers.
    """

    header: "laspy.LasHeader"
    system: ReferenceSystem
    announced: int
    packing: bytes
    has_new_items: bool = False
    no_data: dict[str, float] = field(default_factory=dict)
    notes: list[Note] = field(default_factory=list)
    projection: tuple[tuple[int, bytes], ...] = ()


def read_head(file: BinaryIO, path: Path) -> LasHead:
    """Read the header and its records.

    Raises
    ------
    ReadError
        If it points beyond the file's end or names no known point format.
    """
    import laspy  # noqa: PLC0415

    size = path.stat().st_size
    head = bytearray(file.read(375))
    if len(head) < 227:
        raise damaged(path, "LAS", "its header is cut off")
    header_size, start, n_records, kind, record_size, n_legacy = struct.unpack_from(
        "<HIIBHI", head, 94
    )
    if start > size or not 227 <= header_size <= start:
        raise damaged(path, "LAS", "its header points beyond its end")
    point_format = kind & 0x3F
    if point_format >= len(RECORD_SIZES) or record_size < RECORD_SIZES[point_format]:
        raise damaged(path, "LAS", "its header names no known point format")
    file.seek(0)
    head = bytearray(file.read(start))
    notes: list[Note] = []
    head[25] = max(
        v for v, n in _HEADER_SIZES.items() if n <= header_size and v <= max(head[25], 2)
    )
    announced = _mend_count(
        head, n_legacy, (size - start) // record_size if not kind & 0x80 else None
    )
    if announced == 0 and not kind & _COMPRESSED:
        announced = _held_count(head, start, size, record_size)
        if announced:
            notes.append(
                Note(
                    "The header of “{name}” announces no points; the {held:,} that it holds were "
                    "read.",
                    name=path.name,
                    held=announced,
                )
            )
    for place in (26, 58):
        _mend_text(head, place, 32)
    no_data: dict[str, float] = {}
    n_extra = record_size - RECORD_SIZES[point_format]
    contents = _mend_records(head, path, header_size, n_records, n_extra, no_data)
    packing, has_new_items = _older_items(contents.get((b"laszip encoded", 22204), b""))
    found, is_whole = _extended_records(file, head, size)
    contents |= found
    if not is_whole:
        notes.append(
            Note(
                "What “{name}” has behind its points is damaged; a reference system may have "
                "stood there.",
                name=path.name,
            )
        )
    try:
        header = laspy.LasHeader.read_from(io.BytesIO(head))
    except Exception as error:
        raise damaged(path, "LAS") from error
    if kind & _COMPRESSED and not packing:
        raise damaged(path, "LAZ", "it does not say how its points are packed")
    own = {number: data for (user, number), data in contents.items() if user == b"LASF_Projection"}
    return LasHead(
        header,
        _system(own),
        announced,
        packing,
        has_new_items,
        no_data,
        notes,
        tuple(own.items()),
    )


def _mend_records(
    head: bytearray,
    path: Path,
    place: int,
    n_records: int,
    n_extra: int,
    no_data: dict[str, float],
) -> dict[tuple[bytes, int], bytes]:
    """Hide from laspy what it may fail on; return the contents by user and number."""
    records = list(_records(head, place, n_records))
    if len(records) < n_records:
        raise damaged(path, "LAS", "its header points beyond its end")
    contents = {}
    for start, user, number, length in records:
        key = user, number
        contents[key] = bytes(head[start + _RECORD_HEAD : start + _RECORD_HEAD + length])
        _mend_text(head, start + 22, 32)
        if key == (b"LASF_Spec", 4) and n_extra:
            no_data |= _mend_extra_bytes(head, start, length, n_extra)
        elif key not in _KEPT or key == (b"LASF_Spec", 4):
            head[start + 2 : start + 18] = b"other".ljust(16, b"\0")
    return contents


def _mend_count(head: bytearray, n_legacy: int, n_held: int | None) -> int:
    """Put the right one of two point counts where laspy looks for it, and return it."""
    if head[25] < 4:
        return n_legacy
    (n_points,) = struct.unpack_from("<Q", head, 247)
    is_wrong = n_points == 0 or (n_held is not None and n_points > n_held)
    if is_wrong and n_legacy and (n_held is None or n_legacy <= n_held):
        n_points = n_legacy
        struct.pack_into("<Q", head, 247, n_points)
    return int(n_points)


def _held_count(head: bytearray, start: int, size: int, record_size: int) -> int:
    """Points between the header and the records behind them, of a header that says none.

    Programs that are stopped while they write leave such files.
    """
    end = size
    if head[25] >= 4:
        (behind,) = struct.unpack_from("<Q", head, 235)
        end = behind if start <= behind <= size else size
    n_points = (end - start) // record_size
    if head[25] >= 4:
        struct.pack_into("<Q", head, 247, n_points)
    else:
        struct.pack_into("<I", head, 107, min(n_points, 2**32 - 1))
    return n_points


def _mend_text(head: bytearray, place: int, length: int) -> None:
    """Replace what is no ASCII; nothing that counts stands in such texts."""
    for i in range(place, min(place + length, len(head))):
        if head[i] > 0x7F:
            head[i] = ord("?")


def _records(head: bytearray, place: int, n: int) -> Iterator[tuple[int, bytes, int, int]]:
    """Place, user, number and length of each record that lies within the header."""
    for _ in range(n):
        if place + _RECORD_HEAD > len(head):
            return
        user = bytes(head[place + 2 : place + 18]).split(b"\0")[0]
        number, length = struct.unpack_from("<HH", head, place + 18)
        if place + _RECORD_HEAD + length > len(head):
            return
        yield place, user, number, length
        place += _RECORD_HEAD + length


def _mend_extra_bytes(head: bytearray, place: int, length: int, n_bytes: int) -> dict[str, float]:
    """Give the values of points different names; drop their description if it does not fit.

    Returns the stored values that stand for none, which laspy does not keep.
    """
    import laspy  # noqa: PLC0415

    taken = {name.casefold() for f in range(11) for name in laspy.PointFormat(f).dimension_names}
    taken |= _RESERVED_NAMES
    no_data: dict[str, float] = {}
    total = 0
    for at in range(place + _RECORD_HEAD, place + _RECORD_HEAD + length, _EXTRA_BYTES):
        _mend_text(head, at + 4, 32)
        _mend_text(head, at + 160, 32)
        kind, options = head[at + 2], head[at + 3]
        total += options if kind == 0 else _size_of(kind)
        name = bytes(head[at + 4 : at + 36]).split(b"\0")[0].decode("ascii").strip() or "extra"
        unique, k = name, 1
        while unique.casefold() in taken:
            k += 1
            unique = f"{name[: 31 - len(str(k))]} {k}"
        taken.add(unique.casefold())
        head[at + 4 : at + 36] = unique.encode("ascii").ljust(32, b"\0")[:32]
        if options & _HAS_NO_DATA and 1 <= kind <= 10:
            (no_data[unique],) = struct.unpack_from(_NO_DATA_KINDS[kind - 1], head, at + 40)
    if total > n_bytes or length % _EXTRA_BYTES:
        head[place + 2 : place + 18] = b"other".ljust(16, b"\0")
    return no_data


def _size_of(kind: int) -> int:
    """Bytes of a kind of extra value; too many for one that does not exist."""
    sizes = (1, 1, 2, 2, 4, 4, 8, 8, 4, 8)
    if not 1 <= kind <= 30:
        return 1 << 20
    return sizes[(kind - 1) % 10] * ((kind - 1) // 10 + 1)


def _older_items(packing: bytes) -> tuple[bytes, bool]:
    """Say version 3 where version 4 is said, and whether it was."""
    mended, has_new = bytearray(packing), False
    if len(packing) < 34 or struct.unpack_from("<H", packing)[0] != _LAYERED:
        return packing, False
    (n_items,) = struct.unpack_from("<H", packing, 32)
    for i in range(min(n_items, (len(packing) - 34) // 6)):
        if struct.unpack_from("<H", packing, 34 + 6 * i + 4)[0] == _LAYERED_VERSIONS[1]:
            struct.pack_into("<H", mended, 34 + 6 * i + 4, _LAYERED_VERSIONS[0])
            has_new = True
    return bytes(mended), has_new


def _extended_records(
    file: BinaryIO, head: bytearray, size: int
) -> tuple[dict[tuple[bytes, int], bytes], bool]:
    """Contents of the records behind the points, as far as they may name a system.

    Also whether all of them are there.
    """
    found: dict[tuple[bytes, int], bytes] = {}
    if head[25] < 4:
        return found, True
    place, n = struct.unpack_from("<QI", head, 235)
    for _ in range(n):
        if not len(head) <= place <= size - _EXTENDED_HEAD:
            return found, False
        file.seek(place)
        start = file.read(_EXTENDED_HEAD)
        user, (number, length) = start[2:18].split(b"\0")[0], struct.unpack_from("<HQ", start, 18)
        if place + _EXTENDED_HEAD + length > size:
            return found, False
        if length <= _LONGEST_EXTENDED:
            found[user, number] = file.read(length)
        place += _EXTENDED_HEAD + length
    return found, True


_WKT, _KEYS, _TEXTS = 2112, 34735, 34737


def _system(own: dict[int, bytes]) -> ReferenceSystem:
    """The reference system from the well-known text or the GeoTIFF keys, by their numbers."""
    text = own.get(_WKT, b"").decode("utf-8", errors="replace").strip("\0 \r\n\t")
    if text:
        return from_wkt(text)
    if _KEYS in own:
        return from_geotiff_keys(own[_KEYS], own.get(_TEXTS, b""))
    return NO_SYSTEM
