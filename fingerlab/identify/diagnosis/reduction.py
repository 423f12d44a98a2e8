"""From sessions to Gram matrices: the only pass over the data.

All columns of all effects at all grid points are formed once, low-passed, decimated, and reduced to products
of features, one matrix for each fold of each group of runs. Fits, held-out scores and distances between
effects then cost nothing that grows with the recording.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field, replace
from functools import cached_property

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
from fingerlab.identify.diagnosis.stretches import stretches
from fingerlab.physics.effects import CATALOGUE
from fingerlab.physics.effects.base import Effect, Row
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


@dataclass
class Fold:
    """Sums of feature products over some runs of a group."""

    gram: Array  # (features, features), taut samples
    slack: Array  # the same for cable features where the cable may be slack
    taut_samples: int = 0
    slack_samples: int = 0
    runs: list[str] = field(default_factory=list)


def _total(matrices: Sequence[Array]) -> Array:
    """Their sum, one after the other: stacking them first would copy all of them."""
    result = matrices[0].copy()
    for one in matrices[1:]:
        result += one
    return result


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

    @cached_property
    def gram(self) -> Array:
        """Sums over all folds, (features, features); asked for when all runs are in."""
        return _total([f.gram for f in self.folds])

    @cached_property
    def slack(self) -> Array:
        """The same where the cable may be slack."""
        return _total([f.slack for f in self.folds])

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
    phases = {run.phase for _, run in pairs}
    effects = [e for e in effects if (e.bench or not on_bench) and (not e.phases or phases & set(e.phases))]
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
    size = len(layout.features)
    folds = [Fold(np.zeros((size, size)), np.zeros((size, size))) for _ in range(count)]
    return Group(group_key(run), run.cable_sign, folds, cable_rows(layout), np.zeros((size, size)))


def cable_rows(layout: Layout) -> BoolArray:
    """Which features stand in the cable equation, (features,) bool."""
    return np.array([f.row == Row.CABLE for f in layout.features])


@dataclass
class RunSums:
    """Sums of feature products over one run."""

    name: str
    gram: Array
    slack: Array  # (cable features, cable features)
    noise: Array | None = None  # None: nothing in the run repeats
    noise_samples: float = 0.0
    taut_samples: int = 0
    slack_samples: int = 0


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
    cable = cable_rows(layout)
    ids = [e.id for e in effects]
    if any(CATALOGUE.get(e.id) is not e for e in effects):
        executor = None  # a user's own effect lives in this process only
    waiting = deque(range(len(pairs)))
    ahead: dict[int, Future[RunSums]] = {}
    done: dict[int, RunSums] = {}
    try:
        for number in range(len(pairs)):
            while number not in done:
                _refill(executor, ahead, waiting, pairs, (ids, cable))
                if number in waiting:
                    waiting.remove(number)
                    done[number] = run_sums(*pairs[number], effects, cable, keep)
                elif waiting and not ahead[number].done():
                    own = waiting.popleft()
                    done[own] = run_sums(*pairs[own], effects, cable, keep)
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
    constants: tuple[Sequence[str], BoolArray],
) -> None:
    """Keep the second process busy; the next run in turn is left to this one."""
    if executor is None:
        return
    while len(waiting) > 1 and sum(not f.done() for f in ahead.values()) < TASKS_AHEAD:
        number = waiting[1]
        waiting.remove(number)
        session, run = pairs[number]
        ahead[number] = executor.submit(_elsewhere, replace(session, runs=()), run, *constants)


def _elsewhere(session: Session, run: Run, ids: Sequence[str], cable: BoolArray) -> RunSums:
    """What the second process does."""
    return run_sums(session, run, [CATALOGUE[name] for name in ids], cable, None)


def run_sums(
    session: Session,
    run: Run,
    effects: Sequence[Effect],
    cable: BoolArray,
    keep: Callable[[Session, Run, Narrow], None] | None,
) -> RunSums:
    """Products of all features over a run, in stretches of at most a minute.

    ``cable`` tells which features stand in the cable equation, shape (features,).
    """
    size = len(cable)
    sums = RunSums(run.name, np.zeros((size, size)), np.zeros((int(cable.sum()), int(cable.sum()))))
    for motion in stretches(run, session.rig):
        low = narrow_columns(motion, effects)
        products = _add_products(sums, low, cable)
        _add_noise(sums, low, run, products)
        if keep is not None:
            keep(session, run, low)
    return sums


def _add_products(sums: RunSums, low: Narrow, cable: BoolArray) -> Array:
    """Add a stretch; returns the products of its features, (features, features)."""
    columns = low.columns
    if not low.taut.all():
        columns = columns.copy()
        columns[np.ix_(~low.taut, cable)] = 0.0
    products = columns.T @ columns
    sums.gram += products
    sums.taut_samples += int(low.taut.sum())
    loose = low.columns[~low.taut][:, cable]
    if len(loose):
        sums.slack += loose.T @ loose
    sums.slack_samples += int((~low.taut).sum())
    return np.asarray(products)


def _add_noise(sums: RunSums, low: Narrow, run: Run, products: Array) -> None:
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
    noise = products - cyclic.T @ cyclic
    sums.noise = noise if sums.noise is None else sums.noise + noise
    sums.noise_samples += len(low.time) - basis.shape[1]


def _add(group: Group, k: int, sums: RunSums) -> None:
    """Add a run to fold ``k`` of its group."""
    fold = group.folds[k]
    fold.gram += sums.gram
    fold.slack[np.ix_(group.cable_rows, group.cable_rows)] += sums.slack
    fold.taut_samples += sums.taut_samples
    fold.slack_samples += sums.slack_samples
    fold.runs.append(sums.name)
    if sums.noise is not None:
        group.noise += sums.noise
        group.noise_samples += sums.noise_samples
