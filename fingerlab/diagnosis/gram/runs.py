"""The sums of one run: signals low-passed, decimated and multiplied; pairs of runs; the floor of any law.

Low-passing decides which samples of a segment count, which of them are judged apart (those of a taut cable,
and those at which the motor stands), how a delayed channel is read, and what a second reading takes over from
the first.

The floor of any law is a regression on functions of angle, speed, acceleration, load and way since reversal,
with runs left out. Among those of the angle are waves of the orders at which the torque repeats over it most.
It knows no physics and no plausible range; what it cannot tell either, no effect is asked to explain. It
takes as many functions as the runs that were left out bear out.

In a pair, what a machine does in every run that no law tells is in both and cancels; what follows from the
change stays. The difference is divided by the root of two, so that it is as noisy as one run.

A later pass asks the same runs for few other columns, or for none. Opening the file again, differentiating
its channels and forming the columns would cost more than all the rest: the first reading keeps the motion of
every segment, and its signals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache, partial
from itertools import count

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.polynomial.legendre import legvander

from fingerlab.diagnosis.equations.columns import Asked, Column, all_columns, effect_columns
from fingerlab.diagnosis.equations.features import SHIFT_SAMPLES, SLOPE, BoolArray, IntArray
from fingerlab.diagnosis.gram.sums import PairSums, Part, RunSums, Sums
from fingerlab.diagnosis.settings import (
    AT_ONCE,
    AT_REST_DEG,
    INERTIA_SPREADS,
    MOST_BYTES,
    NARROW_RATE_HZ,
    REST_REACH,
    SLACK_NOISES,
    SLACK_TENSION_N,
    STATE_BLOCK,
    STATE_LEAST_GAIN,
    STATE_RIDGE,
    STATE_SPEEDS,
    STATE_TRAVELS_DEG,
    TREND_DEGREE,
)
from fingerlab.diagnosis.signals.conditions import GroupKey, facts_of
from fingerlab.diagnosis.signals.filters import (
    NARROW_HALF,
    NARROW_STEP,
    decimate,
    decimated_count,
    padded_length,
)
from fingerlab.diagnosis.signals.segments import segments_of, senses
from fingerlab.effects.base import Effect, Shape
from fingerlab.effects.joints import DRIVE, driven_tension
from fingerlab.physics.friction_states import slip_states
from fingerlab.physics.motion import Motion
from fingerlab.sessions.model import Array, Run, Session
from fingerlab.sessions.trajectory import found_frequency, told_frequency


def drive_told(effects: Sequence[Effect]) -> Shape:
    """What motor and gearbox keep for themselves, as the shape of any effect tells it; nothing: none does."""
    return next(
        (e.shapes[0] for e in effects if len(e.shapes) == 1 and DRIVE.keys() <= e.shapes[0].keys()), {}
    )


def taut_moments(motion: Motion, inner: slice, drive: Shape) -> BoolArray:
    """Samples into whose low-pass window no slack moment falls.

    Args:
        drive: what motor and gearbox keep for themselves, of ``joints.DRIVE``.
    """
    if motion.finger is None:
        return np.ones(len(decimate(motion.time[inner])), dtype=bool)
    pull = driven_tension(motion, drive)
    pull = pull - INERTIA_SPREADS * motion.inertia_spread * np.abs(motion.acceleration) / motion.radius
    smooth = np.convolve(pull, np.ones(9) / 9, mode="same")  # 36 ms: the tension's own noise is then small
    noise = float(np.median(np.abs(pull - smooth)[inner])) if len(pull[inner]) else 0.0
    loose = (smooth < max(SLACK_TENSION_N, SLACK_NOISES * noise))[inner]
    # A slack cable hangs through by millimetres, the taut one is known to micrometres: no window that
    # holds a slack moment anywhere but at its very ends may pass for taut.
    reach = np.ones(2 * (NARROW_HALF - NARROW_HALF // 8) + 1)
    near = np.convolve(loose.astype(float), reach, mode="same") > 0.5
    count = decimated_count(len(loose))
    return np.asarray(~near[NARROW_HALF::NARROW_STEP][:count])


def rest_moments(position: Array) -> BoolArray:
    """Decimated samples around which the motor stands, (n,)."""
    angle = np.pad(decimate(position), REST_REACH, mode="edge")
    windows = sliding_window_view(angle, 2 * REST_REACH + 1)
    return np.asarray(np.ptp(windows, axis=1) < np.radians(AT_REST_DEG))


MARGIN = max(abs(samples) for samples in SHIFT_SAMPLES)
"""Samples at the wide rate on either side of those that are judged: room for the delays."""


@dataclass(frozen=True)
class Decimated:
    """Signals of one stretch, decimated: ``columns`` (n, signals), ``taut`` (n,) bool, ``time`` (n,) s.

    ``rest`` (n,) tells where the motor stands; ``live`` are the signals that are not zero throughout.
    """

    columns: Array
    taut: BoolArray
    time: Array
    wide: Motion
    rest: BoolArray
    live: IntArray


def counted(motion: Motion) -> slice:
    """Samples of a stretch, at the wide rate, that are judged: behind its lead, with room for shifts."""
    return slice(motion.lead + MARGIN, len(motion.time) - MARGIN)


def decimated_columns(motion: Motion, effects: Sequence[Effect], signals: IntArray) -> Decimated:
    """All signals of a segment, low-passed at 8 Hz and decimated to 25 Hz.

    ``signals`` is the layout's: which signal each feature is, (features,).
    """
    inner = counted(motion)
    time = decimate(motion.time[inner])
    low = np.zeros((int(signals.max()) + 1, len(time)))
    known = np.zeros(len(low), dtype=bool)
    live = fill(low, motion, all_columns(motion, effects), signals, known)
    taut, rest = taut_moments(motion, inner, drive_told(effects)), rest_moments(motion.position[inner])
    return Decimated(low.T, taut, time, motion, rest, np.array(live))


def fill(
    low: Array, motion: Motion, columns: Iterable[Column], signals: IntArray, known: BoolArray
) -> list[int]:
    """Filter the signals that are not ``known`` (signals,) into ``low``; gives those that are not zero."""
    inner = counted(motion)
    # Single precision is a hundred times finer than the sensors, and twice as fast.
    length = max(inner.stop - inner.start, 0)
    wide = np.zeros((AT_ONCE, padded_length(length)), np.float32)
    live: list[int] = []
    waiting = 0
    done = known.tolist()
    for place, (values, shift, _, _) in zip(signals.tolist(), columns, strict=True):
        if done[place]:
            continue
        done[place] = True
        column = _shifted(values, shift, motion.sample_rate_hz, inner)
        if not _is_zero(column):  # a force where nothing is touched, a stop that no joint reaches
            wide[waiting, :length] = column
            live.append(place)
            waiting += 1
        if waiting == AT_ONCE:
            low[live[-waiting:]] = decimate(wide, length)
            waiting = 0
    if waiting:
        low[live[-waiting:]] = decimate(wide[:waiting], length)
    return live


def _is_zero(values: Array) -> bool:
    if len(values) == 0 or values.strides == (0,):  # one value all along
        return len(values) == 0 or bool(values[0] == 0.0)
    return bool(values[len(values) // 2] == 0.0 and not values.any())


def _shifted(values: Array, shift: int | None, rate: float, inner: slice) -> Array:
    """Samples ``inner`` of a channel, later by a kept shift, or of its derivative; the margin has room."""
    if shift is None:
        return values[inner]
    if shift == SLOPE:
        return np.asarray(np.gradient(values, 1.0 / rate)[inner])
    late = SHIFT_SAMPLES[shift]
    return values[inner.start - late : max(inner.stop - late, 0)]


def repeating_bases(low: Decimated, run: Run, seek: bool = False) -> tuple[Array, Array] | None:
    """What a stretch may repeat: bases of its cycle, (n, harmonics), and of a slow trend, (n, degrees).

    ``seek`` a cycle in the motion itself where the run does not tell it. None where there is no cycle that
    repeats often enough.
    """
    frequency = told_frequency(run)
    if frequency is None and seek:
        frequency = _sought(low, run)
    if frequency is None:
        return None
    count = int(np.ceil(0.5 * NARROW_RATE_HZ / frequency)) - 1
    if 2 * count + 1 > 0.6 * len(low.time):
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


BASIS = 4
"""So many functions every law has: a constant, acceleration, load and speed."""


def _functions(motion: Motion, orders: Sequence[float]) -> Array:
    """Functions of the state at the wide rate, simple ones first, and the torque last, (functions + 1, n)."""
    waves = [part(order * motion.position) for order in orders for part in (np.sin, np.cos)]
    angle, speed = motion.position, motion.velocity
    load = np.zeros_like(speed) if motion.load is None else motion.load
    ways = slip_states(motion.position, np.radians(STATE_TRAVELS_DEG))
    by_speed = [np.tanh(speed / s) for s in STATE_SPEEDS]
    middle = ways[len(ways) // 2]
    return np.stack(
        [
            np.ones_like(speed), motion.acceleration, load, speed,
            *by_speed, *ways,
            angle, np.cos(angle), np.sin(angle), angle * middle, speed * np.abs(speed),
            np.sign(speed) * np.sqrt(np.abs(speed)), *(np.abs(load) * way for way in ways),
            load * speed, load * angle, speed * middle, *waves, motion.torque,
        ]
    )  # fmt: skip


def state_products(low: Decimated, orders: Sequence[float]) -> list[Array]:
    """Products of the functions over blocks of a stretch, (functions + 1,) * 2 each.

    ``orders``: periods a turn at which the torque may repeat with the angle.
    """
    signals = decimate(_functions(low.wide, orders)[:, counted(low.wide)])
    pieces = max(round(signals.shape[1] / STATE_BLOCK), 1)
    return [block @ block.T for block in np.array_split(signals, pieces, axis=1)]


def left_out_variance(runs: Sequence[Sequence[Array]]) -> float:
    """Mean square of the torque that no law of the state tells where it has not seen it, (N m)^2; 0: unknown.

    Function after function is taken, while what was left out is told better by it.

    Args:
        runs: products over blocks of each; a single run is left out block by block.
    """
    parts = [sum(blocks[1:], blocks[0]) for blocks in runs if blocks]
    if len(parts) == 1:
        parts = list(runs[0])
    if len(parts) < 2:
        return 0.0
    each = np.stack(parts)
    others = each.sum(axis=0) - each
    # A function is taken only if it is there in what every part is judged by.
    there = np.flatnonzero((np.diagonal(others, axis1=1, axis2=2) > 0.0).all(axis=0))[:-1]
    taken = [int(k) for k in there if k < BASIS]
    found = _left_out(each, others, taken)
    rest = [int(k) for k in there if k >= BASIS]
    while rest:
        tried = [_left_out(each, others, [*taken, k]) for k in rest]
        best = int(np.argmin(tried))
        if tried[best] > (1.0 - STATE_LEAST_GAIN) * found:
            break
        found = tried[best]
        taken.append(rest.pop(best))
    return found


def _left_out(parts: Array, others: Array, taken: Sequence[int]) -> float:
    """Mean square of the torque that these functions leave of the parts, each told by the others."""
    here = np.append(taken, parts.shape[1] - 1)
    seen, left = others[:, here[:, None], here], parts[:, here[:, None], here]
    scale = 1.0 / np.sqrt(np.diagonal(seen, axis1=1, axis2=2))
    seen = seen * scale[:, :, None] * scale[:, None, :]
    matrix = seen[:, :-1, :-1] + STATE_RIDGE * np.eye(len(taken))
    values = np.linalg.solve(matrix, seen[:, :-1, -1:])[..., 0] * scale[:, :-1] / scale[:, -1:]
    law = np.concatenate((-values, np.ones((len(parts), 1))), axis=1)
    squares = np.einsum("pi,pij,pj->p", law, left, law)
    return float(np.maximum(squares, 0.0).sum() / max(parts[:, 0, 0].sum(), 1.0))


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


@dataclass(frozen=True)
class CachedSegment:
    """A segment as the first reading saw it, with its signals at the decimated rate.

    ``low`` (live, n), in single precision as the filter gives it, holds the signals ``live``, (live,), which
    are those that are not zero throughout. ``taut``, ``rest`` (n,) bool and ``time`` (n,) s as in
    :class:`Decimated`.
    """

    motion: Motion
    low: np.ndarray[tuple[int, ...], np.dtype[np.float32]]
    live: IntArray
    taut: BoolArray
    rest: BoolArray
    time: Array

    @property
    def size(self) -> int:
        """Bytes, about."""
        joints = self.motion.joints
        arrays = [getattr(self.motion, f.name) for f in fields(self.motion)]
        arrays += [] if joints is None else list(vars(joints).values())
        return self.low.nbytes + sum(a.nbytes for a in arrays if isinstance(a, np.ndarray))


_NUMBERS = count()


@dataclass
class SegmentCache:
    """Who reads the runs of one analysis, and what they keep of them.

    Attributes:
        executor: a second process that takes a share of the runs; None: there is none.
        number: tells analyses apart in the second process, which keeps what it read itself.
        elsewhere: runs that the second process has read; runs are told by their numbers.
    """

    executor: Executor | None = None
    number: int = field(default_factory=partial(next, _NUMBERS))
    elsewhere: set[int] = field(default_factory=set)
    _runs: dict[int, list[CachedSegment]] = field(default_factory=dict, repr=False)
    _size: int = 0

    def segments(self, run: int) -> Iterator[CachedSegment]:
        """The segments of a run that is kept; none of others. States of friction are formed anew."""
        for segment in self._runs.get(run, ()):
            yield replace(segment, motion=replace(segment.motion, _memory={}))

    def keep(self, run: int, segments: Sequence[CachedSegment]) -> None:
        """Keep a run that was read to its end."""
        self._size += sum(one.size for one in segments)
        self._runs[run] = list(segments)

    def has_room(self, segments: Sequence[CachedSegment]) -> bool:
        """Whether these could be kept, too."""
        return self._size + sum(one.size for one in segments) <= MOST_BYTES

    def __contains__(self, run: int) -> bool:
        return run in self._runs


def decimated_again(segment: CachedSegment, effects: Sequence[Effect], asked: Asked) -> Decimated:
    """The signals that are asked for, of a segment that was read before; few are formed."""
    low = np.zeros((len(asked.cached), len(segment.time)))
    rows = np.full(max(int(segment.live.max(initial=-1)), int(asked.cached.max())) + 1, -1)
    rows[segment.live] = np.arange(len(segment.live))
    known = asked.cached >= 0
    places = np.flatnonzero(known)
    held = rows[asked.cached[places]]
    places, held = places[held >= 0], held[held >= 0]
    low[places] = segment.low[held]
    wanted = [effects[k] for k in asked.formed]
    # Positions of their features, in the order in which the columns come.
    signals = np.concatenate([asked.features[k] for k in asked.formed] or [np.zeros(0, dtype=int)])
    formed = fill(low, segment.motion, effect_columns(segment.motion, wanted), signals, known)
    live = np.sort(np.concatenate((places, np.array(formed, dtype=places.dtype))))
    drive = drive_told(effects)
    taut = (
        taut_moments(segment.motion, counted(segment.motion), drive) if any(drive.values()) else segment.taut
    )
    return Decimated(low.T, taut, segment.time, segment.motion, segment.rest, live)


def to_cache(low: Decimated) -> CachedSegment:
    """What later passes need of a segment; what its motion remembers, many times its size, is formed anew."""
    signals = low.columns.T[low.live].astype(np.float32)
    return CachedSegment(replace(low.wide, _memory={}), signals, low.live, low.taut, low.rest, low.time)


Keep = Callable[[Session, Run, Decimated], None]
"""Who is shown every segment of a run as it passes."""


def run_sums(
    number: int,
    session: Session,
    run: Run,
    effects: Sequence[Effect],
    asked: Asked,
    keep: Keep | None,
    cache: SegmentCache,
) -> RunSums:
    """Products of all signals over a run, in segments of at most a minute; ``number`` is its own."""
    result = RunSums(run.name)
    for low in _decimated(number, session, run, effects, asked, cache):
        motion = low.wide
        if asked.first and result.facts is None:
            result.facts = facts_of(run, motion, session.rig)
        sense = senses(run, motion)
        result.senses += [] if sense is None else [sense]
        result.repairs.update(motion.repairs)
        result.samples += (len(motion.time) - motion.lead) * run.sample_rate_hz / motion.sample_rate_hz
        live = np.ascontiguousarray(low.columns.T[low.live])
        part, totals = _products(low, live)
        repeating = repeating_bases(low, run, asked.seek_cycle)
        if repeating is None:
            result.add(Part(low.live + asked.start, part, totals))
            result.state_products += state_products(low, asked.orders) if motion.finger is None else []
        else:
            cyclic, trend = live @ repeating[0], live @ repeating[1]
            noise = part.products - cyclic @ cyclic.T
            result.add(Part(low.live + asked.start, part, totals, noise, len(low.time) - cyclic.shape[1]))
            result.trends.append((low.live + asked.start, trend))
        result.encoder_variance = (motion.radius * motion.position_step) ** 2 / 12.0
        if keep is not None:
            keep(session, run, low)
    return result


def _decimated(
    number: int, session: Session, run: Run, effects: Sequence[Effect], asked: Asked, cache: SegmentCache
) -> Iterator[Decimated]:
    """All signals of a run's segments, read or from the cache; a first reading is kept."""
    if number in cache:
        for segment in cache.segments(number):
            yield decimated_again(segment, effects, asked)
        return
    found: list[CachedSegment] | None = [] if asked.first else None
    for motion in segments_of(run, session.rig):
        low = decimated_columns(motion, effects, asked.signals)
        yield low
        if found is not None:
            found.append(to_cache(low))
            found = found if cache.has_room(found) else None
    if found is not None:
        cache.keep(number, found)


def _products(low: Decimated, live: Array) -> tuple[Sums, Array]:
    """Sums over one stretch, of products of its live signals, (live, n), and of these, (3, live)."""
    taut = int(low.taut.sum())
    loose, still = live[:, ~low.taut], live[:, low.taut & low.rest]
    sums = Sums(
        live @ live.T,
        loose @ loose.T if loose.shape[1] else None,
        taut,
        len(low.taut) - taut,
        still @ still.T if still.shape[1] else None,
        still.shape[1],
    )
    return sums, np.stack([signals.sum(axis=1) for signals in (live, loose, still)])
