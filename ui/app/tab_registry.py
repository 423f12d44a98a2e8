"""What the frame asks of a tab, which tabs there are, and the rail that chooses among them.

To add a tab: subclass :class:`Tab` in a sub-package and add its line to :data:`TABS`. The frame builds a tab
when it is first shown (or first needed), so that the window opens without waiting for the others. All that
tabs share, they find on their :class:`fingerlab.ui.app.context.ApplicationContext`.

The number is the tab's place on the rail and its key, Ctrl+number; it stays the same whichever tabs exist:
1 Acquire, 2 Calibrate, 3 Sessions, 4 Fit, 5 Predict, 6 Model lab.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QFont, QFontMetrics, QKeySequence
from PySide6.QtWidgets import QButtonGroup, QComboBox, QPushButton, QWidget

from ..widgets.layout import described, vbox
from .context import ApplicationContext
from .undo import UndoSteps

if TYPE_CHECKING:
    from pathlib import Path

    from fingerlab.sessions.model import Session


def _always() -> bool:
    return True


@dataclass(frozen=True)
class Command:
    """One thing that a tab can do: an entry of its menu, with its key.

    Attributes:
        text: as in the menu, with ``&`` before the letter of its mnemonic; empty for a separator.
        call: called without arguments. keys: such as ``Ctrl+Return``; works only while the tab is shown.
        enabled: asked before the menu opens and after :attr:`ApplicationContext.commands_changed`.
        checked: for an entry that is on or off: asked like ``enabled``; None for an ordinary one.
        within: title of the menu inside the tab's menu where it stands; empty where it stands in that itself.
    """

    text: str
    call: Callable[[], Any] = _always
    keys: str | QKeySequence.StandardKey | None = None
    enabled: Callable[[], bool] = _always
    checked: Callable[[], bool] | None = None
    within: str = ""


SEPARATOR = Command("")


def run_commands(runs: Callable[[], QComboBox], enabled: Callable[[], bool]) -> tuple[Command, Command]:
    """To the next and to the previous run of a list, which ends at either end."""

    def step(by: int) -> None:
        box = runs()
        box.setCurrentIndex(min(max(box.currentIndex() + by, 0), box.count() - 1))

    return (
        Command("Next run", partial(step, 1), "Alt+Down", enabled),
        Command("Previous run", partial(step, -1), "Alt+Up", enabled),
    )


class Tab(QObject):
    """One tab of the window.

    Attributes:
        widget: the work area with its own side panel; made in ``__init__``.
        header: what stands at the left of the header while the tab is shown, or None; the frame shows the
            state of the rig, what is recorded, and STOP at the right of it.
        commands: entries of the tab's menu.
        history: steps of the tab that can be taken back; None where it has none, or tells itself.
    """

    widget: QWidget
    header: QWidget | None = None
    commands: Sequence[Command] = ()
    history: UndoSteps[Any] | None = None

    def __init__(self, context: ApplicationContext) -> None:
        super().__init__(context)
        self.context = context

    def window_title(self) -> str:
        """What the window's title bar names while the tab is shown, such as a file; may be empty."""
        return ""

    def figure_source(self, plot: QWidget) -> str:
        """What a plot of the tab is of, to stand above a figure that is saved of it: session, model, runs."""
        return self.window_title()

    def on_shown(self) -> None:
        """The tab has come to the front. Begin here what takes time, not when sessions are opened."""

    def on_hidden(self) -> None:
        """Another tab has come to the front: stop drawing."""

    def on_session_opened(self, sessions: tuple[Session, ...]) -> None:
        """Other sessions are open, or none (an empty tuple). Also called when a tab is built later."""

    def on_session_recorded(self, path: Path) -> None:
        """A session file has been recorded and verified."""

    def accept_files(self, paths: Sequence[Path]) -> bool:
        """Files were dropped while the tab is shown: True where it takes them; else they are opened."""
        return False

    def undo(self) -> None:
        """Take back the last step; Ctrl+Z while the tab is shown."""

    def redo(self) -> None:
        """The opposite; Ctrl+Shift+Z."""

    @property
    def can_undo(self) -> bool:
        return self.history is not None and self.history.can_undo

    @property
    def can_redo(self) -> bool:
        return self.history is not None and self.history.can_redo

    def can_close(self) -> bool:
        """Asked before the window closes; ask the user here, and answer False to stay open."""
        return True

    def shut_down(self) -> None:
        """The window closes now: end processes, threads and timers."""


