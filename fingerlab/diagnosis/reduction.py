"""From sessions to Gram matrices: the only pass over the data.

All columns of all effects at all grid points are formed once (``columns``), low-passed, decimated
(``narrowing``), and reduced to products of features (``reading``), one matrix for each fold of each group of
runs (``groups``). Fits, held-out scores and distances between effects then cost nothing that grows with the
recording.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fingerlab.diagnosis.conditions import Fold
from fingerlab.diagnosis.features import Layout
from fingerlab.diagnosis.groups import (
    Group,
    GroupKey,
    Reduced,
    deal_runs,
    group_key,
    runs_to_analyse,
)
from fingerlab.diagnosis.narrowing import Keep
from fingerlab.diagnosis.recall import Recall
from fingerlab.diagnosis.repeating import remove_common_trend
from fingerlab.diagnosis.senses import Senses, check_senses
from fingerlab.diagnosis.sharing import sums_in_turn
from fingerlab.diagnosis.sums import RunSums, empty
from fingerlab.diagnosis.watch import SILENT, Watch
from fingerlab.effects.base import Effect
from fingerlab.sessions.model import Run, Session


def reduce_sessions(
    sessions: Sequence[Session],
    effects: Sequence[Effect],
    watch: Watch = SILENT,
    keep: Keep | None = None,
    recall: Recall | None = None,
) -> Reduced:
    """One pass over the data; ``keep`` is shown every stretch as it passes.

    ``recall`` tells whether a second process takes a share of the runs (not together with ``keep``), and
    holds what earlier passes over the same sessions left.

    Raises:
        UserError: nothing to analyse, a run that cannot be read, or channels whose sense is turned.
        Cancelled: the user asked for it.
    """
    pairs, on_bench = runs_to_analyse(sessions)
    phases, cables = {run.phase for _, run in pairs}, {run.cable for _, run in pairs}
    effects = [e for e in effects if (e.bench or not on_bench) and (not e.phases or phases & set(e.phases))]
    effects = [e for e in effects if cables >= set(e.cables)]
    dealt, places = deal_runs([run for _, run in pairs])
    groups: dict[GroupKey, Group] = {}
    layout: Layout | None = None
    seen: list[Senses] = []
    parts = sums_in_turn(pairs, effects, recall or Recall(), keep)
    for number, (_, run) in enumerate(pairs):
        watch.tell(number / len(pairs), f"reading run {run.name}")
        layout, sums = next(parts)
        key = group_key(run)
        if key not in groups:
            groups[key] = _empty_group(run, layout, dealt[key])
        _add(groups[key], places[number], sums)
        seen += sums.senses
    assert layout is not None
    check_senses(seen)
    for group in groups.values():
        remove_common_trend(group)
    radius = 1.0 if on_bench else pairs[0][0].rig.motor.pulley_radius or 1.0
    return Reduced(layout, list(groups.values()), on_bench, radius)


def _empty_group(run: Run, layout: Layout, dealt: list[Fold]) -> Group:
    size = layout.signal_count
    folds = [empty(size) for _ in dealt]
    return Group(group_key(run), run.cable_sign, folds, np.zeros((size, size)), dealt=dealt)


def _add(group: Group, k: int, found: RunSums) -> None:
    """Add a run to fold ``k`` of its group."""
    fold = group.folds[k]
    fold.runs.append(found.run)
    for part in found.parts:
        fold.add(part.sums, part.live)
        if part.noise is not None:
            group.noise[np.ix_(part.live, part.live)] += part.noise
            group.noise_samples += part.noise_samples
    for number, (live, trend) in enumerate(found.trends):
        whole = np.zeros((len(group.noise), trend.shape[1]))
        whole[live] = trend
        group.trends.setdefault((group.dealt[k].condition, number), []).append(whole)
    group.encoder_variance = max(group.encoder_variance, found.encoder_variance)
