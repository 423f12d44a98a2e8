"""What the frame asks of a tab. Subclass :class:`Tab` in a sub-package and name it in ``registry.py``.

The frame builds a tab when it is first shown (or first needed), so that the window opens without waiting
for the others. All that tabs share, they find on their :class:`fingerlab.ui.desk.Desk`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import QWidget

if TYPE_CHECKING:
    from pathlib import Path

    from fingerlab.sessions.model import Session

    from .desk import Desk


def _always() -> bool:
    return True


@dataclass(frozen=True)
class Command:
    """One thing that a tab can do: an entry of its menu, with its key.

    Attributes:
        text: as in the menu, with ``&`` before the letter of its mnemonic; empty for a separator.
        call: called without arguments. keys: such as ``Ctrl+Return``; works only while the tab is shown.
        enabled: asked before the menu opens and after :attr:`Desk.commands_changed`.
        checked: for an entry that is on or off: asked like ``enabled``; None for an ordinary one.
    """

    text: str
    call: Callable[[], Any] = _always
    keys: str | QKeySequence.StandardKey | None = None
    enabled: Callable[[], bool] = _always
    checked: Callable[[], bool] | None = None


SEPARATOR = Command("")


class Tab(QObject):
    """One tab of the window.

    Attributes:
        widget: the work area with its own side panel; made in ``__init__``.
        header: what stands at the left of the header while the tab is shown, or None; the frame shows the
            state of the rig, what is recorded, and STOP at the right of it.
        commands: entries of the tab's menu.
    """

    widget: QWidget
    header: QWidget | None = None
    commands: Sequence[Command] = ()

    def __init__(self, desk: Desk) -> None:
        super().__init__(desk)
        self.desk = desk

    def window_title(self) -> str:
        """What the window's title bar names while the tab is shown, such as a file; may be empty."""
        return ""

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
        return False

    @property
    def can_redo(self) -> bool:
        return False

    def can_close(self) -> bool:
        """Asked before the window closes; ask the user here, and answer False to stay open."""
        return True

    def shut_down(self) -> None:
        """The window closes now: end processes, threads and timers."""
