"""A plot saved: its numbers with names and units as CSV, its picture as PNG in dots, SVG and PDF in lines."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QBuffer, QByteArray, QIODevice, QMarginsF, QPoint, QRectF, QSizeF, Qt
from PySide6.QtGui import QColor, QImage, QPageLayout, QPageSize, QPainter, QPdfWriter, QPen
from PySide6.QtWidgets import QWidget

from fingerlab.core.errors import UserError
from fingerlab.core.files import whole_file
from fingerlab.sessions.model import Array

from .plots import FULL_LABEL, DecimatedCurve
from .series import Series, ShowsSeries
from .theme import Colours, colours_of


def series_of(widget: QWidget) -> list[Series]:
    """Every curve that a plot shows, whole where the screen only draws a part; empty where it shows none."""
    if isinstance(widget, ShowsSeries):
        return _told_apart(widget.shown_series())
    return _told_apart(_of_view(widget, colours_of(widget)) if isinstance(widget, pg.GraphicsView) else [])


def to_csv(series: list[Series]) -> str:
    """A table with a column each for what runs across and up; curves over the same points share the first.

    The first row has names and units. Columns of unequal length end in empty fields; so does a gap.
    """
    columns: list[tuple[str, Array]] = []
    last: Array | None = None
    for one in series:
        if last is None or not np.array_equal(last, one.x, equal_nan=True):
            columns.append((one.across, one.x))
            last = one.x
        columns.append((f"{one.up}: {one.name}" if one.name else one.up, one.y))
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([title for title, _ in columns])
    texts = [[repr(float(v)) if np.isfinite(v) else "" for v in values] for _, values in columns]
    writer.writerows(zip_longest(*texts, fillvalue=""))
    return out.getvalue()


def _of_view(view: pg.GraphicsView, colours: Colours) -> list[Series]:
    plots = [item for item in view.scene().items() if isinstance(item, pg.PlotItem) and item.isVisible()]
    plots.sort(key=lambda plot: plot.sceneBoundingRect().top())
    across = ""
    found: list[Series] = []
    for plot in reversed(plots):  # of plots over one another the lowest names what runs across
        across = _label(plot, "bottom") or across
        found = [s for item in plot.items if (s := _of_item(item, plot, across, colours))] + found
    return found


def _of_item(item: Any, plot: pg.PlotItem, across: str, colours: Colours) -> Series | None:
    up = _label(plot, "left")
    if not isinstance(item, pg.PlotCurveItem | pg.ScatterPlotItem | pg.PlotDataItem) or not item.isVisible():
        return None
    data = item.series if isinstance(item, DecimatedCurve) else item.getData()
    if data[0] is None or not len(data[0]):
        return None
    x, y = (np.asarray(values, dtype=np.float64) for values in data)
    if not np.isfinite(y).any():
        return None
    return Series(_name(item, colours), across, up, x, y)


def _label(plot: pg.PlotItem, side: str) -> str:
    axis = plot.getAxis(side)
    return str(getattr(axis, FULL_LABEL, "") or axis.labelText or "")


def _name(item: Any, colours: Colours) -> str:
    """The curve's own name; else the meaning of its colour, which is the same in all plots."""
    own = item.name() if callable(getattr(item, "name", None)) else None
    if own:
        return str(own)
    pen = item.opts.get("pen")
    if not isinstance(pen, QPen) or pen.style() == Qt.PenStyle.NoPen:
        return ""
    for role in ("measured", "modelled", "residual", "candidate", "floor", "muted", "accent", "fault"):
        if QColor(getattr(colours, role)).rgb() == pen.color().rgb():
            return role
    return ""


def _told_apart(series: list[Series]) -> list[Series]:
    """The same with a number behind a name that comes again."""
    seen: dict[tuple[str, str], int] = {}
    result = []
    for one in series:
        count = seen[(one.up, one.name)] = seen.get((one.up, one.name), 0) + 1
        name = one.name if count == 1 else f"{one.name or 'curve'} {count}"
        result.append(Series(name, one.across, one.up, one.x, one.y))
    return result


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
