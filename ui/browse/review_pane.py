"""One plot of the review: its curves by layer and channel, its cursors, its markers, its axes."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from html import escape

import pyqtgraph as pg

from fingerlab.library.reviewing import Marker

from ..theme import Colours
from ..widgets.curve import DecimatedCurve
from ..widgets.plot_style import bottom_axis_height, line, tint
from .grid import Grid
from .layer import Layer
from .overlays import GLYPHS
from .quantities import QUANTITIES, PaneSpec

RUN_TIME = "Run time (s)"


class ReviewPane:
    """One plot of the stack: its curves by layer and channel, its cursors, its markers."""

    def __init__(self, spec: PaneSpec, plot: pg.PlotItem) -> None:
        self.spec, self.plot = spec, plot
        self.curves: dict[tuple[int, str], DecimatedCurve] = {}
        self.strokes: dict[tuple[int, str], pg.PlotCurveItem] = {}
        names = (
            {"label": "A", "labelOpts": {"position": 0.06}},
            {"label": "B", "labelOpts": {"position": 0.06}},
        )
        self.cursors = [pg.InfiniteLine(angle=90, movable=True, **name) for name in names]
        self.markers: list[pg.InfiniteLine] = []
        self.legend = pg.TextItem(anchor=(0, 0))
        self.legend.setParentItem(plot.getViewBox())
        self.legend.setPos(4, 0)
        self.legend.setZValue(30)
        for cursor in self.cursors:
            cursor.setZValue(20)
        self.grid = Grid(plot)
        plot.addItem(self.grid, ignoreBounds=True)
        self.add_curves(0)

    def add_curves(self, number: int, run: str = "") -> None:
        """Curves for the layer of that number, with the name of its run; they stay when it goes."""
        for name in self.spec.channels:
            if (number, name) not in self.curves:
                self.curves[number, name] = DecimatedCurve()
                self.strokes[number, name] = pg.PlotCurveItem(connect="finite", antialias=True)
                for item in (self.curves[number, name], self.strokes[number, name]):
                    item.setZValue(number)
                    self.plot.addItem(item, ignoreBounds=True)
            for item in (self.curves[number, name], self.strokes[number, name]):
                item.opts["name"] = f"{QUANTITIES[name].title}, {run}" if run else None

    def show_cursors(self, times: Sequence[float] | None) -> None:
        """Put the cursors somewhere; None for none. While they are not shown they cost nothing."""
        for number, cursor in enumerate(self.cursors):
            there = cursor in self.plot.items
            if times is None and there:
                self.plot.removeItem(cursor)
            elif times is not None:
                if not there:
                    self.plot.addItem(cursor, ignoreBounds=True)
                cursor.setValue(times[number])

    def show_time_axis(self, on: bool, words: str) -> None:
        """Times and label below, or nothing."""
        axis = self.plot.getAxis("bottom")
        self.plot.showAxis("bottom", on)
        if on:
            axis.linkToView(self.plot.getViewBox())
            axis.setHeight(bottom_axis_height())
            self.plot.setLabel("bottom", words)
        else:
            axis.unlinkFromView()

    def show_legend(self, present: Collection[str], over: Sequence[Layer], colours: Colours) -> None:
        """Name the curves where there is more than one, each as it is drawn; and the runs laid over."""
        names = [name for name in self.spec.channels if name in present]
        parts = []
        for name in names if len(names) > 1 else ():
            title = escape(QUANTITIES[name].title)
            title = f"<b>{title}</b>" if name in self.spec.wide else title
            colour = getattr(colours, self.spec.channels[name])
            parts.append(f'<span style="color:{colour}">{title}</span>')
        for layer in over:
            drawn_as = f"{GLYPHS[layer.number - 1]}&nbsp;{escape(layer.name)}"
            parts.append(f'<span style="color:{colours.over[layer.number - 1]}">{drawn_as}</span>')
        self.legend.setHtml(" &nbsp; ".join(parts))
        self.legend.fill = pg.mkBrush(tint(colours.surface, 0.75))
        self.legend.setVisible(bool(parts))

    def show_markers(self, markers: Sequence[Marker], with_text: bool, colour: str) -> None:
        """A line for each marker; its note beside it in one pane only."""
        for old in self.markers:
            self.plot.removeItem(old)
        self.markers = []
        for marker in markers:
            text = (
                {"label": marker.note, "labelOpts": {"position": 0.18, "color": colour}} if with_text else {}
            )
            item = pg.InfiniteLine(marker.time, angle=90, pen=line(colour, 1.0, dashed=True), **text)
            self.plot.addItem(item, ignoreBounds=True)
            self.markers.append(item)
