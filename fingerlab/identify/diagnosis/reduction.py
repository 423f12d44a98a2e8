"""From sessions to Gram matrices: the only pass over the data.

All columns of all effects at all grid points are formed once, low-passed, decimated, and reduced to products
of features, one matrix for each fold of each group of runs. Fits, held-out scores and distances between
effects then cost nothing that grows with the recording.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.polynomial.legendre import legvander

from fingerlab.errors import Cancelled, UserError
from fingerlab.identify.diagnosis.bandwidth import (
    NARROW_HALF,
    NARROW_RATE_HZ,
    NARROW_STEP,
    WIDE_RATE_HZ,
    narrow,
    narrow_count,
)
from fingerlab.identify.diagnosis.conditions import Fold, deal
from fingerlab.identify.diagnosis.features import (
    NO_SHIFT,
    SHIFTS_S,
    SLOPE,
    Feature,
    Layout,
    base_columns,
    beside_a_finger,
    nuisance_ranges,
    shifted_columns,
)
from fingerlab.identify.diagnosis.recall import Recall, Seen
from fingerlab.identify.diagnosis.routing import spread_of
from fingerlab.identify.diagnosis.stretches import stretches
from fingerlab.identify.diagnosis.sums import BoolArray, IntArray, Part, RunSums, Sums, empty, total
from fingerlab.physics.effects import CATALOGUE
from fingerlab.physics.effects.base import Effect, Shape, Term
from fingerlab.physics.effects.motion import Motion
from fingerlab.sessions.model import Array, Run, Session

Progress = Callable[[float, str], None]

FOLDS = 10
"""Runs of a condition are dealt to at most this many folds; ten runs or fewer are held out one by one."""
SLACK_TENSION_N = 0.12
"""Below this tension the cable may be slack, N; assumed: a few times the noise of the current at 8 Hz."""
INERTIA_SPREADS = 2.0
"""... and more where the rotor speeds up: its inertia may be off by so many standard deviations."""

TASKS_AHEAD = 2
"""Runs that a second process is given at a time: one at work and one waiting."""

GroupKey = tuple[str, str]
Grid = tuple[str, Sequence[Shape]]
"""A built-in effect by its id, and the shapes that are asked of it."""


@dataclass
class Group:
    """Runs of one routing and phase: they share moment arms, losses and noise.

    ``noise`` (signals, signals) holds products of what does not repeat from cycle to cycle. ``dealt`` says of
    every fold which runs it holds; empty: every fold has its turn, all runs are of one condition.
    """

    key: GroupKey
    cable_sign: int
    folds: list[Sums]
    noise: Array
    noise_samples: float = 0.0
    taut_noise: Array | None = None
    """What noise adds to the products at one taut moment, (signals, signals); None: as at any other."""
    encoder_variance: float = 0.0  # m^2 of cable: what a standing encoder's step leaves open
    dealt: list[Fold] = field(default_factory=list)
    trends: dict[tuple[int, int], list[Array]] = field(default_factory=dict)
    """While runs are read: slow trends by condition and stretch, (signals, degrees) for each run."""

    def __post_init__(self) -> None:
        self.dealt = self.dealt or [Fold(0, k) for k in range(len(self.folds))]

    @cached_property
    def whole(self) -> Sums:
        """Sums over all folds; asked for when all runs are in."""
        return total(self.folds)

    @property
    def conditions(self) -> list[int]:
        """The conditions that its runs were recorded under."""
        return sorted({fold.condition for fold in self.dealt})

    def of_turn(self, turn: int) -> list[int]:
        """Indices of the folds that are left out in this turn; none where nothing else would be left."""
        found = [k for k, fold in enumerate(self.dealt) if fold.turn == turn]
        return found if len(found) < len(self.folds) else []

    def without(self, k: int) -> Group:
        """The group less one of its folds."""
        folds, dealt = list(self.folds), list(self.dealt)
        del folds[k], dealt[k]
        return replace(self, folds=folds, dealt=dealt)

    def of_condition(self, condition: int) -> list[int]:
        """Indices of a condition's folds."""
        return [k for k, fold in enumerate(self.dealt) if fold.condition == condition]

    @property
    def on_bench(self) -> bool:
        """Whether these are runs of the motor alone, which have the motor's equation and no other."""
        return self.cable_sign == 0

    @property
    def equations(self) -> int:
        """How many equations its runs have."""
        return 1 if self.on_bench else 3

    @property
    def samples(self) -> int:
        """Decimated samples in the group."""
        return sum(f.samples for f in self.folds)