TabMaker = Callable[[ApplicationContext], Tab]


@dataclass(frozen=True)
class TabEntry:
    """A tab before it is built.

    Attributes:
        key: by which others name it. title, help: as on the rail. make: builds it.
    """

    number: int
    key: str
    title: str
    help: str
    make: TabMaker


def _later(module: str, name: str) -> TabMaker:
    """Import the tab when it is built: the window opens without waiting for it."""

    def make(context: ApplicationContext) -> Tab:
        maker: TabMaker = getattr(import_module(module, __package__), name)
        return maker(context)

    return make


TABS: tuple[TabEntry, ...] = (
    TabEntry(
        1,
        "acquire",
        "Acquire",
        "Connect a rig, see it live, drive it and record it.",
        _later("..acquire.acquire_tab", "AcquireTab"),
    ),
    TabEntry(
        2,
        "calibrate",
        "Calibrate",
        "Load cell and angle sensors, step by step: volts to units.",
        _later("..calibrate.calibrate_tab", "CalibrateTab"),
    ),
    TabEntry(
        3,
        "sessions",
        "Sessions",
        "A folder of sessions: find, review, tag, cut, merge and export them.",
        _later("..sessions.sessions_tab", "SessionsTab"),
    ),
    TabEntry(
        4,
        "fit",
        "Fit",
        "Moment arms, friction losses and delays of the runs on air.",
        _later("..fit.fit_tab", "FitTab"),
    ),
    TabEntry(
        5,
        "predict",
        "Predict",
        "The endpoint force that models foretell, beside the load cell.",
        _later("..predict.predict_tab", "PredictTab"),
    ),
    TabEntry(
        6,
        "model_lab",
        "Model lab",
        "Where the model fails, which physical effect is missing, and whether it is true.",
        _later("..lab.model_lab_tab", "ModelLabTab"),
    ),
)
"""In the order of their numbers."""


PADDING = 28
"""Room that the style puts around a title, in pixels."""


class Rail(QWidget):
    """Signal ``chosen(key)``."""

    chosen = Signal(str)

    def __init__(self, tabs: Sequence[TabEntry], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("rail")
        self.setAccessibleName("Tabs")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        layout = vbox(self, margins=(0, 8, 0, 8), spacing=0)
        self._group = QButtonGroup(self)
        self._buttons: dict[str, QPushButton] = {}
        for tab in tabs:
            button = described(QPushButton(tab.title), f"tab_{tab.key}", rail="true")
            button.setCheckable(True)
            button.setToolTip(f"{tab.help} (Ctrl+{tab.number})")
            button.setAccessibleName(tab.title)
            button.clicked.connect(lambda _checked=False, key=tab.key: self.chosen.emit(key))
            self._group.addButton(button)
            self._buttons[tab.key] = button
            bold = QFont(button.font())
            bold.setBold(True)  # as the style draws the one in front
            button.setMinimumWidth(QFontMetrics(bold).horizontalAdvance(tab.title) + PADDING)
            layout.addWidget(button)
        layout.addStretch(1)

    def show_current(self, key: str) -> None:
        """Mark a tab as the one in front (without going there)."""
        self._buttons[key].setChecked(True)

    def take_focus(self) -> None:
        """The keyboard begins at the tab in front; Qt would begin at the topmost, and Space go there."""
        checked = self._group.checkedButton()
        if checked is not None:
            checked.setFocus()
