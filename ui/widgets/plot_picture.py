"""A plot as a picture: PNG in dots, SVG and PDF in lines."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QBuffer, QByteArray, QIODevice, QMarginsF, QPoint, QRectF, QSizeF
from PySide6.QtGui import QImage, QPageLayout, QPageSize, QPainter, QPdfWriter
from PySide6.QtWidgets import QWidget

from fingerlab.core.errors import UserError
from fingerlab.core.files import whole_file

from .plot_series import series_of, to_csv

PNG_SCALE = 2
"""Dots a pixel of the window: a picture for print as well as for the screen."""

POINTS_PER_PIXEL = 0.75
"""A pixel is 1/96 inch, a point 1/72."""


def save_plot(widget: QWidget, path: Path) -> None:
    """Write a plot in the format that the file's ending names.

    Raises:
        UserError: the ending is another one, there are no numbers, or the place cannot be written to.
    """
    make = {".png": _png, ".svg": _svg, ".pdf": _pdf, ".csv": _csv}.get(path.suffix.lower())
    if make is None:
        raise UserError(f"{path.name} should end in .png, .svg, .pdf or .csv; that says what is written.")
    content = make(widget)
    with whole_file(path, "choose a folder with room and write access.") as part:
        part.write_bytes(content)


def picture_of(widget: QWidget) -> QImage:
    """The plot in dots, twice as fine as a plain screen."""
    size = widget.size() * PNG_SCALE
    image = QImage(size, QImage.Format.Format_ARGB32)
    image.fill(widget.palette().window().color())
    painter = QPainter(image)
    painter.setRenderHints(QPainter.RenderHint.Antialiasing | QPainter.RenderHint.TextAntialiasing)
    painter.scale(PNG_SCALE, PNG_SCALE)
    _paint(widget, painter)
    painter.end()
    return image


def _png(widget: QWidget) -> bytes:
    held = QByteArray()
    buffer = QBuffer(held)
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    picture_of(widget).save(buffer, "PNG")  # type: ignore[call-overload]
    return bytes(held.data())


def _svg(widget: QWidget) -> bytes:
    from PySide6.QtSvg import QSvgGenerator

    held = QByteArray()
    buffer = QBuffer(held)
    generator = QSvgGenerator()
    generator.setOutputDevice(buffer)
    generator.setSize(widget.size())
    generator.setViewBox(QRectF(widget.rect()))
    generator.setTitle(widget.accessibleName())
    generator.setDescription(widget.accessibleDescription())
    painter = QPainter(generator)
    _paint(widget, painter)
    painter.end()
    return bytes(held.data())


def _pdf(widget: QWidget) -> bytes:
    held = QByteArray()
    buffer = QBuffer(held)
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    writer = QPdfWriter(buffer)
    size = QSizeF(widget.width() * POINTS_PER_PIXEL, widget.height() * POINTS_PER_PIXEL)
    page = QPageSize(size, QPageSize.Unit.Point, "plot", QPageSize.SizeMatchPolicy.ExactMatch)
    writer.setPageLayout(QPageLayout(page, QPageLayout.Orientation.Portrait, QMarginsF()))
    writer.setResolution(96 * 12)  # so that hairlines and letters fall on fine places
    writer.setTitle(widget.accessibleName())
    painter = QPainter(writer)
    painter.scale(writer.width() / widget.width(), writer.height() / widget.height())
    _paint(widget, painter)
    painter.end()
    buffer.close()
    return bytes(held.data())


def _csv(widget: QWidget) -> bytes:
    series = series_of(widget)
    if not series:
        raise UserError("This plot shows no curve now, so that there are no numbers to write.")
    return to_csv(series).encode()


def _paint(widget: QWidget, painter: QPainter) -> None:
    if not isinstance(widget, pg.GraphicsView):
        widget.render(painter, QPoint(0, 0))
        return
    with _as_lines(widget, painter):
        painter.fillRect(widget.rect(), widget.backgroundBrush())
        widget.render(painter, QRectF(widget.rect()), widget.rect())


@contextmanager
def _as_lines(view: pg.GraphicsView, painter: QPainter) -> Iterator[None]:
    """Let items that keep dots for the screen (symbols) draw themselves as lines meanwhile."""
    options: dict[str, Any] = {
        "painter": painter, "antialias": True, "background": None, "resolutionScale": 1.0,
    }  # fmt: skip
    items = [item for item in view.scene().items() if hasattr(item, "setExportMode")]
    for item in items:
        item.setExportMode(True, options)
    try:
        yield
    finally:
        for item in items:
            item.setExportMode(False)
