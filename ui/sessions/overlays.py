"""The runs that are laid over the one under review: a few, each with a colour and a line of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import QEvent, QObject, QSize, Qt, Signal
from PySide6.QtGui import QIcon, QKeyEvent, QPainter, QPaintEvent, QPen, QPixmap, QWheelEvent
from PySide6.QtWidgets import QComboBox, QPushButton, QStyle, QStyleOptionComboBox, QStylePainter, QWidget

from fingerlab.sessions.model import Run, Session

from ..widgets.layout import FLUSH, Spacer, described, hbox
from ..widgets.theme import Colours, colours_of, line, small_font
from .session_words import run_words

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
        words = f"Take {over.name} away: {run_words(over.run)}"
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
        blocked = self.field.blockSignals(True)
        self.field.clear()
        if sessions:
            self.field.addItem("Nothing over it", None)
            self.field.addItem("A run of another session…", BESIDE)
            for session in sessions:
                self._offer(session, session is sessions[0])
            self.field.setCurrentIndex(0)
        self.field.blockSignals(blocked)
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
                self.field.count() - 1, f"Over it: {file}{run_words(run)}", len(self._offered)
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
        elif len(self._over) == MOST:
            self._go_to(self._before)
            self.refused.emit(
                f"{MOST} runs lie over this one already; take one of them away, then lay the next over."
            )
        else:
            self._over[chosen] = min(set(range(1, MOST + 1)) - set(self._over.values()))
            self._settle(row)

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
        blocked = self.field.blockSignals(True)
        self.field.setCurrentIndex(row)
        self.field.blockSignals(blocked)
