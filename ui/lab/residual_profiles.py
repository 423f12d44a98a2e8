"""Where does it fail? The residual of the equation shown over what may be to blame, and the worst place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent
from PySide6.QtWidgets import QComboBox, QLabel, QStackedWidget, QWidget

from fingerlab.core.text import ScreenUnit, largest_of, screen_unit
from fingerlab.diagnosis.answer.error_parts import Comparison, equation_of
from fingerlab.diagnosis.answer.residual_profiles import (
    RESIDUAL_FIGURES,
    Profile,
    ResidualFigure,
    most_orderly,
    profile,
)
from fingerlab.report.budget_words import (
    axis_title,
    bin_words,
    coordinate_unit,
    coordinates_of,
    miss_words,
    residual_unit,
    worst_words,
)
from fingerlab.report.diagnosis_words import PHASE_WORDS, in_sentence
from fingerlab.sessions.model import Array

from ..widgets.layout import FLUSH, described, hbox, vbox
from ..widgets.plots import QuietPlot, plain_curve, span_of
from ..widgets.series import Series
from ..widgets.tables import ElidedLabel, remark
from ..widgets.theme import colours_of, line, tint
from .comparison_bar import CURVES, WHERE, LegendKey, LegendKeys
from .result_words import FLOOR_HELP

UNITLESS = ScreenUnit("", 1.0)
SHAPE_KEYS = {
    **dict.fromkeys(("angle_loop", "tension_loop"), CURVES[:2]),
    "autocorrelation": (CURVES[2], LegendKey("what noise leaves, 95 %", "floor", "band")),
    "spectrum": (CURVES[2], LegendKey("floor", "floor")),
}
BAR_GAP = 0.12
"""Share of a bin's width left between bars."""
KEY_STEPS = {Qt.Key.Key_Left: -1, Qt.Key.Key_Right: 1}


