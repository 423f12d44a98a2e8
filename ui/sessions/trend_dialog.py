"""Dialog over the sessions of a folder: how a bench aged, when it changed, and what two benches share."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, Qt, Signal
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QComboBox, QLabel, QPushButton, QTabWidget, QWidget

from fingerlab.batch.benches import folders_of, shared_effects, two_groups
from fingerlab.batch.changes import BenchChange, NumberCourse, beside, changes, courses
from fingerlab.batch.followed import (
    DAYS_A_MONTH,
    LEAST_TIMES,
    Trend,
    ageing_rows,
    days_of,
    trends,
    with_strengths,
)
from fingerlab.batch.laws import Estimate
from fingerlab.batch.settings import LEAST_SESSIONS, PROBABLE, STEPS
from fingerlab.batch.table import Contents, Row, number_of, recorded_at
from fingerlab.core.errors import UserError
from fingerlab.core.text import ScreenUnit, largest_of, percent, screen_unit
from fingerlab.report.time_words import (
    KIND_WORDS,
    SHARED_HEADINGS,
    change_sentence,
    column_words,
    course_sentence,
    shared_cells,
    shared_sentence,
    trend_cells,
    within_a_day,
)
from fingerlab.sessions.model import Array

from ..widgets.layout import ResultDialog, Spacer, described, hbox, vbox
from ..widgets.plots import QuietPlot, plain_curve, span_of
from ..widgets.series import Series
from ..widgets.tables import NumberTable, WholeLabel, heading, remark
from ..widgets.theme import colours_of, small_font, tint

MEANINGS = (
    "Found in any session of either bench.",
    "Which bench has it: both alike, both of another strength, or one.",
    "Of that.",
    "The number that tells how strong it is.",
    "On the first bench, with its 90 % interval.",
    "On the second bench, with its 90 % interval.",
    "Zero inside the interval: no difference is seen.",
)
NAME_HELP = "A folder below this one, or a pattern of session names such as left-*; then Compare, or Enter."


def _name(name: str, words: str) -> QComboBox:
    field = described(QComboBox(), name, accessible=words, tip=f"{words}. {NAME_HELP}")
    field.setEditable(True)
    field.setInsertPolicy(QComboBox.InsertPolicy.NoInsert)
    field.setMinimumContentsLength(16)
    return field


class BenchesPage(QWidget):
    """Two lists of names, a table with a row for each strength, and a sentence for each effect."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.first = _name("firstBench", "Sessions of the first bench")
        self.second = _name("secondBench", "Sessions of the second bench")
        for field in (self.first, self.second):
            field.activated.connect(self.compare)
            line = field.lineEdit()
            assert line is not None
            line.returnPressed.connect(self.compare)
        columns = tuple(zip(SHARED_HEADINGS, MEANINGS, strict=True))
        self.table = NumberTable("sharedTable", "Effects on two benches", columns, words=4)
        self.words = described(WholeLabel(), "sharedWords", font=small_font())
        self.hint = remark(
            "Both alike, both of another strength, one alone and neither are weighed against one another by "
            "their evidence. Ctrl+C copies the table."
        )
        self.button = described(QPushButton("Co&mpare"), "compareBenches", tip="Of the two that are named.")
        self.button.clicked.connect(self.compare)
        self._contents: Contents | None = None
        first, second = QLabel("&First"), QLabel("&Second")
        first.setBuddy(self.first)
        second.setBuddy(self.second)
        chosen = hbox(None, first, self.first, second, self.second, self.button, Spacer(1), spacing=8)
        vbox(self, chosen, self.words, (self.table, 1), self.hint, Spacer(), spacing=8)

    def show_contents(self, contents: Contents) -> None:
        """Offer the folders of a batch's table, and compare the first two."""
        self._contents = contents
        names = folders_of(contents.rows)
        for field, at in ((self.first, 0), (self.second, 1)):
            before = field.currentText()
            field.clear()
            field.addItems(names)
            field.setCurrentText(before or (names[at] if at < len(names) else ""))
        self.compare()

    def compare(self) -> None:
        """Compare the two that are named."""
        names = self.first.currentText().strip(), self.second.currentText().strip()
        cells: list[tuple[str, ...]] = []
        if self._contents is None or not all(names):
            said = (
                "Name two benches, each a folder below this one or a pattern of session names such as "
                "left-*, and press Compare: which effects they share, and how strong they are on each, will "
                "stand here."
            )
        else:
            try:
                groups = two_groups(self._contents.rows, *names)
                found = shared_effects(*groups, self._contents.units)
                cells = [row for one in found for row in shared_cells(one)]
                sentences = [shared_sentence(one, *groups) for one in found]
                said = "\n".join(sentences) or "No effect was found in any session of either."
            except UserError as error:
                said = str(error)
        self.words.setText(said)
        self.table.show_rows(cells)
        for part in (self.table, self.hint):
            part.setVisible(bool(cells))


