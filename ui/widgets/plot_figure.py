"""A plot of the window saved: its numbers as CSV, its figure drawn anew by matplotlib for paper.

The figure has what the plot shows: the same axes, curves, bands and words, always in the light colours, with
title and legend and without cursors. A picture of the screen would carry the screen's scale, theme and pixels
into a paper.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from textwrap import fill
from typing import Any

import matplotlib as mpl
import numpy as np
import pyqtgraph as pg
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QBrush, QColor, QPen
from PySide6.QtWidgets import QWidget

from fingerlab.core.errors import UserError
from fingerlab.core.files import whole_file
from fingerlab.core.text import NO_BREAK
from fingerlab.report.figure_style import DPI, LABEL_SIZE, TICK_SIZE, TITLE_SIZE, legend_below
from fingerlab.sessions.model import Array

from .plots import FULL_LABEL, Cursor, DecimatedCurve, Tints
from .series import Series, ShowsFigure, ShowsSeries, envelope
from .theme import Colours, colours_of, light_colours

POINTS_PER_PIXEL = 0.75
"""A pixel is 1/96 inch, a point 1/72."""
PIXELS_PER_INCH = 96.0
MILLIMETRES_PER_INCH = 25.4
TITLE_LETTER_MM, LETTER_MM, SMALL_LETTER_MM = 2.1, 1.75, 1.6
"""Width of a letter of title, label and legend, rather more than less."""
KEY_MM = 14.0
"""Room that the line before a name of the legend takes."""
AXIS_SHARE = 0.6
LEAST_HEIGHT = 60.0
"""Of a figure, mm."""
BUCKETS = 2000
"""Of a long curve, at least five a printed millimetre; the eye sees no more, and the file stays small."""
STACK_GAP = 0.02
HATCH = "////"
STYLES = {
    Qt.PenStyle.SolidLine: "solid",
    Qt.PenStyle.DashLine: "dashed",
    Qt.PenStyle.DotLine: "dotted",
    Qt.PenStyle.DashDotLine: "dashdot",
    Qt.PenStyle.DashDotDotLine: "dashdot",
}
SYMBOLS = {"o": "o", "s": "s", "t": "v", "t1": "^", "d": "D", "+": "+", "x": "x", "star": "*"}
ROLES = ("measured", "modelled", "residual", "candidate", "alike", "floor", "muted", "accent", "fault")
SETTINGS: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "fingerlab",
    "pdf.fonttype": 42,
    "text.parse_math": False,
    "axes.unicode_minus": True,
}
"""Letters stay letters, in SVG and PDF, and a dollar sign in a name is one."""
FORMATS: Mapping[str, Mapping[str, Any]] = {
    "png": {},
    "svg": {"metadata": {"Date": None}},
    "pdf": {"metadata": {"CreationDate": None}},
}


@dataclass(frozen=True)
class Paper:
    """How large a figure is, in mm, how fine in dots per inch, and what stands over it."""

    width: float
    height: float
    dots_per_inch: float = 2 * PIXELS_PER_INCH
    title: str = ""


def paper_of(widget: QWidget, source: str = "") -> Paper:
    """As large as on a screen of 96 dots per inch, twice as fine, under the plot's own title, or name.

    A plot that is low on the screen becomes higher: a figure has a title and a legend, too.

    Args:
        source: what the plot is of, which the title tells as well.
    """
    scale = MILLIMETRES_PER_INCH / PIXELS_PER_INCH
    height = max(widget.height() * scale, LEAST_HEIGHT)
    title = getattr(widget, "figure_title", "") or widget.accessibleName()
    return Paper(widget.width() * scale, height, title=" – ".join(filter(None, (title, source))))


def picture(widget: QWidget, kind: str, paper: Paper | None = None) -> bytes:
    """The plot as a file of a kind: png, svg or pdf."""
    paper = paper or paper_of(widget)
    out = io.BytesIO()
    with mpl.rc_context():
        mpl.rcdefaults()  # whatever a matplotlibrc of the user or of the folder says
        mpl.rcParams.update(SETTINGS)
        size = (paper.width / MILLIMETRES_PER_INCH, paper.height / MILLIMETRES_PER_INCH)
        figure = Figure(figsize=size, dpi=DPI, layout="constrained", facecolor="white")
        if isinstance(widget, ShowsFigure):
            widget.draw_figure(figure)
        elif isinstance(widget, pg.GraphicsView):
            _draw_view(figure, widget)
        elif isinstance(widget, ShowsSeries):
            _draw_series(figure, widget.shown_series())
        if paper.title:
            title = fill(paper.title, max(int(paper.width / TITLE_LETTER_MM), 10))
            figure.suptitle(title, fontsize=TITLE_SIZE, x=0.01, ha="left")
        figure.savefig(out, format=kind, dpi=paper.dots_per_inch, **FORMATS[kind])
    return out.getvalue()


def _in_lines(label: str, letters: int) -> str:
    """Words in lines that are no longer than ``letters`` where that can be; a unit is never parted."""
    kept = re.sub(r"\([^)]*\)$", lambda unit: unit[0].replace(" ", NO_BREAK), label)
    return fill(kept, letters, break_long_words=False).replace(NO_BREAK, " ")


def full_label(plot: pg.PlotItem, side: str) -> str:
    """What stands along an axis, whole, even where a low plot shortens it."""
    axis = plot.getAxis(side)
    return str(getattr(axis, FULL_LABEL, "") or axis.labelText or "")


def plots_of(view: pg.GraphicsView) -> list[pg.PlotItem]:
    """The plots of a view from top to bottom."""
    plots = [item for item in view.scene().items() if isinstance(item, pg.PlotItem) and item.isVisible()]
    return sorted(plots, key=lambda plot: plot.sceneBoundingRect().top())


def name_of(item: Any, colours: Colours) -> str:
    """A curve's own name; else the meaning of its colour, which is the same in all plots."""
    own = item.name() if callable(getattr(item, "name", None)) else None
    if own:
        return str(own)
    pen = item.opts.get("pen")
    if not isinstance(pen, QPen) or pen.style() == Qt.PenStyle.NoPen:
        return ""
    role = _role(pen.color(), colours)
    return role if isinstance(role, str) and role in ROLES else ""


