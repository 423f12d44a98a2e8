"""Undo of what was entered in the forms: whole states of them, one step for each thing that a hand did."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from PySide6.QtCore import QEvent, QObject, QTimer, Signal
from PySide6.QtGui import QKeyEvent, QKeySequence
from PySide6.QtWidgets import QAbstractSpinBox, QWidget

MERGE_S = 1.0
"""Changes of one field that follow one another so soon, such as turns of the wheel, are one step."""

MOST_STEPS = 200

State = Mapping[str, Any]


class Form(Protocol):
    """A form whose whole state can be taken and given back."""

    def state(self) -> State: ...

    def restore(self, state: State) -> None: ...


class FormHistory(QObject):
    """Signals: changed: can be undone or not. shown(name): undo or redo has changed that form."""

    changed = Signal()
    shown = Signal(str)

    def __init__(
        self,
        forms: Mapping[str, Form],
        parent: QObject | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(parent)
        self._forms = dict(forms)
        self._clock = clock
        self._now = self._states()
        self._undo: list[dict[str, State]] = []
        self._redo: list[dict[str, State]] = []
        self._last: tuple[set[tuple[str, str]], float] = (set(), 0.0)
        self._applying = False
        # All that one click changes, such as a trajectory that was handed over, is one step.
        self._settled = QTimer(self)
        self._settled.setSingleShot(True)
        self._settled.setInterval(0)
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
        if not (changes == keys and len(keys) == 1 and self._clock() - moment < MERGE_S and self._undo):
            self._undo.append(self._now)
            del self._undo[:-MOST_STEPS]
        self._last = changes, self._clock()
        self._now = now
        self._redo.clear()
        self.changed.emit()

    def given(self, name: str) -> None:
        """What stands in that form now was not entered by hand, such as a rig's own values: no step."""
        state = dict(self._forms[name].state())
        for step in (self._now, *self._undo, *self._redo):
            step[name] = state

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to take back."""
        return bool(self._undo)

    @property
    def can_redo(self) -> bool:
        """Whether a step was taken back that can be done again."""
        return bool(self._redo)

    def undo(self) -> None:
        """Take the last step back."""
        self.note()
        self._go(self._undo, self._redo)

    def redo(self) -> None:
        """Do it again."""
        self.note()
        self._go(self._redo, self._undo)

    def _go(self, source: list[dict[str, State]], target: list[dict[str, State]]) -> None:
        if not source:
            return
        wanted = source.pop()
        target.append(self._now)
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
