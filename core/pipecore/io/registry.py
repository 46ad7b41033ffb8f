"""The formats that can be read, and which of them a file is in."""

import codecs
import importlib
import re
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from pipecore.errors import ReadError
from pipecore.io.formats import ptx, unread
from pipecore.io.source import DEFAULT, OpenOptions, Source

HEAD_BYTES = 4096


@dataclass(frozen=True)
class Format:
    """A format that can be read.

    Parameters
    ----------
    name : str
        What surveyors call it.
    endings : tuple of str
        File name endings, lower case, with the dot.
    module : str
        The module of this package that reads it, imported when needed.
    signature : pattern, optional
        Matches the first bytes of such a file; None if any text may be one.
    """

    name: str
    endings: tuple[str, ...]
    module: str
    signature: re.Pattern[bytes] | None = None

    def open(self, path: Path, options: OpenOptions = DEFAULT) -> AbstractContextManager[Source]:
        """Open a file of this format.

        Parameters
        ----------
        path : Path
        options : OpenOptions

        Returns
        -------
        context manager of Source

        Raises
        ------
        ReadError
            From here or from the source's chunks.
        """
        module = importlib.import_module(f"pipecore.io.formats.{self.module}")
        open_source: Callable[[Path, OpenOptions], AbstractContextManager[Source]]
        open_source = module.open_source
        return open_source(path, options)


_TEXT = Format("Text", (".pts", ".xyz", ".txt", ".csv", ".asc"), "text")
_FORMATS = (
    Format("LAS/LAZ", (".las", ".laz"), "las", re.compile(rb"LASF")),
    Format("E57", (".e57",), "e57", re.compile(rb"ASTM-E57")),
    Format("PLY", (".ply",), "ply", re.compile(rb"\s*ply[ \t]*[\r\n]")),
    Format(
        "PCD",
        (".pcd",),
        "pcd",
        re.compile(rb"\s*(#[^\n]*PCD|(#[^\n]*\n\s*)*(VERSION|FIELDS)\s)"),
    ),
    Format("PTX", (".ptx",), "ptx", ptx.SIGNATURE),
    _TEXT,
)


def formats() -> tuple[Format, ...]:
    """Return all formats that can be read.

    Returns
    -------
    tuple of Format
    """
    return _FORMATS


def file_filter() -> str:
    """Return the filter of a file dialog, such as “Point clouds (*.las …);;PLY (*.ply)”.

    Returns
    -------
    str
    """

    def entry(label: str, endings: tuple[str, ...]) -> str:
        return f"{label} ({' '.join('*' + ending for ending in endings)})"

    every = tuple(ending for f in _FORMATS for ending in f.endings)
    return ";;".join(
        [
            entry("Point clouds", every),
            *(entry(f.name, f.endings) for f in _FORMATS),
            "All files (*)",
        ]
    )


def identify(path: Path) -> Format:
    """Return the format of a file: by its first bytes, for text by its ending.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Format

    Raises
    ------
    ReadError
        If it is missing, not a file, empty, or in no known format.
    """
    head = _head(path)
    for candidate in _FORMATS:
        if candidate.signature is not None and candidate.signature.match(head):
            return candidate
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise ReadError("“{name}” is UTF-16 text; save it as UTF-8 or plain text.", name=path.name)
    unread.check_not_foreign(path, head)
    by_ending = next((f for f in _FORMATS if path.suffix.lower() in f.endings), None)
    if b"\0" not in head and by_ending is not None and by_ending.module in ("text", "pcd"):
        return by_ending
    if _is_table(head):
        return _TEXT
    if by_ending is not None:
        raise ReadError(
            "“{name}” is damaged or no {format_name} file: it does not begin like one.",
            name=path.name,
            format_name=by_ending.name,
        )
    known = ", ".join(f.name for f in _FORMATS)
    raise ReadError(
        "“{name}” is in no known point cloud format ({known}).", name=path.name, known=known
    )


def _head(path: Path) -> bytes:
    try:
        if path.is_dir():
            raise ReadError("“{path}” is a folder; give a point cloud file.", path=path)
        if path.exists() and not path.is_file():
            raise ReadError("“{path}” is not an ordinary file.", path=path)
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except FileNotFoundError as error:
        raise ReadError("There is no file “{path}”.", path=path) from error
    except PermissionError as error:
        raise ReadError("You have no permission to read “{path}”.", path=path) from error
    except (OSError, ValueError) as error:
        cause = getattr(error, "strerror", None) or "not a valid file name"
        raise ReadError("“{path}” cannot be opened ({reason}).", path=path, reason=cause) from error
    if not head:
        raise ReadError("“{name}” is empty.", name=path.name)
    return head


def _is_table(head: bytes) -> bool:
    """Return whether the head holds a line of at least three numbers, and nothing binary."""
    number = rb"[-+]?\d+([.,]\d*)?([eE][-+]?\d+)?"
    line_of_numbers = rb"(?m)^\s*" + number + rb"([ \t;,]+" + number + rb"){2}"
    return b"\0" not in head and re.search(line_of_numbers, head) is not None
