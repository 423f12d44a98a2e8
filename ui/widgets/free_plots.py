"""Plots of the user's own: any channel over any other, over time, or its spectrum; which plots are seen.

What is arranged is kept at once, and stands there again at the next start. pyqtgraph is imported with the
first plot: without one the window opens sooner.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import QCheckBox, QComboBox, QLabel, QPushButton, QSplitter, QToolButton, QWidget

from fingerlab.core.text import ScreenUnit
from fingerlab.sessions.model import Array

from .beside_plots import BesidePlots, own_switch
from .fields import choice, form_menu
from .layout import FLUSH, described, hbox, vbox
from .series import envelope
from .tables import remark

if TYPE_CHECKING:
    from ..app.context import Settings

TIME, FREQUENCY = "time", "frequency"
"""What a channel can be drawn over besides another channel."""
MOST_PLOTS = 4
MOST_POINTS, LOOP_POINTS = 4000, 1000
"""Of a curve on the screen: more would cost time and show nothing. A loop is drawn through means of
neighbouring samples, or its noise would hide it."""
SPECTRUM_HZ = 100.0
"""Of a spectrum: motions are below 10 Hz, the mains and its double at 50 and 100 Hz."""
SEGMENT_S = 4.0
"""A spectrum tells a quarter of a hertz apart."""
SMALLEST_DB = -120.0
SHRINK_BELOW = 0.35
"""A scale is tightened when its data fill less than this share of it."""
LEAST_WIDTH, LEAST_HEIGHT = 200, 150
WIDTH = 300
MOST_HEIGHT = 1 << 15
"""px; what settings say beyond it is no height."""


LOOP_HELP = "A loop goes through means of neighbouring samples, a thousand in what is shown."


class Channel(Protocol):
    """What a plot has to know of a channel."""

    @property
    def title(self) -> str: ...
    @property
    def unit(self) -> ScreenUnit: ...


class FreePlot(QWidget):
    """One plot with a list for each axis. Signals: changed; removed(self)."""

    changed = Signal()
    removed = Signal(object)

    def __init__(self, number: int, channels: Mapping[str, Channel], up: str, across: str) -> None:
        from .plots import HELP, LookBox, QuietPlot

        super().__init__()
        self.up = choice(f"freeUp{number}", {}, "Drawn: the channel of the upright axis.")
        self.across = choice(f"freeAcross{number}", {}, "Over: another channel, the time, or the frequency.")
        for field in (self.up, self.across):
            field.setMinimumContentsLength(6)
            field.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
            field.activated.connect(self._on_chosen)
        self.gone = described(QToolButton(), f"freeGone{number}", "Remove this plot", "Remove this plot.")
        self.gone.setText("×")
        self.gone.setAutoRaise(True)
        self.gone.clicked.connect(lambda: self.removed.emit(self))
        box = LookBox()
        self.plot = QuietPlot(f"freePlot{number}", "Plot of one's own", box=box)
        self.plot.setToolTip(f"{LOOP_HELP}\n{HELP}")
        self._by_hand = False
        box.sigRangeChangedManually.connect(lambda *_: self._keep_view(True))
        box.whole_asked.connect(lambda: self._keep_view(False))
        self._channels: Mapping[str, Channel] = {}
        self._samples: Mapping[str, Array] = {}
        self._rate, self._newest = 1.0, False
        self._curve: Any = None
        first = hbox(None, (self.up, 1), self.gone, margins=(8, 0, 0, 0), spacing=4)
        second = hbox(None, QLabel("over"), (self.across, 1), margins=(8, 0, 0, 0), spacing=4)
        vbox(self, first, second, (self.plot, 1), margins=FLUSH, spacing=4)
        self.setMinimumSize(LEAST_WIDTH, LEAST_HEIGHT)
        self.offer(channels, up, across)

    @property
    def spec(self) -> tuple[str, str]:
        """What is drawn, over what."""
        return str(self.up.currentData()), str(self.across.currentData())

    def offer(self, channels: Mapping[str, Channel], up: str = "", across: str = "") -> None:
        """Other channels; what was chosen stays, also where it is not there now."""
        up, across = up or self.spec[0], across or self.spec[1]
        self._channels = channels
        over = {TIME: "time", FREQUENCY: "frequency (spectrum)"}
        for field, wanted, more in ((self.up, up, {}), (self.across, across, over)):
            field.clear()
            for key, words in {**{k: c.title for k, c in channels.items()}, **more}.items():
                field.addItem(words, key)
            if field.findData(wanted) < 0:
                field.addItem(wanted.replace("_", " "), wanted)
            field.setCurrentIndex(field.findData(wanted))
        self._draw()

    def _on_chosen(self) -> None:
        self._keep_view(False)
        self.changed.emit()

    def _keep_view(self, by_hand: bool) -> None:
        self._by_hand = by_hand
        if not by_hand:
            self._seen: tuple[Any, ...] = ()
            self._draw()

    def show_samples(self, samples: Mapping[str, Array], rate_hz: float, newest: bool) -> None:
        """Draw samples of one stretch, (n,) each, SI; ``newest``: the last of them is now, and is marked."""
        self._samples, self._rate, self._newest = samples, rate_hz, newest
        self._draw()

    def curve(self) -> tuple[Array, Array]:
        """What is drawn, in the units of the axes."""
        up, across = self.spec
        values = self._samples.get(up)
        if values is None or up not in self._channels:
            return np.empty(0), np.empty(0)
        y = values * self._channels[up].unit.factor
        if across == FREQUENCY:
            return _spectrum(y, self._rate)
        if across == TIME:
            time = self._samples.get(TIME)
            return envelope(np.arange(len(y)) / self._rate if time is None else time, y, MOST_POINTS // 2)
        if across in self._channels and across in self._samples:
            x = self._samples[across] * self._channels[across].unit.factor
            every = max(-(-len(y) // LOOP_POINTS), 1)
            first = len(y) % every  # so that the newest are among them
            x, y = (np.mean(values[first:].reshape(-1, every), axis=1) for values in (x, y))
            return x, y
        return np.empty(0), np.empty(0)

    def _draw(self) -> None:
        import pyqtgraph as pg

        item = self.plot.getPlotItem()
        up, across = self.spec
        if self._curve is None:
            self._curve = pg.PlotCurveItem(connect="finite", name="")
            self._dot = pg.ScatterPlotItem(size=7, pen=None)
            self._seen = ()
            item.addItem(self._curve)
            item.addItem(self._dot, ignoreBounds=True)
            self.plot.redraw = self._recolour  # type: ignore[method-assign]
            self._recolour()
        x, y = self.curve()
        drawn, over = self._channels.get(up), self._channels.get(across)
        self._curve.opts["name"] = drawn.title if drawn is not None else up
        self._curve.setData(x, y)
        loop = across not in (TIME, FREQUENCY)
        marked = self._newest and loop and len(x) > 0 and np.isfinite(x[-1]) and np.isfinite(y[-1])
        self._dot.setData(*((x[-1:], y[-1:]) if marked else ((), ())))
        if drawn is not None:
            unit = drawn.unit
            if across == FREQUENCY:
                unit = ScreenUnit(f"dB re 1 {unit.symbol}/√Hz", 1.0)
            words = {TIME: "Time (s)", FREQUENCY: "Frequency (Hz)"}.get(across, "")
            words = over.unit.label(_capital(over.title)) if over is not None and loop else words
            named = (_capital(drawn.title), unit, words)
            if getattr(self, "_named", None) != named:
                self._named = named
                self.plot.name_axes(*named)
        description = f"{self.up.currentText()} over {self.across.currentText()}"
        self.plot.setAccessibleDescription(description if len(x) else f"{description}: nothing recorded")
        if len(x) and not self._by_hand:
            self._fit(x, y)

    def _fit(self, x: Array, y: Array) -> None:
        """Ranges that hold all, and stay while the data fill them well."""
        from .plots import span_of

        ranges = []
        for number, values in enumerate((x, y)):
            finite = values[np.isfinite(values)]
            if not len(finite):
                return
            low, high = float(finite.min()), float(finite.max())
            before = self._seen[number] if self._seen else None
            fits = before is not None and before[0] <= low and high <= before[1]
            filled = before is not None and high - low >= SHRINK_BELOW * (before[1] - before[0])
            still = fits and filled and self.spec[1] != TIME
            ranges.append(before if still and before is not None else span_of(finite))
        if tuple(ranges) != self._seen:
            self._seen = tuple(ranges)
            self.plot.getPlotItem().setRange(xRange=ranges[0], yRange=ranges[1], padding=0)

    def _recolour(self) -> None:
        if self._curve is not None:
            self._curve.setPen(self.plot.pen("measured", 1.0))
            self._dot.setBrush(self.plot.pen("accent").color())


def _capital(title: str) -> str:
    return title[:1].upper() + title[1:]


def _spectrum(y: Array, rate_hz: float) -> tuple[Array, Array]:
    """Hz, and decibels above one unit a root of a hertz."""
    from fingerlab.signals.prepare import amplitude_density

    found = amplitude_density(y, rate_hz, SEGMENT_S)
    if found is None:
        return np.empty(0), np.empty(0)
    frequency, amplitude = (values[found[0] <= SPECTRUM_HZ] for values in found)
    return frequency, np.asarray(20.0 * np.log10(np.maximum(amplitude, 10.0 ** (SMALLEST_DB / 20.0))))


class FreePlots(QWidget):
    """A column of the user's own plots, and which of the page's plots are left out.

    Signals: changed: another arrangement; wanted: other samples are needed.
    """

    changed = Signal()
    wanted = Signal()

    def __init__(
        self, channels: Mapping[str, Channel], fixed: Mapping[str, str], first: tuple[str, str]
    ) -> None:
        """``fixed``: the page's own plots by key; ``first``: what a new plot shows."""
        super().__init__()
        self.setObjectName("freePlots")
        self.setAccessibleName("Plots of one's own")
        self._channels, self.fixed, self._first = channels, dict(fixed), first
        self.titles = dict(fixed)
        self.left_out: frozenset[str] = frozenset()
        self.plots: list[FreePlot] = []
        self._made = self._turn = 0
        self._beside: BesidePlots | None = None
        self.switch = own_switch()
        self._keep: Callable[[str], None] = lambda _text: None
        self._stack = described(QSplitter(Qt.Orientation.Vertical, childrenCollapsible=False), "freeStack")
        self._stack.splitterMoved.connect(lambda *_: self._store())
        vbox(self, self._stack, margins=FLUSH)
        self.hide()

    def beside(self, page: QWidget) -> BesidePlots:
        """The page's own plots with these at their right."""
        self._beside = BesidePlots(page, self, self.switch, (3 * WIDTH, WIDTH))
        return self._beside

    def remember(self, settings: Settings, name: str) -> None:
        """Arrange the plots as they were left, as wide and as high as they were, and keep every change."""
        if self._beside is not None:
            self._beside.setObjectName(f"{name}Beside")
            self._beside.remember(settings)
        try:
            kept = json.loads(settings.arrangement(name) or "{}")
            left_out, free = kept.get("left_out", []), kept.get("free", [])
            pairs = [(str(up), str(across)) for up, across in free][:MOST_PLOTS]
            gone = frozenset(map(str, left_out))
            heights = [int(height) for height in kept.get("heights", [])]
        except (ValueError, TypeError, AttributeError, OverflowError):
            gone, pairs, heights = frozenset(), [], []
        self.left_out = frozenset(self.fixed) & gone
        for up, across in pairs:
            self._add(up, across)
        if len(heights) == len(self.plots) and all(0 < height < MOST_HEIGHT for height in heights):
            self._stack.setSizes(heights)
        self._keep = lambda text: settings.set_arrangement(name, text)
        self.changed.emit()

    def add(self) -> None:
        """One more plot."""
        if len(self.plots) < MOST_PLOTS:
            self._add(*self._first)
            if self._beside is not None:
                self._beside.bring_forward()
            self._on_changed()

    def _add(self, up: str, across: str) -> None:
        self._made += 1
        plot = FreePlot(self._made, self._channels, up, across)
        plot.changed.connect(self._on_changed)
        plot.removed.connect(self._remove)
        self.plots.append(plot)
        self._stack.addWidget(plot)
        self._show_if_any()

    def _remove(self, plot: FreePlot) -> None:
        self.plots.remove(plot)
        plot.setParent(None)  # the others take its place at once
        plot.deleteLater()
        self._show_if_any()
        self._on_changed()

    def _show_if_any(self) -> None:
        if self._beside is not None:
            self._beside.show_own(bool(self.plots))
        else:
            self.setVisible(bool(self.plots))

    def leave_out(self, key: str, out: bool) -> None:
        """Leave one of the page's own plots out, or show it again."""
        self.left_out = self.left_out | {key} if out else self.left_out - {key}
        self._on_changed()

    def _store(self) -> None:
        kept = {
            "left_out": sorted(self.left_out),
            "free": [plot.spec for plot in self.plots],
            "heights": self._stack.sizes(),
        }
        self._keep(json.dumps(kept))

    def _on_changed(self) -> None:
        self._store()
        self.changed.emit()
        self.wanted.emit()

    def offer(self, channels: Mapping[str, Channel]) -> None:
        """The channels of another run."""
        self._channels = channels
        for plot in self.plots:
            plot.offer(channels)

    def call(self, titles: Mapping[str, str]) -> None:
        """Titles of the page's own plots by key, for another run; those not named it cannot have."""
        self.titles = dict(titles)
        self.changed.emit()

    def names(self, plots: Sequence[FreePlot]) -> tuple[str, ...]:
        """Channels whose samples these plots draw."""
        every = [name for plot in plots for name in plot.spec if name in self._channels]
        return tuple(dict.fromkeys(every))

    def next(self) -> Sequence[FreePlot]:
        """The plot whose turn it is: drawn all at once they would hold up the pictures that move."""
        self._turn += 1
        return [self.plots[self._turn % len(self.plots)]] if self.plots else []

    def show_samples(self, samples: Mapping[str, Array], rate_hz: float) -> None:
        """Draw samples of one stretch in every plot; see :meth:`FreePlot.show_samples`."""
        for plot in self.plots:
            plot.show_samples(samples, rate_hz, newest=False)


