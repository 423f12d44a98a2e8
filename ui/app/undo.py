"""What can be undone and what can be done again: steps of any kind, and whole states of forms."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic, Protocol, TypeVar

from PySide6.QtCore import QEvent, QObject, QTimer, Signal
from PySide6.QtGui import QKeyEvent, QKeySequence
from PySide6.QtWidgets import QAbstractSpinBox, QWidget

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


MERGE_S = 1.0
"""Changes of one field that follow one another so soon, such as turns of the wheel, are one step."""

State = Mapping[str, Any]


class UndoableForm(Protocol):
    """A form whose whole state can be taken and given back."""

    def state(self) -> State: ...

    def restore(self, state: State) -> None: ...


class FormHistory(UndoSteps[dict[str, State]]):
    """Steps are what all forms held before. Signal ``shown(name)``: undo or redo has changed that form."""

    shown = Signal(str)

    def __init__(
        self,
        forms: Mapping[str, UndoableForm],
        parent: QObject | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(parent)
        self._forms = dict(forms)
        self._clock = clock
        self._now = self._states()
        self._last: tuple[set[tuple[str, str]], float] = (set(), 0.0)
        self._applying = False
        # All that one click changes, such as a trajectory that was handed over, is one step.
        self._settled = QTimer(self, singleShot=True, interval=0)
        self._settled.timeout.connect(self.note)

    def watch(self, fields: Sequence[QWidget]) -> None:
        """Let Ctrl+Z through where the field itself has nothing to take back."""
        for field in fields:
            field.installEventFilter(self)

    def edited(self) -> None:
        """A field has another value."""
        if not self._applying:
            self._settled.start()

    def note(self) -> None:
        """Take what was changed since the last look as one step."""
        self._settled.stop()
        now = self._states()
        changes = _changes(self._now, now)
        if not changes:
            return
        keys, moment = self._last
        merged = changes == keys and len(keys) == 1 and self._clock() - moment < MERGE_S and self.can_undo
        before, self._now = self._now, now
        self._last = changes, self._clock()
        self.add(self._done.pop() if merged else before)

    def given(self, name: str) -> None:
        """What stands in that form now was not entered by hand, such as a rig's own values: no step."""
        state = dict(self._forms[name].state())
        for step in (self._now, *self._done, *self._undone):
            step[name] = state

    def undo(self) -> None:
        """Take the last step back."""
        self.note()
        if self.can_undo:
            self._go_to(self.back(self._now))

    def redo(self) -> None:
        """Do it again."""
        self.note()
        if self.can_redo:
            self._go_to(self.forth(self._now))

    def _go_to(self, wanted: dict[str, State]) -> None:
        names = sorted({name for name, _ in _changes(self._now, wanted)})
        self._applying = True
        for name in names:
            self._forms[name].restore(wanted[name])
        self._applying = False
        self._now = self._states()
        self._last = set(), 0.0
        self.changed.emit()
        for name in names:
            self.shown.emit(name)

    def _states(self) -> dict[str, State]:
        return {name: dict(form.state()) for name, form in self._forms.items()}

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """A field takes Ctrl+Z for itself, even with nothing to undo; let it go on to the window then."""
        if event.type() != QEvent.Type.ShortcutOverride or not isinstance(event, QKeyEvent):
            return False
        line = watched.lineEdit() if isinstance(watched, QAbstractSpinBox) else None
        for key, busy in (
            (QKeySequence.StandardKey.Undo, line is not None and line.isUndoAvailable()),
            (QKeySequence.StandardKey.Redo, line is not None and line.isRedoAvailable()),
        ):
            if event.matches(key) and not busy:
                event.ignore()
                return True
        return False


def _changes(before: Mapping[str, State], after: Mapping[str, State]) -> set[tuple[str, str]]:
    """Form and field of everything that differs."""
    return {
        (name, key)
        for name, state in after.items()
        for key in set(state) | set(before[name])
        if state.get(key) != before[name].get(key)
    }
