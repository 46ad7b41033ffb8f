"""What a column of a text file may hold, in words, and what comes of the columns chosen."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pipecore.formatting import format_coordinate
from pipecore.io import DecimalSign, Separator, TextPreview
from pipegui.i18n.texts import mark, tr

SKIP = "-"
ROLES = {
    "x": "x",
    "y": "y",
    "z": "z",
    "intensity": mark("intensity"),
    "red": mark("red"),
    "green": mark("green"),
    "blue": mark("blue"),
    "nx": "nx",
    "ny": "ny",
    "nz": "nz",
    "station": mark("station"),
    "classification": mark("class"),
    SKIP: mark("skip"),
}
"""Names of columns as the core knows them, and as they are shown."""
SEPARATORS = {
    Separator.AUTO: mark("Automatic"),
    Separator.BLANK: mark("Blanks"),
    Separator.TAB: mark("Tab"),
    Separator.COMMA: mark("Comma"),
    Separator.SEMICOLON: mark("Semicolon"),
}
DECIMAL_SIGNS = {
    DecimalSign.AUTO: mark("Automatic"),
    DecimalSign.POINT: mark("Point"),
    DecimalSign.COMMA: mark("Comma"),
}


def role_text(role: str) -> str:
    """Return what a column is called."""
    return tr(ROLES[role]) if role in ROLES else role


def columns_text(columns: str) -> str:
    """Return columns in words: "x, y, z, –, intensity"."""
    return ", ".join("–" if name == SKIP else role_text(name) for name in columns.split(","))


def outcome(preview: TextPreview) -> Iterator[tuple[str, str]]:
    """Yield what comes of a preview's points, as labels and texts."""
    points = preview.points
    if points is None or not len(points):
        return
    finite = points.xyz[np.isfinite(points.xyz).all(axis=1)]
    if len(finite):
        named = zip("xyz", finite[0].tolist(), strict=True)
        first = "   ".join(f"{axis} {format_coordinate(value)}" for axis, value in named)
        yield tr("First point"), first
        spread = " × ".join(f"{v:.2f}" for v in np.ptp(finite, axis=0))
        yield (
            tr("Extent"),
            tr("{spread} (first {n:,} points, in the file's unit)").format(
                spread=spread, n=len(points)
            ),
        )
    if points.intensity is not None:
        yield tr("Intensity"), _range(points.intensity)
    if points.rgb is not None:
        yield tr("Colours"), _range(points.rgb)
    if isinstance(points.station, np.ndarray):
        yield tr("Stations"), f"{len(np.unique(points.station)):,}"
    if points.classification is not None:
        yield tr("Classes"), _range(points.classification)


def _range(values: NDArray[np.generic]) -> str:
    low, high = np.nanmin(values), np.nanmax(values)
    return f"{low:g}" if low == high else f"{low:g} – {high:g}"
