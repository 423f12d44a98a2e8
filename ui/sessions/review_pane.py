"""One plot of the review, with the runs that are laid over it, each with a colour and a line of its own."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from html import escape
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QEvent, QLineF, QObject, QRectF, QSignalBlocker, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QFontMetrics,
    QIcon,
    QKeyEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QPixmap,
    QWheelEvent,
)
from PySide6.QtWidgets import QComboBox, QPushButton, QStyle, QStyleOptionComboBox, QStylePainter, QWidget

from fingerlab.library.reviewing import Marker
from fingerlab.report.line_units import LineUnits
from fingerlab.sessions.model import Run, Session

from ..widgets.layout import FLUSH, Spacer, described, hbox
from ..widgets.plots import Cursor, DecimatedCurve, bottom_axis_height, label_left
from ..widgets.series import round_ticks
from ..widgets.theme import Colours, colours_of, line, small_font
from .review_data import Layer, PaneSpec, channels_of
from .session_table import run_words

MOST = 4
"""Runs over the one under review: more could not be told apart."""
BESIDE = "beside"
SWATCH = QSize(28, 10)
STYLES = (Qt.PenStyle.DashLine, Qt.PenStyle.DotLine, Qt.PenStyle.DashDotLine, Qt.PenStyle.DashDotDotLine)
GLYPHS = ("– –", "· · ·", "– ·", "– · ·")
"""The same lines in text."""


@dataclass(frozen=True)
class LaidOver:
    """A run that is laid over: ``number`` of its line, 1 to :data:`MOST`, its own while it is there."""

    number: int
    session: Session
    run: Run
    name: str

    def pen(self, colours: Colours, width: float = 1.0) -> QPen:
        """How it is drawn, in every plot and legend."""
        return over_pen(self.number, colours, width)


def over_pen(number: int, colours: Colours, width: float = 1.0) -> QPen:
    """The pen of the runs that are laid over, by their number."""
    pen = line(colours.over[number - 1], width)
    pen.setStyle(STYLES[number - 1])
    return pen


class AddingBox(QComboBox):
    """A list from which things are added one by one: neither keys nor wheel run through it when shut.

    Shut, it shows its ``caption``, which is short, in place of what was chosen last; where there is none,
    that. Open, it is as wide as its entries.
    """

    caption = ""

    def showPopup(self) -> None:
        view = self.view()
        bar = view.verticalScrollBar().sizeHint().width()
        view.setMinimumWidth(max(view.sizeHintForColumn(0) + bar, self.width()))
        super().showPopup()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, option = QStylePainter(self), QStyleOptionComboBox()
        self.initStyleOption(option)
        if self.caption:
            option.currentText = self.caption
        painter.drawComplexControl(QStyle.ComplexControl.CC_ComboBox, option)
        painter.drawControl(QStyle.ControlElement.CE_ComboBoxLabel, option)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in (Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_PageUp, Qt.Key.Key_PageDown):
            self.showPopup()
            return
        super().keyPressEvent(event)

    def wheelEvent(self, event: QWheelEvent) -> None:
        event.ignore()


class LaidOverRow(QWidget):
    """What is laid over, each with its line; a press takes it away. Signal ``pressed(number)``."""

    pressed = Signal(int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._shown: tuple[LaidOver, ...] = ()
        self.buttons: dict[int, QPushButton] = {}
        self._row = hbox(self, Spacer(1), margins=FLUSH, spacing=8)
        self.hide()

    def show_overs(self, overs: Sequence[LaidOver]) -> None:
        """Show these, in the order of their numbers."""
        self._shown = tuple(sorted(overs, key=lambda over: over.number))
        for button in self.buttons.values():
            self._row.removeWidget(button)
            button.deleteLater()
        self.buttons = {over.number: self._button(over) for over in self._shown}
        for place, button in enumerate(self.buttons.values()):
            self._row.insertWidget(place, button)
        self.setVisible(bool(self._shown))
        self._recolour()

    def _button(self, over: LaidOver) -> QPushButton:
        button = described(QPushButton(f" {over.name}  ✕"), f"over-{over.number}", font=small_font())
        button.setIconSize(SWATCH)
        words = f"Take {over.name} away: {run_words(over.run, over.session)}"
        button.setToolTip(words)
        button.setAccessibleName(words)
        button.clicked.connect(lambda _checked=False: self.pressed.emit(over.number))
        return button

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange:
            self._recolour()

    def _recolour(self) -> None:
        for over in self._shown:
            self.buttons[over.number].setIcon(QIcon(self._swatch(over)))

    def _swatch(self, over: LaidOver) -> QPixmap:
        ratio = self.devicePixelRatioF()
        picture = QPixmap(SWATCH * ratio)
        picture.setDevicePixelRatio(ratio)
        picture.fill(Qt.GlobalColor.transparent)
        painter = QPainter(picture)
        painter.setPen(over.pen(colours_of(self), 2.0 * ratio))
        painter.drawLine(0, SWATCH.height() // 2, SWATCH.width(), SWATCH.height() // 2)
        painter.end()
        return picture


class Overlays(QObject):
    """Which runs are offered, and which of them are laid over the one under review.

    Signals:
        changed: others are laid over. beside_asked: runs of a further session are wanted.
        refused(sentence): why one cannot be laid over as well.
    """

    changed = Signal()
    beside_asked = Signal()
    refused = Signal(str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._offered: list[tuple[Session, Run, str]] = []
        self._over: dict[int, int] = {}  # row of the offer -> number of its line
        self._before = 0
        self.row = LaidOverRow()
        self.row.pressed.connect(self.take_away)
        self.field = AddingBox()
        self.field.currentIndexChanged.connect(self._on_chosen)

    def offer_all(self, sessions: Sequence[Session]) -> None:
        """Offer the runs of these sessions, the first of which is under review; lay none over."""
        self._offered, self._over, self._before = [], {}, 0
        self._caption()
        with QSignalBlocker(self.field):
            self.field.clear()
            if sessions:
                self.field.addItem("Nothing over it", None)
                self.field.addItem("A run of another session…", BESIDE)
                for session in sessions:
                    self._offer(session, session is sessions[0])
                self.field.setCurrentIndex(0)
        self.row.show_overs(())

    def offer_beside(self, session: Session) -> None:
        """Offer the runs of another session as well, and lay the first of them over."""
        row = self.field.count() - 1
        self._offer(session, False)
        self.field.setCurrentIndex(row)

    def _offer(self, session: Session, own: bool) -> None:
        """Before the last entry, which asks for a further session."""
        for run in session.runs:
            file = "" if own else f"{session.path.stem}, "
            self.field.insertItem(
                self.field.count() - 1, f"Over it: {file}{run_words(run, session)}", len(self._offered)
            )
            self._offered.append((session, run, f"{file}Run {run.name}"))

    def shown_over(self, run: Run) -> list[LaidOver]:
        """What is laid over this run, which is never laid over itself."""
        return [
            LaidOver(number, *self._offered[offer])
            for offer, number in self._over.items()
            if self._offered[offer][1] is not run
        ]

    def take_away(self, number: int) -> None:
        """Lay the run with this number's line over no more."""
        self._over = {offer: one for offer, one in self._over.items() if one != number}
        self._settle(1 + list(self._over)[-1] if self._over else 0)
        self.field.setFocus()  # the button that was pressed is gone

    def _on_chosen(self, row: int) -> None:
        chosen = self.field.itemData(row)
        if chosen == BESIDE:
            self._go_to(self._before)
            self.beside_asked.emit()
        elif chosen is None:
            self._over = {}
            self._settle(row)
        elif chosen in self._over:
            self._settle(row)
        elif not self._goes_with(self._offered[chosen][0]):
            self._go_to(self._before)
            self.refused.emit(
                f"{self._offered[chosen][0].path.name} is of another kind of axis than the run under review, "
                "and an angle cannot be laid over a length; review them one after the other."
            )
        elif len(self._over) == MOST:
            self._go_to(self._before)
            self.refused.emit(
                f"{MOST} runs lie over this one already; take one of them away, then lay the next over."
            )
        else:
            self._over[chosen] = min(set(range(1, MOST + 1)) - set(self._over.values()))
            self._settle(row)

    def _goes_with(self, session: Session) -> bool:
        """Whether a session is told in the units of the one under review."""
        own = self._offered[0][0]
        return bool(session.rig.line_radius) == bool(own.rig.line_radius)

    def _settle(self, row: int) -> None:
        self._before = row
        self._caption()
        self._go_to(row)
        self.changed.emit()

    def _caption(self) -> None:
        many = len(self._over)
        self.field.caption = f"{many} run{'s' if many > 1 else ''} over it" if many else ""
        self.field.update()

    def _go_to(self, row: int) -> None:
        with QSignalBlocker(self.field):
            self.field.setCurrentIndex(row)


