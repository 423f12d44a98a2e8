"""Dialogs over several sessions: two of them run by run, and how a bench aged."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, Qt, Signal
from PySide6.QtGui import QFontMetrics, QMouseEvent
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QHeaderView, QLabel, QTableWidgetItem, QWidget

from fingerlab.batch.changes import LEAST_SESSIONS, Change, changes
from fingerlab.batch.table import (
    DAYS_A_MONTH,
    LEAST_TIMES,
    Contents,
    Trend,
    ageing_rows,
    days_of,
    number_of,
    recorded_at,
    trends,
)
from fingerlab.core.text import ScreenUnit, fixed, largest_of, percent, screen_unit
from fingerlab.report.comparison_words import (
    NOTABLE,
    cell,
    change_sentence,
    channel_title,
    channels_of,
    column_words,
    pair_title,
    pairs_sentence,
    trend_cells,
)
from fingerlab.sessions.model import CHANNEL_UNITS, Array
from fingerlab.signals.run_pairs import ChannelPair, RunPair, SessionPair

from ..widgets.layout import Spacer, described, vbox
from ..widgets.plots import QuietPlot, plain_curve, span_of
from ..widgets.series import Series
from ..widgets.tables import NumberTable, WholeLabel, heading, remark
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
            half = 1.645 * one.scatter * unit.factor
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


class PairsDialog(QDialog):
    """A row for each pair of runs, a column for each channel; a click draws it."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("runPairs")
        self.setWindowTitle("Compared run by run – FingerLab")
        self.resize(PAIRS_WIDTH, PAIRS_HEIGHT)
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
        close = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        close.rejected.connect(self.reject)
        hint = remark(
            "A number is the root mean square of the second less the first, and in brackets how many times "
            "the scatter of a cycle that is. A click draws it; Ctrl+C copies the table."
        )
        vbox(
            self, self.words, (self.table, 3), self.title, (self.curves, 3), (self.difference, 2), hint,
            close, spacing=8,
        )  # fmt: skip

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
                told = cell(pair, name, unit)
                item = QTableWidgetItem(told.text)
                item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                item.setToolTip(told.help)
                if told.times > NOTABLE:
                    item.setBackground(tint(colour, STRONGEST * min(told.times / MOST_TIMES, 1.0)))
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


WIDTH, HEIGHT = 940, 700
NEAR = 12
"""From so many px a click means a session."""
COLUMNS = (
    ("Quantity", "Of every session's final model, or of an effect fitted alone."),
    ("Median", "Of all sessions."),
    ("Unit", ""),
    ("Per month", "Median of the slopes of all pairs of sessions (Theil-Sen)."),
    ("90 % interval", "Of the slope. It leaves out zero for one steady quantity in ten by chance."),
    ("Sessions", "That have this number and a time."),
    ("A step", "Probability that it changed at one moment, and neither drifted nor stayed."),
)


class TrendPlot(QuietPlot):
    """One number over days. Signal ``session_asked(name)``: a click on a session."""

    session_asked = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        self.trend: Trend | None = None
        self.change: Change | None = None
        self._rows: list[dict[str, object]] = []
        self._unit = ScreenUnit("", 1.0)
        super().__init__("trendPlot", "One number of the bench over days", parent)
        self.setToolTip("A point is a session with its 90 % interval; a click marks it in the table behind.")

    def show_trend(self, rows: list[dict[str, object]], trend: Trend | None, change: Change | None) -> None:
        """Show one quantity of these rows, in the order of time."""
        self._rows = [row for row in rows if trend and np.isfinite(number_of(row.get(trend.column)))]
        self.trend, self.change = trend, change
        self.redraw()

    def _numbers(self) -> tuple[Array, Array, Array, Array]:
        """Days since the first session, values and both ends of their intervals, (n,) each."""
        assert self.trend is not None
        column, factor = self.trend.column, self._unit.factor
        days = days_of(self._rows)
        value, low, high = (
            np.array([number_of(row.get(column + end)) for row in self._rows]) * factor
            for end in ("", ".low", ".high")
        )
        return days - days[0], value, np.where(np.isfinite(low), low, value), np.where(
            np.isfinite(high), high, value
        )  # fmt: skip

    def redraw(self) -> None:
        plot = self.getPlotItem()
        plot.clear()
        if self.trend is None or not self._rows:
            return
        largest = largest_of(number_of(row.get(self.trend.column)) for row in self._rows)
        self._unit = screen_unit(self.trend.unit, largest)
        days, value, low, high = self._numbers()
        first = recorded_at(self._rows[0]["created"])
        since = f"{first:%Y-%m-%d}" if isinstance(first, datetime) else "the first"
        self.name_axes(column_words(self.trend.column), self._unit, f"Days since {since}")
        if self.change is not None:
            self._draw_change(days)
        else:
            slope = self.trend.per_month * self._unit.factor / DAYS_A_MONTH
            line = np.median(value) + slope * (days - np.median(days))
            plot.addItem(plain_curve(days, line, self.pen("modelled", 1.5, dashed=True), "trend"))
        bars = pg.ErrorBarItem(
            x=days, y=value, top=high - value, bottom=value - low, pen=self.pen("muted", 1.0)
        )
        plot.addItem(bars)
        points = pg.ScatterPlotItem(
            days, value, size=8, pen=pg.mkPen(None), brush=colours_of(self).measured, name="sessions"
        )
        plot.addItem(points)
        margin = 0.04 * (days[-1] - days[0]) or 0.5
        plot.setRange(
            xRange=(days[0] - margin, days[-1] + margin),
            yRange=span_of(np.concatenate((low, high))),
            padding=0.0,
        )

    def _draw_change(self, days: Array) -> None:
        change, plot = self.change, self.getPlotItem()
        assert change is not None
        names = [str(row["session"]) for row in self._rows]
        if change.after not in names:
            return
        k = names.index(change.after)
        gap = pg.LinearRegionItem((days[k - 1], days[k]), movable=False)
        gap.setBrush(tint(colours_of(self).residual, 0.18))
        for edge in gap.lines:
            edge.setPen(pg.mkPen(None))
        plot.addItem(gap, ignoreBounds=True)
        value = self._numbers()[1]
        for side in (slice(None, k), slice(k, None)):
            if len(days[side]):
                y, ends = np.full(2, value[side].mean()), days[side][[0, -1]]
                plot.addItem(plain_curve(ends, y, self.pen("modelled", 2.0), "mean of a side"))

    def shown_series(self) -> list[Series]:
        """For CSV."""
        if self.trend is None or not self._rows:
            return []
        days, value, low, high = self._numbers()
        label = self._unit.label(column_words(self.trend.column))
        pairs = (("sessions", value), ("low end", low), ("high end", high))
        return [Series(name, "Days since the first", label, days, y) for name, y in pairs]

    def mousePressEvent(self, event: QMouseEvent) -> None:
        super().mousePressEvent(event)
        if self.trend is None or not self._rows or event.button() != Qt.MouseButton.LeftButton:
            return
        days, value, _, _ = self._numbers()
        box = self.getPlotItem().getViewBox()
        places = [box.mapViewToScene(QPointF(x, y)) for x, y in zip(days, value, strict=True)]
        at = self.mapToScene(event.position().toPoint())
        away = [(place - at).manhattanLength() for place in places]
        nearest = int(np.argmin(away))
        if away[nearest] <= NEAR:
            self.session_asked.emit(str(self._rows[nearest]["session"]))


