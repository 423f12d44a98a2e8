"""The window's lines: above every tab its name, the rig's state, STOP and news; below, device and work."""

from __future__ import annotations

import time
from collections.abc import Callable

from PySide6.QtCore import QSize, Qt, QTimer, Signal
from PySide6.QtGui import QColor, QGuiApplication, QPainter, QPaintEvent
from PySide6.QtWidgets import (
    QApplication,
    QFrame,
    QLabel,
    QProgressBar,
    QPushButton,
    QSizePolicy,
    QStackedWidget,
    QWidget,
)

from fingerlab.core.text import grouped

from ..widgets.fields import PROGRESS_STEPS
from ..widgets.layout import FLUSH, described, hbox
from ..widgets.tables import ElidedLabel, FittingLabel, LinesLabel
from ..widgets.theme import colours_of, large_font
from .context import RigLine
from .worker import Worker

STOP_SIZE = QSize(136, 36)
RECORDING_WIDTH, MANY_SAMPLES = 152, 999_999
LAMP_PX = 12


class Lamp(QWidget):
    """A round light. Its colour never stands alone: a word is beside it, and its form tells it, too.

    ``off`` is a ring, ``ready`` and ``live`` a disc, ``fault`` a disc in the fault's colour,
    ``recording`` in red.
    """

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._light = "off"
        self.setAccessibleName(name)
        self.setFixedSize(LAMP_PX + 4, LAMP_PX + 4)

    @property
    def light(self) -> str:
        """What it shows."""
        return self._light

    def show_light(self, light: str) -> None:
        """Change colour and form."""
        if light != self._light:
            self._light = light
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        colours = colours_of(self)
        colour = QColor(
            {
                "off": colours.muted,
                "ready": colours.accent,
                "live": colours.candidate,
                "paused": colours.muted,
                "recording": colours.stop,
            }.get(self._light, colours.fault)
        )
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(colour)
        if self._light not in ("off", "paused"):
            painter.setBrush(colour)
        painter.drawEllipse(2, 2, LAMP_PX, LAMP_PX)
        painter.end()


def _by_tab(area: QWidget) -> list[QWidget]:
    """What Tab goes to in it."""
    return [w for w in area.findChildren(QWidget) if w.focusPolicy() & Qt.FocusPolicy.TabFocus]


class FrameHeader(QWidget):
    """What it says is told it; what the STOP button does is in ``stop_guard.py``."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("frameHeader")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.own = QStackedWidget()
        self.own.addWidget(QWidget())
        self.doing = described(ElidedLabel(), "doing", accessible="What is running")
        self.doing.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.lamp = Lamp("State light")
        self.state = described(QLabel(), "rigState", accessible="State of the rig")
        self.dot = Lamp("Recording light")
        self.count = described(QLabel(), "sampleCount", accessible="Recorded samples")
        self.stop = described(QPushButton("STOP"), "stop", accessible="Stop the motor", font=large_font())
        self.stop.setMinimumSize(STOP_SIZE)
        self.stop.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # Escape reaches it; space must not by accident
        layout = hbox(
            self, (self.own, 5), (self.doing, 2), self.lamp, self.state, 8, margins=(0, 2, 8, 2), spacing=8
        )
        # Its room is kept, so that nothing jumps when recording begins or the count gets longer.
        recording = QWidget()
        longest = self.count.fontMetrics().horizontalAdvance(f"{grouped(MANY_SAMPLES)} samples")
        recording.setFixedWidth(max(RECORDING_WIDTH, self.dot.sizeHint().width() + 8 + longest))
        recording.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Preferred)
        hbox(recording, self.dot, (self.count, 1), margins=FLUSH, spacing=8)
        layout.addWidget(recording)
        layout.addWidget(self.stop)
        self.show_rig(RigLine())

    def show_own(self, widget: QWidget | None) -> None:
        """Show the tab's own part of the header."""
        if widget is None:
            self.own.setCurrentIndex(0)
            return
        if self.own.indexOf(widget) < 0:
            self.own.addWidget(widget)
        self.own.setCurrentWidget(widget)

    def follow(self, rail: QWidget) -> None:
        """Have Tab go from the rail to the buttons here, then on to the work below."""
        last, shown = _by_tab(rail)[-1], self.own.currentWidget()
        for button in _by_tab(shown) if shown is not None else ():
            QWidget.setTabOrder(last, button)
            last = button

    def show_rig(self, line: RigLine) -> None:
        """State, what is running, and what is recorded."""
        self.lamp.show_light(line.light)
        self.state.setText(line.state.capitalize())
        self.doing.setText(line.doing)
        self.doing.setVisible(bool(line.doing))  # its room is the name's while nothing runs
        recording = line.recording is not None
        self.dot.setVisible(recording)
        self.dot.show_light("paused" if line.paused else "recording")
        words = "paused" if line.paused else "samples"
        self.count.setText("" if line.recording is None else f"{grouped(line.recording)} {words}")