class ProfilePlot(QuietPlot):
    """Bars: root mean square; points: mean with its 90 % interval; grey: floor. A click or ← → choose a bin.

    Signal ``chosen(bin)``: by the user.
    """

    chosen = Signal(int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("wherePlot", "Residual over a coordinate", parent)
        self.found: Profile | None = None
        self.bin = -1
        self.setFocusPolicy(Qt.FocusPolicy.WheelFocus)
        self.setMinimumHeight(120)

    def show_profile(self, found: Profile | None, bin_: int = -1) -> None:
        """Another profile with a bin of it chosen; -1 for none."""
        self.found, self.bin = found, bin_
        self.redraw()

    def choose(self, bin_: int) -> None:
        """Mark a bin, as a click does."""
        if self.found is not None and np.isfinite(self.found.rms[bin_]):
            self.bin = bin_
            self.redraw()
            self.chosen.emit(bin_)

    def redraw(self) -> None:
        plot, found = self.getPlotItem(), getattr(self, "found", None)
        plot.clear()
        for name in ("left", "bottom"):
            plot.getAxis(name).setStyle(showValues=found is not None)
        if found is None:
            self.setAccessibleDescription("Nothing to show")
            return
        across, up = coordinate_unit(found), residual_unit(found)
        self.name_axes("Residual", up, across.label(axis_title(found)))
        self._name_runs(found)
        self._draw(found, across.factor, up.factor)
        self.setAccessibleDescription(self._spoken(found))

    def _draw(self, found: Profile, across: float, up: float) -> None:
        plot, colours = self.getPlotItem(), colours_of(self)
        x, rms, floor = across * found.centres, up * found.rms, up * found.floor
        known = np.isfinite(rms)
        width = (1 - BAR_GAP) * across * (found.edges[1] - found.edges[0])
        brushes = [tint(colours.residual, 0.55 if k == self.bin else 0.25) for k in np.flatnonzero(known)]
        # What is chosen is framed as well: not by shade alone.
        pens = [
            line(colours.text, 2 * self.devicePixelRatioF()) if k == self.bin else pg.mkPen(None)
            for k in np.flatnonzero(known)
        ]
        plot.addItem(pg.BarGraphItem(x=x[known], height=rms[known], width=width, brushes=brushes, pens=pens))
        band = pg.LinearRegionItem((-floor, floor), orientation="horizontal", movable=False)
        band.setBrush(tint(colours.floor, 0.35))
        for edge in band.lines:
            edge.setPen(pg.mkPen(None))
        band.setZValue(-10)
        plot.addItem(band, ignoreBounds=True)
        plot.addItem(pg.InfiniteLine(0, angle=0, pen=line(colours.muted)), ignoreBounds=True)
        mean, half = up * found.mean[known], up * found.half[known]
        pen = self.pen("residual")
        plot.addItem(pg.ErrorBarItem(x=x[known], y=mean, top=half, bottom=half, beam=0.0, pen=pen))
        points = pg.ScatterPlotItem(x[known], mean, size=6, pen=pen, name="mean residual")
        points.setBrush(pg.mkBrush(colours.residual))
        plot.addItem(points)
        low = min(float(np.min(mean - half)), -1.1 * floor)
        high = max(float(np.max(rms[known])), float(np.max(mean + half)), 1.1 * floor)
        room = 0.06 * (high - low)
        plot.setRange(
            xRange=(across * found.edges[0], across * found.edges[-1]),
            yRange=(low - room, high + room),
            padding=0.0,
        )

    def _name_runs(self, found: Profile) -> None:
        """Runs are named below their bars, as many as there is room for."""
        axis = self.getPlotItem().getAxis("bottom")
        if not found.runs:
            axis.setTicks(None)
            return
        room = max(self.getPlotItem().getViewBox().width(), 1.0) / (5 * self.fontMetrics().averageCharWidth())
        every = max(round(len(found.runs) / max(room, 1.0)), 1)
        axis.setTicks([[(k, run) for k, (_, run, _) in enumerate(found.runs) if k % every == 0], []])
        phases = list(dict.fromkeys(PHASE_WORDS.get(phase, phase) for _, _, phase in found.runs))
        self.getPlotItem().setLabel("bottom", f"Run ({', then '.join(phases)})")

    def _spoken(self, found: Profile) -> str:
        if self.bin < 0:
            return f"{axis_title(found)}: {len(found.mean)} bins"
        return f"{bin_words(found, self.bin)}: {miss_words(found, self.bin)}"

    def shown_series(self) -> list[Series]:
        """For CSV: what is drawn of each bin. Runs go by their place in the list."""
        found = self.found
        if found is None:
            return []
        across, up = coordinate_unit(found), residual_unit(found)
        columns = (
            ("root mean square", found.rms),
            ("mean", found.mean),
            ("half of the mean's 90 % interval", found.half),
        )
        title = across.label(axis_title(found))
        return [
            Series(name, title, up.label("Residual"), across.factor * found.centres, up.factor * values)
            for name, values in columns
        ]

    # hand

    def mousePressEvent(self, event: QMouseEvent) -> None:
        super().mousePressEvent(event)
        found = self.found
        if found is None or event.button() != Qt.MouseButton.LeftButton:
            return
        place = self.getPlotItem().getViewBox().mapSceneToView(self.mapToScene(event.position().toPoint()))
        at = place.x() / coordinate_unit(found).factor
        number = int(np.searchsorted(found.edges, at)) - 1
        if 0 <= number < len(found.mean):
            self.setFocus()
            self.choose(number)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        step = KEY_STEPS.get(Qt.Key(event.key()))
        if step is None or self.found is None:
            super().keyPressEvent(event)
            return
        known = np.flatnonzero(np.isfinite(self.found.rms))
        if self.bin < 0:
            self.choose(self.found.worst)
            return
        row = int(np.clip(np.searchsorted(known, self.bin) + step, 0, len(known) - 1))
        self.choose(int(known[row]))


class ResidualFigurePlot(QuietPlot):
    """A loop, or what the residual of the run shown has in common with itself."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("shapePlot", "Loop, autocorrelation or spectrum of the run shown", parent)
        self.shape: ResidualFigure | None = None
        self.quantity = ""

    def show_shape(self, shape: ResidualFigure | None, quantity: str = "") -> None:
        """Another picture; None: none can be drawn. ``quantity``: what stands upwards, if not the shape's."""
        self.shape, self.quantity = shape, quantity
        self.redraw()

    def redraw(self) -> None:
        plot, shape = self.getPlotItem(), getattr(self, "shape", None)
        plot.clear()
        for name in ("left", "bottom"):
            plot.getAxis(name).setStyle(showValues=shape is not None)
        if shape is None:
            self.write("This run does not tell it.", 0.5, 0.5, (0.5, 0.5))
            self.name_axes("", UNITLESS, "")
            return
        every = [np.concatenate(values) for values in zip(*shape.curves.values(), strict=True)]
        across, up = (_unit(axis, v) for axis, v in zip((shape.across[1], shape.up[1]), every, strict=True))
        self.name_axes(self.quantity or shape.up[0], up, across.label(shape.across[0]))
        for name, (x, y) in shape.curves.items():
            pen = self.pen(name, 1.0, dashed=name == "modelled")
            plot.addItem(plain_curve(across.factor * x, up.factor * y, pen, name))
        if shape.chance:
            band = pg.LinearRegionItem((-shape.chance, shape.chance), orientation="horizontal", movable=False)
            band.setBrush(tint(colours_of(self).floor, 0.35))
            for edge in band.lines:
                edge.setPen(pg.mkPen(None))
            plot.addItem(band, ignoreBounds=True)
        plot.setRange(
            xRange=span_of(across.factor * every[0]), yRange=span_of(up.factor * every[1]), padding=0.0
        )
        self.setAccessibleDescription(f"{shape.title}: {', '.join(shape.curves)}")


def _unit(si: str, values: Array) -> ScreenUnit:
    """A unit for the screen; that of a density keeps what it is over."""
    unit, _, over = si.partition("/√")
    found = screen_unit(unit, largest_of(values))
    return ScreenUnit(f"{found.symbol}/√{over}", found.factor) if over else found


SHAPE_TITLES = {
    "angle_loop": "Loop over the angle",
    "tension_loop": "Loop over the tension",
    "autocorrelation": "Autocorrelation",
    "spectrum": "Spectrum",
}
POSITION_LOOP = "Loop over the position"
"""Of an axis along a line."""
LOOPS = ("angle_loop", "tension_loop")
SHAPE_WORDS = {
    "angle_loop": "Wider than the model's loop: a loss that the model lacks. Turned against it: a spring.",
    "tension_loop": "Where the loops part, what is missing grows with the load, or does not.",
    "autocorrelation": "Beyond the grey band the residual resembles itself later: it is no noise (95 %).",
    "spectrum": "Lines above the grey floor come again at that frequency: they are no noise.",
}


WHERE_HELP = (
    "Bars: root mean square of measured less modelled in each bin, over all runs. Points: its mean with the "
    "90 % interval; a mean far from zero is what a missing effect leaves, bars without it are scatter. "
    f"Click a bar, or use ← and →, to see it in the curves above. {FLOOR_HELP}"
)


class ProfilePanel(QWidget):
    """Signal ``place_chosen(profile, bin)``: a bin was chosen by the user."""

    place_chosen = Signal(object, int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._comparisons: tuple[Comparison, ...] = ()
        self._profiles: dict[str, Profile] = {}
        self._equation = ""
        self._by_hand = ""
        self.title = described(ElidedLabel(), role="heading")
        font = self.title.font()
        font.setBold(True)
        self.title.setFont(font)
        self.coordinate = QComboBox()
        self.coordinate.setObjectName("whereCoordinate")
        self.coordinate.setAccessibleName("Residual over")
        self.coordinate.setToolTip(
            "What the residual is drawn over; at first that in which its mean is the least like scatter."
        )
        label = QLabel("&Over")
        label.setBuddy(self.coordinate)
        self.words = described(remark(), "whereWords")
        self.plot = described(ProfilePlot(), tip=WHERE_HELP)
        top = hbox(None, (self.title, 1), label, self.coordinate, spacing=8)
        self._comparison: Comparison | None = None
        self.shape = ResidualFigurePlot()
        self.keys = LegendKeys(WHERE, wraps=True)
        self.pictures = QStackedWidget()
        self.pictures.addWidget(self.plot)
        self.pictures.addWidget(self.shape)
        keys = hbox(None, self.keys, margins=(72, 0, 0, 0))
        vbox(self, top, self.words, keys, (self.pictures, 1), margins=FLUSH, spacing=4)
        self.coordinate.activated.connect(self._on_coordinate)
        self.plot.chosen.connect(self._on_bin)

    def show_equation(self, comparisons: Sequence[Comparison], equation: str | None) -> None:
        """The residual of another equation, or of another model; the coordinate chosen by hand stays."""
        given = tuple(comparisons)
        same = given == () and not self._comparisons
        if same or (equation == self._equation and _identical(given, self._comparisons)):
            return
        self._comparisons, self._equation = given, equation or ""
        told = coordinates_of(given, self._equation)
        made = {name: profile(given, self._equation, name) for name in told} if given else {}
        self._profiles = {name: one for name, one in made.items() if one is not None}
        self.coordinate.clear()
        for name, one in self._profiles.items():
            self.coordinate.addItem(axis_title(one), name)
        if self._profiles:
            self.coordinate.insertSeparator(self.coordinate.count())
            for name, title in SHAPE_TITLES.items():
                if name == "tension_loop" and "tension" not in told:
                    continue  # a motor alone has no cable
                if name == "angle_loop" and "position" in self._profiles:
                    title = POSITION_LOOP
                self.coordinate.addItem(f"{title} of this run", name)
        known = self._by_hand in self._profiles or (self._by_hand in SHAPE_TITLES and self._profiles)
        wanted = self._by_hand if known else most_orderly(self._profiles)
        self.coordinate.setCurrentIndex(self.coordinate.findData(wanted))
        self._show()

    def show_run(self, comparison: Comparison | None) -> None:
        """The run whose loops and spectrum are drawn, where one of these is chosen."""
        if comparison is not self._comparison:
            self._comparison = comparison
            if str(self.coordinate.currentData()) in SHAPE_TITLES:
                self._show()

    @property
    def found(self) -> Profile | None:
        """The profile that is shown."""
        return self._profiles.get(str(self.coordinate.currentData()))

    def choose_worst(self) -> None:
        """Mark the worst bin, as a click on it does."""
        if self.found is not None:
            self.plot.choose(self.found.worst)

    def _on_coordinate(self) -> None:
        self._by_hand = str(self.coordinate.currentData())
        self._show()
        self.choose_worst()

    def _show(self) -> None:
        found, chosen = self.found, str(self.coordinate.currentData())
        self.pictures.setCurrentWidget(self.shape if chosen in SHAPE_TITLES else self.plot)
        self.keys.set_keys(SHAPE_KEYS.get(chosen, WHERE))
        quantity = equation_of(self._equation).quantity
        whole = (quantity,) if chosen in LOOPS else (f"Residual of {in_sentence(quantity)}", "Residual")
        self.title.set_texts((*whole, "") if chosen in LOOPS or self._profiles else ("",))
        if chosen in SHAPE_TITLES:
            self.words.setText(SHAPE_WORDS[chosen])
            shape = RESIDUAL_FIGURES[chosen](self._comparison) if self._comparison is not None else None
            upwards = {**dict.fromkeys(LOOPS, quantity), "spectrum": "Residual"}
            self.shape.show_shape(shape, upwards.get(chosen, ""))
            return
        self.plot.show_profile(found)
        self.words.setText(worst_words(found) if found is not None else "")

    def _on_bin(self, number: int) -> None:
        found = self.found
        if found is None:
            return
        words = worst_words(found)
        if number != found.worst:
            words += f" Chosen: {bin_words(found, number)}: {miss_words(found, number)}."
        self.words.setText(words)
        self.place_chosen.emit(found, number)


def _identical(one: Sequence[Comparison], other: Sequence[Comparison]) -> bool:
    return len(one) == len(other) and all(a is b for a, b in zip(one, other, strict=True))