# of pyqtgraph


@dataclass(frozen=True)
class _Ink:
    """Turns pens and brushes of the window into those of the figure."""

    shown: Colours
    paper: Colours
    pixel: float
    """Device pixels of a pixel on the window."""

    def colour(self, colour: QColor) -> tuple[float, float, float, float]:
        role = _role(colour, self.shown)
        if isinstance(role, int):
            meant = QColor(self.paper.over[role])
        else:
            meant = QColor(getattr(self.paper, role)) if role else colour
        return meant.redF(), meant.greenF(), meant.blueF(), colour.alphaF()

    def line(self, pen: QPen) -> dict[str, Any]:
        """Style, width (points) and colour of a line."""
        width = max(pen.widthF() / self.pixel, 1.0) * POINTS_PER_PIXEL
        return {"color": self.colour(pen.color()), "lw": width, "ls": STYLES.get(pen.style(), "solid")}


def _role(colour: QColor, colours: Colours) -> str | int:
    """What a colour means: a role, the number of a run laid over, or nothing."""
    for role in (*ROLES, "text", "line"):
        if QColor(getattr(colours, role)).rgb() == colour.rgb():
            return role
    over = [QColor(one).rgb() for one in colours.over]
    return over.index(colour.rgb()) if colour.rgb() in over else ""


def _draw_view(figure: Figure, view: pg.GraphicsView) -> None:
    plots = plots_of(view)
    if not plots:
        return
    heights = [max(float(plot.getViewBox().height()), 1.0) for plot in plots]
    stacked = figure.subplots(len(plots), 1, squeeze=False, height_ratios=heights)[:, 0]
    figure.set_layout_engine("constrained", hspace=STACK_GAP)
    ink = _Ink(colours_of(view), light_colours(), view.devicePixelRatioF())
    named: dict[str, Any] = {}
    for axes, plot in zip(stacked, plots, strict=True):
        _draw_plot(axes, plot, ink)
        named |= dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    figure.align_ylabels(stacked)
    _name_below(figure, named)


def _draw_plot(axes: Axes, plot: pg.PlotItem, ink: _Ink) -> None:
    (left, right), (low, high) = plot.viewRange()
    for item in plot.items:
        draw = next((how for kind, how in DRAWN.items() if isinstance(item, kind)), None)
        if draw is not None and item.isVisible():
            draw(axes, item, ink)
    axes.set_xlim(left, right)
    axes.set_ylim(low, high)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, lw=0.4, alpha=0.35)
    axes.tick_params(labelsize=TICK_SIZE)
    axes.set_axisbelow(True)
    for side, axis, name in (("left", axes.yaxis, axes.set_ylabel), ("bottom", axes.xaxis, axes.set_xlabel)):
        shown = plot.getAxis(side)
        label = full_label(plot, side)
        if label and shown.isVisible():
            letters = max(int(axis_height(axes) / LETTER_MM), 8)
            name(_in_lines(label, letters) if side == "left" else label, fontsize=LABEL_SIZE)
        if not (shown.isVisible() and shown.style["showValues"]):
            axis.set_tick_params(labelbottom=False, labelleft=False)
        # Round values are matplotlib's own; words under bars (runs) are the plot's.
        words = [tick for level in shown._tickLevels or () for tick in level]
        if words and not all(_says(text, place) for place, text in words):
            axis.set_ticks([place for place, _ in words], [text for _, text in words])


