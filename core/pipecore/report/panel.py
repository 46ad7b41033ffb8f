"""Panels of a figure as SVG: axes with ticks, lines, points, error bars, pictures of cells.

A plot library takes half a second to be imported and a sixth for a figure, which is most of
a report's time; these figures ask for little of what it can do.
"""

import base64
import math
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np
from numpy.typing import NDArray

from pipecore.report.format import MINUS
from pipecore.types import Array

INK, BLUE, VERMILION, GREY = "#333333", "#0072B2", "#D55E00", "#8a8a8a"
HOLE = "#eeeeee"
TICK = 3.0
"""Length of a tick, points as all lengths here."""

DOT = "h.01"
"""A stroke so short that only its round ends are seen; not all viewers draw one of no length."""

ROOM_PER_TICK = (32.0, 18.0)
"""What a tick needs for itself along x and y."""

LETTER = 3.5
"""About the width of a letter of a legend."""

STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
SHADES = np.array(
    [(5, 48, 97), (67, 147, 195), (247, 247, 247), (214, 96, 77), (103, 0, 31)], np.float64
)
"""From far inward (blue) over none to far outward (red)."""

Limits = tuple[float, float]
Ticks = Sequence[tuple[float, str]]


@dataclass(eq=False)
class Panel:
    """A rectangle of a figure with its own axes.

    Parameters
    ----------
    box : tuple of float
        Left, top, width and height.
    x, y : (float, float)
        Values at the left and right, and at the bottom and top.
    title, x_label : str
    y_ticks : sequence of (float, str), optional
        By default round numbers.
    is_on_the_right : bool
        Whether the axis of y is at the right.
    """

    box: tuple[float, float, float, float]
    x: Limits
    y: Limits
    title: str = ""
    x_label: str = ""
    y_ticks: Ticks | None = None
    is_on_the_right: bool = False
    _parts: list[str] = field(default_factory=list)

    def across(self, values: Array | float) -> Array:
        """Places along x, points."""
        left, _, width, _ = self.box
        return np.asarray(left + width * (np.asarray(values) - self.x[0]) / (self.x[1] - self.x[0]))

    def down(self, values: Array | float) -> Array:
        """Places along y, points."""
        _, top, _, height = self.box
        return np.asarray(top + height * (self.y[1] - np.asarray(values)) / (self.y[1] - self.y[0]))

    def band(self, start: float, end: float, colour: str) -> None:
        """Shade what lies between two values of x."""
        _, top, _, height = self.box
        left, right = self.across(np.clip([start, end], *self.x)).tolist()
        self._parts.append(
            f'<rect x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" '
            f'height="{height:.1f}" fill="{colour}" fill-opacity="0.12"/>'
        )

    def vertical(self, at: float, colour: str) -> None:
        """Draw a line at a value of x."""
        self.line(np.array([at, at]), np.array(self.y), colour, 0.8)

    def line(self, x: Array, y: Array, colour: str, width: float) -> None:
        """Draw a line through places in their order, broken where one is nan."""
        seen = np.isfinite(x) & np.isfinite(y)
        begins = seen & ~np.append(False, seen[:-1])
        places = zip(begins[seen], self.across(x[seen]), self.down(y[seen]), strict=True)
        path = "".join(f"{'M' if begin else 'L'}{a:.1f} {b:.1f}" for begin, a, b in places)
        self._stroke(path, colour, width)

    def points(self, x: Array, y: Array, colour: str, size: float) -> None:
        """Draw round points."""
        seen = np.isfinite(x) & np.isfinite(y)
        places = zip(self.across(x[seen]), self.down(y[seen]), strict=True)
        path = "".join(f"M{a:.1f} {b:.1f}{DOT}" for a, b in places)
        self._stroke(path, colour, size, ' stroke-linecap="round"')

    def bars(self, x: Array, low: Array, high: Array, colour: str) -> None:
        """Draw upright error bars."""
        seen = np.isfinite(x) & np.isfinite(low) & np.isfinite(high)
        places = zip(self.across(x[seen]), self.down(low[seen]), self.down(high[seen]), strict=True)
        self._stroke("".join(f"M{a:.1f} {b:.1f}V{c:.1f}" for a, b, c in places), colour, 0.5)

    def cross(self, x: float, y: float, colour: str) -> None:
        """Mark a place."""
        a, b = float(self.across(x)), float(self.down(y))
        self._stroke(f"M{a - 3.5:.1f} {b:.1f}h7M{a:.1f} {b - 3.5:.1f}v7", colour, 1.0)

    def cells(self, values: Array, limit: float) -> None:
        """Fill the panel with cells (rows from the top, columns) shaded by ±`limit`; nan: holes."""
        left, top, width, height = self.box
        where = f'x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" height="{height:.1f}"'
        picture = base64.b64encode(_png(_shaded(values, limit))).decode("ascii")
        self._parts.append(
            f'<rect {where} fill="{HOLE}"/><image {where} preserveAspectRatio="none" '
            f'style="image-rendering:pixelated" href="data:image/png;base64,{picture}"/>'
        )

    def legend(self, entries: Sequence[tuple[str, str, float]], *, is_on_the_right: bool) -> None:
        """Say what lines and points (wider than two) are: texts with their colours and widths."""
        left, top, width, _ = self.box
        lengths = [20.0 + LETTER * len(text) for text, _, _ in entries]
        at, y = left + (width - sum(lengths) if is_on_the_right else 6.0), top + 5.0
        for (text, colour, stroke), length in zip(entries, lengths, strict=True):
            is_point = stroke > 2.0
            path = f"M{at + 5:.1f} {y:.1f}{DOT}" if is_point else f"M{at:.1f} {y:.1f}h10"
            self._stroke(path, colour, stroke, ' stroke-linecap="round"' if is_point else "")
            self._text(at + 13.0, y + 2.5, text, size=7.0)
            at += length

    def svg(self) -> str:
        """Return what is drawn, with its axes over it."""
        self._draw_axes()
        return "".join(self._parts)

    def _draw_axes(self) -> None:
        left, top, width, height = self.box
        bottom = top + height
        out, anchor = (1.0, "start") if self.is_on_the_right else (-1.0, "end")
        axis = left + width if self.is_on_the_right else left
        marks = f"M{axis:.1f} {top:.1f}V{bottom:.1f}"
        for value, label in self.y_ticks or round_ticks(self.y, height / ROOM_PER_TICK[1]):
            y = float(self.down(value))
            marks += f"M{axis:.1f} {y:.1f}h{out * TICK:g}"
            self._text(axis + out * (TICK + 2.0), y + 2.8, label, anchor)
        if self.x_label:
            marks += f"M{left:.1f} {bottom:.1f}h{width:.1f}"
            for value, label in round_ticks(self.x, width / ROOM_PER_TICK[0]):
                x = float(self.across(value))
                marks += f"M{x:.1f} {bottom:.1f}v{TICK:g}"
                self._text(x, bottom + TICK + 8.5, label, "middle")
            self._text(left + width / 2, bottom + TICK + 19.5, self.x_label, "middle")
        self._stroke(marks, GREY, 0.6)
        self._text(left, top - 6.0, self.title)

    def _stroke(self, path: str, colour: str, width: float, more: str = "") -> None:
        if path:
            self._parts.append(
                f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="{width:g}"{more}/>'
            )

    def _text(
        self, x: float, y: float, text: str, anchor: str = "start", size: float = 8.0
    ) -> None:
        if text:
            self._parts.append(
                f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size:g}">'
                f"{escape(text)}</text>"
            )


