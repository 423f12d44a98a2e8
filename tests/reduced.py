"""Sums over sessions of which nothing is kept, as tests of single rooms need them."""

from __future__ import annotations

from collections.abc import Sequence

from fingerlab.core.progress import SILENT, Watch
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.gram.sums import Reduced
from fingerlab.diagnosis.signals.scales import Scales
from fingerlab.effects.base import Effect
from fingerlab.sessions.model import Session


def reduce_sessions(
    sessions: Sequence[Session],
    effects: Sequence[Effect],
    watch: Watch = SILENT,
    scales: Scales | None = None,
) -> Reduced:
    """One pass over the data, of which nothing is kept; ``scales``: as of :class:`Reduction`.

    Raises:
        UserError: nothing to analyse, a run that cannot be read, or channels whose sense is turned.
        Cancelled: the user asked for it.
    """
    return Reduction(sessions, scales=scales).of(effects, watch)
