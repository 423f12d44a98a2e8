"""STOP at once, whatever stands open: its button by the press itself, Escape, and the key of a foot switch.

A menu or a list takes every press of the mouse for itself, and a dialog keeps presses from the window behind
it. Hence, while a rig is connected:

* every press and key of the application is looked at first, wherever it goes. One on STOP's place is STOP's,
  even where a list stands open; the list is shut, and nothing is picked of it. So is one after What's This,
  which takes the next press for a question;
* while a dialog blocks the window, or a window of the program lies over STOP, a stand-in of STOP lies in the
  very same place, above it. It belongs to the dialog and is therefore not blocked by it.

Neither knows any dialog: one that is added tomorrow is held in the same way.
"""

from __future__ import annotations

from PySide6.QtCore import QCoreApplication, QEvent, QObject, QPoint, QRect, Qt, QTimer
from PySide6.QtGui import (
    QEventPoint,
    QGuiApplication,
    QInputEvent,
    QKeyEvent,
    QMouseEvent,
    QPointerEvent,
    QWindow,
)
from PySide6.QtWidgets import QApplication, QPushButton, QWhatsThis, QWidget

from ..widgets.layout import FLUSH, vbox
from .context import ApplicationContext
from .stop_key import STOP_KEYS, SystemKey
from .worker import Precedence

LOOK_MS = 50
"""From one look at what stands open to the next; nobody's hand is at STOP sooner after opening a dialog."""

MOST_POPUPS = 20
"""Lists and submenus that stand open at once; assumed."""

PRESSES = (
    QEvent.Type.MouseButtonPress,
    QEvent.Type.MouseButtonDblClick,  # the second press of two
    QEvent.Type.TabletPress,
    QEvent.Type.TouchBegin,
    QEvent.Type.TouchUpdate,  # of a further finger
)
KEYS = (QEvent.Type.ShortcutOverride, QEvent.Type.KeyPress)
"""The first comes before a shortcut takes the key, the second where the first was not sent."""


class StandIn(QWidget):
    """STOP again, as a window of its own that takes neither the keyboard nor a place among the windows."""

    def __init__(self, button: QPushButton, owner: QWindow) -> None:
        super().__init__(
            None,
            Qt.WindowType.ToolTip  # above dialogs and lists; on X11 not the window manager's
            | Qt.WindowType.FramelessWindowHint
            | Qt.WindowType.WindowDoesNotAcceptFocus,
        )
        self.setAttribute(Qt.WidgetAttribute.WA_ShowWithoutActivating)
        self.setAttribute(Qt.WidgetAttribute.WA_QuitOnClose, False)
        self.setWindowTitle("STOP – FingerLab")
        self.owner = owner
        self.button = QPushButton(button.text())
        self.button.setObjectName(button.objectName())  # by which it has its colour
        self.button.setAccessibleName(button.accessibleName())
        self.button.setFont(button.font())
        self.button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.button.setMinimumSize(button.size())
        vbox(self, self.button, margins=FLUSH)
        self.winId()  # made now, to belong to the dialog before it is shown
        handle = self.windowHandle()
        assert handle is not None
        handle.setTransientParent(owner)


