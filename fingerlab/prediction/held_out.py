"""Modelled force of every contact run of a session, by values that have not seen the run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.prediction.extended import Variant
from fingerlab.prediction.force import contact_runs, contact_stretches, solved_forces
from fingerlab.prediction.interval import RunError
from fingerlab.sessions.model import Array, Session


@dataclass(frozen=True)
class StretchForces:
    """Forces of one stretch of a contact run, N, (n,): by the two equations, and what the cell read."""

    session_sha256: str
    run: str
    cable: str
    time: Array
    measured: Array
    pip: Array
    mcp: Array
    frequency_hz: float
    held_out: bool

    def both(self, pip_weight: float) -> Array:
        """The two equations weighed; one alone where the other has no lever."""
        mixed = pip_weight * self.pip + (1.0 - pip_weight) * self.mcp
        return np.where(np.isfinite(mixed), mixed, np.where(np.isfinite(self.pip), self.pip, self.mcp))


def contact_forces(variant: Variant, session: Session, sha256: str, where: str) -> list[StretchForces]:
    """Forces of every contact run, each by values that have not seen it wherever there are such.

    Args:
        where: the model's name, for the errors' sentences.
    """
    effects = [c.alone() for c in variant.effects]
    result = []
    for run in contact_runs(session):
        without = variant.values_without(sha256, run.name)
        values = variant.values if without is None else without
        for one in contact_stretches(session, run):
            forces = solved_forces(one, effects, values, where)
            result.append(
                StretchForces(
                    sha256, run.name, run.cable, one.time, one.measured, forces["pip"], forces["mcp"],
                    one.frequency_hz, without is not None,
                )
            )  # fmt: skip
    return result


def by_run(forces: Sequence[StretchForces], errors: Sequence[RunError | None]) -> list[RunError]:
    """Errors of the stretches, those of one run joined."""
    runs: dict[tuple[str, str], list[RunError]] = {}
    for one, error in zip(forces, errors, strict=True):
        if error is not None:
            runs.setdefault((one.session_sha256, one.run), []).append(error)
    return [
        RunError(*(np.concatenate([getattr(e, part) for e in parts]) for part in ("force", "rate", "error")))
        for parts in runs.values()
    ]


def equation_weight(forces: Sequence[StretchForces]) -> float:
    """Share of the PIP equation that makes the mean square of the held-out error least, 0 to 1."""
    pip = np.concatenate([f.pip - f.measured for f in forces] or [np.zeros(0)])
    mcp = np.concatenate([f.mcp - f.measured for f in forces] or [np.zeros(0)])
    good = np.isfinite(pip) & np.isfinite(mcp)
    apart = pip[good] - mcp[good]
    size = float(apart @ apart)
    return float(np.clip(-(apart @ mcp[good]) / size, 0.0, 1.0)) if size > 1e-12 else 0.5
