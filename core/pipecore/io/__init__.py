"""Reading and writing point clouds: one module a format, one registry, one result.

>>> from pipecore import io
>>> cloud = io.read("scan.e57")
>>> io.info("scan.laz").n_points
1000000

Importing this package imports none of the libraries that read the formats.
"""

from pipecore.io.atomic import write_directory, write_file
from pipecore.io.mapped import reserve
from pipecore.io.reading import Corners, corners_of, read
from pipecore.io.registry import Format, file_filter, formats, identify
from pipecore.io.summary import FileInfo, StationInfo, info
from pipecore.io.text_format import DecimalSign, Separator, TextFormat
from pipecore.io.text_preview import TextPreview, guessed_columns, is_text, preview_text
from pipecore.io.writing import with_fields, write, write_laz

__all__ = [
    "Corners",
    "DecimalSign",
    "FileInfo",
    "Format",
    "Separator",
    "StationInfo",
    "TextFormat",
    "TextPreview",
    "corners_of",
    "file_filter",
    "formats",
    "guessed_columns",
    "identify",
    "info",
    "is_text",
    "preview_text",
    "read",
    "reserve",
    "with_fields",
    "write",
    "write_directory",
    "write_file",
    "write_laz",
]
