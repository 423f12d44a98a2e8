"""The run that would best separate what these data cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fingerlab.identify.diagnosis.evidence import Evidence
from fingerlab.identify.diagnosis.study import Study
from fingerlab.sessions.model import Session


def propose(
    sessions: Sequence[Session], study: Study, evidence: Evidence, chosen: Sequence[int]
) -> dict[str, Any] | None:
    """None where nothing needs to be separated."""
    return None