def axis_height(axes: Axes) -> float:
    """Length of an upright axis, mm: its share of the figure less what title and legend take, about."""
    figure = axes.figure
    assert isinstance(figure, Figure)
    return figure.get_figheight() * MILLIMETRES_PER_INCH / len(figure.axes) * AXIS_SHARE


def _says(text: str, value: float) -> bool:
    """Whether the words of a tick are its value."""
    try:
        return bool(np.isclose(float(text.replace("−", "-")), value, rtol=1e-6, atol=1e-9))
    except ValueError:
        return False


def _curve(axes: Axes, item: Any, ink: _Ink) -> None:
    x, y = item.series if isinstance(item, DecimatedCurve) else item.getData()
    pen = item.opts.get("pen")
    if x is None or not len(x) or not isinstance(pen, QPen) or pen.style() == Qt.PenStyle.NoPen:
        return
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    (left, right), _ = item.getViewBox().viewRange()
    if np.all(np.diff(x) >= 0):  # over time: what is seen, and a point more on each side
        first = max(int(np.searchsorted(x, left)) - 1, 0)
        last = int(np.searchsorted(x, right)) + 1
        x, y = envelope(x[first:last], y[first:last], BUCKETS)
    if np.isfinite(y).any():
        axes.plot(x, y, label=name_of(item, ink.shown) or None, zorder=3 + item.zValue(), **ink.line(pen))


def _points(axes: Axes, item: Any, ink: _Ink) -> None:
    x, y = item.getData()
    if x is None or not len(x):
        return
    brush, edge = item.opts["brush"], pg.mkPen(item.opts["pen"])
    filled = pg.mkBrush(brush).style() != Qt.BrushStyle.NoBrush
    drawn = edge.style() != Qt.PenStyle.NoPen
    axes.scatter(
        x,
        y,
        s=(float(item.opts["size"]) * POINTS_PER_PIXEL) ** 2,
        marker=SYMBOLS.get(item.opts["symbol"], "o"),
        facecolors=[ink.colour(pg.mkBrush(brush).color())] if filled else "none",
        edgecolors=[ink.colour(edge.color())] if drawn else "none",
        zorder=5,
        label=item.name() or None,
    )


def _curve_and_points(axes: Axes, item: Any, ink: _Ink) -> None:
    for part, draw in ((item.curve, _curve), (item.scatter, _points)):
        if part.isVisible():
            draw(axes, part, ink)


def _intervals(axes: Axes, item: Any, ink: _Ink) -> None:
    if item.opts["x"] is None:
        return
    spans = [np.asarray(item.opts[side], dtype=float) for side in ("bottom", "top")]
    look = ink.line(pg.mkPen(item.opts["pen"]))
    axes.errorbar(
        item.opts["x"], item.opts["y"], yerr=spans, fmt="none", ecolor=look["color"], elinewidth=look["lw"]
    )


def _bars(axes: Axes, item: Any, ink: _Ink) -> None:
    opts = item.opts
    count = len(opts["x"])
    brushes = opts["brushes"] if opts.get("brushes") is not None else [opts["brush"]] * count
    pens = opts["pens"] if opts.get("pens") is not None else [opts["pen"]] * count
    pens = [pg.mkPen(pen) for pen in pens]
    axes.bar(
        opts["x"],
        opts["height"],
        opts["width"],
        color=[ink.colour(pg.mkBrush(one).color()) for one in brushes],
        label=opts.get("name"),
        edgecolor=[ink.colour(p.color()) if p.style() != Qt.PenStyle.NoPen else "none" for p in pens],
    )


def _band(axes: Axes, item: Any, ink: _Ink) -> None:
    start, stop = item.getRegion()
    upwards = item.orientation in ("vertical", pg.LinearRegionItem.Vertical)
    role = _role(item.brush.color(), ink.shown)
    span = axes.axvspan if upwards else axes.axhspan
    named = "floor" if role == "floor" and not upwards and stop > start else None
    span(start, stop, color=ink.colour(item.brush.color()), lw=0, zorder=0.5, label=named)


def _tints(axes: Axes, item: Any, ink: _Ink) -> None:
    for start, stop in item.stretches:
        colour = ink.colour(item.colour)
        if item.hatched:
            how: dict[str, Any] = {"facecolor": "none", "edgecolor": colour, "hatch": HATCH}
        else:
            how = {"color": colour}
        axes.axvspan(start, stop, **how, lw=0, zorder=0.5, label=item.name or None)


