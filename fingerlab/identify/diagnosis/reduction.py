"""From sessions to Gram matrices: the only pass over the data.

All columns of all effects at all grid points are formed once, low-passed, decimated, and reduced to products
of features, one matrix for each fold of each group of runs. Fits, held-out scores and distances between
effects then cost nothing that grows with the recording.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

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
    SHIFTS_S,
    SLOPE,
    BoolArray,
    Feature,
    Layout,
    base_columns,
    nuisance_ranges,
    shifted_columns,
)
from fingerlab.identify.diagnosis.stretches import LONGEST_STRETCH_S, stretches
from fingerlab.physics.effects.base import Effect, Row
from fingerlab.physics.effects.motion import Motion
from fingerlab.sessions.model import Array, Run, Session

Progress = Callable[[float, str], None]

FOLDS = 10
"""Runs of a group are dealt to at most this many folds; ten runs or fewer are held out one by one."""
SLACK_TENSION_N = 0.12
"""Below this tension the cable may be slack, N; assumed: a few times the noise of the current at 8 Hz."""

WORKERS = 2
"""Threads that form columns ahead of the sums; numpy lets go of the interpreter in its inner loops."""

GroupKey = tuple[str, str]


@dataclass
class Fold:
    """Sums of feature products over some runs of a group."""

    gram: Array  # (features, features), taut samples
    slack: Array  # the same for cable features where the cable may be slack
    taut_samples: int = 0
    slack_samples: int = 0
    runs: list[str] = field(default_factory=list)


@dataclass
class Group:
    """Runs of one routing and phase: they share moment arms, losses and noise."""

    key: GroupKey
    cable_sign: int
    folds: list[Fold]
    cable_rows: BoolArray  # (features,) bool: features of the cable equation
    noise: Array  # (features, features): products of what does not repeat from cycle to cycle
    noise_samples: float = 0.0
    condition_count: int = 0

    @property
    def samples(self) -> int:
        """Decimated samples in the group."""
        return sum(f.taut_samples + f.slack_samples for f in self.folds)

    @property
    def run_count(self) -> int:
        return sum(len(f.runs) for f in self.folds)


@dataclass
class Reduced:
    """All that the diagnosis needs of the sessions."""

    layout: Layout
    groups: list[Group]
    on_bench: bool
    radius: float  # of the pulley, m; 1 on a bench without one


@dataclass(frozen=True)
class Narrow:
    """Features of one stretch, decimated: ``columns`` (n, features), ``taut`` (n,) bool, ``time`` (n,) s."""

    columns: Array
    taut: BoolArray
    time: Array
    wide: Motion


MARGIN = round(max(abs(s) for s in SHIFTS_S) * WIDE_RATE_HZ)


def layout_of(motion: Motion, session: Session, effects: Sequence[Effect]) -> Layout:
    """The features in the order in which :func:`narrow_columns` fills them."""
    features = [f for f, _ in base_columns(motion)]
    for feature, _ in shifted_columns(motion):
        shifts: Sequence[int | None] = [None] if motion.finger is None else range(SLOPE + 1)
        features += [_with(feature, shift=k) for k in shifts]
    base = np.arange(len(features))
    for effect in effects:
        for index, shape in enumerate(effect.shapes):
            features += [
                Feature(t.row, t.gain, t.constant, t.scale, owner=effect.id, shape=index)
                for t in effect.columns(motion, shape)
            ]
    return Layout(tuple(features), nuisance_ranges(session.rig), tuple(effects), base)


def _with(feature: Feature, **changes: object) -> Feature:
    return Feature(**{**vars(feature), **changes})


def narrow_columns(motion: Motion, effects: Sequence[Effect]) -> Narrow:
    """All features of a stretch, low-passed at 8 Hz and decimated to 25 Hz."""
    n = len(motion.time)
    inner = slice(MARGIN, n - MARGIN)
    columns = [values[inner] for _, values in base_columns(motion)]
    for _, values in shifted_columns(motion):
        if motion.finger is None:
            columns.append(values[inner])
            continue
        for shift in SHIFTS_S:
            k = round(shift * WIDE_RATE_HZ)
            columns.append(values[MARGIN - k : n - MARGIN - k])
        columns.append(np.gradient(values, 1.0 / motion.sample_rate_hz)[inner])
    for effect in effects:
        for shape in effect.shapes:
            columns += [term.values[inner] for term in effect.columns(motion, shape)]
    # Single precision is a hundred times finer than the sensors, and twice as fast.
    low = narrow(np.stack(columns, dtype=np.float32, casting="same_kind"))
    return Narrow(low.T, _taut(motion, inner), narrow(motion.time[inner]), motion)


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


def narrow_stretches(run: Run, session: Session, effects: Sequence[Effect]) -> Iterator[Narrow]:
    """The run's stretches as decimated features."""
    for motion in stretches(run, session.rig):
        yield narrow_columns(motion, effects)


