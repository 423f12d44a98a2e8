"""The sums of one run, of a pair of runs, and of all runs in order.

Signals are multiplied, and what repeats in them is set apart. In a pair, what a machine does in every run
that no law tells is in both and cancels; what follows from the change stays. The difference is divided by the
root of two, so that it is as noisy as one run.

A second process may read ahead; only sums travel between the two (see ``fingerlab.core.progress``), and each
keeps what it read. Runs that are kept are shared by threads.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
from numpy.polynomial.legendre import legvander

from fingerlab.diagnosis.equations.columns import ReadRequest, of_the_user
from fingerlab.diagnosis.gram.decimation import (
    CachedSegment,
    Decimated,
    SegmentCache,
    counted,
    decimated_again,
    decimated_columns,
    to_cache,
)
from fingerlab.diagnosis.gram.state_law import signal_products, torque_products
from fingerlab.diagnosis.gram.sums import Cycle, PairSums, Part, RunSums, Sums, finer_of
from fingerlab.diagnosis.settings import MOST_HARMONICS, NARROW_RATE_HZ, SPLITS, TASKS_AHEAD, TREND_DEGREE
from fingerlab.diagnosis.signals.channel_checks import facts_of
from fingerlab.diagnosis.signals.conditions import GroupKey
from fingerlab.diagnosis.signals.filters import noise_of_derivatives
from fingerlab.diagnosis.signals.segments import segments_of, senses
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Effect, PortableColumns, Shape
from fingerlab.physics.motion import Motion
from fingerlab.sessions.model import Array, IntArray, Run, Session
from fingerlab.sessions.trajectory import commanded_frequency, found_frequency


def repeating_frequency(low: Decimated, run: Run, seek: bool = False) -> float | None:
    """Cycles a second that a stretch may repeat, Hz; ``seek`` where the run does not tell; None: none."""
    frequency = commanded_frequency(run)
    return _sought(low, run) if frequency is None and seek else frequency


def repeating_bases(low: Decimated, frequency: float | None) -> tuple[Array, Array] | None:
    """What a stretch may repeat: bases of its cycle, (n, harmonics), and of a slow trend, (n, degrees).

    None where there is no cycle that repeats often enough.
    """
    if frequency is None:
        return None
    count = int(np.ceil(0.5 * NARROW_RATE_HZ / frequency)) - 1
    if 2 * count + 1 > MOST_HARMONICS * len(low.time):
        return None
    return _harmonics(frequency, count, float(low.time[0]), float(low.time[-1]), len(low.time))


def _sought(low: Decimated, run: Run) -> float | None:
    """Cycles a second of a stretch, Hz, by its command, or else by its motion; None: neither comes again.

    A finger that presses settles for a while, and hardly moves: its command is the better witness.
    """
    motion = low.wide
    if run.has("motor_command"):
        step = max(round(run.sample_rate_hz / motion.sample_rate_hz), 1)
        first, last = (round(float(t) * run.sample_rate_hz) for t in low.time[[0, -1]])
        command = run.channel("motor_command", first, last + 1)[::step]
        found = found_frequency(command, run.sample_rate_hz / step) if np.isfinite(command).all() else None
        if found is not None:
            return found
    return found_frequency(motion.position[counted(motion)], motion.sample_rate_hz)


@lru_cache(maxsize=4)
def _harmonics(frequency: float, count: int, first: float, last: float, samples: int) -> tuple[Array, Array]:
    """Orthonormal bases of a constant and harmonics, (samples, 2 count + 1), and of a trend beside them.

    ``frequency`` in Hz, ``first`` and ``last`` sample in s. The runs of a session share them.
    """
    phase = 2 * np.pi * frequency * np.outer(np.linspace(first, last, samples), np.arange(1, count + 1))
    trend = legvander(np.linspace(-1.0, 1.0, samples), TREND_DEGREE)
    basis = np.linalg.qr(np.hstack((trend[:, :1], np.cos(phase), np.sin(phase), trend[:, 1:])))[0]
    return basis[:, :-TREND_DEGREE], basis[:, -TREND_DEGREE:]


def pair_sums(
    numbers: tuple[int, int], group: GroupKey, before: Decimated, after: Decimated
) -> PairSums | None:
    """The sums over a pair's first stretches; None: they have no moments in common.

    Constants are taken out: the sensors are set anew where a machine is changed.
    """
    common = in_common(before, after)
    return None if common is None else sums_of_difference(numbers, group, *common)


def in_common(before: Decimated, after: Decimated) -> tuple[Array, Array] | None:
    """Signals of both where the cable is taut and the motor moves in both, (n, signals) each."""
    count = min(len(before.time), len(after.time))
    common = (before.taut & ~before.rest)[:count] & (after.taut & ~after.rest)[:count]
    if common.sum() < 2:
        return None
    return before.columns[:count][common], after.columns[:count][common]


def difference_alone(first: Array, second: Array) -> Sums:
    """The sums over their difference, see :class:`PairSums`."""
    apart = _apart(first, second)
    return Sums(apart.T @ apart, taut_samples=len(apart))


def _apart(first: Array, second: Array) -> Array:
    apart = (second - first) / np.sqrt(2.0)
    return np.asarray(apart - apart.mean(axis=0))


def sums_of_difference(numbers: tuple[int, int], group: GroupKey, first: Array, second: Array) -> PairSums:
    """The sums over two runs' signals at the same moments, (n, signals) each."""
    apart = _apart(first, second)
    mean = 0.5 * (first + second)
    mean = mean - mean.mean(axis=0)
    sums = Sums(apart.T @ apart, taut_samples=len(apart))
    return PairSums(*numbers, group, sums, apart.T @ mean, mean.T @ mean)