def figure(width: float, height: float, panels: Sequence[Panel], label: str) -> str:
    """Return panels as one ``<svg>`` element; `label` says what it is to who cannot see it."""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" role="img" '
        f'aria-label="{escape(label)}" font-family="sans-serif" fill="{INK}">'
        f"{''.join(panel.svg() for panel in panels)}</svg>"
    )


def limits_of(*values: Array, margin: float) -> Limits:
    """Limits that hold values with a share of their range to either side; nan are passed over."""
    every = np.concatenate([np.ravel(v) for v in values])
    every = every[np.isfinite(every)]
    if not len(every):
        return 0.0, 1.0
    low, high = float(every.min()), float(every.max())
    room = margin * (high - low) or 0.05 * max(abs(high), 1.0)
    return low - room, high + room


def round_ticks(limits: Limits, n_most: float) -> list[tuple[float, str]]:
    """Round numbers between two limits, in their order, with their texts."""
    low, high = min(limits), max(limits)
    least = (high - low) / max(n_most, 1.0)
    power = 10.0 ** math.floor(math.log10(least))
    step = next(s * power for s in STEPS if s * power >= least * (1 - 1e-9))
    decimals = next(d for d in range(20) if abs(step * 10**d - round(step * 10**d)) < 1e-6)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    texts = (f"{i * step + 0.0:.{decimals}f}".replace("-", MINUS) for i in range(first, last + 1))
    return [(i * step, text) for i, text in zip(range(first, last + 1), texts, strict=True)]


def _shaded(values: Array, limit: float) -> NDArray[np.uint8]:
    """Red, green, blue and opacity of cells."""
    share = np.clip(np.nan_to_num(values) / (2 * limit) + 0.5, 0.0, 1.0) * (len(SHADES) - 1)
    at = np.arange(len(SHADES))
    colour = [np.interp(share, at, SHADES[:, k]) for k in range(3)]
    return np.stack([*colour, 255.0 * np.isfinite(values)], axis=-1).round().astype(np.uint8)


def _png(pixels: NDArray[np.uint8]) -> bytes:
    """Return a picture (rows, columns, 4) as a PNG file."""
    n_rows, n_columns, _ = pixels.shape

    def chunk(kind: bytes, data: bytes) -> bytes:
        check = struct.pack(">I", zlib.crc32(kind + data))
        return struct.pack(">I", len(data)) + kind + data + check

    # Each row begins with how it is filtered: not at all.
    rows = np.concatenate([np.zeros((n_rows, 1), np.uint8), pixels.reshape(n_rows, -1)], axis=1)
    head = struct.pack(">IIBBBBB", n_columns, n_rows, 8, 6, 0, 0, 0)
    data = zlib.compress(rows.tobytes())
    return b"".join(
        [b"\x89PNG\r\n\x1a\n", chunk(b"IHDR", head), chunk(b"IDAT", data), chunk(b"IEND", b"")]
    )
