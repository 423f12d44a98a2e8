"""All live plots with one time axis: live or held, scrolled back, triggered, with cursors and marks."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QScrollBar, QWidget

from fingerlab.acquisition.recording import crossings
from fingerlab.core.text import with_minus

from ..widgets.free_plots import TIME, FreePlots
from ..widgets.layout import FLUSH, vbox
from ..widgets.tables import remark
from .live_history import PLOTS, QUANTITIES, LiveHistory
from .live_pane import LivePane

WINDOWS_S = (2.0, 5.0, 10.0, 30.0, 60.0, 120.0)
SHORTEST_S = 0.02
"""Closer than twenty samples there is nothing to see."""

BEFORE_TRIGGER = 0.1
"""Share of the window before a trigger."""


@dataclass
class Trigger:
    """Where the display starts: ``column`` crosses ``level`` (SI) upwards or downwards."""

    on: bool = False
    column: str = "motor_position"
    level: float = 0.0
    rising: bool = True


class LivePlots(QWidget):
    """Signals: held_changed(on); cursors_moved(times, differences, values): empty for no cursors."""

    held_changed = Signal(bool)
    cursors_moved = Signal(str, str, str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.panes = {spec.key: LivePane(spec) for spec in PLOTS}
        titles = {spec.key: spec.title for spec in PLOTS if not spec.model}
        self.free = FreePlots(QUANTITIES, titles, ("motor_torque", "motor_position"))
        self.free.changed.connect(self._arrange)
        self.free.wanted.connect(self._draw_free)
        self._models = (False, False)
        self.history: LiveHistory | None = None
        self.window_s = 10.0
        self.held = False
        self.trigger = Trigger()
        self.triggered_at: int | None = None
        self._stop = 0
        self._cursors: list[float] | None = None
        self._marks: list[tuple[float, str]] = []
        self.scroll_bar = QScrollBar(Qt.Orientation.Horizontal)
        self.scroll_bar.setAccessibleName("Scroll back through the last minutes")
        self.scroll_bar.setToolTip("Scroll back through the last four minutes; the end is now.")
        self.scroll_bar.valueChanged.connect(self._on_scrolled)
        layout = vbox(self, margins=FLUSH, spacing=4)
        for pane in self.panes.values():
            layout.addWidget(pane, pane.spec.share)
            pane.moved_by_hand.connect(self._on_hand)
            pane.cursor_moved.connect(self._on_cursor)
        self.none_seen = remark("None of these plots is seen; Plots, above, brings them back.")
        self.none_seen.setAlignment(Qt.AlignmentFlag.AlignCenter)
        layout.addWidget(self.none_seen, 1)
        layout.addWidget(self.scroll_bar)
        self.show_model(False, False)

    # what is shown

    def show_history(self, history: LiveHistory | None) -> None:
        """Another bench."""
        self.history = history
        self._marks.clear()
        self._stop = 0
        self.triggered_at = None
        for pane in self.panes.values():
            pane.show_marks(())
        self.hold(False)
        self.refresh()

    def show_model(self, torque: bool, force: bool) -> None:
        """Whether the modelled torque and the modelled force are shown, each with its residual."""
        self._models = (torque, force)
        for key, pane in self.panes.items():
            pane.show_model(force if key.startswith("force") else torque)
        self._arrange()

    def _arrange(self) -> None:
        """Which plots are seen: those that belong to what is shown, and are not left out."""
        last = None
        for key, pane in self.panes.items():
            on = self._models[1 if key.startswith("force") else 0]
            whole = key.removesuffix("_residual")
            pane.setVisible((on or not pane.spec.model) and whole not in self.free.left_out)
            if not pane.isHidden():
                last = pane
        self.none_seen.setVisible(last is None)
        for pane in self.panes.values():
            pane.show_time_axis(pane is last)
        self.refresh()

    def set_window(self, seconds: float) -> None:
        """How much time is shown."""
        self.window_s = seconds
        self.refresh()

    def hold(self, on: bool) -> None:
        """Keep the picture still, or follow the bench again."""
        if on != self.held:
            self.held = on
            self.held_changed.emit(on)

    def mark(self, index: int, note: str) -> None:
        """A line with a note at a sample."""
        if self.history is not None:
            self._marks.append((index / self.history.rate_hz, note))
            for pane in self.panes.values():
                pane.show_marks(self._marks)

    def tick(self, numbers: bool = True, live: bool = True) -> None:
        """New samples may be there; ``numbers``: show the readings and the scroll bar, too.

        Without a ``live`` device no reading is shown: the last one is none of now.
        """
        history = self.history
        if history is None or not (self.isVisible() or self.free.isVisible()):
            return
        if not self.held:
            self._stop = self._live_stop(history)
            self._draw_panes()
            if numbers:
                self._draw_free(in_turn=True)
        if not numbers:
            return
        for pane in self.panes.values():
            for column, reading in pane.readings.items():
                reading.show_value(history.value(column, history.stop - 1) if live else math.nan)
        if self._cursors is not None and not self.held:
            self._tell_cursors()
        self._show_scroll(history)

    def refresh(self) -> None:
        """Draw again what is shown, live or held."""
        history = self.history
        if history is None:
            return
        if not self.held:
            self._stop = self._live_stop(history)
        self._draw()
        self._show_scroll(history)

    @property
    def shown(self) -> tuple[int, int]:
        """First sample shown, and the one after the last."""
        assert self.history is not None
        return self._stop - round(self.window_s * self.history.rate_hz), self._stop

    def _draw(self) -> None:
        """All that is seen."""
        self._draw_panes()
        self._draw_free()

    def _draw_panes(self) -> None:
        assert self.history is not None
        start, stop = self.shown
        for pane in self.panes.values():
            if not (pane.isHidden() or self.isHidden()):
                pane.show_part(self.history, start, stop)

    def _draw_free(self, in_turn: bool = False) -> None:
        """The user's own plots, of what the others show; or the one of them whose turn it is."""
        history = self.history
        plots = self.free.next() if in_turn else self.free.plots
        if history is None or not plots:
            return
        start, stop = self.shown
        names = self.free.names(plots)
        samples = {name: history.series(name, start, stop)[1].copy() for name in names}
        first = max(start, history.first)
        time = (first + np.arange(len(next(iter(samples.values()), ())))) / history.rate_hz
        for plot in plots:
            plot.show_samples({**samples, TIME: time}, history.rate_hz, newest=not self.held)

    def _live_stop(self, history: LiveHistory) -> int:
        if not self.trigger.on:
            wide = round(self.window_s * history.rate_hz)
            return max(history.stop, history.first + wide)  # the first seconds fill the picture from the left
        after = round(self.window_s * (1 - BEFORE_TRIGGER) * history.rate_hz)
        found = last_crossing(history, self.trigger, history.stop - after)
        if found is not None:
            self.triggered_at = found
        if self.triggered_at is None:
            return self._stop or history.stop
        return self.triggered_at + after

    # by hand

    def _show_scroll(self, history: LiveHistory) -> None:
        """The scroll bar's unit is a millisecond; its length, what is kept."""
        wide = round(self.window_s * history.rate_hz)
        with QSignalBlocker(self.scroll_bar):
            self.scroll_bar.setRange(
                history.first + min(wide, len(history)), max(history.stop, history.first)
            )
            self.scroll_bar.setPageStep(wide)
            self.scroll_bar.setSingleStep(max(wide // 20, 1))
            self.scroll_bar.setValue(self._stop)

    def scroll_by(self, share: float) -> None:
        """Hold, and go back (negative) or forward by a share of what is shown."""
        history = self.history
        if history is not None:
            step = round(share * self.window_s * history.rate_hz)
            self._on_scrolled(min(max(self._stop + step, history.first + 1), history.stop))
            self._show_scroll(history)

    def _on_scrolled(self, stop: int) -> None:
        self.hold(True)
        self._stop = stop
        self._draw()

    def _on_hand(self, left: float, right: float) -> None:
        """The user has panned or zoomed in one plot: hold, and let the others follow."""
        history = self.history
        if history is None:
            return
        self.hold(True)
        self.window_s = max(right - left, SHORTEST_S)
        self._stop = min(max(round(right * history.rate_hz), history.first + 1), history.stop)
        self._draw()
        self._show_scroll(history)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        history = self.history
        key = event.key()
        if history is None:
            super().keyPressEvent(event)
        elif key in (Qt.Key.Key_Left, Qt.Key.Key_Right):
            self.scroll_by(0.1 if key == Qt.Key.Key_Right else -0.1)
        elif key in (Qt.Key.Key_Plus, Qt.Key.Key_Equal, Qt.Key.Key_Minus):
            self.window_s *= 1.5 if key == Qt.Key.Key_Minus else 1 / 1.5
            self.window_s = min(max(self.window_s, SHORTEST_S), len(history) / history.rate_hz + 1.0)
            self.refresh()
        elif key == Qt.Key.Key_Home:
            self.hold(False)
            self.refresh()
        else:
            super().keyPressEvent(event)

    # cursors

    def show_cursors(self, on: bool) -> None:
        """Two cursors at a third and two thirds of what is shown, or none."""
        self._cursors = None
        if on and self.history is not None:
            start, stop = (edge / self.history.rate_hz for edge in self.shown)
            self._cursors = [start + (stop - start) / 3, start + 2 * (stop - start) / 3]
        for pane in self.panes.values():
            pane.show_cursors(self._cursors)
        self._tell_cursors()

    def _on_cursor(self, number: int, time: float) -> None:
        if self._cursors is not None:
            self._cursors[number] = time
            for pane in self.panes.values():
                pane.show_cursors(self._cursors)
            self._tell_cursors()

    def _tell_cursors(self) -> None:
        if self._cursors is None or self.history is None:
            self.cursors_moved.emit("", "", "")
            return
        a, b = self._cursors
        times = f"A {a:.3f} s, B {b:.3f} s, B − A: {b - a:+.3f} s"
        times += f" ({1 / abs(b - a):.2f} Hz)" if b != a else ""
        history, values, differences = self.history, [times], []
        for pane in self.panes.values():
            for column in pane.spec.readings:
                at = [history.value(column, round(time * history.rate_hz)) for time in (a, b)]
                if all(value == value for value in at):
                    quantity = QUANTITIES[column]
                    values.append(f"{quantity.title}: A {quantity.text(at[0])}, B {quantity.text(at[1])}")
                    title = quantity.title if quantity.title.isupper() else quantity.title.lower()
                    differences.append(f"{title} {quantity.text(at[1] - at[0])}")
        texts = (times, f"B − A: {', '.join(differences)}", "\n".join(values))
        self.cursors_moved.emit(*(with_minus(text) for text in texts))


def last_crossing(history: LiveHistory, trigger: Trigger, before: int) -> int | None:
    """The newest sample before ``before`` at which the trigger's level was crossed; None for none."""
    first, values = history.series(trigger.column, before - round(4 * history.rate_hz), before)
    if len(values) < 2:
        return None
    crossed = crossings(values, trigger.level, trigger.rising)
    return first + int(crossed[-1]) if len(crossed) else None


def level_of(history: LiveHistory | None, column: str) -> float:
    """The middle of what a quantity did in the last seconds: a level that it is sure to cross."""
    if history is None:
        return 0.0
    _, values = history.series(column, history.stop - round(5 * history.rate_hz), history.stop)
    good = values[np.isfinite(values)]
    return 0.0 if not len(good) else math.fsum((float(good.min()), float(good.max()))) / 2
