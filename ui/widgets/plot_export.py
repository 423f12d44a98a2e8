"""A plot saved: its numbers with names and units as CSV, its figure as PNG in dots, SVG and PDF in lines."""

from __future__ import annotations

import csv
import io
from itertools import zip_longest
from pathlib import Path

import numpy as np
import pyqtgraph as pg
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QWidget

from fingerlab.core.errors import UserError
from fingerlab.core.files import whole_file
from fingerlab.sessions.model import Array

from .plot_figure import FORMATS, Paper, full_label, name_of, picture, plots_of, values_of
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
    across = ""
    found: list[Series] = []
    for plot in reversed(plots_of(view)):  # of plots over one another the lowest names what runs across
        across, up = full_label(plot, "bottom") or across, full_label(plot, "left")
        shown = [(name_of(item, colours), values) for item in plot.items if (values := values_of(item))]
        found = [Series(name, across, up, *values) for name, values in shown] + found
    return found


def _told_apart(series: list[Series]) -> list[Series]:
    """The same with a number behind a name that comes again."""
    seen: dict[tuple[str, str], int] = {}
    result = []
    for one in series:
        count = seen[(one.up, one.name)] = seen.get((one.up, one.name), 0) + 1
        name = one.name if count == 1 else f"{one.name or 'curve'} {count}"
        result.append(Series(name, one.across, one.up, one.x, one.y))
    return result


def save_plot(widget: QWidget, path: Path, paper: Paper | None = None) -> None:
    """Write a plot in the format that the file's ending names, on ``paper`` or as it is on the screen.

    Raises:
        UserError: the ending is another one, there are no numbers, or the place cannot be written to.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind != "csv" and kind not in FORMATS:
        raise UserError(f"{path.name} should end in .png, .svg, .pdf or .csv; that says what is written.")
    content = _csv(widget) if kind == "csv" else picture(widget, kind, paper)
    with whole_file(path, "choose a folder with room and write access.") as part:
        part.write_bytes(content)


def picture_of(widget: QWidget) -> QImage:
    """The plot in dots, as large as on the screen and twice as fine, in light colours."""
    return QImage.fromData(picture(widget, "png"))


def _csv(widget: QWidget) -> bytes:
    series = series_of(widget)
    if not series:
        raise UserError("This plot shows no curve now, so that there are no numbers to write.")
    return to_csv(series).encode()
