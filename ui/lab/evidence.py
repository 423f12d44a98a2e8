"""Why the chosen candidate is where it is: words, strength, and the residual against its own coordinate."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QPen
from PySide6.QtWidgets import QWidget

from fingerlab.core.text import ScreenUnit, estimate_text, printed, screen_unit
from fingerlab.diagnosis.answer.error_parts import EQUATIONS, equation_of
from fingerlab.diagnosis.answer.results import Candidate, Diagnosis, Fingerprint
from fingerlab.report.diagnosis_words import FAMILY_TITLES, in_sentence, listed, suspects
from fingerlab.report.line_units import LineUnits
from fingerlab.report.parameter_words import parameter_titles

from ..widgets.layout import FLUSH, described, hbox, vbox
from ..widgets.plots import FocusFrame, bottom_axis_height, colour_plot, label_left, prepare_plot, span_of
from ..widgets.series import Series
from ..widgets.tables import ElidedLabel, WholeLabel
from ..widgets.theme import colours_of, line, small_font, tint
from .comparison_bar import FINGERPRINT, LOOK_ALIKES, RESIDUAL_ONLY, LegendKeys
from .comparison_curves import largest
from .result_words import FLOOR_HELP, OUTCOME_TITLES, find_candidate, outcome_explanation

AXIS_WIDTH = 72


class FingerprintPlot(FocusFrame, pg.PlotWidget):
    """Bins as points with their interval, the effect as a green curve, the floor as a grey band.

    Effects that cannot be told from it are dotted beside it, as far as the view of it goes.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent, enableMenu=False)
        self.setObjectName("fingerprint")
        self.setAcceptDrops(False)  # a file dropped here is for the window
        self.setAccessibleName("Fingerprint: residual against the effect's own coordinate")
        self._unit: ScreenUnit | None = None
        plot = self.getPlotItem()
        prepare_plot(plot)
        plot.getViewBox().sigResized.connect(self._label_left)
        plot.setMouseEnabled(x=False, y=False)
        plot.setContentsMargins(0, 4, 8, 0)
        plot.getAxis("left").setWidth(AXIS_WIDTH)
        plot.getAxis("bottom").setHeight(bottom_axis_height())
        horizontal = pg.LinearRegionItem.Horizontal
        self.floor_band = pg.LinearRegionItem((0, 0), orientation=horizontal, movable=False)
        self.floor_band.setZValue(-10)
        self.zero = pg.InfiniteLine(angle=0, movable=False)
        self.bars = pg.ErrorBarItem(beam=0.0)
        self.points = pg.ScatterPlotItem(size=6, pxMode=True, name="mean residual, 90 % interval")
        self.curve = pg.PlotCurveItem(connect="finite", antialias=True, name="the effect's own curve")
        self.alike: dict[str, pg.PlotCurveItem] = {}
        self.empty = pg.TextItem("This effect has no fingerprint on these data.", anchor=(0.5, 0.5))
        self.empty.setFont(small_font())
        for item in (self.floor_band, self.zero, self.bars, self.curve, self.points, self.empty):
            plot.addItem(item, ignoreBounds=True)
        self.fingerprint: Fingerprint | None = None
        self._with_curve = True
        self._look_alikes: dict[str, Fingerprint] = {}
        self._recolour()
        self.show_fingerprint(None)

    def show_fingerprint(
        self,
        fingerprint: Fingerprint | None,
        floor: float | None = None,
        with_curve: bool = True,
        look_alikes: Mapping[str, Fingerprint] | None = None,
    ) -> None:
        """Show a fingerprint; ``floor`` in its ``value_unit``; without curve where no effect is claimed.

        Args:
            look_alikes: by title, fingerprints over the same residual whose curves are drawn as well.
        """
        self.fingerprint, self._with_curve = fingerprint, with_curve
        self._look_alikes = dict(look_alikes or {})
        usable = fingerprint is not None and bool(np.isfinite(fingerprint.mean).any())
        for item in (self.floor_band, self.zero, self.bars, self.points, self.curve):
            item.setVisible(usable)
        self.empty.setVisible(not usable)
        plot = self.getPlotItem()
        for name in ("left", "bottom"):
            plot.getAxis(name).setStyle(showValues=usable)
        for old in self.alike.values():
            plot.removeItem(old)
        self.alike = {}
        if fingerprint is None or not usable:
            plot.setRange(xRange=(-1, 1), yRange=(-1, 1), padding=0)
            self._unit = None
            plot.setLabel("left", "")
            plot.setLabel("bottom", "")
            self.setAccessibleDescription("No fingerprint")
            return
        self._draw(fingerprint, floor, with_curve)

    def _draw(self, fingerprint: Fingerprint, floor: float | None, with_curve: bool) -> None:
        across = screen_unit(fingerprint.coordinate_unit, largest(fingerprint.centre))
        up = screen_unit(fingerprint.value_unit, max(largest(fingerprint.mean), floor or 0.0))
        known = np.isfinite(fingerprint.mean)
        x = fingerprint.centre[known] * across.factor
        mean, low, high, curve = (
            values[known] * up.factor
            for values in (fingerprint.mean, fingerprint.low, fingerprint.high, fingerprint.curve)
        )
        low, high = np.where(np.isfinite(low), low, mean), np.where(np.isfinite(high), high, mean)
        self.points.setData(x, mean)
        self.bars.setData(x=x, y=mean, top=np.maximum(high - mean, 0), bottom=np.maximum(mean - low, 0))
        self.curve.setData(x, curve if with_curve else np.full(len(x), np.nan))
        for title, other in self._look_alikes.items():
            self._draw_alike(title, other, across.factor, up.factor)
        band = (floor or 0.0) * up.factor
        self.floor_band.setRegion((-band, band))
        plot = self.getPlotItem()
        coordinate = fingerprint.coordinate[:1].upper() + fingerprint.coordinate[1:]
        plot.setLabel("bottom", across.label(coordinate))
        self._unit = up
        self._label_left()
        # The edges of the floor stay in view: inside it, a residual says nothing. A look-alike may be many
        # times what was measured, and goes beyond the view.
        edges = [-1.1 * band, 1.1 * band]
        bottom, top = span_of(np.concatenate([low, high, curve if with_curve else mean, edges]))
        plot.setRange(xRange=span_of(x), yRange=(bottom, top), padding=0)
        self.setAccessibleDescription(
            f"{equation_of(fingerprint.equation).quantity} residual in {up.symbol} against "
            f"{fingerprint.coordinate} in {across.symbol}, {int(known.sum())} bins"
        )

    def _draw_alike(self, title: str, other: Fingerprint, across: float, up: float) -> None:
        """The curve of a look-alike; ``across`` and ``up``: factors to the units of the screen."""
        known = np.isfinite(other.curve)
        self.alike[title] = item = pg.PlotCurveItem(
            other.centre[known] * across, other.curve[known] * up, antialias=True, name=title
        )
        item.setPen(self._dotted())
        item.setZValue(1)  # seen where it lies on the effect's own
        self.getPlotItem().addItem(item, ignoreBounds=True)

    def _dotted(self) -> QPen:
        pen = line(colours_of(self).alike, 2 * self.devicePixelRatioF())
        pen.setStyle(Qt.PenStyle.DotLine)
        return pen

    def shown_series(self) -> list[Series]:
        """For CSV: bins with their interval, the curves of look-alikes, the effect's own where claimed."""
        shown = self.fingerprint
        if shown is None or self._unit is None:
            return []
        drawn = [("mean residual", shown, shown.mean), ("lower end of the 90 % interval", shown, shown.low)]
        drawn += [("upper end of the 90 % interval", shown, shown.high)]
        drawn += [(f"{title}'s curve", one, one.curve) for title, one in self._look_alikes.items()]
        drawn += [("the effect's own curve", shown, shown.curve)] if self._with_curve else []
        across, up = screen_unit(shown.coordinate_unit, largest(shown.centre)), self._unit
        coordinate = across.label(shown.coordinate[:1].upper() + shown.coordinate[1:])
        return [
            Series(name, coordinate, up.label("Residual"), one.centre * across.factor, y * up.factor)
            for name, one, y in drawn
        ]

    def _label_left(self) -> None:
        if self._unit is not None:
            label_left(self.getPlotItem(), "Residual", self._unit)

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.DevicePixelRatioChange:
            self._recolour()  # pens are in device pixels
        return bool(super().event(event))

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "empty"):
            self._recolour()

    def _recolour(self) -> None:
        colours = colours_of(self)
        width = self.devicePixelRatioF()
        self.setBackground(colours.surface)
        colour_plot(self.getPlotItem(), colours)
        self.zero.setPen(line(colours.muted))
        self.bars.setData(pen=line(colours.residual, 1.5 * width))
        self.points.setPen(line(colours.residual))
        self.points.setBrush(pg.mkBrush(colours.residual))
        self.curve.setPen(line(colours.candidate, 2 * width))
        for other in self.alike.values():
            other.setPen(self._dotted())
        self.floor_band.setBrush(tint(colours.floor, 0.35))
        for edge in self.floor_band.lines:
            edge.setPen(pg.mkPen(None))
        self.empty.setColor(colours.muted)