WIDTH, HEIGHT = 980, 740
NEAR = 12
"""From so many px a click means a session."""
COLUMNS = (
    ("Quantity", "Of every session's final model, or of an effect fitted alone."),
    ("Median", "Of all sessions."),
    ("Unit", ""),
    ("Per month", "Median of the slopes of all pairs of sessions (Theil-Sen)."),
    ("90 % interval", "Of the slope. It leaves out zero for one steady quantity in ten by chance."),
    ("Sessions", "That have this number and a time."),
    ("Course", "What became of it, if that is likelier than all else together, with its probability."),
)


LEAST_PLOT = 144
"""px; on a low screen the table gives way, which scrolls."""


class TrendPlot(QuietPlot):
    """One number over days. Signal ``session_asked(name)``: a click on a session."""

    session_asked = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        self.trend: Trend | None = None
        self.course: NumberCourse | None = None
        self._rows: list[Row] = []
        self._unit = ScreenUnit("", 1.0)
        super().__init__("trendPlot", "One number of the bench over days", parent)
        self.setMinimumHeight(LEAST_PLOT)
        self.setToolTip(
            "A point is a session with its 90 % interval; a click marks it in the table behind. The shaded "
            "bands are the levels that the likeliest course has, with their 90 % intervals."
        )

    def show_trend(self, rows: Sequence[Row], trend: Trend | None, course: NumberCourse | None) -> None:
        """Show one quantity of these rows, in the order of time."""
        self._rows = [row for row in rows if trend and np.isfinite(number_of(row.get(trend.column)))]
        self.trend, self.course = trend, course
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
        levels = self._draw_course(days) if self.course is not None else []
        if self.course is None or self.course.course.verdict == "open":
            slope = np.nan_to_num(self.trend.per_month) * self._unit.factor / DAYS_A_MONTH
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
            yRange=span_of(np.concatenate((low, high, np.array(levels)))),
            padding=0.0,
        )

    def _draw_course(self, days: Array) -> list[float]:
        """The levels of the likeliest course, and where a step or an odd session is; returns their ends."""
        assert self.course is not None
        course = self.course.course
        verdict, first, last = course.verdict, course.first, course.last
        if verdict == "open":
            return []
        if verdict in STEPS:
            k = course.place
            self._mark(days[k - 1], days[k])
            self._band(days[[0, k - 1]], first, first, "before")
            self._band(days[[k, len(days) - 1]], last, last, "after")
            return self._ends(first, last)
        if verdict == "odd":
            at = float(days[int(np.argmax(course.odd))])
            room = 0.01 * float(days[-1] - days[0])
            self._mark(at - room, at + room)
        if verdict == "warm_up":  # it comes back with every pause: a band over days would hide that
            return []
        self._band(days[[0, -1]], first, last, KIND_WORDS[verdict])
        return self._ends(first, last)

    def _mark(self, start: float, stop: float) -> None:
        gap = pg.LinearRegionItem((start, stop), movable=False)
        gap.setBrush(tint(colours_of(self).residual, 0.18))
        for edge in gap.lines:
            edge.setPen(pg.mkPen(None))
        self.getPlotItem().addItem(gap, ignoreBounds=True)

    def _band(self, ends: Array, first: Estimate, last: Estimate, name: str) -> None:
        """A level that may differ at its ends, with its interval."""
        factor = self._unit.factor
        value, low, high = (
            factor * np.array([getattr(one, what) for one in (first, last)])
            for what in ("value", "low", "high")
        )
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        self.draw_band(ends, middle, half, tint(colours_of(self).modelled, 0.25), name)
        self.getPlotItem().addItem(plain_curve(ends, value, self.pen("modelled", 2.0), name))

    def _ends(self, first: Estimate, last: Estimate) -> list[float]:
        return [self._unit.factor * end for one in (first, last) for end in (one.low, one.high)]

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


