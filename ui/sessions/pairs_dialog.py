"""Dialog over two sessions: runs of the same motion over one another, channel by channel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import QHeaderView, QLabel, QTableWidgetItem, QWidget

from fingerlab.core.text import ScreenUnit, fixed, largest_of, screen_unit
from fingerlab.diagnosis.settings import Z90
from fingerlab.report.comparison_words import (
    NOTABLE,
    cell,
    channel_title,
    channels_of,
    pair_title,
    pairs_sentence,
)
from fingerlab.sessions.model import CHANNEL_UNITS, Array
from fingerlab.signals.run_pairs import ChannelPair, RunPair, SessionPair

from ..widgets.layout import ResultDialog, described
from ..widgets.plots import QuietPlot, plain_curve, span_of
from ..widgets.series import Series
from ..widgets.tables import NumberTable, WholeLabel, remark
from ..widgets.theme import colours_of, small_font, tint

PAIRS_WIDTH, PAIRS_HEIGHT = 980, 720
ROOM = 6
"""About the words of a row, px."""
STRONGEST, MOST_TIMES = 0.45, 20.0
"""Tint of a cell, and the difference over the scatter from which on it is no stronger."""


class PairPlot(QuietPlot):
    """One channel of a pair: both courses, or the second less the first with the scatter of a cycle."""

    def __init__(self, name: str, accessible: str, difference: bool, parent: QWidget | None = None) -> None:
        self._difference = difference
        self._pair: tuple[RunPair, str, tuple[str, str]] | None = None
        super().__init__(name, accessible, parent)
        self.setToolTip(
            "Second less first; the band is what one cycle differs by from another of its run (90 %)."
            if difference
            else "Mean cycles of both runs; phase 0 is where the motor passes its mean, rising."
        )

    def show_pair(self, pair: RunPair | None, channel: str, names: tuple[str, str]) -> None:
        """Show a channel of a pair; ``names`` of the two sessions."""
        self._pair = (pair, channel, names) if pair is not None and channel in pair.channels else None
        self.redraw()

    def _curves(self) -> tuple[RunPair, ChannelPair, ScreenUnit, list[tuple[str, Array]]]:
        assert self._pair is not None
        pair, channel, names = self._pair
        one = pair.channels[channel]
        curves = list(zip(names, (one.first, one.second), strict=True))
        if self._difference:
            curves = [("second less first", one.second - one.first)]
        unit = screen_unit(CHANNEL_UNITS[channel], largest_of(float(np.abs(y).max()) for _, y in curves))
        return pair, one, unit, [(name, y * unit.factor) for name, y in curves]

    def redraw(self) -> None:
        plot = self.getPlotItem()
        plot.clear()
        if self._pair is None:
            return
        pair, one, unit, curves = self._curves()
        title = "Difference" if self._difference else channel_title(self._pair[1])
        self.name_axes(title, unit, "Phase (of a cycle)" if pair.periodic else "Time (s)")
        values = [y for _, y in curves]
        if self._difference:
            half = Z90 * one.scatter * unit.factor
            zero = np.zeros(len(pair.axis))
            self.draw_band(pair.axis, zero, half, tint(colours_of(self).floor, 0.35), "scatter")
            values += [half[np.isfinite(half)], -half[np.isfinite(half)]]
        roles = ("residual",) if self._difference else ("measured", "modelled")
        for number, (role, (name, y)) in enumerate(zip(roles, curves, strict=True)):
            plot.addItem(plain_curve(pair.axis, y, self.pen(role, 1.5, dashed=number == 1), name))
        plot.setRange(
            xRange=(pair.axis[0], pair.axis[-1]), yRange=span_of(np.concatenate(values)), padding=0.0
        )

    def shown_series(self) -> list[Series]:
        """For CSV."""
        if self._pair is None:
            return []
        pair, _, unit, curves = self._curves()
        across = "Phase (of a cycle)" if pair.periodic else "Time (s)"
        label = unit.label(channel_title(self._pair[1]))
        return [Series(name, across, label, pair.axis, y) for name, y in curves]


class PairsDialog(ResultDialog):
    """A row for each pair of runs, a column for each channel; a click draws it."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent, "runPairs", "Compared run by run", PAIRS_WIDTH, PAIRS_HEIGHT)
        self.words = described(WholeLabel(), "pairWords", font=small_font())
        self.table = NumberTable("pairTable", "Differences of runs of the same motion", ())
        self.table.setSelectionBehavior(NumberTable.SelectionBehavior.SelectItems)
        self.table.setWordWrap(False)
        self.table.verticalHeader().setDefaultSectionSize(QFontMetrics(small_font()).height() + ROOM)
        self.table.currentCellChanged.connect(lambda *_: self._show_chosen())
        self.title = described(QLabel(), "pairTitle", font=small_font())
        self.curves = PairPlot("pairCurves", "Both runs over one another", difference=False)
        self.difference = PairPlot("pairDifference", "Second run less the first", difference=True)
        self._found: SessionPair | None = None
        self._channels: Sequence[str] = ()
        hint = remark(
            "A number is the root mean square of the second less the first, and in brackets how many times "
            "the scatter of a cycle that is. A click draws it; Ctrl+C copies the table."
        )
        plots = (self.curves, 3), (self.difference, 2)
        self.lay_out(self.words, (self.table, 3), self.title, *plots, hint)

    def show_pair(self, found: SessionPair) -> None:
        """Show two sessions that were compared."""
        self._found = found
        self.words.setText(" ".join((pairs_sentence(found), *found.refused)))
        units = channels_of(found)
        self._channels = tuple(units)
        columns = [("Runs", "Of the first session and of the second."), ("Motion", "That both were told.")]
        columns += [
            (unit.label(channel_title(n)), f"{channel_title(n)}: difference.") for n, unit in units.items()
        ]
        self.table.set_columns(columns, words=2)
        self.table.setRowCount(len(found.pairs))
        colour = colours_of(self).residual
        for row, pair in enumerate(found.pairs):
            for column, text in enumerate(pair_title(pair)):
                item = QTableWidgetItem(text)
                item.setToolTip(text)
                self.table.setItem(row, column, item)
            for column, (name, unit) in enumerate(units.items(), start=2):
                shown = cell(pair, name, unit)
                item = QTableWidgetItem(shown.text)
                item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                item.setToolTip(shown.help)
                if shown.times > NOTABLE:
                    item.setBackground(tint(colour, STRONGEST * min(shown.times / MOST_TIMES, 1.0)))
                self.table.setItem(row, column, item)
        header = self.table.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(1, QHeaderView.ResizeMode.Stretch)
        self.table.setCurrentCell(0, 2 + max(self._strongest(found), 0))
        self._show_chosen()

    def _strongest(self, found: SessionPair) -> int:
        """The channel that differs most in the first pair, by its scatter."""
        first = found.pairs[0].channels if found.pairs else {}
        times = [first[n].times if n in first else 0.0 for n in self._channels]
        return int(np.argmax(np.nan_to_num(times))) if times else 0

    def _show_chosen(self) -> None:
        row, column = self.table.currentRow(), self.table.currentColumn() - 2
        found = self._found
        if found is None or not 0 <= row < len(found.pairs):
            return
        pair = found.pairs[row]
        channel = self._channels[min(max(column, 0), len(self._channels) - 1)]
        names = found.first.path.name, found.second.path.name
        lag = f"; the second was shifted by {fixed(1e3 * pair.lag, 0)} ms" if abs(pair.lag) > 5e-4 else ""
        cycles = f", {pair.cycles[0]} and {pair.cycles[1]} cycles" if pair.periodic else ""
        self.title.setText(
            f"{channel_title(channel)}, runs {pair_title(pair)[0]}: {names[0]} (solid), {names[1]} (dashed)"
            f"{cycles}{lag}"
        )
        for plot in (self.curves, self.difference):
            plot.show_pair(pair, channel, names)
