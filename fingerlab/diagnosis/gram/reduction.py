"""From sessions to Gram matrices: the only pass over the data.

All columns of all effects at all grid points are formed once, low-passed, decimated, and reduced to products
of features, one matrix for each fold of each group of runs. Fits, held-out scores and distances between
effects then cost nothing that grows with the recording.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, TypeVar

from fingerlab.core.progress import SILENT, Watch
from fingerlab.diagnosis.equations.columns import ReadRequest, asked_of, joined, layout_of
from fingerlab.diagnosis.equations.features import Layout
from fingerlab.diagnosis.equations.parameters import narrowed
from fingerlab.diagnosis.gram.decimation import Decimated, SegmentCache
from fingerlab.diagnosis.gram.grouping import (
    add_few,
    add_run,
    empty_group,
    remove_common_trend,
    shared_motions,
)
from fingerlab.diagnosis.gram.run_constants import RunConstants
from fingerlab.diagnosis.gram.run_sums import Keep, in_place, pair_sums, run_sums, sums_in_turn
from fingerlab.diagnosis.gram.state_law import torque_products
from fingerlab.diagnosis.gram.sums import (
    ALL_NOISE,
    Group,
    PairSums,
    Reduced,
    RunSums,
    TorqueNoise,
)
from fingerlab.diagnosis.settings import (
    FEW_RUNS,
    MOST_CLOSER,
    MOST_REMEMBERED,
    STATE_ORDERS,
)
from fingerlab.diagnosis.signals.channel_checks import ChannelRatios, check_channels
from fingerlab.diagnosis.signals.conditions import (
    GroupKey,
    changed_pairs,
    folds_of_runs,
    group_key,
)
from fingerlab.diagnosis.signals.filters import Repair
from fingerlab.diagnosis.signals.odd_runs import RunKey
from fingerlab.diagnosis.signals.reading_errors import (
    ReadingErrors,
    RunZeros,
)
from fingerlab.diagnosis.signals.recordings import Recordings
from fingerlab.diagnosis.signals.scales import (
    Scales,
)
from fingerlab.diagnosis.signals.segments import (
    ChannelSigns,
    check_senses,
    segments_of,
)
from fingerlab.effects.base import Effect, Shape
from fingerlab.physics.motion import strongest_lines
from fingerlab.sessions.model import Array, Run, Session
from fingerlab.sessions.trajectory import commanded_frequency

_Found = TypeVar("_Found")


class Reduction(Recordings):
    """Sessions that are reduced more than once: what the first pass read is kept for all that follow.

    A pass over effects that the first one knew reads no run and forms no column again. What comes out does
    not depend on what was asked in between.

    Attributes:
        constants: that every run has of its own, for what is asked now; None: none.
        settled: whether they were looked for under the bare model.
        late_torque: whether the torque of a motor alone was found to be logged later than its position.
        torque_noise: how much is noise of what no law of the state tells of a motor's torque.
        fixed: values that somebody holds unknowns of every model at, by key, SI.
        repairs: samples that were put right, by number of the run, how and channel; samples: that it has.
    """

    def __init__(
        self, sessions: Sequence[Session], executor: Executor | None = None, scales: Scales | None = None
    ) -> None:
        """``executor``: a second process (``core.progress``) that takes a share of the runs.

        ``scales``: those to use; None: the machine's own.

        Raises:
            UserError: there is nothing to analyse.
        """
        super().__init__(sessions, scales)
        self._executor = executor
        self._asked: list[_Key] | None = None
        self._seen: dict[str, tuple[Shape, ...]] = {}
        self.constants: RunConstants | None = None
        self._settled_constants: RunConstants | None = None
        self.settled = False
        self.late_torque = self._settled_late = False
        self.torque_noise: TorqueNoise = ALL_NOISE
        self.fixed: Mapping[str, float] = {}
        self.repairs: dict[int, Mapping[Repair, int]] = {}
        self.samples: dict[int, float] = {}
        self._forget()

    def restart(self, fixed: Mapping[str, float] | None = None) -> None:
        """Begin a call that asks for nothing that another left: no constants but those of the bare model."""
        self.fixed, self.constants = dict(fixed or {}), self._settled_constants
        self.late_torque = self._settled_late
        self.torque_noise = ALL_NOISE
        self.leave_aside(frozenset())
        self.correct_readings({})
        self.correct_runs({})

    def correct_readings(self, errors: ReadingErrors) -> bool:
        """As of :class:`Recordings`; then constants that were found under the bare model are forgotten."""
        changed = super().correct_readings(errors)
        if changed:
            self.constants, self._settled_constants, self.settled = None, None, False
            self._forget()
        return changed

    def correct_runs(self, zeros: RunZeros) -> bool:
        """As of :class:`Recordings`.

        How far zeros move from run to run is known, and stays: what is taken off is the likeliest of each.
        """
        changed = super().correct_runs(zeros)
        if changed:
            self._forget()
        return changed

    def leave_aside(self, runs: frozenset[RunKey]) -> bool:
        """As of :class:`Recordings`; then constants that were found under the bare model are forgotten."""
        changed = super().leave_aside(runs)
        if changed:
            self.constants, self._settled_constants, self.settled = None, None, False
            self._forget()
        return changed

    def settle(self, constants: RunConstants | None) -> None:
        """Keep what was found under the bare model."""
        self.constants = self._settled_constants = constants
        self._settled_late, self.settled = self.late_torque, True

    @property
    def known_of_bench(self) -> KnownOfBench:
        """What was found of the bench so far."""
        found = self.constants, self._settled_constants, self.settled
        return KnownOfBench(self.reading_errors, self.run_zeros, *found, self.late_torque, self.disagreeing)

    def go_back(self, known: KnownOfBench) -> None:
        """Take for the bench's own errors again what was before."""
        self.leave_aside(known.disagreeing)
        self.correct_readings(known.reading_errors)
        self.correct_runs(known.run_zeros)
        self.constants, self._settled_constants = known.constants, known.settled_constants
        self.settled, self.late_torque = known.settled, known.late_torque

    def resume(
        self,
        fixed: Mapping[str, float],
        constants: RunConstants | None,
        torque_noise: TorqueNoise | None = None,
        reading_errors: ReadingErrors | None = None,
        run_zeros: RunZeros | None = None,
        disagreeing: frozenset[RunKey] = frozenset(),
    ) -> None:
        """Go on from an answer: what it had fixed, constants of runs, noise, readings, runs left aside."""
        self.leave_aside(disagreeing)
        self.correct_readings(reading_errors or {})
        self.correct_runs(run_zeros or {})
        self.fixed, self.constants, self.torque_noise = fixed, constants, torque_noise or ALL_NOISE

    def _forget(self) -> None:
        self._cache = SegmentCache(self._executor)
        self._first: dict[bool, Layout] = {}
        self._closer: dict[tuple[_Key, ...], Reduced] = {}
        self._remembered: dict[Hashable, Any] = {}
        self._asked = None

    def suited(self, effects: Sequence[Effect]) -> list[Effect]:
        """The effects with the shapes that the recordings suggest, and the ranges that the rig file gives.

        Raises:
            UserError: the rig file gives a range that is none.
        """
        suits = [e.shapes_seen is not None and (self.on_bench or not e.bench) for e in effects]
        seen = [self._suited(e) if suited else e for e, suited in zip(effects, suits, strict=True)]
        return [narrowed(effect, self._given[0].rig, self.scales) for effect in seen]

    def _suited(self, effect: Effect) -> Effect:
        if effect.id not in self._seen:
            assert effect.shapes_seen is not None
            self._seen[effect.id] = tuple(effect.shapes_seen(list(self._looked_at.values())))
        return replace(effect, shapes=self._seen[effect.id] or effect.shapes)

    @cached_property
    def _orders(self) -> tuple[float, ...]:
        """Periods a turn at which the torque of a motor alone repeats with its angle."""
        return tuple(strongest_lines(list(self._looked_at.values())))[:STATE_ORDERS] if self.on_bench else ()

    def begin(self, catalogue: Sequence[Effect], watch: Watch = SILENT, read: bool = False) -> None:
        """Make sure that the first pass is over this catalogue; one over another one is forgotten.

        ``read``: make that pass now, if it was not made yet.
        """
        if self._asked != [_key(e) for e in self._acting(catalogue)]:
            self._forget()
            if read:
                self.of(catalogue, watch)

    def of(self, effects: Sequence[Effect], watch: Watch = SILENT, keep: Keep | None = None) -> Reduced:
        """Sums for those of the effects that act in these runs; ``keep`` is shown every segment as it passes.

        Raises:
            UserError: a run that cannot be read, or channels whose sense is turned.
            Cancelled: the user asked for it.
        """
        if self._asked is None:
            self._forget()  # a pass may have been broken off
        acting = self._acting(effects)
        layouts = self._layouts(acting)
        reduced = self._reduced(acting, layouts, watch, keep, anew=False)
        if self._asked is None:
            self._asked, self._first = [_key(e) for e in acting], layouts
        return reduced

    def refined(self, effects: Sequence[Effect], watch: Watch = SILENT) -> Reduced:
        """The same for few effects at shapes between the grid's, whose columns are formed anew.

        What was asked before is kept: another way to the same effects asks it again.
        """
        if self._asked is None:
            return self.of(effects, watch)
        acting = self._acting(effects)
        key = tuple(_key(e) for e in acting)
        if key not in self._closer:
            if len(self._closer) >= MOST_CLOSER:
                self._closer.pop(next(iter(self._closer)))
            self._closer[key] = self._reduced(acting, self._layouts(acting), watch, None, anew=True)
        known = self._closer[key]
        # Missing noise is filled in by whoever asks.
        groups = [replace(g) for g in known.groups]
        layout = replace(known.layout, late_torque=self.late_torque)
        known = replace(known, constants=self.constants, fixed=self.fixed, torque_noise=self.torque_noise)
        return replace(known, layout=layout, groups=groups)

    def shown(self, effects: Sequence[Effect], keep: Keep) -> None:
        """Show ``keep`` every segment as it passes, with the columns of few effects, formed anew."""
        acting = self._acting(effects)
        self._reduced(acting, self._layouts(acting), SILENT, keep, anew=True)

    def torque_with_memory(self) -> list[list[Array]]:
        """Of each run of the motor alone what a law of its state and past (``gram.state_law``) is made of.

        Returns:
            Products over blocks, (functions + 1,) * 2 each.
        """
        found: dict[tuple[Path, str], list[Array]] = {}

        def keep(session: Session, run: Run, low: Decimated) -> None:
            if low.wide.finger is None:
                products = torque_products(low, self._orders, with_memory=True)
                found.setdefault((session.path, run.name), []).extend(products)

        self.shown([], keep)
        return list(found.values())

    def by_state(self, effects: Sequence[Effect], watch: Watch = SILENT) -> Reduced:
        """Sums for few effects, and what a law of the state (``gram.state_law``) tells their signals by."""
        acting = self._acting(effects)
        return self._reduced(acting, self._layouts(acting), watch, None, anew=True, by_state=True)

    def remember(
        self, effects: Sequence[Effect], shapes: Sequence[int], work: Callable[[], _Found]
    ) -> _Found:
        """What ``work`` finds in the sums over these effects alone, or found in them before.

        It may depend on the effects, the ``shapes`` that it begins at, the constants of the runs and what is
        fixed, and on nothing else.
        """
        key = (
            tuple((*_key(e), e.widened) for e in effects),
            None if self.constants is None else self.constants.key,
            tuple(sorted(self.fixed.items())),
            self.late_torque,
            self.torque_noise,
            tuple(shapes),
        )
        if key not in self._remembered:
            if len(self._remembered) >= MOST_REMEMBERED:
                self._remembered.pop(next(iter(self._remembered)))
            self._remembered[key] = work()
        return self._remembered[key]

    def _acting(self, effects: Sequence[Effect]) -> list[Effect]:
        """Those that can act in these runs."""
        phases = {run.phase for _, run in self.pairs}
        cables = {run.cable for _, run in self.pairs}
        return [
            e
            for e in effects
            if (e.bench is True or not self.on_bench)
            and (not e.phases or phases & set(e.phases))
            and cables >= set(e.cables)
        ]

    def _layouts(self, effects: Sequence[Effect]) -> dict[bool, Layout]:
        """The features of the finger's runs and of those of the motor alone (True), of what there is."""
        kinds = [run.phase == "motor_bench" for _, run in self.pairs]
        layouts = {}
        for on_bench in sorted(set(kinds)):
            number = kinds.index(on_bench)
            session, run = self.pairs[number]
            kept = next(self._cache.segments(number), None)
            known = [kept.motion] if kept is not None else self._read.get(number)
            motion = known[0] if known is not None else next(segments_of(run, session.rig))
            beside = len(set(kinds)) == 2
            speed = self._speed if self.on_bench else 0.0
            found = layout_of(motion.head(), session, effects, beside, speed, self._tip_sticks)
            layouts[on_bench] = replace(
                found, scales=self.scales, late_torque=self.late_torque, knocks=self._knocks
            )
        return layouts

    def _reduced(
        self,
        effects: Sequence[Effect],
        layouts: Mapping[bool, Layout],
        watch: Watch,
        keep: Keep | None,
        anew: bool,
        by_state: bool = False,
    ) -> Reduced:
        pairs, runs = self.pairs, [run for _, run in self.pairs]
        seek_cycle = all(commanded_frequency(run) is None for run in runs)
        asked, start = {}, 0
        for on_bench, layout in layouts.items():
            found = asked_of(layout, effects, self._first.get(on_bench), start, anew, seek_cycle)
            in_parts = self.on_bench and len(runs) <= FEW_RUNS
            asked[on_bench] = replace(found, orders=self._orders, by_state=by_state, in_parts=in_parts)
            start += layout.signal_count
        whole = joined(*layouts.values())
        dealt, places = folds_of_runs(runs)
        motions = shared_motions(self.motions)
        groups: dict[GroupKey, Group] = {}
        few: dict[GroupKey, list[tuple[int, RunSums]]] = {}
        seen: list[ChannelSigns] = []
        facts: list[ChannelRatios] = []
        each = [asked[run.phase == "motor_bench"] for run in runs]
        parts = sums_in_turn(pairs, effects, whole.signal_count, each, self._cache, keep, self._read)
        for number, run in enumerate(runs):
            watch.tell(number / len(pairs), f"reading run {run.name}")
            sums = next(parts)
            key = group_key(run)
            if key not in groups:
                groups[key] = empty_group(run, whole, dealt[key])
            if each[number].in_parts:
                few.setdefault(key, []).append((number, sums))
            else:
                add_run(groups[key], places[number], sums, number, motions[number])
            seen += sums.senses
            facts += [] if sums.facts is None else [sums.facts]
            self.repairs[number], self.samples[number] = sums.repairs, sums.samples
        for key, found_sums in few.items():
            add_few(groups[key], found_sums, places, motions)
        check_channels(facts)
        check_senses(seen)
        for group in groups.values():
            remove_common_trend(group)
        radius = 1.0 if self.on_bench else pairs[0][0].rig.motor.pulley_radius or 1.0
        changed = tuple(self._changed_pairs(runs, effects, each, whole.signal_count))
        every = list(groups.values())
        now = self.constants, self.fixed, changed, self.torque_noise
        return Reduced(whole, every, self.on_bench, radius, *now)

    def _changed_pairs(
        self, runs: Sequence[Run], effects: Sequence[Effect], asked: Sequence[ReadRequest], size: int
    ) -> Iterator[PairSums]:
        """The sums over every pair of runs before a known change and with it; these are read once more."""
        for numbers in changed_pairs(runs):
            seen: list[Decimated] = []

            def keep(session: Session, run: Run, low: Decimated, seen: list[Decimated] = seen) -> None:
                seen.append(low)

            for number in numbers:
                count, own = len(seen), SegmentCache()
                shown = partial(in_place, keep, asked[number].start, size)
                run_sums(number, *self.pairs[number], effects, asked[number], shown, own)
                del seen[count + 1 :]
            found = pair_sums(numbers, group_key(runs[numbers[0]]), *seen)
            if found is not None:
                yield found


@dataclass(frozen=True)
class KnownOfBench:
    """What was found of a bench's own errors; see the attributes of :class:`Reduction`."""

    reading_errors: ReadingErrors
    run_zeros: RunZeros
    constants: RunConstants | None
    settled_constants: RunConstants | None
    settled: bool
    late_torque: bool
    disagreeing: frozenset[RunKey]


_Key = tuple[str, object, tuple[tuple[tuple[str, float], ...], ...]]


def _key(effect: Effect) -> _Key:
    """What decides the columns of an effect."""
    return effect.id, effect.columns, tuple(tuple(sorted(shape.items())) for shape in effect.shapes)
