"""From sessions to Gram matrices: the only pass over the data.

All columns of all effects at all grid points are formed once, low-passed, decimated, and reduced to products
of features, one matrix for each fold of each group of runs. Fits, held-out scores and distances between
effects then cost nothing that grows with the recording.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from fingerlab.errors import Cancelled, UserError
from fingerlab.identify.diagnosis.bandwidth import (
    NARROW_HALF,
    NARROW_RATE_HZ,
    NARROW_STEP,
    WIDE_RATE_HZ,
    narrow,
    narrow_count,
)
from fingerlab.identify.diagnosis.features import (
    NO_SHIFT,
    SHIFTS_S,
    SLOPE,
    Feature,
    Layout,
    base_columns,
    nuisance_ranges,
    shifted_columns,
)
from fingerlab.identify.diagnosis.routing import spread_of
from fingerlab.identify.diagnosis.stretches import stretches
from fingerlab.identify.diagnosis.sums import BoolArray, IntArray, Sums, empty, total
from fingerlab.physics.effects import CATALOGUE
from fingerlab.physics.effects.base import Effect, Shape
from fingerlab.physics.effects.motion import Motion
from fingerlab.sessions.model import Array, Run, Session

Progress = Callable[[float, str], None]

FOLDS = 10
"""Runs of a group are dealt to at most this many folds; ten runs or fewer are held out one by one."""
SLACK_TENSION_N = 0.12
"""Below this tension the cable may be slack, N; assumed: a few times the noise of the current at 8 Hz."""

TASKS_AHEAD = 2
"""Runs that a second process is given at a time: one at work and one waiting."""

GroupKey = tuple[str, str]
Grid = tuple[str, Sequence[Shape]]
"""A built-in effect by its id, and the shapes that are asked of it."""


@dataclass
class Group:
    """Runs of one routing and phase: they share moment arms, losses and noise.

    ``noise`` (signals, signals) holds products of what does not repeat from cycle to cycle.
    """

    key: GroupKey
    cable_sign: int
    folds: list[Sums]
    noise: Array
    noise_samples: float = 0.0
    encoder_variance: float = 0.0  # m^2 of cable: what a standing encoder's step leaves open

    @cached_property
    def whole(self) -> Sums:
        """Sums over all folds; asked for when all runs are in."""
        return total(self.folds)

    @property
    def samples(self) -> int:
        """Decimated samples in the group."""
        return sum(f.samples for f in self.folds)


@dataclass
class Reduced:
    """All that the diagnosis needs of the sessions."""

    layout: Layout
    groups: list[Group]
    on_bench: bool
    radius: float  # of the pulley, m; 1 on a bench without one


@dataclass(frozen=True)
class Narrow:
    """Signals of one stretch, decimated: ``columns`` (n, signals), ``taut`` (n,) bool, ``time`` (n,) s.

    ``rest`` (n,) tells where the motor stands.
    """

    columns: Array
    taut: BoolArray
    time: Array
    wide: Motion
    rest: BoolArray


MARGIN = round(max(abs(s) for s in SHIFTS_S) * WIDE_RATE_HZ)


def counted(motion: Motion) -> slice:
    """Samples of a stretch, at the wide rate, that are judged: behind its lead, with room for shifts."""
    return slice(motion.lead + MARGIN, len(motion.time) - MARGIN)


def layout_of(motion: Motion, session: Session, effects: Sequence[Effect]) -> Layout:
    """The features in the order in which :func:`narrow_columns` meets them."""
    features: list[Feature] = []
    signals: list[int] = []
    known: dict[tuple[int, int | None], int] = {}
    kept: list[Array] = []  # so that no array's identity is given to a later one
    count = base = 0
    for feature, values, own in _columns(motion, effects):
        base += feature.owner is None
        kept.append(values)
        # What is one array in two equations is one signal; a user's own code is not relied on for that.
        key = id(values), None if feature.shift == NO_SHIFT else feature.shift
        place = count if own else known.setdefault(key, count)
        count = max(count, place + 1)
        features.append(feature)
        signals.append(place)
    return Layout(
        tuple(features), nuisance_ranges(session.rig), tuple(effects), np.arange(base), np.array(signals),
        spread_of(session.rig),
    )  # fmt: skip


def _columns(motion: Motion, effects: Sequence[Effect]) -> Iterator[tuple[Feature, Array, bool]]:
    """All features in order with their values at the wide rate, and whether a user's own effect brings them.

    A motor channel comes once for every shift, with the same values.
    """
    for feature, values in base_columns(motion):
        yield feature, values, False
    for feature, values in shifted_columns(motion):
        shifts: Sequence[int | None] = [None] if motion.finger is None else range(SLOPE + 1)
        for k in shifts:
            yield _with(feature, shift=k), values, False
    for effect in effects:
        own = _of_the_user(effect)
        for index, shape in enumerate(effect.shapes):
            for t in effect.columns(motion, shape):
                feature = Feature(t.row, t.gain, t.constant, t.scale, owner=effect.id, shape=index)
                yield feature, t.values, own


def _with(feature: Feature, **changes: object) -> Feature:
    return Feature(**{**vars(feature), **changes})


def narrow_columns(motion: Motion, effects: Sequence[Effect], signals: IntArray) -> Narrow:
    """All signals of a stretch, low-passed at 8 Hz and decimated to 25 Hz.

    ``signals`` is the layout's: which signal each feature is, (features,).
    """
    inner = counted(motion)
    columns: list[Array] = []
    for place, (feature, values, _) in zip(signals, _columns(motion, effects), strict=True):
        if place == len(columns):
            columns.append(_shifted(values, feature.shift, motion.sample_rate_hz)[inner])
    # Single precision is a hundred times finer than the sensors, and twice as fast.
    low = narrow(np.stack(columns, dtype=np.float32, casting="same_kind"))
    return Narrow(
        low.T, _taut(motion, inner), narrow(motion.time[inner]), motion, _at_rest(motion.position[inner])
    )


AT_REST_DEG = 0.1
"""A motor stands that turns by less than this in a sixth of a second; assumed: two steps of its encoder."""
REST_REACH = 2  # decimated samples on either side


def _at_rest(position: Array) -> BoolArray:
    """Decimated samples around which the motor stands, (n,)."""
    angle = np.pad(narrow(position), REST_REACH, mode="edge")
    windows = sliding_window_view(angle, 2 * REST_REACH + 1)
    return np.asarray(np.ptp(windows, axis=1) < np.radians(AT_REST_DEG))


def _shifted(values: Array, shift: int | None, rate: float) -> Array:
    """A channel later by a kept shift, or its derivative; what falls out at the ends is in the margin."""
    if shift is None:
        return values
    if shift == SLOPE:
        return np.asarray(np.gradient(values, 1.0 / rate))
    return np.roll(values, round(SHIFTS_S[shift] * WIDE_RATE_HZ))


def _taut(motion: Motion, inner: slice) -> BoolArray:
    """Samples into whose low-pass window no slack moment falls."""
    if motion.finger is None:
        return np.ones(len(narrow(motion.time[inner])), dtype=bool)
    pull = (motion.torque - (motion.motor.inertia or 0.0) * motion.acceleration) / motion.radius
    smooth = np.convolve(pull, np.ones(9) / 9, mode="same")  # 36 ms: the tension's own noise is then small
    loose = (smooth < SLACK_TENSION_N)[inner]
    # A slack cable hangs through by millimetres, the taut one is known to micrometres: no window that
    # holds a slack moment anywhere but at its very ends may pass for taut.
    reach = np.ones(2 * (NARROW_HALF - NARROW_HALF // 8) + 1)
    near = np.convolve(loose.astype(float), reach, mode="same") > 0.5
    count = narrow_count(len(loose))
    return np.asarray(~near[NARROW_HALF::NARROW_STEP][:count])


def runs_to_analyse(sessions: Sequence[Session]) -> tuple[list[tuple[Session, Run]], bool]:
    """Finger runs of all sessions; motor-bench runs only where there is nothing else.

    Raises:
        UserError: there is no run at all, or finger runs without the finger's constants.
    """
    every = [(s, r) for s in sessions for r in s.runs]
    finger = [(s, r) for s, r in every if r.phase != "motor_bench" and r.cable_sign != 0]
    if finger:
        for session, _ in finger:
            if session.rig.finger is None:
                raise UserError(f"{session.path} gives no finger constants; its rig text needs 'finger'.")
        return finger, False
    bench = [(s, r) for s, r in every if r.phase == "motor_bench"]
    if not bench:
        names = ", ".join(str(s.path) for s in sessions)
        raise UserError(
            f"{names} holds no run with a cable and no motor-bench run; there is nothing to compare."
        )
    return bench, True


def group_key(run: Run) -> GroupKey:
    """Runs of one cable and phase belong together."""
    return (run.cable, "contact" if run.phase == "contact" else "free")


def reduce_sessions(
    sessions: Sequence[Session],
    effects: Sequence[Effect],
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
    keep: Callable[[Session, Run, Narrow], None] | None = None,
    executor: Executor | None = None,
) -> Reduced:
    """One pass over the data; ``keep`` is shown every stretch as it passes.

    ``executor`` is a second process that takes a share of the runs; not together with ``keep``.

    Raises:
        UserError: nothing to analyse, or a run that cannot be read.
        Cancelled: ``cancelled`` answered True.
    """
    pairs, on_bench = runs_to_analyse(sessions)
    phases, cables = {run.phase for _, run in pairs}, {run.cable for _, run in pairs}
    effects = [e for e in effects if (e.bench or not on_bench) and (not e.phases or phases & set(e.phases))]
    effects = [e for e in effects if cables >= set(e.cables)]
    totals = Counter(group_key(run) for _, run in pairs)
    seen: Counter[GroupKey] = Counter()
    groups: dict[GroupKey, Group] = {}
    layout: Layout | None = None
    parts = _in_turn(pairs, effects, executor if keep is None else None, keep)
    for number, (_, run) in enumerate(pairs):
        if cancelled is not None and cancelled():
            raise Cancelled
        if progress is not None:
            progress(number / len(pairs), f"reading run {run.name}")
        layout, sums = next(parts)
        key = group_key(run)
        if key not in groups:
            groups[key] = _empty_group(run, layout, min(FOLDS, totals[key]))
        _add(groups[key], seen[key] % len(groups[key].folds), sums)
        seen[key] += 1
    assert layout is not None
    radius = 1.0 if on_bench else pairs[0][0].rig.motor.pulley_radius or 1.0
    return Reduced(layout, list(groups.values()), on_bench, radius)


def _empty_group(run: Run, layout: Layout, count: int) -> Group:
    size = layout.signal_count
    return Group(group_key(run), run.cable_sign, [empty(size) for _ in range(count)], np.zeros((size, size)))


@dataclass
class RunSums:
    """Sums of signal products over one run; ``noise`` is None where nothing in the run repeats."""

    sums: Sums
    noise: Array | None = None
    noise_samples: float = 0.0
    encoder_variance: float = 0.0


def _in_turn(
    pairs: Sequence[tuple[Session, Run]],
    effects: Sequence[Effect],
    executor: Executor | None,
    keep: Callable[[Session, Run, Narrow], None] | None,
) -> Iterator[tuple[Layout, RunSums]]:
    """The sums of every run, in order; a second process works ahead on every run that is not yet begun.

    The layout is made here, from the first run: only its sums travel between the processes.
    """
    first, run = pairs[0]
    layout = layout_of(next(stretches(run, first.rig)).glimpse(), first, effects)
    signals = layout.signals
    grids = [(e.id, e.shapes) for e in effects]
    if any(_of_the_user(e) for e in effects):
        executor = None  # a user's own effect lives in this process only
    waiting = deque(range(len(pairs)))
    ahead: dict[int, Future[RunSums]] = {}
    done: dict[int, RunSums] = {}
    try:
        for number in range(len(pairs)):
            while number not in done:
                _refill(executor, ahead, waiting, pairs, (grids, signals))
                if number in waiting:
                    waiting.remove(number)
                    done[number] = run_sums(*pairs[number], effects, signals, keep)
                elif waiting and not ahead[number].done():
                    own = waiting.popleft()
                    done[own] = run_sums(*pairs[own], effects, signals, keep)
                else:
                    done[number] = ahead.pop(number).result()
            yield layout, done.pop(number)
    finally:
        for future in ahead.values():
            future.cancel()


def _refill(
    executor: Executor | None,
    ahead: dict[int, Future[RunSums]],
    waiting: deque[int],
    pairs: Sequence[tuple[Session, Run]],
    constants: tuple[Sequence[Grid], IntArray],
) -> None:
    """Keep the second process busy; the next run in turn is left to this one."""
    if executor is None:
        return
    while len(waiting) > 1 and sum(not f.done() for f in ahead.values()) < TASKS_AHEAD:
        number = waiting[1]
        waiting.remove(number)
        session, run = pairs[number]
        ahead[number] = executor.submit(_elsewhere, replace(session, runs=()), run, *constants)


def _elsewhere(session: Session, run: Run, grids: Sequence[Grid], signals: IntArray) -> RunSums:
    """What the second process does."""
    effects = [replace(CATALOGUE[name], shapes=shapes) for name, shapes in grids]
    return run_sums(session, run, effects, signals, None)


def _of_the_user(effect: Effect) -> bool:
    """Whether it is none of the built-in effects; those may come with shapes for a second look."""
    known = CATALOGUE.get(effect.id)
    return known is None or known.columns is not effect.columns


def run_sums(
    session: Session,
    run: Run,
    effects: Sequence[Effect],
    signals: IntArray,
    keep: Callable[[Session, Run, Narrow], None] | None,
) -> RunSums:
    """Products of all signals over a run, in stretches of at most a minute.

    ``signals`` is the layout's: which signal each feature is, (features,).
    """
    result = RunSums(empty(int(signals.max()) + 1))
    result.sums.runs.append(run.name)
    for motion in stretches(run, session.rig):
        low = narrow_columns(motion, effects, signals)
        part = _products(low)
        result.sums.add(part)
        _add_noise(result, low, run, part.products)
        result.encoder_variance = (motion.radius * motion.position_step) ** 2 / 12.0
        if keep is not None:
            keep(session, run, low)
    return result


def _products(low: Narrow) -> Sums:
    """Sums over one stretch."""
    taut = int(low.taut.sum())
    loose, still = low.columns[~low.taut], low.columns[low.taut & low.rest]
    return Sums(
        low.columns.T @ low.columns,
        loose.T @ loose if len(loose) else None,
        taut,
        len(low.taut) - taut,
        still.T @ still if len(still) else None,
        len(still),
    )


def _add_noise(result: RunSums, low: Narrow, run: Run, products: Array) -> None:
    """Products of what is left of every signal without the harmonics of the run's cycle."""
    frequency = run.trajectory.get("frequency_hz")
    if run.trajectory.get("kind") != "sine" or not frequency or not bool(low.taut.all()):
        return
    count = int(np.ceil(0.5 * NARROW_RATE_HZ / frequency)) - 1
    if 2 * count + 1 > 0.6 * len(low.time):
        return
    phase = 2 * np.pi * frequency * np.outer(low.time, np.arange(1, count + 1))
    harmonics = np.hstack((np.ones((len(phase), 1)), np.cos(phase), np.sin(phase)))
    basis, _ = np.linalg.qr(harmonics)
    cyclic = basis.T @ low.columns
    noise = products - cyclic.T @ cyclic
    result.noise = noise if result.noise is None else result.noise + noise
    result.noise_samples += len(low.time) - basis.shape[1]


def _add(group: Group, k: int, found: RunSums) -> None:
    """Add a run to fold ``k`` of its group."""
    group.folds[k].add(found.sums)
    group.encoder_variance = max(group.encoder_variance, found.encoder_variance)
    if found.noise is not None:
        group.noise += found.noise
        group.noise_samples += found.noise_samples
