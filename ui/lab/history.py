"""The models tried so far, with undo and redo. No Qt, nothing is computed twice."""

from __future__ import annotations

from dataclasses import dataclass

from fingerlab.diagnosis.answer.results import Diagnosis


@dataclass(frozen=True)
class Step:
    """A model that was fitted: the effects added to the nominal equations, and what came out."""

    added: tuple[str, ...]
    diagnosis: Diagnosis

    @property
    def last_added(self) -> str | None:
        return self.added[-1] if self.added else None


class History:
    """Steps from the nominal model onwards; a new step after an undo replaces what was undone."""

    def __init__(self, nominal: Diagnosis, added: tuple[str, ...] = ()) -> None:
        self._steps = [Step(added, nominal)]
        self._index = 0

    @property
    def now(self) -> Step:
        return self._steps[self._index]

    @property
    def first(self) -> Step:
        return self._steps[0]

    @property
    def done(self) -> tuple[Step, ...]:
        """Steps up to the present one, the nominal model first."""
        return tuple(self._steps[: self._index + 1])

    @property
    def can_undo(self) -> bool:
        return self._index > 0

    @property
    def can_redo(self) -> bool:
        return self._index < len(self._steps) - 1

    def push(self, step: Step) -> None:
        self._steps[self._index + 1 :] = [step]
        self._index += 1

    def undo(self) -> None:
        self._index = max(self._index - 1, 0)

    def redo(self) -> None:
        self._index = min(self._index + 1, len(self._steps) - 1)

    def undone(self) -> str | None:
        """The effect that redo would put back."""
        return self._steps[self._index + 1].last_added if self.can_redo else None
