"""Above every tab: what is open, the rig's state, what is recorded, STOP, and a sentence of news."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QColor, QGuiApplication, QPainter, QPaintEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QSizePolicy, QStackedWidget, QWidget

from ..widgets.labels import ElidedLabel
from ..widgets.theme import colours_of, large_font
from .context import RigLine

STOP_SIZE = QSize(136, 36)
RECORDING_WIDTH = 152
LIGHT = 12


class Lamp(QWidget):
    """A round light. Its colour never stands alone: a word is beside it, and its form tells it, too.

    ``off`` is a ring, ``ready`` and ``live`` a disc, ``fault`` a disc in the fault's colour,
    ``recording`` in red.
    """

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._light = "off"
        self.setAccessibleName(name)
        self.setFixedSize(LIGHT + 4, LIGHT + 4)

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
        painter.drawEllipse(2, 2, LIGHT, LIGHT)
        painter.end()


class FrameHeader(QWidget):
    """What it says is told it; what the STOP button does is in ``stop_guard.py``."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("frameHeader")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.own = QStackedWidget()
        self.own.addWidget(QWidget())
        self.doing = ElidedLabel()
        self.doing.setObjectName("doing")
        self.doing.setAccessibleName("What is running")
        self.doing.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.lamp = Lamp("State light")
        self.state = QLabel()
        self.state.setObjectName("rigState")
        self.state.setAccessibleName("State of the rig")
        self.dot = Lamp("Recording light")
        self.count = QLabel()
        self.count.setObjectName("sampleCount")
        self.count.setAccessibleName("Recorded samples")
        self.stop = QPushButton("STOP")
        self.stop.setObjectName("stop")
        self.stop.setAccessibleName("Stop the motor")
        self.stop.setFont(large_font())
        self.stop.setMinimumSize(STOP_SIZE)
        self.stop.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # Escape reaches it; space must not by accident
        self._lay_out()
        self.show_rig(RigLine())

    def _lay_out(self) -> None:
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 2, 8, 2)
        layout.setSpacing(8)
        layout.addWidget(self.own, 5)
        layout.addWidget(self.doing, 2)
        layout.addWidget(self.lamp)
        layout.addWidget(self.state)
        layout.addSpacing(8)
        # Its room is kept, so that nothing jumps when recording begins or the count gets longer.
        recording = QWidget()
        recording.setFixedWidth(RECORDING_WIDTH)
        recording.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Preferred)
        row = QHBoxLayout(recording)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(8)
        row.addWidget(self.dot)
        row.addWidget(self.count, 1)
        layout.addWidget(recording)
        layout.addWidget(self.stop)

    def show_own(self, widget: QWidget | None) -> None:
        """Show the tab's own part of the header."""
        if widget is None:
            self.own.setCurrentIndex(0)
            return
        if self.own.indexOf(widget) < 0:
            self.own.addWidget(widget)
        self.own.setCurrentWidget(widget)

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
        self.count.setText(f"{line.recording:,} {words}".replace(",", "\u202f") if recording else "")


class MessageBar(QFrame):
    """Hidden until there is something to say; stays until it is dismissed or replaced."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("messageBar")
        self.setAccessibleName("Message")
        self.sentence = QLabel()
        self.sentence.setObjectName("message")
        self.sentence.setWordWrap(True)
        self.sentence.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self.copy = QPushButton("&Copy details")
        self.copy.setObjectName("copyDetails")
        self.copy.clicked.connect(self._copy)
        self.dismiss = QPushButton("&Dismiss")
        self.dismiss.clicked.connect(self.hide)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(16, 8, 8, 8)
        layout.setSpacing(8)
        for widget in (self.sentence, self.copy, self.dismiss):
            layout.addWidget(widget)
        self._details = ""
        self.hide()

    def tell(self, sentence: str, details: str = "") -> None:
        """Show a sentence; with details it can be copied whole for a report. An empty one hides the bar."""
        if not sentence:
            self.hide()
            return
        self._details = details
        self.sentence.setText(sentence)
        self.setAccessibleDescription(sentence)
        self.copy.setVisible(bool(details))
        self.show()

    def _copy(self) -> None:
        QGuiApplication.clipboard().setText(f"{self.sentence.text()}\n\n{self._details}")
