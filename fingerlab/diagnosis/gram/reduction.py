"""From sessions to Gram matrices: the only pass over the data.

All columns of all effects at all grid points are formed once, low-passed, decimated, and reduced to products
of features, one matrix for each fold of each group of runs. Fits, held-out scores and distances between
effects then cost nothing that grows with the recording. A second process may read ahead; only sums travel
between the two (see ``fingerlab.core.parallel``), and each keeps what it read.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import replace
from functools import partial

import numpy as np

from fingerlab.core.progress import SILENT, Watch
from fingerlab.diagnosis.equations.columns import Asked, layout_of, of_the_user
from fingerlab.diagnosis.equations.features import Layout
from fingerlab.diagnosis.gram.decimation import Narrow
from fingerlab.diagnosis.gram.runs import Keep, Recall, run_sums
from fingerlab.diagnosis.gram.sums import Group, Reduced, RunSums, empty
from fingerlab.diagnosis.signals.conditions import Fold, GroupKey, deal_runs, group_key, runs_to_analyse
from fingerlab.diagnosis.signals.segments import Senses, check_senses, stretches
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Effect, Shape
from fingerlab.sessions.model import Array, Run, Session
from fingerlab.sessions.trajectory import told_frequency


def layout_of_all(
    pairs: Sequence[tuple[Session, Run]], effects: Sequence[Effect], recall: Recall
) -> tuple[Layout, list[Asked]]:
    """The features of all runs, those of the motor alone last; and what is asked of each run."""
    kinds = [run.phase == "motor_bench" for _, run in pairs]
    layouts = {}
    for on_bench in sorted(set(kinds)):
        number = kinds.index(on_bench)
        session, run = pairs[number]
        known = next(recall.stretches(number), None)
        motion = known.motion if known is not None else next(stretches(run, session.rig))
        beside = len(set(kinds)) == 2
        layouts[on_bench] = layout_of(motion.glimpse(), session, effects, beside_finger=beside)
    asked, start, seek_cycle = {}, 0, all(told_frequency(run) is None for _, run in pairs)
    for on_bench, layout in layouts.items():
        asked[on_bench] = Asked(layout.signals, len(layout.base), start, seek_cycle)
        start += layout.signal_count
    finger, *bench = layouts.values()
    if bench:
        finger = replace(
            finger,
            features=(*finger.features, *bench[0].features),
            base=np.concatenate((finger.base, len(finger.features) + bench[0].base)),
            signals=np.concatenate((finger.signals, finger.signal_count + bench[0].signals)),
        )
    return finger, [asked[on_bench] for on_bench in kinds]


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
    effects = [
        e for e in effects if (e.bench is True or not on_bench) and (not e.phases or phases & set(e.phases))
    ]
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


def remove_common_trend(group: Group) -> None:
    """Takes out of a group's noise the slow trend that the runs of a condition have in common.

    A trend (a sensor that warms up, a spring that creeps) is no noise if it comes again in every run: it can
    be explained. Its noise is what it differs by from run to run. Only in free motion: how a tip settles on
    the load cell comes again, too, and no law here tells it.
    """
    for trends in _comparable(group):
        count = len(trends)
        if count < 2 or group.in_contact:
            continue
        runs = np.stack(trends)  # (runs, signals, degrees)
        mean = runs.mean(axis=0)
        apart = (runs - mean).transpose(1, 0, 2).reshape(mean.shape[0], -1)
        group.noise += apart @ apart.T / (count - 1) - count * mean @ mean.T
    group.trends.clear()


def _comparable(group: Group) -> list[list[Array]]:
    """Trends of runs that can be compared: those of one condition, and of all conditions with one run."""
    repeated = [trends for trends in group.trends.values() if len(trends) > 1]
    alone: dict[int, list[Array]] = {}
    for (_, stretch), trends in group.trends.items():
        if len(trends) == 1:
            alone.setdefault(stretch, []).extend(trends)
    return [*repeated, *alone.values()]


TASKS_AHEAD = 2
"""Runs that a second process is given at a time: one at work and one waiting."""
Grid = tuple[str, Sequence[Shape]]
"""A built-in effect by its id, and the shapes that are asked of it."""


def sums_in_turn(
    pairs: Sequence[tuple[Session, Run]],
    effects: Sequence[Effect],
    recall: Recall,
    keep: Keep | None,
) -> Iterator[tuple[Layout, RunSums]]:
    """The sums of every run, in order; a second process works ahead on every run that is not yet begun.

    The layout is made here, from the first run: only its sums travel between the processes. A run goes to the
    process that has read it before.
    """
    layout, asked = layout_of_all(pairs, effects, recall)
    size = layout.signal_count
    grids = [(e.id, e.shapes) for e in effects]
    # A user's own effect lives in this process only, and so does what is shown.
    alone = recall.executor is None or keep is not None or any(of_the_user(e) for e in effects)
    waiting = deque(range(len(pairs)))
    ahead: dict[int, Future[RunSums]] = {}
    done: dict[int, RunSums] = {}

    def ask(number: int) -> None:
        session, run = pairs[number]
        waiting.remove(number)
        recall.elsewhere.add(number)
        assert recall.executor is not None
        ahead[number] = recall.executor.submit(
            _elsewhere, number, replace(session, runs=()), run, grids, asked[number], recall.number
        )

    try:
        for number in range(len(pairs)):
            while number not in done:
                while not alone and sum(not f.done() for f in ahead.values()) < TASKS_AHEAD:
                    theirs = _theirs(recall, waiting)
                    if theirs is None:
                        break
                    ask(theirs)
                own = next((n for n in waiting if alone or n not in recall.elsewhere), None)
                if own is not None and (number in waiting or not ahead[number].done()):
                    waiting.remove(own)
                    shown = None if keep is None else partial(_shown, keep, asked[own].start, size)
                    done[own] = run_sums(own, *pairs[own], effects, asked[own], shown, recall)
                else:
                    done[number] = ahead.pop(number).result()
            yield layout, done.pop(number)
    finally:
        for future in ahead.values():
            future.cancel()


def _shown(
    keep: Keep,
    start: int,
    size: int,
    session: Session,
    run: Run,
    low: Narrow,
) -> None:
    """Keep a stretch with its signals in their places among those of all runs."""
    columns = low.columns
    if columns.shape[1] != size:
        columns = np.zeros((len(low.time), size))
        columns[:, start : start + low.columns.shape[1]] = low.columns
    keep(session, run, replace(low, columns=columns, live=low.live + start))


def _theirs(recall: Recall, waiting: Iterable[int]) -> int | None:
    """The run that the second process is given next: one that it has read, or one that neither has.

    Of the latter the next in turn is left to this process.
    """
    read = [n for n in waiting if n in recall.elsewhere]
    return (read + [n for n in waiting if n not in recall][1:2] + [None])[0]


_recalled = Recall(number=-1)
"""In the second process: what it has read of the analysis that is going on."""


def _elsewhere(
    number: int, session: Session, run: Run, grids: Sequence[Grid], asked: Asked, analysis: int
) -> RunSums:
    """What the second process does."""
    global _recalled
    if _recalled.number != analysis:
        _recalled = Recall(number=analysis)
    effects = [replace(CATALOGUE[name], shapes=shapes) for name, shapes in grids]
    return run_sums(number, session, run, effects, asked, None, _recalled)