Keep = Callable[[Session, Run, Decimated], None]
"""Who is shown every segment of a run as it passes."""
Looked = Mapping[int, Sequence[Motion]]
"""All stretches of the runs that were read before their first reduction, by the runs' numbers."""


def run_sums(
    number: int,
    session: Session,
    run: Run,
    effects: Sequence[Effect],
    asked: ReadRequest,
    keep: Keep | None,
    cache: SegmentCache,
    stretches: Sequence[Motion] | None = None,
) -> RunSums:
    """Products of all signals over a run, in segments of at most a minute; ``number`` is its own.

    ``stretches``: of the run, if it was read already.
    """
    result = RunSums(run.name)
    for low in _decimated(number, session, run, effects, asked, cache, stretches):
        motion = low.wide
        if asked.first and result.facts is None:
            result.facts = facts_of(run, motion, session.rig)
        sense = senses(run, motion)
        result.senses += [] if sense is None else [sense]
        result.repairs.update(motion.repairs)
        result.samples += (len(motion.time) - motion.lead) * run.sample_rate_hz / motion.sample_rate_hz
        live = np.ascontiguousarray(low.columns.T[low.live])
        frequency = repeating_frequency(low, run, asked.seek_cycle)
        repeating = repeating_bases(low, frequency)
        if repeating is None:
            for split, part, totals in _products_by_split(low, live, asked.in_parts):
                result.add(Part(low.live + asked.start, part, totals, split=split))
            if motion.finger is None:
                result.state_products += torque_products(low, asked.orders, in_parts=asked.in_parts)
            elif asked.by_state:
                result.state_products += signal_products(low)
        else:
            part, totals = _products(low, live)
            part.standstills = _different(part.standstills, low, frequency)
            cyclic, trend = live @ repeating[0], live @ repeating[1]
            noise = part.products - cyclic @ cyclic.T
            result.add(Part(low.live + asked.start, part, totals, noise, len(low.time) - cyclic.shape[1]))
            result.trends.append((low.live + asked.start, trend))
            told = commanded_frequency(run)
            if told is not None:
                stretch = told, float(low.time[0]), float(low.time[-1]), len(low.time)
                result.cycles.append(Cycle(stretch, low.live + asked.start, cyclic))
        of_a_step = motion.position_step**2 / 12.0
        result.encoder_variance = finer_of(result.encoder_variance, motion.radius**2 * of_a_step)
        of_encoder = tuple(of_a_step * one for one in noise_of_derivatives(run.sample_rate_hz))
        result.encoder_noise = tuple(map(finer_of, result.encoder_noise, of_encoder))
        if keep is not None:
            keep(session, run, low)
    return result


