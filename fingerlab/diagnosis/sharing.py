"""Who reads which run: this process, or a second one that works ahead.

Only sums travel between the processes (see ``fingerlab.core.parallel``); each keeps what it read.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import replace
from functools import partial

import numpy as np

from fingerlab.diagnosis.columns import Asked, layout_of_all, of_the_user
from fingerlab.diagnosis.features import Layout
from fingerlab.diagnosis.narrowing import Keep, Narrow
from fingerlab.diagnosis.reading import run_sums
from fingerlab.diagnosis.recall import Recall
from fingerlab.diagnosis.sums import RunSums
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Effect, Shape
from fingerlab.sessions.model import Run, Session

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