def reduce_sessions(
    sessions: Sequence[Session],
    effects: Sequence[Effect],
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
    keep: Callable[[Session, Run, Narrow], None] | None = None,
) -> Reduced:
    """One pass over the data; ``keep`` is shown every stretch as it passes.

    Raises:
        UserError: nothing to analyse, or a run that cannot be read.
        Cancelled: ``cancelled`` answered True.
    """
    pairs, on_bench = runs_to_analyse(sessions)
    if on_bench:
        effects = [e for e in effects if e.bench]
    groups: dict[GroupKey, Group] = {}
    layout: Layout | None = None
    totals: dict[GroupKey, int] = {}
    for _, run in pairs:
        key = group_key(run)
        totals[key] = totals.get(key, 0) + 1
    seen: dict[GroupKey, int] = {}
    narrowed = _narrowed_ahead(pairs, effects)
    for number, (session, run) in enumerate(pairs):
        if cancelled is not None and cancelled():
            raise Cancelled
        if progress is not None:
            progress(number / len(pairs), f"reading run {run.name}")
        key = group_key(run)
        for low in next(narrowed):
            if layout is None:
                layout = layout_of(low.wide, session, effects)
            if key not in groups:
                size = len(layout.features)
                count = min(FOLDS, totals[key])
                folds = [Fold(np.zeros((size, size)), np.zeros((size, size))) for _ in range(count)]
                groups[key] = Group(key, run.cable_sign, folds, cable_rows(layout), np.zeros((size, size)))
            group = groups[key]
            fold = group.folds[seen.get(key, 0) % len(group.folds)]
            products = _add(fold, low, layout)
            _add_noise(group, low, run, products)
            if keep is not None:
                keep(session, run, low)
        if layout is not None and key in groups:
            groups[key].folds[seen.get(key, 0) % len(groups[key].folds)].runs.append(run.name)
        seen[key] = seen.get(key, 0) + 1
    assert layout is not None
    radius = 1.0 if on_bench else pairs[0][0].rig.motor.pulley_radius or 1.0
    return Reduced(layout, list(groups.values()), on_bench, radius)


def cable_rows(layout: Layout) -> BoolArray:
    """Which features stand in the cable equation, (features,) bool."""
    return np.array([f.row == Row.CABLE for f in layout.features])


def _narrowed_ahead(
    pairs: Sequence[tuple[Session, Run]], effects: Sequence[Effect]
) -> Iterator[Iterable[Narrow]]:
    """The runs' stretches in order; the next run is worked on while the caller adds up the last.

    A run that is longer than one stretch is not worked on ahead, so that memory stays that of a few minutes.
    """
    longest = LONGEST_STRETCH_S

    def work(pair: tuple[Session, Run]) -> Iterable[Narrow]:
        session, run = pair
        narrow_run = narrow_stretches(run, session, effects)
        return list(narrow_run) if run.length <= longest * run.sample_rate_hz else narrow_run

    with ThreadPoolExecutor(WORKERS) as pool:
        ahead: deque[Future[Iterable[Narrow]]] = deque()
        waiting = iter(pairs)
        try:
            for pair in waiting:
                ahead.append(pool.submit(work, pair))
                if len(ahead) > WORKERS:
                    yield ahead.popleft().result()
            while ahead:
                yield ahead.popleft().result()
        finally:
            for future in ahead:
                future.cancel()


def _add(fold: Fold, low: Narrow, layout: Layout) -> Array:
    """Add a stretch to a fold; returns the products of its features, (features, features)."""
    cable = cable_rows(layout)
    columns = low.columns
    if not low.taut.all():
        columns = columns.copy()
        columns[np.ix_(~low.taut, cable)] = 0.0
    products = columns.T @ columns
    fold.gram += products
    fold.taut_samples += int(low.taut.sum())
    loose = low.columns[~low.taut][:, cable]
    if len(loose):
        fold.slack[np.ix_(cable, cable)] += loose.T @ loose
    fold.slack_samples += int((~low.taut).sum())
    return np.asarray(products)


def _add_noise(group: Group, low: Narrow, run: Run, products: Array) -> None:
    """Products of what is left of every feature without the harmonics of the run's cycle."""
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
    group.noise += products - cyclic.T @ cyclic
    group.noise_samples += len(low.time) - basis.shape[1]