def _decimated(
    number: int,
    session: Session,
    run: Run,
    effects: Sequence[Effect],
    asked: ReadRequest,
    cache: SegmentCache,
    stretches: Sequence[Motion] | None,
) -> Iterator[Decimated]:
    """All signals of a run's segments, read or from the cache; a first reading is kept."""
    if number in cache:
        for segment in cache.segments(number):
            yield decimated_again(segment, effects, asked)
        return
    found: list[CachedSegment] | None = [] if asked.first else None
    for motion in segments_of(run, session.rig) if stretches is None else stretches:
        low = decimated_columns(motion, effects, asked.signals)
        yield low
        if found is not None:
            found.append(to_cache(low))
            found = found if cache.has_room(found) else None
    if found is not None:
        cache.keep(number, found)


def _products_by_split(low: Decimated, live: Array, in_parts: bool) -> Iterator[tuple[int, Sums, Array]]:
    """The same as :func:`_products` of what is left out in each split; of all, if there are no splits."""
    if not in_parts:
        yield 0, *_products(low, live)
        return
    for split, mine in enumerate(np.array_split(np.arange(len(low.time)), SPLITS)):
        yield split, *_products(low, live, mine)


def _products(low: Decimated, live: Array, of: IntArray | None = None) -> tuple[Sums, Array]:
    """Sums over one stretch, of products of its live signals, (live, n), and of these, (3, live).

    Args:
        of: so many of its samples, (m,); None: all.
    """
    resting = low.taut & low.rest
    begins = np.diff(resting, prepend=False) & resting
    taut = low.taut
    if of is not None:
        live, taut, resting, begins = live[:, of], taut[of], resting[of], begins[of]
    loose, still = live[:, ~taut], live[:, resting]
    sums = Sums(
        live @ live.T,
        loose @ loose.T if loose.shape[1] else None,
        int(taut.sum()),
        len(taut) - int(taut.sum()),
        still @ still.T if still.shape[1] else None,
        still.shape[1],
        int(np.count_nonzero(begins)),
    )
    return sums, np.stack([signals.sum(axis=1) for signals in (live, loose, still)])


def _different(standstills: float, low: Decimated, frequency: float | None) -> float:
    """How many of a stretch's standstills are not the same ones of another cycle; at least one, if any."""
    cycles = (frequency or 0.0) * float(low.time[-1] - low.time[0])
    return min(standstills, max(standstills / max(cycles, 1.0), 1.0))


Grid = tuple[str, Sequence[Shape]]
"""A built-in effect by its id, and the shapes that are asked of it."""


def _sent(effect: Effect) -> Grid | Effect | None:
    """What a second process is told of an effect; None where it is a user's code, which lives in this one."""
    if not of_the_user(effect):
        return effect.id, effect.shapes
    return effect if isinstance(effect.columns, PortableColumns) else None