class TrendDialog(QDialog):
    """Signal ``chosen(name)``: a session is to be marked in the table behind."""

    chosen = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("trendDialog")
        self.setWindowTitle("Trend over days – FingerLab")
        self.resize(WIDTH, HEIGHT)
        self.title = heading()
        self.words = described(WholeLabel(), "trendWords", font=small_font())
        self.table = NumberTable("trendTable", "Numbers of the bench over time", COLUMNS)
        self.table.currentCellChanged.connect(lambda *_: self._show_chosen())
        self.plot = TrendPlot()
        self.plot.session_asked.connect(self.chosen)
        self._rows: list[dict[str, object]] = []
        self._trends: list[Trend] = []
        self._changes: dict[str, Change] = {}
        close = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        close.rejected.connect(self.reject)
        hint = remark(
            "Steady, drifting and stepping are weighed against one another (Bayes factors), each number as "
            "one of many. Ctrl+C copies the table."
        )
        parts = (self.table, 3), (self.plot, 4), hint, Spacer(), close
        vbox(self, self.title, self.words, *parts, spacing=8)
        self.hint = hint

    def show_contents(self, contents: Contents, folder: Path) -> None:
        """Show the sessions of a batch's table."""
        self._rows = ageing_rows(contents.rows)
        self._trends = trends(contents.rows, contents.units)
        found = changes(contents.rows, contents.units)
        self._changes = {name: one for one in reversed(found) for name in (*one.others, one.column) if name}
        self.title.setText(f"{len(self._rows)} sessions of {folder.name} with a verdict and a time")
        self.words.setText(self._said(found))
        rank = {name: -one.chance for one in found for name in (*one.others, one.column)}
        rank |= {one.column: -1.0 - one.chance for one in found}
        self._trends.sort(key=lambda one: rank.get(one.column, 0.0))
        self._fill()

    def _said(self, found: list[Change]) -> str:
        times = len({row["created"] for row in self._rows})
        if found:
            return "\n".join(change_sentence(one) for one in found)
        if times < LEAST_TIMES:
            how = f"all {len(self._rows)} are of {times}" if len(self._rows) > times else f"there are {times}"
            then = "" if len(self._rows) > times else " Diagnose all makes them."
            return (
                f"A trend needs verdicts of {LEAST_TIMES} times, a change of {LEAST_SESSIONS}; {how}.{then}"
            )
        return "No change between two sessions is likelier than none; what drifts has a slope below."

    def _fill(self) -> None:
        rows = []
        for trend in self._trends:
            change = self._changes.get(trend.column)
            own = change is not None and change.column == trend.column
            step = "–" if change is None else percent(change.chance) if own else "with another"
            rows.append((*trend_cells(trend), step))
        self.table.show_rows(rows)
        for part in (self.table, self.plot, self.hint):  # an empty plot would have axes of nothing
            part.setVisible(bool(rows))
        if rows:
            self.table.setCurrentCell(0, 0)
        self._show_chosen()

    def _show_chosen(self) -> None:
        row = self.table.currentRow()
        trend = self._trends[row] if 0 <= row < len(self._trends) else None
        change = self._changes.get(trend.column) if trend is not None else None
        self.plot.show_trend(self._rows, trend, change)
