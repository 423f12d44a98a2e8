"""How a model does on each motion that was recorded, on runs that its fit has not seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fingerlab.diagnosis.groups import GroupKey, Reduced, deal_runs, group_key, runs_to_analyse
from fingerlab.diagnosis.results import HeldOutRuns
from fingerlab.diagnosis.trial import Trial
from fingerlab.sessions.model import Run, Session


def held_out_runs(sessions: Sequence[Session], reduced: Reduced, trial: Trial) -> tuple[HeldOutRuns, ...]:
    """The trial's score on the runs of every condition, in the order of the groups; () if it has none."""
    if not trial.held_out:
        return ()
    members = _members(sessions)
    conditions = [(g.key, c) for g in reduced.groups for c in g.conditions]
    found = []
    for place, (misfit, count) in zip(conditions, trial.misfits, strict=True):
        runs = members[place]
        found.append(
            HeldOutRuns(
                runs=tuple(run.name for run in runs),
                phase=runs[0].phase,
                cable=runs[0].cable,
                trajectory=runs[0].trajectory,
                score=float(np.sqrt(1.0 + max(float(misfit), 0.0) / max(float(count), 1.0))),
            )
        )
    return tuple(found)


def _members(sessions: Sequence[Session]) -> dict[tuple[GroupKey, int], list[Run]]:
    """The runs of each condition of each group, as the reading deals them."""
    runs = [run for _, run in runs_to_analyse(sessions)[0]]
    folds, places = deal_runs(runs)
    members: dict[tuple[GroupKey, int], list[Run]] = {}
    for run, place in zip(runs, places, strict=True):
        key = group_key(run)
        members.setdefault((key, folds[key][place].condition), []).append(run)
    return members