def sums_in_turn(
    pairs: Sequence[tuple[Session, Run]],
    effects: Sequence[Effect],
    size: int,
    asked: Sequence[ReadRequest],
    cache: SegmentCache,
    keep: Keep | None,
    looked: Looked,
) -> Iterator[RunSums]:
    """The sums of every run, in order; a second process works ahead on every run that is not yet begun.

    Only sums travel between the processes. A run goes to the process that has read it before. Without a
    second process, runs that are kept are shared by threads.

    Args:
        size: signals of all runs. asked: of each run.
    """
    sent = [one for one in map(_sent, effects) if one is not None]
    # A user's own effect lives in this process only, and so does what is shown.
    alone = cache.executor is None or keep is not None or len(sent) < len(effects)
    if alone and all(number in cache for number in range(len(pairs))):
        formed = [effects[k] for one in asked for k in one.formed]
        if None not in map(_sent, formed):  # nobody knows whether that code minds threads
            yield from _in_threads(pairs, effects, size, asked, cache, keep)
            return
    waiting = deque(range(len(pairs)))
    ahead: dict[int, Future[RunSums]] = {}
    done: dict[int, RunSums] = {}

    def ask(number: int) -> None:
        session, run = pairs[number]
        waiting.remove(number)
        cache.elsewhere.add(number)
        assert cache.executor is not None
        ahead[number] = cache.executor.submit(
            _elsewhere, number, replace(session, runs=()), run, sent, asked[number], cache.number
        )

    try:
        for number in range(len(pairs)):
            while number not in done:
                while not alone and sum(not f.done() for f in ahead.values()) < TASKS_AHEAD:
                    theirs = _theirs(cache, waiting)
                    if theirs is None:
                        break
                    ask(theirs)
                own = next((n for n in waiting if alone or n not in cache.elsewhere), None)
                if own is not None and (number in waiting or not ahead[number].done()):
                    waiting.remove(own)
                    shown = None if keep is None else partial(in_place, keep, asked[own].start, size)
                    known = looked.get(own)
                    done[own] = run_sums(own, *pairs[own], effects, asked[own], shown, cache, known)
                else:
                    done[number] = ahead.pop(number).result()
            yield done.pop(number)
    finally:
        for future in ahead.values():
            future.cancel()


def _in_threads(
    pairs: Sequence[tuple[Session, Run]],
    effects: Sequence[Effect],
    size: int,
    asked: Sequence[ReadRequest],
    cache: SegmentCache,
    keep: Keep | None,
) -> Iterator[RunSums]:
    """The sums of runs that are kept, by one thread for each core: nearly all of it is linear algebra."""

    def one(number: int) -> tuple[RunSums, list[Decimated]]:
        shown: list[Decimated] = []
        show = None if keep is None else lambda session, run, low: shown.append(low)
        return run_sums(number, *pairs[number], effects, asked[number], show, cache), shown

    count = os.cpu_count() or 1
    ahead: deque[Future[tuple[RunSums, list[Decimated]]]] = deque()
    with ThreadPoolExecutor(count) as threads:
        for number in range(len(pairs) + count):
            if number < len(pairs):
                ahead.append(threads.submit(one, number))
            if number >= count:
                sums, shown = ahead.popleft().result()
                for low in shown:
                    assert keep is not None
                    in_place(keep, asked[number - count].start, size, *pairs[number - count], low)
                yield sums


def in_place(
    keep: Keep,
    start: int,
    size: int,
    session: Session,
    run: Run,
    low: Decimated,
) -> None:
    """Keep a stretch with its signals in their places among those of all runs."""
    columns = low.columns
    if columns.shape[1] != size:
        columns = np.zeros((len(low.time), size))
        columns[:, start : start + low.columns.shape[1]] = low.columns
    keep(session, run, replace(low, columns=columns, live=low.live + start))


def _theirs(cache: SegmentCache, waiting: Iterable[int]) -> int | None:
    """The run that the second process is given next: one that it has read, or one that neither has.

    Of the latter the next in turn is left to this process.
    """
    read = [n for n in waiting if n in cache.elsewhere]
    return (read + [n for n in waiting if n not in cache][1:2] + [None])[0]


_cached = SegmentCache(number=-1)
"""In the second process: what it has read of the analysis that is going on."""


def _elsewhere(
    number: int,
    session: Session,
    run: Run,
    sent: Sequence[Grid | Effect],
    asked: ReadRequest,
    analysis: int,
) -> RunSums:
    """What the second process does."""
    global _cached
    if _cached.number != analysis:
        _cached = SegmentCache(number=analysis)
    effects = [one if isinstance(one, Effect) else replace(CATALOGUE[one[0]], shapes=one[1]) for one in sent]
    return run_sums(number, session, run, effects, asked, None, _cached)