class StopGuard(QObject):
    """Belongs to one window and its STOP button; asleep until it is armed.

    Attributes:
        key: the foot switch's, one of :data:`STOP_KEYS`. alone: why it is heard only while FingerLab is in
            front, empty where the whole system gives it.
        stand_in: what lies over the button's place now, or None.
    """

    def __init__(self, window: QWidget, button: QPushButton, context: ApplicationContext) -> None:
        super().__init__(window)
        self._window, self._button, self._context = window, button, context
        self._armed = False
        self._last = 0
        self._system = SystemKey(context.stop)
        self.key = context.settings.stop_key()
        self.alone = ""
        self.stand_in: StandIn | None = None
        self._timer = QTimer(self, interval=LOOK_MS)
        self._timer.timeout.connect(self.look)
        button.pressed.connect(context.stop)
        self._say_keys()

    def arm(self, on: bool) -> None:
        """Guard from now on, or sleep."""
        app = QCoreApplication.instance()
        if on == self._armed or app is None:
            return
        self._armed = on
        Precedence.take(on)
        # The system's own dialogs would keep keys and presses to themselves.
        QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_DontUseNativeDialogs, on)
        if on:
            app.installEventFilter(self)
            self._timer.start()
            self._take_key()
        else:
            app.removeEventFilter(self)
            self._timer.stop()
            self._end_stand_in()
            self._system.release()
            self.alone = ""
        self._say_keys()

    def choose_key(self, name: str) -> None:
        """Another key for the foot switch."""
        self.key = name
        self._context.settings.set_stop_key(name)
        if self._armed:
            self._take_key()
        self._say_keys()

    def _take_key(self) -> None:
        self.alone = self._system.take(self.key, self._window)
        if self.alone:
            self._context.say(f"Foot-switch key {self.key} is heard only while FingerLab is in front")
        else:
            self._context.say(f"Foot-switch key {self.key} is heard, also while another program is in front")

    def _say_keys(self) -> None:
        alone = f" while FingerLab is in front: {self.alone}"
        where = alone if self.alone else " from another program, too"
        self._button.setToolTip(
            "Motor current to zero and amplifier off, at once "
            f"(Escape, in every tab; {self.key}{where if self._armed else ''})."
        )

    # presses and keys

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if not isinstance(
            event, QInputEvent
        ):  # first: the type of each event of the application takes longer
            return False
        if isinstance(event, QKeyEvent):
            self._on_key(event)
        elif isinstance(event, QPointerEvent) and event.type() in PRESSES and self._on_stop(event):
            return self._on_press(watched, event)
        return False  # a key goes on to where it was meant for, too

    def _on_key(self, event: QKeyEvent) -> None:
        if event.type() not in KEYS or event.isAutoRepeat():
            return
        scan_code = self._system.scan_code
        if event.key() not in (Qt.Key.Key_Escape, STOP_KEYS[self.key].qt) and (
            not scan_code or event.nativeScanCode() != scan_code
        ):
            return
        # The same press comes again for the widget, for those that it is in, and as a shortcut before.
        if not event.timestamp() or event.timestamp() != self._last:
            self._last = event.timestamp()
            self._context.stop()

    def _on_stop(self, event: QPointerEvent) -> bool:
        """Whether something was pressed where STOP is."""
        shown = [self._button] if self._button.isVisible() and not self._window.isMinimized() else []
        if self.stand_in is not None and self.stand_in.isVisible():
            shown.append(self.stand_in.button)
        places = [QRect(button.mapToGlobal(QPoint(0, 0)), button.size()) for button in shown]
        return any(
            point.state() == QEventPoint.State.Pressed and place.contains(point.globalPosition().toPoint())
            for point in event.points()
            for place in places
        )

    def _on_press(self, watched: QObject, event: QPointerEvent) -> bool:
        """Stop; True where the press ends here."""
        own = [self._button, *([self.stand_in.button] if self.stand_in is not None else [])]
        handles = [widget.window().windowHandle() for widget in own]
        goes_there = watched in handles or watched in own
        plain = isinstance(event, QMouseEvent) and event.button() == Qt.MouseButton.LeftButton
        asks_what = QWhatsThis.inWhatsThisMode()  # which would keep the press from the button, to explain it
        if goes_there and plain and not asks_what and QApplication.activePopupWidget() is None:
            return False  # the button acts by itself, and shows it
        self._context.stop()
        if asks_what:
            QWhatsThis.leaveWhatsThisMode()
        for _ in range(MOST_POPUPS):
            popup = QApplication.activePopupWidget()
            if popup is None:
                break
            popup.close()
        return True

    # the stand-in

    def look(self) -> None:
        """Lay the stand-in where it is needed, or take it away."""
        owner = self._over()
        if owner is None or not self._button.isVisible() or self._window.isMinimized():
            self._end_stand_in()
            return
        if self.stand_in is None or self.stand_in.owner is not owner:
            self._end_stand_in()
            self.stand_in = StandIn(self._button, owner)
            self.stand_in.button.pressed.connect(self._context.stop)
        place = QRect(self._button.mapToGlobal(QPoint(0, 0)), self._button.size())
        if self.stand_in.geometry() != place:
            self.stand_in.setGeometry(place)
        if not self.stand_in.isVisible():
            self.stand_in.show()
            self.stand_in.raise_()

    def _over(self) -> QWindow | None:
        """What keeps presses from STOP: a dialog that blocks the window, or a window that lies over STOP."""
        modal = QGuiApplication.modalWindow()
        if modal is not None:
            return modal
        place = QRect(self._button.mapToGlobal(QPoint(0, 0)), self._button.size())
        own = (self._window, self.stand_in)
        for other in QApplication.topLevelWidgets():
            if (
                other not in own
                and other.isVisible()
                and other.windowType() != Qt.WindowType.ToolTip
                and other.frameGeometry().intersects(place)
            ):
                return other.windowHandle()
        return None

    def _end_stand_in(self) -> None:
        stand_in, self.stand_in = self.stand_in, None
        if stand_in is not None:
            stand_in.hide()
            stand_in.deleteLater()