KINDS = {"done": ("✓", "Done"), "trouble": ("⚠", "Attention")}
"""How a message is marked, and what that is in words."""


class MessageBar(QFrame):
    """Hidden until there is something to say; stays until it is dismissed or replaced.

    That something was written goes by itself after ``GOES_AFTER_MS``, but not from under pointer or focus.

    Its room at the bottom of the window is kept, so that nothing moves when it comes or goes.
    Signal ``open_asked(path)``: what was written is to be opened.
    """

    LINES = 2
    GOES_AFTER_MS = 20_000
    open_asked = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("messageBar")
        self.setAccessibleName("Message")
        keeps = self.sizePolicy()
        keeps.setRetainSizeWhenHidden(True)
        keeps.setVerticalPolicy(QSizePolicy.Policy.Fixed)
        self.setSizePolicy(keeps)
        self.mark = described(QLabel(), "messageKind")
        self.sentence = described(LinesLabel(self.LINES), "message")
        self.copy = described(QPushButton("&Copy details"), "copyDetails")
        self.copy.clicked.connect(self._copy)
        self.open = described(QPushButton("&Open"), "openWritten")
        self.open.clicked.connect(lambda: self.open_asked.emit(self._path))
        self.dismiss = QPushButton("&Dismiss")
        self.dismiss.clicked.connect(self.hide)
        entries = (self.mark, (self.sentence, 1), self.copy, self.open, self.dismiss)
        hbox(self, *entries, margins=(16, 1, 8, 1), spacing=8)
        self._details = ""
        self._path: object = None
        self._goes = QTimer(self, singleShot=True)
        self._goes.timeout.connect(self._go)
        self.hide()

    def tell(self, sentence: str, details: str = "") -> None:
        """Show a sentence; with details it can be copied whole for a report. An empty one hides the bar."""
        if not sentence:
            self.hide()
            return
        self._details, self._path = details, None
        self._show("trouble", sentence)

    def announce(self, sentence: str, path: object = None) -> None:
        """Say that something was done; with the path of what was written it can be opened."""
        self._details, self._path = "", path
        self._show("done", sentence)

    def _show(self, kind: str, sentence: str) -> None:
        sign, words = KINDS[kind]
        self.mark.setText(sign)
        self.mark.setAccessibleName(words)
        self.setProperty("kind", kind)
        self.style().polish(self)
        self.sentence.setText(sentence)
        self.setAccessibleDescription(f"{words}: {sentence}")
        self.copy.setVisible(bool(self._details))
        self.open.setVisible(self._path is not None)
        self._goes.stop()
        if self._path is not None:
            self._goes.start(self.GOES_AFTER_MS)
        self.show()

    def _go(self) -> None:
        focus = QApplication.focusWidget()
        if self.underMouse() or (focus is not None and self.isAncestorOf(focus)):
            self._goes.start(self.GOES_AFTER_MS)
        else:
            self.hide()

    def take_back(self, sentence: str) -> None:
        """Hide it where it still says this, which does not hold any more."""
        if self.sentence.text() == sentence:
            self.hide()

    def _copy(self) -> None:
        QGuiApplication.clipboard().setText(f"{self.sentence.text()}\n\n{self._details}")


TELLS_FROM_S = 2.0
TELLS_FROM_SHARE = 0.05
"""Time left is told after so long and so much: before, it would be a guess."""