class TrendDialog(ResultDialog):
    """Signal ``chosen(name)``: a session is to be marked in the table behind."""

    chosen = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent, "trendDialog", "Trend over days", WIDTH, HEIGHT)
        self.title = heading()
        self.words = described(WholeLabel(), "trendWords", font=small_font())
        self.table = NumberTable("trendTable", "Numbers of the bench over time", COLUMNS)
        self.table.currentCellChanged.connect(lambda *_: self._show_chosen())
        self.plot = TrendPlot()
        self.plot.session_asked.connect(self.chosen)
        self.sentence = described(WholeLabel(), "courseWords", accessible="What became of this number")
        self._rows: list[Row] = []
        self._trends: list[Trend] = []
        self._changes: dict[str, BenchChange] = {}
        self._courses: dict[str, NumberCourse] = {}
        self.hint = remark(
            "Steady, a step, wear, settling, warming up and one session gone wrong are weighed against one "
            "another by their evidence, each number as one of many. Ctrl+C copies the table."
        )
        self.over_time = QWidget()
        parts = (self.table, 3), (self.plot, 4), self.sentence, self.hint, Spacer()
        vbox(self.over_time, self.words, *parts, spacing=8)
        self.benches = BenchesPage()
        self.pages = described(QTabWidget(), "trendPages")
        self.pages.addTab(self.over_time, "&Over time")
        self.pages.addTab(self.benches, "&Two benches")
        self.lay_out(self.title, self.pages).setAutoDefault(False)  # Enter compares two benches

    def show_contents(self, contents: Contents, folder: Path) -> None:
        """Show the sessions of a batch's table."""
        self._rows = with_strengths(ageing_rows(contents.rows))
        number_courses = courses(contents.rows, contents.units)
        self._courses = {one.column: one for one in number_courses}
        found = changes(contents.rows, contents.units, number_courses)
        self._changes = {name: one for one in reversed(found) for name in (*one.others, one.column) if name}
        known = trends(contents.rows, contents.units)
        self._trends = _with_courses(known, number_courses, self._rows)
        self.title.setText(f"{len(self._rows)} sessions in “{folder.name}” with a verdict and a time")
        self.words.setText(" ".join(filter(None, (self._said(found), within_a_day(known)))))
        led = {one.column for one in found}
        self._trends.sort(key=lambda one: self._rank(one.column, led))
        self.table.show_rows(
            [(*trend_cells(trend), self._verdict_words(trend.column)) for trend in self._trends]
        )
        for part in (self.table, self.plot, self.sentence, self.hint):  # an empty plot has axes of nothing
            part.setVisible(bool(self._trends))
        if self._trends:
            self.table.setCurrentCell(0, 0)
        self._show_chosen()
        self.benches.show_contents(contents)

    def _rank(self, column: str, led: set[str]) -> tuple[bool, bool, float]:
        """What leads a change stands first, then what changed by its probability, then what leans on that."""
        one = self._courses.get(column)
        if one is None:
            return True, False, 1.0
        steady = one.course.chances["steady"]
        return column not in led, bool(one.leans_on) and steady < PROBABLE, steady

    def _said(self, found: list[BenchChange]) -> str:
        times = len({row["created"] for row in self._rows})
        if times < LEAST_SESSIONS:
            how = f"all {len(self._rows)} are of {times}" if len(self._rows) > times else f"there are {times}"
            then = "" if len(self._rows) > times else " Diagnose all makes them."
            return (
                f"A change needs verdicts of {LEAST_SESSIONS} times, a trend of {LEAST_TIMES}; {how}.{then}"
            )
        sentences = [change_sentence(one) for one in found]
        rest = beside(list(self._courses.values()), found)
        sentences += [course_sentence(one) for one in rest if one.course.verdict not in ("steady", "open")]
        return "\n".join(sentences) or "No change of any number is likelier than none. Each one's own below."

    def _verdict_words(self, column: str) -> str:
        one = self._courses.get(column)
        if one is None:
            return "–"
        verdict = one.course.verdict
        if verdict == "open":
            return KIND_WORDS[verdict]
        if verdict == "steady":
            return f"{KIND_WORDS[verdict]} {percent(one.course.certain)}"
        change = self._changes.get(column)
        if one.leans_on or (change is not None and change.column not in (column, "")):
            # Whose effect came or went, the other says.
            kind = "step" if verdict in STEPS else KIND_WORDS[verdict]
            return f"{kind} {percent(one.course.certain)}, with another"
        return f"{KIND_WORDS[verdict]} {percent(one.course.certain)}"

    def _show_chosen(self) -> None:
        row = self.table.currentRow()
        trend = self._trends[row] if 0 <= row < len(self._trends) else None
        course = self._courses.get(trend.column) if trend is not None else None
        self.plot.show_trend(self._rows, trend, course)
        self.sentence.setText("" if course is None else course_sentence(course))


def _with_courses(
    known: Sequence[Trend], number_courses: Sequence[NumberCourse], rows: Sequence[Row]
) -> list[Trend]:
    """The trends, and numbers that have a course alone; those of no trend have no slope."""
    named = {one.column for one in known}
    more = []
    for one in number_courses:
        if one.column not in named:
            values = [number_of(row.get(one.column)) for row in rows]
            median = float(np.nanmedian(values))
            more.append(Trend(one.column, one.unit, median, np.nan, np.nan, np.nan, len(one.names)))
    return [*known, *more]
