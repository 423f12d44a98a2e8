"""What can be undone and what can be done again, for every history of the window."""

from __future__ import annotations

from typing import Generic, TypeVar

from PySide6.QtCore import QObject, Signal

MOST_STEPS = 200

Step = TypeVar("Step")


class UndoSteps(QObject, Generic[Step]):
    """Steps that were done and steps that were undone, each with the latest last.

    A step is a state as it was before, or something that knows how to undo itself.

    Signal ``changed``: another step can be undone or redone.
    """

    changed = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._done: list[Step] = []
        self._undone: list[Step] = []

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to take back."""
        return bool(self._done)

    @property
    def can_redo(self) -> bool:
        """Whether a step was taken back that can be done again."""
        return bool(self._undone)

    def add(self, step: Step) -> None:
        """Something was done; what was undone before cannot be done again any more."""
        self._done.append(step)
        del self._done[:-MOST_STEPS]
        self._undone.clear()
        self.changed.emit()

    def forget(self) -> None:
        """Nothing can be undone or redone any more."""
        self._done.clear()
        self._undone.clear()
        self.changed.emit()

    def back(self, now: Step) -> Step:
        """The state before this one, which can be redone; only where something can be undone."""
        self._undone.append(now)
        return self._done.pop()

    def forth(self, now: Step) -> Step:
        """The state that was undone last; only where something can be redone."""
        self._done.append(now)
        return self._undone.pop()