@dataclass
class Reduced:
    """All that the diagnosis needs of the sessions; ``on_bench``: all runs are of the motor alone."""

    layout: Layout
    groups: list[Group]
    on_bench: bool
    radius: float  # of the pulley, m; 1 on a bench without one


@dataclass(frozen=True)
class Narrow:
    """Signals of one stretch, decimated: ``columns`` (n, signals), ``taut`` (n,) bool, ``time`` (n,) s.

    ``rest`` (n,) tells where the motor stands; ``live`` are the signals that are not zero throughout.
    """

    columns: Array
    taut: BoolArray
    time: Array
    wide: Motion
    rest: BoolArray
    live: IntArray


MARGIN = round(max(abs(s) for s in SHIFTS_S) * WIDE_RATE_HZ)


def counted(motion: Motion) -> slice:
    """Samples of a stretch, at the wide rate, that are judged: behind its lead, with room for shifts."""
    return slice(motion.lead + MARGIN, len(motion.time) - MARGIN)


def layout_of(
    motion: Motion, session: Session, effects: Sequence[Effect], beside_finger: bool = False
) -> Layout:
    """The features in the order in which :func:`narrow_columns` meets them.

    ``beside_finger``: if it is a run of the motor alone, the motor is that of a finger's runs.
    """
    features: list[Feature] = []
    signals: list[int] = []
    known: dict[tuple[int, int | None], int] = {}
    kept: list[Array] = []  # so that no array's identity is given to a later one
    count = base = 0
    for values, shift, own, make in _columns(motion, effects):
        feature = make()
        if beside_finger and motion.finger is None:
            feature = beside_a_finger(feature, session.rig)
        base += feature.owner is None
        kept.append(values)
        # What is one array in two equations is one signal; a user's own code is not relied on for that.
        key = id(values), None if shift == NO_SHIFT else shift
        place = count if own else known.setdefault(key, count)
        count = max(count, place + 1)
        features.append(feature)
        signals.append(place)
    return Layout(
        tuple(features), nuisance_ranges(session.rig), tuple(effects), np.arange(base), np.array(signals),
        spread_of(session.rig),
    )  # fmt: skip