class PlotsButton(QToolButton):
    """Opens a form: which of the page's plots are seen, and one more of one's own."""

    def __init__(self, plots: FreePlots) -> None:
        super().__init__()
        self._plots = plots
        described(self, "arrangePlots", "Plots", "Which plots are seen, and plots of your own.")
        self.setText("Plots")
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        form = QWidget()
        self.boxes: dict[str, QCheckBox] = {}
        for key, title in plots.fixed.items():
            self.boxes[key] = box = described(QCheckBox(title), f"shows_{key}")
            box.setChecked(True)
            box.toggled.connect(lambda on, k=key: plots.leave_out(k, not on))
        self.add = described(QPushButton("&Add a plot of your own"), "addPlot", tip=ADD_HELP)
        self.add.clicked.connect(plots.add)
        self.add.clicked.connect(lambda: form.window().close())
        vbox(form, *self.boxes.values(), self.add, remark(ADD_HELP), margins=(16, 8, 16, 8), spacing=8)
        form_menu(self, form)
        plots.changed.connect(self._follow)

    def _follow(self) -> None:
        for key, box in self.boxes.items():
            with QSignalBlocker(box):
                box.setChecked(key not in self._plots.left_out)
            box.setText(self._plots.titles.get(key, ""))
            box.setVisible(key in self._plots.titles)
        self.add.setEnabled(len(self._plots.plots) < MOST_PLOTS)


ADD_HELP = "Any channel over any other, over time, or its spectrum; at most four."
