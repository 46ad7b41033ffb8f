"""A plot as a picture or as numbers, for the clipboard and for files."""

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import pyqtgraph as pg
from PySide6.QtCore import QBuffer, QByteArray, QIODevice, QMarginsF, QRectF, QSize, QSizeF
from PySide6.QtGui import QImage, QImageWriter, QPainter, QTextDocument
from PySide6.QtSvg import QSvgGenerator
from PySide6.QtWidgets import QGraphicsScene

from pipegui.style import theme
from pipegui.style.theme import SPACING

Table = Mapping[str, Sequence[str]]
"""Columns of cells by their titles, all of one length."""

PIXEL_RATIO = 2.0
"""Pixels of a picture per pixel of the screen: sharp in print."""


def to_csv(table: Table) -> str:
    """Return a table with a header row, comma separated."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table)
    writer.writerows(zip(*table.values(), strict=True))
    return text.getvalue()


def to_tsv(table: Table) -> str:
    """Return a table as spreadsheets take it from the clipboard."""
    rows = [table.keys(), *zip(*table.values(), strict=True)]
    return "".join("\t".join(row) + "\n" for row in rows)


def to_image(canvas: pg.GraphicsLayoutWidget, heading: str) -> QImage:
    """Return the plots under a heading (rich text)."""
    document = _laid_out(canvas, heading)
    size = _size(canvas, document)
    image = QImage(size * PIXEL_RATIO, QImage.Format.Format_RGB32)
    image.setDevicePixelRatio(PIXEL_RATIO)
    _paint(canvas, document, QPainter(image), size)
    return image


def png(image: QImage) -> bytes:
    """Return a picture as a PNG file's content."""
    buffer = QBuffer()
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    QImageWriter(buffer, QByteArray(b"PNG")).write(image)
    return bytes(buffer.data().data())


def to_svg(canvas: pg.GraphicsLayoutWidget, heading: str) -> bytes:
    """Return the plots under a heading (rich text) as a drawing of lines and letters."""
    document = _laid_out(canvas, heading)
    size = _size(canvas, document)
    buffer = QBuffer()
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    generator = QSvgGenerator()
    generator.setOutputDevice(buffer)
    generator.setResolution(canvas.logicalDpiX())  # the axes are drawn for the screen's
    generator.setSize(size)
    generator.setViewBox(QRectF(0, 0, size.width(), size.height()))
    generator.setTitle(document.toPlainText().split("\n")[0])
    _paint(canvas, document, QPainter(generator), size)
    return bytes(buffer.data().data())


def _laid_out(canvas: pg.GraphicsLayoutWidget, heading: str) -> QTextDocument:
    document = QTextDocument()
    document.setDefaultFont(canvas.font())
    document.setDefaultStyleSheet(f"body {{ color: {theme.colour('text').name()} }}")
    document.setHtml(f"<body>{heading}</body>")
    document.setTextWidth(canvas.width() - 2 * SPACING)
    return document


def _size(canvas: pg.GraphicsLayoutWidget, document: QTextDocument) -> QSize:
    height = canvas.height() + document.size().height() + SPACING
    return QSizeF(canvas.width(), height).toSize()


def _paint(
    canvas: pg.GraphicsLayoutWidget, document: QTextDocument, painter: QPainter, size: QSize
) -> None:
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    whole = QRectF(0, 0, size.width(), size.height())
    painter.fillRect(whole, theme.colour("window"))
    painter.save()
    painter.translate(SPACING, SPACING)
    document.drawContents(painter)
    painter.restore()
    source = QRectF(canvas.viewport().rect())
    target = whole.marginsRemoved(QMarginsF(0, whole.height() - source.height(), 0, 0))
    with _export_mode(canvas.scene(), painter):
        canvas.scene().render(painter, target, source)
    painter.end()


@contextmanager
def _export_mode(scene: QGraphicsScene, painter: QPainter) -> Iterator[None]:
    """Let pyqtgraph draw shapes instead of the small bitmaps that it keeps for the screen."""
    items = [item for item in scene.items() if hasattr(item, "setExportMode")]
    options = {"antialias": True, "painter": painter, "resolutionScale": 1.0}
    for item in items:
        item.setExportMode(True, options)
    try:
        yield
    finally:
        for item in items:
            item.setExportMode(False)