class TaskBar(QWidget):
    """Follows a task runner. Ctrl+. cancels."""

    def __init__(
        self, tasks: Worker, parent: QWidget | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__(parent)
        self._clock, self._began = clock, 0.0
        self.text = described(ElidedLabel(), "status", accessible="Status")
        self.progress = described(QProgressBar(), "progress", accessible="Progress")
        self.progress.setRange(0, PROGRESS_STEPS)
        self.progress.setFixedWidth(200)
        self.progress.setFormat("%p %")
        self.cancel = described(QPushButton("Cancel"), "cancel", tip="Stop what is running (Ctrl+.).")
        self.cancel.setShortcut("Ctrl+.")
        hbox(self, (self.text, 1), self.progress, self.cancel, margins=(0, 1, 8, 1), spacing=8)
        # Its height is kept, so that nothing jumps when work starts or ends; the width is the words'.
        self.setMinimumHeight(self.sizeHint().height())
        self.cancel.clicked.connect(self._on_cancel)
        tasks.started.connect(self._on_started)
        tasks.progressed.connect(self._on_progress)
        tasks.ended.connect(self._on_ended)
        self._tasks = tasks
        self._title = ""
        self._show_work(False)

    def say(self, text: str) -> None:
        """The last thing that happened."""
        self.text.setText(text)

    def _show_work(self, running: bool) -> None:
        if not running:
            self.cancel.clearFocus()  # Qt would hand it to the next widget, whatever that is
        for widget in (self.progress, self.cancel):
            widget.setVisible(running)

    def _on_started(self, title: str) -> None:
        self._title, self._began = title, self._clock()
        self.say(title)
        self.progress.setValue(0)
        self.cancel.setEnabled(True)
        self._show_work(True)

    def _on_progress(self, share: float, what: str) -> None:
        self.progress.setValue(round(share * PROGRESS_STEPS))
        words = f"{self._title}: {what}" if what else self._title
        left = time_left(share, self._clock() - self._began)
        self.say(f"{words}, {left}" if left else words)

    def _on_cancel(self) -> None:
        self.cancel.clearFocus()
        self.cancel.setEnabled(False)
        self.say(f"{self._title}: stopping")
        self._tasks.cancel()

    def _on_ended(self, how: str) -> None:
        self._show_work(False)
        words = {"done": "done", "stopped": "stopped", "failed": "failed"}
        self.say(f"{self._title}: {words.get(how, how)}")


def time_left(share: float, seconds: float) -> str:
    """How long it will still take, in words; empty as long as that is a guess.

    Args:
        share: done, 0 to 1. seconds: since the start.
    """
    if not TELLS_FROM_SHARE <= share < 1.0 or seconds < TELLS_FROM_S:
        return ""
    left = seconds * (1.0 - share) / share
    return f"about {max(round(left), 1)} s left" if left < 90 else f"about {round(left / 60)} min left"


LOW_DISK_BYTES = 1 << 30
"""With less room than this the status bar warns (assumed): about two hours of recording at 1 kHz."""

CYCLE_HELP = (
    "Late: cycles of the control loop that came too late or were lost, since the device was connected.\n"
    "Cycle: measured over the last ten seconds, mean and longest."
)


class StatusBar(QWidget):
    """Follows the rig and a task runner."""

    def __init__(self, tasks: Worker, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.device = described(FittingLabel(), "statusDevice", accessible="Device")
        self.tasks = TaskBar(tasks)
        hbox(self, self.device, (self.tasks, 1), margins=(16, 0, 0, 0), spacing=8)
        self.show_rig(RigLine())

    def show_rig(self, line: RigLine) -> None:
        """How the rig does."""
        texts = device_texts(line)
        self.device.set_texts(texts)
        self.device.setVisible(bool(line.device))
        self.device.setToolTip("\n".join(filter(None, (texts[0], CYCLE_HELP if line.cycle_s else ""))))


def device_texts(line: RigLine) -> tuple[str, ...]:
    """Device, samples, late cycles, cycle time, disk, in words: all of it, then less and less.

    What endangers the recording is in each.
    """
    if not line.device:
        return ("",)
    samples, late = f"{grouped(line.samples)} samples", f"{line.late} late"
    mean, longest = f"cycle {1e3 * line.cycle_s:.2f} ms", f"longest {1e3 * line.longest_cycle_s:.2f} ms"
    cycle = f"{mean}, {longest}" if line.cycle_s else ""
    warning = f"⚠ {line.warning}" if line.warning else ""
    room, low = _room(line.free_bytes), 0 < line.free_bytes < LOW_DISK_BYTES
    choices = (
        (line.device, samples, late, cycle, room, warning),
        (line.device, samples, late, longest if line.cycle_s else "", room, warning),
        (line.device, late, room, warning),
        (line.device, room if low else "", warning),
    )
    return tuple(dict.fromkeys(" · ".join(filter(None, parts)) for parts in choices))


def _room(free_bytes: int) -> str:
    """Empty before it is known."""
    if not free_bytes:
        return ""
    room = f"{free_bytes / 1e9:.{0 if free_bytes >= 1e10 else 1}f} GB free"
    return f"⚠ only {room}" if free_bytes < LOW_DISK_BYTES else room
