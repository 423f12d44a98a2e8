"""The sums of one run: its stretches read or recalled, and reduced to products of signals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fingerlab.diagnosis.columns import Asked
from fingerlab.diagnosis.narrowing import Keep, Narrow, narrow_again, narrow_columns, to_recall
from fingerlab.diagnosis.recall import Recall, Seen
from fingerlab.diagnosis.repeating import repeating_bases
from fingerlab.diagnosis.senses import senses
from fingerlab.diagnosis.stretches import stretches
from fingerlab.diagnosis.sums import Part, RunSums, Sums
from fingerlab.effects.base import Effect
from fingerlab.sessions.model import Array, Run, Session


def run_sums(
    number: int,
    session: Session,
    run: Run,
    effects: Sequence[Effect],
    asked: Asked,
    keep: Keep | None,
    recall: Recall,
) -> RunSums:
    """Products of all signals over a run, in stretches of at most a minute; ``number`` is its own."""
    result = RunSums(run.name)
    for low in _narrowed(number, session, run, effects, asked, recall):
        motion = low.wide
        sense = senses(run, motion)
        result.senses += [] if sense is None else [sense]
        live = np.ascontiguousarray(low.columns.T[low.live])
        part = _products(low, live)
        repeating = repeating_bases(low, run, asked.seek_cycle)
        if repeating is None:
            result.add(Part(low.live + asked.start, part))
        else:
            cyclic, trend = live @ repeating[0], live @ repeating[1]
            noise = part.products - cyclic @ cyclic.T
            result.add(Part(low.live + asked.start, part, noise, len(low.time) - cyclic.shape[1]))
            result.trends.append((low.live + asked.start, trend))
        result.encoder_variance = (motion.radius * motion.position_step) ** 2 / 12.0
        if keep is not None:
            keep(session, run, low)
    return result


def _narrowed(
    number: int, session: Session, run: Run, effects: Sequence[Effect], asked: Asked, recall: Recall
) -> Iterator[Narrow]:
    """All signals of a run's stretches, read or recalled."""
    if number in recall:
        for seen in recall.stretches(number):
            yield narrow_again(seen, effects, asked.signals)
        return
    found: list[Seen] | None = []
    for motion in stretches(run, session.rig):
        low = narrow_columns(motion, effects, asked.signals)
        yield low
        if found is not None:
            found.append(to_recall(low, asked))
            found = found if recall.has_room(found) else None
    if found is not None:
        recall.keep(number, found)


def _products(low: Narrow, live: Array) -> Sums:
    """Sums over one stretch, of its live signals, (live, n)."""
    taut = int(low.taut.sum())
    loose, still = live[:, ~low.taut], live[:, low.taut & low.rest]
    return Sums(
        live @ live.T,
        loose @ loose.T if loose.shape[1] else None,
        taut,
        len(low.taut) - taut,
        still @ still.T if still.shape[1] else None,
        still.shape[1],
    )