def _line(axes: Axes, item: Any, ink: _Ink) -> None:
    if isinstance(item, Cursor) or not isinstance(item.pen, QPen):
        return
    upright = item.angle == 90
    (axes.axvline if upright else axes.axhline)(item.value(), **ink.line(item.pen))
    if upright and hasattr(item, "label"):
        axes.annotate(
            item.label.format, (item.value(), 1.0), (3, -2), ("data", "axes fraction"), "offset points",
            va="top", fontsize=TICK_SIZE,
        )  # fmt: skip


def _words(axes: Axes, item: Any, ink: _Ink) -> None:
    text = item.toPlainText()
    if not text or item.parentItem() is item.getViewBox():
        return
    place: QPointF = item.pos()
    across, down = item.anchor if not item.angle else (item.anchor[1], 1.0 - item.anchor[0])
    axes.text(
        place.x(),
        place.y(),
        text,
        ha={0.0: "left", 0.5: "center"}.get(float(across), "right"),
        va={0.0: "top", 0.5: "center"}.get(float(down), "bottom"),
        rotation=item.angle,
        fontsize=TICK_SIZE,
        color=ink.colour(item.color),
        clip_on=True,
    )


def _between(axes: Axes, item: Any, ink: _Ink) -> None:
    (x, one), (_, other) = (curve.getData() for curve in item.curves)
    colour = ink.colour(QBrush(item.brush()).color())
    axes.fill_between(x, one, other, color=colour, lw=0, zorder=1, label="90 % interval")


DRAWN: Mapping[type, Callable[[Axes, Any, _Ink], None]] = {
    pg.PlotCurveItem: _curve,
    pg.PlotDataItem: _curve_and_points,
    pg.ScatterPlotItem: _points,
    pg.ErrorBarItem: _intervals,
    pg.BarGraphItem: _bars,
    pg.LinearRegionItem: _band,
    Tints: _tints,
    pg.InfiniteLine: _line,
    pg.TextItem: _words,
    pg.FillBetweenItem: _between,
}


def _name_below(figure: Figure, named: Mapping[str, Any]) -> None:
    """The legend, in as many columns as the figure's width has room for."""
    if named:
        column = KEY_MM + SMALL_LETTER_MM * max(map(len, named))
        room = figure.get_figwidth() * MILLIMETRES_PER_INCH
        legend_below(figure, named, most=max(int(room / column), 1))


# of plots that say themselves what they show


def _draw_series(figure: Figure, series: list[Series]) -> None:
    """Curves over one another, one axis for each quantity."""
    heights = list(dict.fromkeys(one.up for one in series))
    if not heights:
        return
    stacked = figure.subplots(len(heights), 1, squeeze=False, sharex=True)[:, 0]
    colours = light_colours()
    named: dict[str, Any] = {}
    for axes, up in zip(stacked, heights, strict=True):
        for number, one in enumerate(part for part in series if part.up == up):
            x, y = envelope(one.x, one.y, BUCKETS) if len(one.x) else (one.x, one.y)
            own = one.name in ROLES
            colour = getattr(colours, one.name) if own else colours.over[number % len(colours.over)]
            axes.plot(x, y, label=one.name or None, lw=POINTS_PER_PIXEL, color=colour)
            axes.set_xlabel(one.across, fontsize=LABEL_SIZE)
        axes.set_ylabel(up, fontsize=LABEL_SIZE)
        axes.tick_params(labelsize=TICK_SIZE)
        axes.spines[["top", "right"]].set_visible(False)
        axes.label_outer()
        named |= dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    _name_below(figure, named)


def values_of(item: Any) -> tuple[Array, Array] | None:
    """The points of a curve or of dots, whole where the screen draws a part; None where it shows none."""
    if not isinstance(item, pg.PlotCurveItem | pg.ScatterPlotItem | pg.PlotDataItem) or not item.isVisible():
        return None
    data = item.series if isinstance(item, DecimatedCurve) else item.getData()
    if data[0] is None or not len(data[0]):
        return None
    x, y = (np.asarray(values, dtype=np.float64) for values in data)
    return (x, y) if np.isfinite(y).any() else None


def series_of(widget: QWidget) -> list[Series]:
    """Every curve that a plot shows, whole where the screen only draws a part; empty where it shows none."""
    if isinstance(widget, ShowsSeries):
        return _distinct(widget.shown_series())
    return _distinct(_of_view(widget, colours_of(widget)) if isinstance(widget, pg.GraphicsView) else [])


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


def _distinct(series: list[Series]) -> list[Series]:
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


def _csv(widget: QWidget) -> bytes:
    series = series_of(widget)
    if not series:
        raise UserError("This plot shows no curve now, so that there are no numbers to write.")
    return to_csv(series).encode()
