"""Bottom row of the lab: the error of each model tried with undo and redo, and that of each equation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from PySide6.QtCore import QEvent, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QBrush, QColor, QFontMetricsF, QHelpEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QBoxLayout, QGridLayout, QLabel, QPushButton, QSizePolicy, QToolTip, QWidget

from fingerlab.core.text import r2_text, score_text
from fingerlab.report.diagnosis_words import (
    FAMILY_TITLES,
    alone,
    called,
    called_in_sentence,
    in_sentence,
    listed,
    on_the_path,
)
from fingerlab.report.line_units import LineUnits
from fingerlab.report.parameter_words import held_words, parameter_title

from ..widgets.fields import set_usable
from ..widgets.layout import FLUSH, Spacer, hbox, vbox
from ..widgets.series import Series
from ..widgets.tables import cells_of_grid, copies
from ..widgets.theme import Colours, colours_of, small_font, tint
from .controller import ModelHistory, ModelStep
from .result_words import FLOOR_HELP, SCORE_HELP, error_texts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fingerlab.diagnosis.answer.results import FirstLook

BAR_WIDTH = 40.0
MIN_COLUMN = 96.0
FLOOR_SCORE = 1.0


@dataclass(frozen=True)
class ErrorBar:
    """One model of the path; ``tried`` ones are filled, the diagnosis' own suggestions outlined.

    One that is ``under_way`` is fitted, and hatched while it is worked out what else is missing beside it.
    """

    title: str
    score: float
    tried: bool
    under_way: bool = False

    @property
    def remark(self) -> str:
        """What its number is, where it is not that of a model that was tried."""
        return "" if self.tried else UNDER_WAY if self.under_way else "would be"


UNDER_WAY = "still being worked out"


def bars_of(history: ModelHistory, chosen: str = "", look: FirstLook | None = None) -> list[ErrorBar]:
    """What was done, then what the effect ``chosen`` would bring, or else what the diagnosis would add.

    Args:
        look: at the model that is being diagnosed; it comes in place of what would be.
    """
    done = history.done
    bars = []
    for before, step in zip((None, *done), done, strict=False):
        came, gone = step.change_from(before) if before is not None else (step.added, ())
        entered = [on_the_path(step.diagnosis, name) for name in came]
        left = [on_the_path(before.diagnosis, name) for name in gone] if before is not None else []
        title = _change_title(entered, left) or (_held_title(step, before) if before is not None else "")
        bars.append(ErrorBar(title or "Nominal", step.diagnosis.score, True))
    if look is not None:
        came = tuple(name for name in look.model if name not in history.now.added)
        gone = tuple(name for name in history.now.added if name not in look.model)
        titles = [[called(history.now.diagnosis, name) for name in part] for part in (came, gone)]
        return [*bars, ErrorBar(_change_title(*titles), look.score, False, under_way=True)]
    path = [step for step in history.now.diagnosis.path if step.added is not None]
    judged = next((c for c in history.now.diagnosis.candidates if c.effect == chosen), None)
    if judged is not None and not (path and path[0].added == chosen):
        gone_titles = [on_the_path(history.now.diagnosis, name) for name in judged.replaces]
        return [*bars, ErrorBar(_change_title([judged.title], gone_titles), judged.score, False)]
    for suggested in path:
        if suggested.added is not None:
            now = history.now.diagnosis
            old = [on_the_path(now, suggested.removed)] if suggested.removed else []
            new = suggested.title or called(now, suggested.added)
            bars.append(ErrorBar(_change_title([new], old), suggested.score, False))
    return bars


def _change_title(came: Sequence[str], gone: Sequence[str]) -> str:
    """``+ Coulomb friction``, ``Stribeck friction for Coulomb friction``; empty where nothing changed."""
    new, old = " + ".join(came), " + ".join(gone)
    if new and old:
        return f"{new} for {in_sentence(old)}"
    return f"+ {new}" if new else f"− {old}" if old else ""


def _held_title(step: ModelStep, before: ModelStep) -> str:
    """What was held or let go in this step: ``held: moment arm at the MCP``."""
    new, old = dict(step.held), dict(before.held)
    keys = [key for key in new if new[key] != old.get(key)] or [key for key in old if key not in new]
    if not keys:
        return ""
    line = LineUnits(step.diagnosis.line_radius)
    titles = [in_sentence(line.title(parameter_title(key, keys))) for key in keys]
    return f"{'held' if new else 'free'}: {listed(titles)}"


class ErrorPath(QWidget):
    """Painted bars; the text of all of them is in the accessible description and the tooltip."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("errorPath")
        self.setAccessibleName("Error path")
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.bars: list[ErrorBar] = []
        self._history: ModelHistory | None = None
        self._look: FirstLook | None = None

    def sizeHint(self) -> QSize:
        return QSize(400, 104)

    def minimumSizeHint(self) -> QSize:
        return QSize(140, 72)

    def show_history(self, history: ModelHistory | None) -> None:
        """Show the path up to the present model."""
        self._history, self._look = history, None
        self.show_forecast("")

    def show_first_look(self, look: FirstLook) -> None:
        """Show the error of the model that is being diagnosed, until its history is shown."""
        self._look = look
        self.show_forecast("")

    def show_forecast(self, effect: str) -> None:
        """Predict the error with this effect (an id); for an outcome, what the path would add."""
        self.bars = bars_of(self._history, effect, self._look) if self._history is not None else []
        self.setAccessibleDescription(self.text())
        self.update()

    def text(self) -> str:
        """The path in words."""
        words = [
            f"{bar.title} {score_text(bar.score)}" + (f" ({bar.remark})" if bar.remark else "")
            for bar in self.bars
        ]
        return " → ".join(words) + (", in multiples of the floor" if words else "")

    def shown_series(self) -> list[Series]:
        """For CSV: the error of each model in multiples of the floor, by how many effects it has."""
        tried, others = ([bar for bar in self.bars if bar.tried == wanted] for wanted in (True, False))
        parts = (("", 0, tried), (others[0].remark if others else "", len(tried), others))
        return [
            Series(
                name,
                "Effects in the model",
                "Error (floors)",
                first + np.arange(len(bars), dtype=np.float64),
                np.array([bar.score for bar in bars]),
            )
            for name, first, bars in parts
            if bars
        ]

    def draw_figure(self, figure: Figure) -> None:
        """The bars with their names and numbers, for paper."""
        from fingerlab.report.figure_style import CANDIDATE, RESIDUAL, draw_score_bars, label

        names = [f"{bar.title} ({bar.remark})" if bar.remark else bar.title for bar in self.bars]
        colours = [RESIDUAL if bar.tried else CANDIDATE for bar in self.bars]
        axes = draw_score_bars(figure, names, [bar.score for bar in self.bars], colours)
        label(axes, "held-out error, in multiples of the floor", "")

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.ToolTip and isinstance(event, QHelpEvent):
            QToolTip.showText(event.globalPos(), f"{self.text()}\n\n{SCORE_HELP}", self)
            return True
        return super().event(event)

    def paintEvent(self, event: QPaintEvent) -> None:
        if not self.bars:
            return
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setFont(small_font())
        colours = colours_of(self)
        metrics = QFontMetricsF(painter.font())
        text_height = metrics.height()
        label = "floor 1.0"
        left_room = self.width() - metrics.horizontalAdvance(label) - 8
        widest = max(metrics.horizontalAdvance(bar.title) for bar in self.bars)
        column = min(max(widest + 24, MIN_COLUMN), left_room / len(self.bars))
        titles = [_in_lines(bar.title, metrics, column - 8) for bar in self.bars]
        ground = self.height() - max(map(len, titles)) * text_height - 2  # titles below
        room = ground - text_height - 2  # numbers above
        finite = [bar.score for bar in self.bars if math.isfinite(bar.score)]
        top = max([*finite, FLOOR_SCORE])
        floor_height = room * FLOOR_SCORE / top
        painter.fillRect(
            QRectF(0, ground - floor_height, self.width(), floor_height), tint(colours.floor, 0.35)
        )
        painter.setPen(QColor(colours.muted))
        painter.drawText(
            QRectF(0, ground - floor_height - text_height, self.width() - 4, text_height),
            Qt.AlignmentFlag.AlignRight,
            label,
        )
        for number, (bar, title) in enumerate(zip(self.bars, titles, strict=True)):
            height = room * min(bar.score, top) / top if math.isfinite(bar.score) else room
            place = QRectF(number * column, ground - height, column, height)
            self._paint_bar(painter, bar, title, place, colours)

    def _paint_bar(
        self, painter: QPainter, bar: ErrorBar, title: Sequence[str], room: QRectF, colours: Colours
    ) -> None:
        metrics = QFontMetricsF(painter.font())
        width = min(BAR_WIDTH, room.width() - 8)
        body = QRectF(room.left() + 4, room.top(), width, max(room.height(), 1.0))
        if bar.tried:
            painter.fillRect(body, QColor(colours.residual))
        else:
            if bar.under_way:
                painter.fillRect(body, QBrush(QColor(colours.residual), Qt.BrushStyle.BDiagPattern))
            painter.setPen(QPen(QColor(colours.residual), 1, Qt.PenStyle.DashLine))
            painter.drawRect(body.adjusted(0.5, 0.5, -0.5, 0))
        painter.setPen(QColor(colours.text if bar.tried else colours.muted))
        number = score_text(bar.score)
        number = f"{number} …" if bar.under_way else number if bar.tried else f"({number})"
        above = QRectF(body.left(), body.top() - metrics.height() - 1, room.width() - 8, metrics.height())
        painter.drawText(above, Qt.AlignmentFlag.AlignLeft, number)
        below = QRectF(body.left(), body.bottom() + 1, room.width() - 8, len(title) * metrics.height())
        painter.drawText(below, Qt.AlignmentFlag.AlignLeft, "\n".join(title))


