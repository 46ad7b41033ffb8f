"""Colour maps and sets that 3D view and plots share, as arrays of RGB. Qt-free."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Colours = NDArray[np.uint8]

_INWARD_TO_OUTWARD = ["#123f9e", "#3a6cc8", "#98a9c2", "#b9b9b3", "#ccaa9d", "#cf4a34", "#9f1423"]
_LOW_TO_HIGH = ["#432e7a", "#38598c", "#25858e", "#2ab07f", "#85d54a", "#e8e337"]
_DARK_TO_BRIGHT = ["#2b2b2b", "#f2f2f2"]

QUALITATIVE = np.array(
    [
        [int(c[i : i + 2], 16) for i in (1, 3, 5)]
        for c in (
            "#4c78a8", "#e8963c", "#54a24b", "#45b0a8", "#c8a415",
            "#9c6b4e", "#7ba3d0", "#8fbf5a", "#d98a8a", "#6d7f8f",
        )
    ],
    np.uint8,
)  # fmt: skip
"""Colours that can be told apart; none is the accent of the selection."""


def station_colour(station_id: int) -> tuple[int, int, int]:
    """Return the colour of a station's points, by its id from 1 on."""
    red, green, blue = QUALITATIVE[(station_id - 1) % len(QUALITATIVE)].tolist()
    return red, green, blue


KINDS = np.array(
    [
        [int(c[i : i + 2], 16) for i in (1, 3, 5)]
        for c in ("#4477aa", "#228833", "#66ccee", "#ccbb44", "#ee6677", "#aa3377", "#6d7f8f")
    ],
    np.uint8,
)
"""Paul Tol's bright colours, which colour-blind people can tell apart, and a grey."""
BLOCK = 1_000_000


def rgb(hexadecimal: str) -> tuple[int, int, int]:
    """Return "#rrggbb" as three numbers from 0 to 255."""
    red, green, blue = (int(hexadecimal[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue


def _table(stops: list[str], n_colours: int = 256) -> Colours:
    channels = np.array([rgb(stop) for stop in stops], np.float64)
    at = np.linspace(0, len(stops) - 1, n_colours)
    table = [np.interp(at, np.arange(len(stops)), channel) for channel in channels.T]
    return np.round(table).T.astype(np.uint8)


DEVIATION = _table(_INWARD_TO_OUTWARD, 257)
"""Inward blue, outward red, the middle entry neutral; shape (257, 3)."""
HEIGHT = _table(_LOW_TO_HIGH)
INTENSITY = _table(_DARK_TO_BRIGHT)


def look_up(table: Colours, share: ArrayLike, missing: ArrayLike = (0, 0, 0)) -> Colours:
    """Return the colours of `share` (0 … 1, clipped; nan is `missing`), shape (…, 3)."""
    share = np.asarray(share)
    colours = np.empty((*share.shape, 3), np.uint8)
    # In blocks: what is in between takes ten times the room of the colours.
    for start in range(0, max(len(share), 1) if share.ndim else 1, BLOCK):
        at = slice(start, start + BLOCK) if share.ndim else ()
        block = share[at]
        is_missing = ~np.isfinite(block)
        index = np.clip(np.where(is_missing, 0, block), 0, 1) * (len(table) - 1)
        part = table[np.rint(index).astype(np.intp)]
        part[is_missing] = missing
        colours[at] = part
    return colours


def deviation_colours(
    deviation_mm: ArrayLike, limit_mm: float, missing: ArrayLike = (0, 0, 0)
) -> Colours:
    """Return the colours of signed deviations; ± `limit_mm` are the ends of the map."""
    share = np.asarray(deviation_mm) / (2 * limit_mm) + 0.5
    return look_up(DEVIATION, share, missing)