def _layout_of_all(
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
    asked, start = {}, 0
    for on_bench, layout in layouts.items():
        asked[on_bench] = Asked(layout.signals, len(layout.base), start)
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


@dataclass(frozen=True)
class Asked:
    """What is asked of a run: its kind's features as signals, of which the first ``common`` every model has.

    ``signals`` (features,) count from ``start``, the kind's first signal among those of all runs.
    """

    signals: IntArray
    common: int
    start: int


Column = tuple[Array, int | None, bool, Callable[[], Feature]]
"""Values at the wide rate, shift, whether a user's own effect brings them, and what makes their feature."""


def _columns(motion: Motion, effects: Sequence[Effect]) -> Iterator[Column]:
    """All features in order: those of every model, then those of the effects."""
    yield from _common_columns(motion)
    yield from _effect_columns(motion, effects)


def _common_columns(motion: Motion) -> Iterator[Column]:
    """A motor channel comes once for every shift, with the same values."""
    for feature, values in base_columns(motion):
        yield values, None, False, partial(replace, feature)
    for feature, values in shifted_columns(motion):
        shifts: Sequence[int | None] = [None] if motion.finger is None else range(SLOPE + 1)
        for k in shifts:
            yield values, k, False, partial(replace, feature, shift=k)


def _effect_columns(motion: Motion, effects: Sequence[Effect]) -> Iterator[Column]:
    alone = motion.finger is None
    for effect in effects:
        if alone and not (effect.bench or effect.bench_beside_finger):
            continue
        own = _of_the_user(effect)
        for index, shape in enumerate(effect.shapes):
            for t in effect.columns(motion, shape):
                yield t.values, None, own, partial(_feature, t, effect.id, index)


def _feature(term: Term, owner: str, shape: int) -> Feature:
    return Feature(term.row, term.gain, term.constant, term.scale, owner=owner, shape=shape)


def narrow_columns(motion: Motion, effects: Sequence[Effect], signals: IntArray) -> Narrow:
    """All signals of a stretch, low-passed at 8 Hz and decimated to 25 Hz.

    ``signals`` is the layout's: which signal each feature is, (features,).
    """
    inner = counted(motion)
    time = narrow(motion.time[inner])
    low = np.zeros((int(signals.max()) + 1, len(time)))
    live = _fill(low, motion, _columns(motion, effects), signals, 0)
    return Narrow(low.T, _taut(motion, inner), time, motion, _at_rest(motion.position[inner]), np.array(live))


def narrow_again(seen: Seen, effects: Sequence[Effect], signals: IntArray) -> Narrow:
    """The same of a stretch that was read before; ``signals`` begin as they did then."""
    known = len(seen.low)
    low = np.zeros((max(int(signals.max()) + 1, known), len(seen.time)))
    low[:known] = seen.low
    rest = _fill(low, seen.motion, _effect_columns(seen.motion, effects), signals[seen.features :], known)
    live = np.concatenate((seen.live, np.array(rest, dtype=seen.live.dtype)))
    return Narrow(low.T, seen.taut, seen.time, seen.motion, seen.rest, live)


def _seen(low: Narrow, asked: Asked) -> Seen:
    """What a later reading needs of a stretch beside its motion."""
    known = int(asked.signals[: asked.common].max()) + 1
    common = low.columns.T[:known].astype(np.float32)
    return Seen(low.wide, asked.common, common, low.live[low.live < known], low.taut, low.rest, low.time)


def _fill(low: Array, motion: Motion, columns: Iterable[Column], signals: IntArray, count: int) -> list[int]:
    """Filter the signals from the number ``count`` on into ``low``; gives those that are not zero."""
    inner = counted(motion)
    # Single precision is a hundred times finer than the sensors, and twice as fast.
    wide = np.empty((AT_ONCE, max(inner.stop - inner.start, 0)), np.float32)
    live: list[int] = []
    waiting = 0
    for place, (values, shift, _, _) in zip(signals.tolist(), columns, strict=True):
        if place < count:
            continue
        count += 1
        column = _shifted(values, shift, motion.sample_rate_hz, inner)
        if not _is_zero(column):  # a force where nothing is touched, a stop that no joint reaches
            wide[waiting] = column
            live.append(place)
            waiting += 1
        if waiting == AT_ONCE:
            low[live[-waiting:]] = narrow(wide)
            waiting = 0
    if waiting:
        low[live[-waiting:]] = narrow(wide[:waiting])
    return live


AT_ONCE = 64
"""So many signals are filtered together: they fit into the processor's cache."""


def _is_zero(values: Array) -> bool:
    if len(values) == 0 or values.strides == (0,):  # one value all along
        return len(values) == 0 or bool(values[0] == 0.0)
    return bool(values[len(values) // 2] == 0.0 and not values.any())


AT_REST_DEG = 0.1
"""A motor stands that turns by less than this in a sixth of a second; assumed: two steps of its encoder."""
REST_REACH = 2  # decimated samples on either side


def _at_rest(position: Array) -> BoolArray:
    """Decimated samples around which the motor stands, (n,)."""
    angle = np.pad(narrow(position), REST_REACH, mode="edge")
    windows = sliding_window_view(angle, 2 * REST_REACH + 1)
    return np.asarray(np.ptp(windows, axis=1) < np.radians(AT_REST_DEG))


def _shifted(values: Array, shift: int | None, rate: float, inner: slice) -> Array:
    """Samples ``inner`` of a channel, later by a kept shift, or of its derivative; the margin has room."""
    if shift is None:
        return values[inner]
    if shift == SLOPE:
        return np.asarray(np.gradient(values, 1.0 / rate)[inner])
    late = round(SHIFTS_S[shift] * WIDE_RATE_HZ)
    return values[inner.start - late : max(inner.stop - late, 0)]


def _taut(motion: Motion, inner: slice) -> BoolArray:
    """Samples into whose low-pass window no slack moment falls."""
    if motion.finger is None:
        return np.ones(len(narrow(motion.time[inner])), dtype=bool)
    pull = (motion.torque - (motion.motor.inertia or 0.0) * motion.acceleration) / motion.radius
    pull -= INERTIA_SPREADS * motion.inertia_spread * np.abs(motion.acceleration) / motion.radius
    smooth = np.convolve(pull, np.ones(9) / 9, mode="same")  # 36 ms: the tension's own noise is then small
    loose = (smooth < SLACK_TENSION_N)[inner]
    # A slack cable hangs through by millimetres, the taut one is known to micrometres: no window that
    # holds a slack moment anywhere but at its very ends may pass for taut.
    reach = np.ones(2 * (NARROW_HALF - NARROW_HALF // 8) + 1)
    near = np.convolve(loose.astype(float), reach, mode="same") > 0.5
    count = narrow_count(len(loose))
    return np.asarray(~near[NARROW_HALF::NARROW_STEP][:count])


def runs_to_analyse(sessions: Sequence[Session]) -> tuple[list[tuple[Session, Run]], bool]:
    """Finger runs of all sessions and the motor-bench runs beside them; whether there are only the latter.

    Raises:
        UserError: there is no run at all, or finger runs without the finger's constants.
    """
    every = [(s, r) for s in sessions for r in s.runs]
    bench = [(s, r) for s, r in every if r.phase == "motor_bench"]
    finger = [(s, r) for s, r in every if r.phase != "motor_bench" and r.cable_sign != 0]
    if finger:
        for session, _ in finger:
            if session.rig.finger is None:
                raise UserError(f"{session.path} gives no finger constants; its rig text needs 'finger'.")
        return finger + bench, False
    if not bench:
        names = ", ".join(str(s.path) for s in sessions)
        raise UserError(
            f"{names} holds no run with a cable and no motor-bench run; there is nothing to compare."
        )
    return bench, True


def group_key(run: Run) -> GroupKey:
    """Runs of one cable and phase belong together."""
    return (run.cable, "contact" if run.phase == "contact" else "free")


def deal_runs(runs: Sequence[Run]) -> tuple[dict[GroupKey, list[Fold]], list[int]]:
    """The folds of every group of runs, and for each run which of its group's folds holds it."""
    members: dict[GroupKey, list[int]] = {}
    for number, run in enumerate(runs):
        members.setdefault(group_key(run), []).append(number)
    folds, places = {}, [0] * len(runs)
    for key, mine in members.items():
        folds[key], found = deal([runs[i] for i in mine], FOLDS)
        for i, place in zip(mine, found, strict=True):
            places[i] = place
    return folds, places


def reduce_sessions(
    sessions: Sequence[Session],
    effects: Sequence[Effect],
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
    keep: Callable[[Session, Run, Narrow], None] | None = None,
    recall: Recall | None = None,
) -> Reduced:
    """One pass over the data; ``keep`` is shown every stretch as it passes.

    ``recall`` tells whether a second process takes a share of the runs (not together with ``keep``), and
    holds what earlier passes over the same sessions left.

    Raises:
        UserError: nothing to analyse, or a run that cannot be read.
        Cancelled: ``cancelled`` answered True.
    """
    pairs, on_bench = runs_to_analyse(sessions)
    phases, cables = {run.phase for _, run in pairs}, {run.cable for _, run in pairs}
    effects = [e for e in effects if (e.bench or not on_bench) and (not e.phases or phases & set(e.phases))]
    effects = [e for e in effects if cables >= set(e.cables)]
    dealt, places = deal_runs([run for _, run in pairs])
    groups: dict[GroupKey, Group] = {}
    layout: Layout | None = None
    parts = _in_turn(pairs, effects, recall or Recall(), keep)
    for number, (_, run) in enumerate(pairs):
        if cancelled is not None and cancelled():
            raise Cancelled
        if progress is not None:
            progress(number / len(pairs), f"reading run {run.name}")
        layout, sums = next(parts)
        key = group_key(run)
        if key not in groups:
            groups[key] = _empty_group(run, layout, dealt[key])
        _add(groups[key], places[number], sums)
    assert layout is not None
    for group in groups.values():
        _without_common_trend(group)
    radius = 1.0 if on_bench else pairs[0][0].rig.motor.pulley_radius or 1.0
    return Reduced(layout, list(groups.values()), on_bench, radius)


def _empty_group(run: Run, layout: Layout, dealt: list[Fold]) -> Group:
    size = layout.signal_count
    folds = [empty(size) for _ in dealt]
    return Group(group_key(run), run.cable_sign, folds, np.zeros((size, size)), dealt=dealt)


def _in_turn(
    pairs: Sequence[tuple[Session, Run]],
    effects: Sequence[Effect],
    recall: Recall,
    keep: Callable[[Session, Run, Narrow], None] | None,
) -> Iterator[tuple[Layout, RunSums]]:
    """The sums of every run, in order; a second process works ahead on every run that is not yet begun.

    The layout is made here, from the first run: only its sums travel between the processes. A run goes to the
    process that has read it before.
    """
    layout, asked = _layout_of_all(pairs, effects, recall)
    size = layout.signal_count
    grids = [(e.id, e.shapes) for e in effects]
    # A user's own effect lives in this process only, and so does what is shown.
    alone = recall.executor is None or keep is not None or any(_of_the_user(e) for e in effects)
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
    keep: Callable[[Session, Run, Narrow], None],
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


def _of_the_user(effect: Effect) -> bool:
    """Whether it is none of the built-in effects; those may come with shapes for a second look."""
    known = CATALOGUE.get(effect.id)
    return known is None or known.columns is not effect.columns


def run_sums(
    number: int,
    session: Session,
    run: Run,
    effects: Sequence[Effect],
    asked: Asked,
    keep: Callable[[Session, Run, Narrow], None] | None,
    recall: Recall,
) -> RunSums:
    """Products of all signals over a run, in stretches of at most a minute; ``number`` is its own."""
    result = RunSums(run.name)
    for low in _narrowed(number, session, run, effects, asked, recall):
        motion = low.wide
        live = np.ascontiguousarray(low.columns.T[low.live])
        part = _products(low, live)
        repeating = _repeating(low, run)
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
            found.append(_seen(low, asked))
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


def _repeating(low: Narrow, run: Run) -> tuple[Array, Array] | None:
    """What a stretch may repeat: bases of its cycle, (n, harmonics), and of a slow trend, (n, degrees).

    None where there is no cycle that repeats often enough.
    """
    frequency = run.trajectory.get("frequency_hz")
    if run.trajectory.get("kind") != "sine" or not frequency or not bool(low.taut.all()):
        return None
    count = int(np.ceil(0.5 * NARROW_RATE_HZ / frequency)) - 1
    if 2 * count + 1 > 0.6 * len(low.time):
        return None
    return _harmonics(float(frequency), count, float(low.time[0]), float(low.time[-1]), len(low.time))


@lru_cache(maxsize=4)
def _harmonics(frequency: float, count: int, first: float, last: float, samples: int) -> tuple[Array, Array]:
    """Orthonormal bases of a constant and harmonics, (samples, 2 count + 1), and of a trend beside them.

    ``frequency`` in Hz, ``first`` and ``last`` sample in s. The runs of a session share them.
    """
    phase = 2 * np.pi * frequency * np.outer(np.linspace(first, last, samples), np.arange(1, count + 1))
    trend = legvander(np.linspace(-1.0, 1.0, samples), TREND_DEGREE)
    basis = np.linalg.qr(np.hstack((trend[:, :1], np.cos(phase), np.sin(phase), trend[:, 1:])))[0]
    return basis[:, :-TREND_DEGREE], basis[:, -TREND_DEGREE:]


TREND_DEGREE = 3
"""Of the polynomial over a stretch that counts as its slow trend."""


def _without_common_trend(group: Group) -> None:
    """Takes out of a group's noise the slow trend that the runs of a condition have in common.

    A trend (a sensor that warms up, a spring that creeps) is no noise if it comes again in every run: it can
    be explained. Its noise is what it differs by from run to run. Only in free motion: how a tip settles on
    the load cell comes again, too, and no law here tells it.
    """
    for trends in group.trends.values():
        count = len(trends)
        if count < 2 or group.key[1] == "contact":
            continue
        runs = np.stack(trends)  # (runs, signals, degrees)
        mean = runs.mean(axis=0)
        apart = (runs - mean).transpose(1, 0, 2).reshape(mean.shape[0], -1)
        group.noise += apart @ apart.T / (count - 1) - count * mean @ mean.T
    group.trends.clear()


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