TITLE_LINES = 2
"""Below a bar, at most; what has no room there ends in an ellipsis and is whole in the tooltip."""


def _in_lines(title: str, metrics: QFontMetricsF, width: float) -> list[str]:
    """A title in lines no wider than ``width`` px, broken between words."""
    lines = [""]
    for word in title.split():
        longer = f"{lines[-1]} {word}".strip()
        if metrics.horizontalAdvance(longer) <= width or not lines[-1] or len(lines) == TITLE_LINES:
            lines[-1] = longer
        else:
            lines.append(word)
    return [metrics.elidedText(line, Qt.TextElideMode.ElideRight, width) for line in lines]


HEADINGS = ("held-out error", "nominal", "now", "floor", "", "R²")
COLUMN_HELP = (
    "",
    "Root mean square of the residual with the nominal model.",
    "Root mean square of the residual with the present model.",
    f"{FLOOR_HELP} It is of what the present model leaves over, so that another model has another one.",
    "",
    "Share of the variance that the present model explains on held-out runs.",
)


class ErrorTable(QWidget):
    """At most four rows, one for each kind of equation."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("errorTable")
        self.setAccessibleName("Error of each equation on held-out runs")
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setHorizontalSpacing(10)
        self._grid.setVerticalSpacing(1)
        self._grid.setColumnStretch(len(HEADINGS), 1)
        self._labels: list[QLabel] = []
        self.setFocusPolicy(Qt.FocusPolicy.ClickFocus)  # so that Ctrl+C is meant for it
        copies(self, lambda: cells_of_grid(self._grid))

    def show_history(self, history: ModelHistory | None, look: FirstLook | None = None) -> None:
        """Rebuild the rows for the present model, or as far as they are known for the one under way."""
        while self._labels:
            label = self._labels.pop()
            self._grid.removeWidget(label)
            label.hide()  # it may be deleted only when a dialog that stands open is shut
            label.deleteLater()
        if history is None:
            return
        single = alone(history.now.diagnosis)
        for column, text in enumerate(("error", *HEADINGS[1:]) if single else HEADINGS):
            self._put(0, column, text, muted=True, help_text=COLUMN_HELP[column])
        first = history.first.diagnosis.errors
        now = history.now.diagnosis.errors if look is None else look.errors
        spoken = []
        for row, (family, error) in enumerate(now.items(), start=1):
            before, after, floor, unit = error_texts(first.get(family, error), error)
            title = FAMILY_TITLES.get(family, family)
            cells = (title, before, after, floor, unit, r2_text(error.r2))
            for column, text in enumerate(cells):
                unsettled = look is not None and column in (2, 5)
                help_text = f"{COLUMN_HELP[column]} It is {UNDER_WAY}." if unsettled else COLUMN_HELP[column]
                self._put(row, column, text, muted=unsettled, bold=column == 2, help_text=help_text)
            settled = "" if look is None else f" ({UNDER_WAY})"
            spoken.append(f"{title}: nominal {before}, now {after}{settled}, floor {floor} {unit}")
        self._grid.setRowStretch(len(now) + 1, 1)
        self.setAccessibleDescription("; ".join(spoken))

    def cell(self, family: str, column: str) -> str:
        """The text in a row (by key of ``Diagnosis.errors``) and a column (by heading)."""
        for row in range(1, self._grid.rowCount()):
            item = self._grid.itemAtPosition(row, 0)
            label = item.widget() if item is not None else None
            if isinstance(label, QLabel) and label.text() == FAMILY_TITLES.get(family, family):
                found = self._grid.itemAtPosition(row, HEADINGS.index(column))
                cell = found.widget() if found is not None else None
                return cell.text() if isinstance(cell, QLabel) else ""
        return ""

    def _put(
        self, row: int, column: int, text: str, muted: bool = False, bold: bool = False, help_text: str = ""
    ) -> None:
        label = QLabel(text)
        font = small_font()
        font.setBold(bold)
        label.setFont(font)
        label.setToolTip(help_text)
        if muted:
            label.setProperty("role", "muted")
        right = column in (1, 2, 3, 5)
        side = Qt.AlignmentFlag.AlignRight if right else Qt.AlignmentFlag.AlignLeft
        self._grid.addWidget(label, row, column, side)
        self._labels.append(label)


class PathPanel(QWidget):
    """Signals ``undo_asked`` and ``redo_asked``."""

    undo_asked = Signal()
    redo_asked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.path = ErrorPath()
        self.table = ErrorTable()
        self.undo = QPushButton("Undo")
        self.redo = QPushButton("Redo")
        self.undo.setObjectName("undo")
        self.redo.setObjectName("redo")
        self.undo.clicked.connect(self.undo_asked)
        self.redo.clicked.connect(self.redo_asked)
        self._buttons = vbox(None, Spacer(1), self.undo, self.redo, Spacer(1), spacing=8)
        self._parts = hbox(self, (self.path, 1), self._buttons, self.table, margins=FLUSH, spacing=8)

    @property
    def height_of_strip(self) -> int:
        """What it needs with its parts side by side, px."""
        parts = (self.path.minimumSizeHint(), self._buttons.minimumSize(), self.table.minimumSizeHint())
        return max(part.height() for part in parts)

    def stack(self, on: bool) -> None:
        """Path, buttons and table above one another, each as wide as the page, or side by side."""
        down, right = QBoxLayout.Direction.TopToBottom, QBoxLayout.Direction.LeftToRight
        self._parts.setDirection(down if on else right)
        self._buttons.setDirection(right if on else down)

    def show_first_look(self, history: ModelHistory, look: FirstLook) -> None:
        """Show what is known already of the model that is being diagnosed."""
        self.path.show_first_look(look)
        self.table.show_history(history, look)

    def show_history(self, history: ModelHistory | None) -> None:
        """Show the path, the errors, and what undo and redo would do."""
        self.path.show_history(history)
        self.table.show_history(history)
        can_undo = history is not None and history.can_undo
        can_redo = history is not None and history.can_redo
        set_usable(self.undo, can_undo)
        set_usable(self.redo, can_redo)
        before = history.before if history is not None else None
        undone = history.undone() if history is not None else None
        self.undo.setToolTip(
            f"{_in_words(before, history.now)} (Ctrl+Z)."
            if history is not None and before is not None
            else "Nothing was added yet."
        )
        self.redo.setToolTip(
            f"{_in_words(undone, history.now)} (Ctrl+Shift+Z)."
            if history is not None and undone is not None
            else "Nothing was undone."
        )


def _in_words(other: ModelStep, now: ModelStep) -> str:
    """What taking or taking back a step does."""
    came, gone = other.change_from(now)
    if not (came or gone):
        held = held_words(dict(other.held), other.diagnosis.line_radius)
        return f"Have {held or 'nothing held'} again"
    new = called_in_sentence(other.diagnosis, came, on_the_path)
    old = called_in_sentence(now.diagnosis, gone, on_the_path)
    if came and gone:
        return f"Put {new} in place of {old} again"
    return f"Add {new} again" if came else f"Take {old} out again"