class ClockAxis(pg.AxisItem):
    """Labels seconds of a run with the clock; empty while it is not known when the run began."""

    def __init__(self) -> None:
        super().__init__("top")
        self.began: datetime | None = None

    def set_began(self, began: datetime | None) -> None:
        """The moment at which the run's time is 0."""
        self.began = began
        self.picture = None
        self.update()

    def tickStrings(self, values: Sequence[float], scale: float, spacing: float) -> list[Any]:
        if self.began is None:
            return ["" for _ in values]
        return [clock_text(self.began, value, spacing) for value in values]


def clock_text(began: datetime, seconds: float, resolution: float) -> str:
    """Time of day, with as many decimals as steps of ``resolution`` seconds need."""
    decimals = 0 if resolution >= 1 else 1 if resolution >= 0.1 else 2 if resolution >= 0.01 else 3
    moment = began + timedelta(seconds=round(seconds, decimals))
    text = f"{moment:%H:%M:%S}"
    return f"{text}.{moment.microsecond:06d}"[: len(text) + 1 + decimals] if decimals else text


TIME_ROOM = 90
HEIGHT_ROOM = 36
"""Pixels from one line to the next, at least."""


class Grid(pg.GraphicsObject):
    """Lines at round times and values of the view that it is in; the axes get their ticks at the same."""

    def __init__(self, plot: pg.PlotItem) -> None:
        super().__init__()
        self._left, self._bottom = plot.getAxis("left"), plot.getAxis("bottom")
        self._columns: list[float] = []
        self._rows: list[float] = []
        self._seen: tuple[Any, ...] = ()
        self._lines: list[QLineF] = []
        self._pen = pg.mkPen("gray")
        self.setZValue(-10)

    def set_colour(self, colour: str, alpha: int = 120) -> None:
        """Colour of the lines."""
        tone = QColor(colour)
        tone.setAlpha(alpha)
        self._pen = pg.mkPen(tone)  # cosmetic: one pixel wide whatever the zoom
        self.update()

    def viewRangeChanged(self) -> None:
        view = self.getViewBox()
        if not isinstance(view, pg.ViewBox):
            return
        self.prepareGeometryChange()
        (left, right), (low, high) = view.viewRange()
        seen = low, high, view.height()
        if seen != self._seen:
            self._seen = seen
            rows = round_ticks(low, high, max(int(view.height()) // HEIGHT_ROOM, 1))
            self._rows = [value for value, _ in rows]
            self._left.setTicks([rows])
        columns = round_ticks(left, right, max(int(view.width()) // TIME_ROOM, 1))
        self._columns = [time for time, _ in columns]
        if self._bottom.isVisible():
            self._bottom.setTicks([columns])
        self._lines = [QLineF(x, low, x, high) for x in self._columns]
        self._lines += [QLineF(left, y, right, y) for y in self._rows]
        self.update()

    def boundingRect(self) -> QRectF:
        return QRectF(self.viewRect())

    def paint(self, painter: QPainter, *_: Any) -> None:
        painter.setPen(self._pen)
        painter.drawLines(self._lines)


RUN_TIME = "Time in the run (s)"


LEGEND_ROOM = 4
"""px around its line."""


class ReviewPane:
    """One plot of the stack: its curves by layer and channel, its cursors, its markers."""

    def __init__(self, spec: PaneSpec, plot: pg.PlotItem) -> None:
        self.spec, self.plot, self.line = spec, plot, LineUnits()
        self.curves: dict[tuple[int, str], DecimatedCurve] = {}
        self.strokes: dict[tuple[int, str], pg.PlotCurveItem] = {}
        names = (
            {"label": "A", "labelOpts": {"position": 0.06}},
            {"label": "B", "labelOpts": {"position": 0.06}},
        )
        self.cursors = [Cursor(angle=90, movable=True, **name) for name in names]
        self.markers: list[pg.InfiniteLine] = []
        self.legend = pg.TextItem(anchor=(0, 0))
        self.legend.setFont(small_font())
        self.legend.setParentItem(plot)  # above the view, where no curve runs
        plot.getViewBox().sigResized.connect(self._place_legend)
        for cursor in self.cursors:
            cursor.setZValue(20)
        self.grid = Grid(plot)
        plot.addItem(self.grid, ignoreBounds=True)
        self.add_curves(0)

    @property
    def title(self) -> str:
        """As it stands at the left."""
        return self.spec.title_of(self.line) or self.spec.title

    def label_axis(self) -> None:
        """Title and unit at the left, as there is room."""
        label_left(self.plot, self.title, self.spec.unit_of(self.line))

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
                item.opts["name"] = f"{self._words(name)}, {run}" if run else None

    def _words(self, name: str) -> str:
        return channels_of(self.line)[name].title

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
            title = escape(self._words(name))
            title = f"<b>{title}</b>" if name in self.spec.wide else title
            colour = getattr(colours, self.spec.channels[name])
            parts.append(f'<span style="color:{colour}">{title}</span>')
        for layer in over:
            drawn_as = f"{GLYPHS[layer.number - 1]}&nbsp;{escape(layer.name)}"
            parts.append(f'<span style="color:{colours.over[layer.number - 1]}">{drawn_as}</span>')
        self.legend.setHtml(" &nbsp; ".join(parts))
        self.legend.setVisible(bool(parts))
        room = QFontMetrics(small_font()).height() + LEGEND_ROOM if parts else 0
        self.plot.layout.setRowFixedHeight(0, room)  # that of the title, which it has not
        self._place_legend()

    def _place_legend(self, *_: object) -> None:
        self.legend.setPos(self.plot.getViewBox().pos().x(), 0)

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
