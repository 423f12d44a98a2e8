"""Long runs come in stretches; on the screen a run is one curve."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from fingerlab.diagnosis.answer.results import Comparison
from fingerlab.sessions.model import Array


def run_key(comparison: Comparison) -> str:
    """Session and run in one text: Qt hands back a tuple as a list, a text as it is."""
    return f"{comparison.session}\n{comparison.run}"


def joined(comparisons: Iterable[Comparison]) -> dict[tuple[str, str], Comparison]:
    """One comparison for each equation and run, by equation and ``run_key``.

    Stretches of one run follow one another in time, with a gap between them. The floor is the mean over
    the samples.
    """
    parts: dict[tuple[str, str], list[Comparison]] = {}
    for comparison in comparisons:
        parts.setdefault((comparison.equation, run_key(comparison)), []).append(comparison)
    return {key: pieces[0] if len(pieces) == 1 else _join(pieces) for key, pieces in parts.items()}


def _join(pieces: list[Comparison]) -> Comparison:
    pieces = sorted((p for p in pieces if len(p.time)), key=lambda p: float(p.time[0]))
    counts = [len(p.time) for p in pieces]
    times, measured, modelled = [], [], []
    for piece in pieces:
        # The gap is one sample of "nothing" at the end of each stretch; time itself never holds NaN.
        times += [piece.time, piece.time[-1:]]
        measured += [piece.measured, _NOTHING]
        modelled += [piece.modelled, _NOTHING]
    return replace(
        pieces[0],
        time=np.concatenate(times),
        measured=np.concatenate(measured),
        modelled=np.concatenate(modelled),
        floor=float(np.average([p.floor for p in pieces], weights=counts)),
        held_out=all(p.held_out for p in pieces),
        coordinates={
            name: np.concatenate([part for p in pieces for part in (p.coordinates[name], _NOTHING)])
            for name in pieces[0].coordinates
        },
    )


_NOTHING: Array = np.array([np.nan])
