"""What the check of a rig finds: one outcome a question, all of them in a protocol that becomes a file."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

import fingerlab
from fingerlab.core.errors import UserError
from fingerlab.rig.constants import Rig
from fingerlab.rig.daq import plain_section

YES, NO, SKIP = "yes", "no", "skip"
CONFIRMED, FAILED, SKIPPED, NOTED, NOT_HERE = "confirmed", "failed", "skipped", "noted", "not applicable"


class Operator(Protocol):
    """Whoever stands at the bench, or answers in their place."""

    def tell(self, text: str) -> None: ...

    def ask(self, step: str, question: str) -> str:
        """``yes``, ``no`` or ``skip``."""
        ...


@dataclass(frozen=True)
class Outcome:
    """One question: what was asked, what was answered, what was measured (SI), and what follows."""

    id: str
    title: str
    state: str
    sentence: str
    question: str = ""
    answer: str = ""
    measured: dict[str, Any] = field(default_factory=dict)

    @property
    def open(self) -> bool:
        """Whether it failed or was left out: the bench is not known to be what its rig file says."""
        return self.state in (FAILED, SKIPPED)


@dataclass(frozen=True)
class CheckProtocol:
    """Everything that was confirmed or not, ready for a file."""

    device: str
    date: str
    rig: Rig
    rig_source: str
    outcomes: tuple[Outcome, ...]

    @property
    def all_confirmed(self) -> bool:
        """Whether no step failed and none was left out."""
        return not any(outcome.open for outcome in self.outcomes)

    def to_json(self) -> dict[str, Any]:
        """Ready for ``json.dumps``; values in SI."""
        return {
            "schema": 1,
            "kind": "check-rig",
            "date": self.date,
            "software": f"FingerLab {fingerlab.__version__}",
            "device": self.device,
            "rig_file": self.rig_source,
            "daq": plain_section(self.rig.daq),
            "limits": plain_section(self.rig.limits),
            "all_confirmed": self.all_confirmed,
            "steps": [asdict(outcome) for outcome in self.outcomes],
        }


def write_protocol(protocol: CheckProtocol, path: Path) -> None:
    """Write the protocol as JSON to a new file.

    Raises:
        UserError: the file is there already or cannot be written.
    """
    text = json.dumps(finite(protocol.to_json()), indent=1, allow_nan=False)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text + "\n")
    except FileExistsError:
        raise UserError(f"{path} exists already and is not overwritten; choose another name.") from None
    except OSError as error:
        raise UserError(f"{path} cannot be written ({error.strerror}); choose another folder.") from None


def finite(value: Any) -> Any:
    """JSON knows no NaN: what was not measured is null."""
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [finite(entry) for entry in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