LEAST_PLOT = 104
"""Height of the fingerprint from which its shape is seen, px."""


class EvidencePanel(QWidget):
    """Shows one candidate, or one of the two outcomes, with the picture that supports it."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.title = described(ElidedLabel(), role="heading")
        font = self.title.font()
        font.setBold(True)
        self.title.setFont(font)
        self.title.setObjectName("evidenceTitle")
        self.explanation = described(WholeLabel(), "explanation", font=small_font())
        self.plot = FingerprintPlot()
        self.plot.setMinimumHeight(LEAST_PLOT)
        layout = vbox(self, self.title, self.explanation, margins=FLUSH, spacing=4)
        keys = hbox(None, margins=(72, 0, 0, 0))
        self.keys = LegendKeys(FINGERPRINT, wraps=True)
        keys.addWidget(self.keys)
        layout.addLayout(keys)
        layout.addWidget(self.plot, 1)

    def show_choice(self, key: str | None, diagnosis: Diagnosis | None) -> None:
        """Show an effect (by id) or an outcome of a diagnosis; None clears the panel."""
        if key is None or diagnosis is None:
            for label in (self.title, self.explanation):
                label.setText("")
            self.plot.show_fingerprint(None)
            return
        candidate = find_candidate(diagnosis, key)
        if candidate is not None:
            self._show_candidate(candidate, diagnosis)
        elif key in OUTCOME_TITLES:
            self._show_outcome(key, diagnosis)

    def _show_candidate(self, candidate: Candidate, diagnosis: Diagnosis) -> None:
        self.title.setText(candidate.title)
        words = printed(candidate.explanation)
        self.explanation.setText(words)
        self.explanation.setToolTip(words)
        self.title.setToolTip(_strength(candidate, LineUnits(diagnosis.line_radius)))
        shown, alike = candidate.fingerprint, look_alikes(candidate, diagnosis)
        self.keys.set_keys(LOOK_ALIKES if alike else FINGERPRINT)
        self.plot.show_fingerprint(shown, _floor(shown, diagnosis), look_alikes=alike)
        dotted = f"Dotted, what could not be told from it: {listed(list(map(in_sentence, alike)))}; "
        dotted += "what goes beyond the data and this effect is cut. "
        self.plot.setToolTip(_plot_help(shown, with_curve=True) + (dotted.rstrip() if alike else ""))

    def _show_outcome(self, outcome: str, diagnosis: Diagnosis) -> None:
        self.title.setText(OUTCOME_TITLES[outcome])
        text = outcome_explanation(outcome, diagnosis)
        self.explanation.setText(text)
        self.explanation.setToolTip(text)
        shown = next((c.fingerprint for c in diagnosis.candidates if c.fingerprint is not None), None)
        self.keys.set_keys(RESIDUAL_ONLY)
        self.plot.show_fingerprint(shown, _floor(shown, diagnosis), with_curve=False)
        self.plot.setToolTip(_plot_help(shown, with_curve=False))


def look_alikes(candidate: Candidate, diagnosis: Diagnosis) -> dict[str, Fingerprint]:
    """Of an effect of the set: the others, by title, whose curves can be drawn over the same residual."""
    own, alike = candidate.fingerprint, suspects(diagnosis)
    if own is None or candidate.effect not in alike:
        return {}
    return {
        one.title: one.fingerprint
        for one in diagnosis.candidates
        if one.effect in alike
        and one is not candidate
        and one.fingerprint is not None
        # Of other coordinates the residual is another picture.
        and (one.fingerprint.equation, one.fingerprint.coordinate) == (own.equation, own.coordinate)
    }


def _strength(candidate: Candidate, line: LineUnits) -> str:
    """Where the effect acts and how strong it is, a line each; ``line``: that its numbers are told in."""
    lines = [candidate.title]
    if candidate.equations:
        lines.append(f"acts in: {listed([_place(name) for name in candidate.equations])}")
    titles = parameter_titles(candidate.effect, list(candidate.parameters))
    lines += [f"{line.title(titles[name])} {estimate_text(p)}" for name, p in candidate.parameters.items()]
    if candidate.parameters:
        lines.append("fitted, with 90 % interval")
    return "\n".join(lines)


def _place(name: str) -> str:
    return in_sentence(EQUATIONS[name].title if name in EQUATIONS else FAMILY_TITLES.get(name, name))


def _floor(fingerprint: Fingerprint | None, diagnosis: Diagnosis) -> float | None:
    """The floor of the fingerprint's equation, where it is in the fingerprint's unit."""
    if fingerprint is None:
        return None
    for comparison in diagnosis.comparisons:
        if comparison.equation == fingerprint.equation and comparison.unit == fingerprint.value_unit:
            return comparison.floor
    return None


def _plot_help(fingerprint: Fingerprint | None, with_curve: bool) -> str:
    if fingerprint is None:
        return ""
    text = (
        f"Residual of the {equation_of(fingerprint.equation).quantity} equation, averaged in bins of "
        f"{fingerprint.coordinate}: points with the 90 % interval of the mean (orange). "
    )
    if with_curve:
        text += "What the fitted effect itself contributes: green line. "
    return text + "Grey band: floor. " + FLOOR_HELP
