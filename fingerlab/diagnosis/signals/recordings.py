"""Recordings as a diagnosis reads them: in reduced units, less what was found wrong with their readings.

What is wrong is found later (``search.reading_errors``, ``search.moved_zeros``) and told here; from then on
every run is read anew without it.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from itertools import groupby, islice

from fingerlab.diagnosis.settings import MOST_LOOKED_AT
from fingerlab.diagnosis.signals.conditions import (
    missing_channels,
    repeated_motions,
    runs_to_analyse,
    usable,
    with_interventions,
)
from fingerlab.diagnosis.signals.load_cell_zero import (
    SeenZeros,
    zero_in_the_air,
    zeros_in_the_air,
    zeros_while_clear,
)
from fingerlab.diagnosis.signals.odd_runs import OddRun, RunKey, odd_runs
from fingerlab.diagnosis.signals.reading_errors import (
    FORCE,
    NO_ERROR,
    ReadingError,
    ReadingErrors,
    RunZeros,
    with_reading_errors,
    with_run_zeros,
)
from fingerlab.diagnosis.signals.scales import (
    Scales,
    as_recorded,
    fastest_speed,
    find_scales,
    reduced_sessions,
)
from fingerlab.diagnosis.signals.segments import is_fragmented, is_read_at_once, segments_of, with_drive_sign
from fingerlab.diagnosis.signals.tip_travel import knocks_at_landing, tips_stick
from fingerlab.physics.motion import Motion
from fingerlab.rig.file import UNCHANGED, Intervention, Rig, intervention_of
from fingerlab.sessions.model import Run, Session


class Recordings:
    """The runs of some sessions that are analysed, in reduced units.

    Attributes:
        on_bench: whether they are of a motor alone.
        run_zeros: that angles were found to have in single runs, in reduced units; taken off wherever read.
        disagreeing: runs that no model of the others explains, which are left aside.
    """

    def __init__(self, sessions: Sequence[Session], scales: Scales | None = None) -> None:
        """``scales``: those to use; None: the machine's own.

        Raises:
            UserError: there is nothing to analyse.
        """
        self._given, self._scales = tuple(sessions), scales
        self.on_bench = runs_to_analyse(sessions)[1]
        self._reading_errors: ReadingErrors = {}
        self.run_zeros: RunZeros = {}
        self.disagreeing: frozenset[RunKey] = frozenset()

    @cached_property
    def scales(self) -> Scales:
        """The machine's scales; all that comes out of here is in their reduced units."""
        return self._scales or find_scales(self._given)

    @cached_property
    def sessions(self) -> tuple[Session, ...]:
        """The sessions in reduced units."""
        corrected = with_reading_errors(self._as_read, self.reading_errors)
        return with_run_zeros(with_run_zeros(corrected, self.seen_zeros), self.run_zeros)

    @cached_property
    def _as_read(self) -> tuple[Session, ...]:
        return with_interventions(reduced_sessions(self._given, self.scales))

    @cached_property
    def zero_in_the_air(self) -> float | None:
        """What the load cell reads where nothing touches it, in reduced units; None: no run tells."""
        return zero_in_the_air([run for session in self._as_read for run in session.runs])

    @cached_property
    def zeros_in_the_air(self) -> SeenZeros | None:
        """How far the load cell's zeros are apart in the air; None: no runs tell, or none has to be told."""
        runs = [run for session in self._as_read for run in session.runs]
        if sum(run.phase == "contact" for run in runs) == len(self.seen_zeros):
            return None
        return zeros_in_the_air(runs)

    @cached_property
    def seen_zeros(self) -> RunZeros:
        """The load cell's zero in each run in contact that shows it, beside what is taken off all runs."""
        return zeros_while_clear(self._as_read, self.reading_errors)

    @property
    def reading_errors(self) -> ReadingErrors:
        """What was found of the channels' readings, in reduced units; taken off wherever runs are read."""
        zero = self.zero_in_the_air
        return ({FORCE: ReadingError(zero)} if zero else {}) | dict(self._reading_errors)

    @cached_property
    def pairs(self) -> list[tuple[Session, Run]]:
        """The runs that are analysed, in reduced units, each with its session."""
        if not self.on_bench:
            return self._usable
        result, looked_at = [], self._looked_at
        for _, each in groupby(enumerate(self._usable), lambda pair: pair[1][0].path):
            numbers, pairs = zip(*each, strict=True)
            motions = [looked_at[number] for number in numbers if number in looked_at]
            runs = with_drive_sign([run for _, run in pairs], motions)
            result += [(session, run) for (session, _), run in zip(pairs, runs, strict=True)]
        return result

    @cached_property
    def odd_runs(self) -> dict[RunKey, OddRun]:
        """Runs that contradict the others of their kind by a channel or a label, which are left aside."""
        return odd_runs((session, run) for session in self._given for run in session.runs)

    @cached_property
    def _usable(self) -> list[tuple[Session, Run]]:
        every = usable(runs_to_analyse(self.sessions)[0], lambda run: not is_fragmented(run))
        aside = self.odd_runs.keys() | self.disagreeing
        return [pair for pair in every if (str(pair[0].path), pair[1].name) not in aside]

    @cached_property
    def _looked_at(self) -> dict[int, Motion]:
        """The first stretch of some runs, evenly among all, by their numbers."""
        return {number: stretches[0] for number, (stretches, _) in self._stretches.items()}

    @cached_property
    def _stretches(self) -> dict[int, tuple[Sequence[Motion], bool]]:
        """What was read of these: all stretches of a run that is read at once, or the first; whether all."""
        step = -(-len(self._usable) // MOST_LOOKED_AT)
        found: dict[int, tuple[Sequence[Motion], bool]] = {}
        for number, (session, run) in list(enumerate(self._usable))[::step]:
            whole = is_read_at_once(run)
            found[number] = list(islice(segments_of(run, session.rig), None if whole else 1)), whole
        return found

    @property
    def _read(self) -> dict[int, Sequence[Motion]]:
        """All stretches of the runs that were looked at, where these are all, and as they were.

        A motor alone is told the sense of its torque after it was looked at.
        """
        looked = {} if self.on_bench else vars(self).get("_stretches", {})
        # What a motion remembers is many times its size: each pass forms it anew.
        return {
            number: [replace(one, _memory={}) for one in stretches]
            for number, (stretches, whole) in looked.items()
            if whole
        }

    @property
    def fragmented_runs(self) -> list[str]:
        """Names of the runs that are left aside because gaps leave no stretch of them that is long enough."""
        kept = set(self.runs) | self.odd_runs.keys() | self.disagreeing
        every = runs_to_analyse(self.sessions)[0]
        return [run.name for session, run in every if (str(session.path), run.name) not in kept]

    def examples(self) -> list[Motion]:
        """The first stretch of one run of every kind (phase and cable), in reduced units.

        Raises:
            UserError: a run cannot be read.
        """
        kinds = {(run.phase, run.cable): (session, run) for session, run in reversed(self.pairs)}
        return [next(segments_of(run, session.rig)) for session, run in reversed(kinds.values())]

    def is_of(self, sessions: Sequence[Session]) -> bool:
        """Whether it was made of these very sessions."""
        return len(sessions) == len(self._given) and all(map(operator.is_, self._given, sessions))

    @property
    def rig(self) -> Rig:
        """The first session's rig, in SI."""
        return self._given[0].rig

    @property
    def excluded_runs(self) -> list[tuple[str, tuple[str, ...]]]:
        """Runs that are not analysed because channels were lost, with these."""
        kept = set(self.runs)
        every = [
            (str(s.path), r) for s in self._given for r in s.runs if r.cable_sign or r.phase == "motor_bench"
        ]
        lost = [(run.name, missing_channels(run)) for path, run in every if (path, run.name) not in kept]
        return [(name, channels) for name, channels in lost if channels]

    @property
    def analysed(self) -> list[Run]:
        """The runs that are analysed, in reduced units."""
        return [run for _, run in self.pairs]

    @property
    def runs(self) -> list[tuple[str, str]]:
        """Session and name of each run that is analysed."""
        return [(str(session.path), run.name) for session, run in self.pairs]

    @property
    def changes(self) -> list[Intervention]:
        """The known change of the machine in every run, SI."""
        each = (as_recorded(run) for _, run in self.pairs)
        return [intervention_of(run.attributes, run.name) or UNCHANGED for run in each]

    @property
    def motions(self) -> list[int | None]:
        """For each run a number that runs told just the same motion share; None: nothing tells it."""
        return repeated_motions([run for _, run in self.pairs])

    @cached_property
    def _speed(self) -> float:
        """Of the fastest run, rad/s."""
        return fastest_speed([run for _, run in self.pairs])

    @cached_property
    def _tip_sticks(self) -> bool:
        """Whether no run in contact shows a tip that slides."""
        return tips_stick(self.pairs)

    @cached_property
    def _knocks(self) -> bool:
        """Whether a tip that lands knocks on the load cell in any run."""
        return any(knocks_at_landing(run) for _, run in self.pairs)

    def correct_readings(self, errors: ReadingErrors) -> bool:
        """Take these errors off the channels' readings, and what the load cell reads in the air.

        Returns:
            Whether they are others than before: then the runs are read anew when they are asked for.
        """
        before = self.reading_errors
        self._reading_errors = {name: error for name, error in errors.items() if error != NO_ERROR}
        changed = self.reading_errors != before
        if changed:
            self._read_anew()
        return changed

    def correct_runs(self, zeros: RunZeros) -> bool:
        """Take these zeros off the angles of single runs; whether they are others than before."""
        changed = zeros != self.run_zeros
        if changed:
            self.run_zeros = dict(zeros)
            self._read_anew()
        return changed

    def leave_aside(self, runs: frozenset[RunKey]) -> bool:
        """Leave these runs aside, and no others; whether they are others than before."""
        changed = runs != self.disagreeing
        if changed:
            self.disagreeing = runs
            self._read_anew()
        return changed

    def _read_anew(self) -> None:
        of_bench, read = ("seen_zeros", "zeros_in_the_air"), ("_usable", "_looked_at", "_stretches")
        for name in ("sessions", "pairs", *of_bench, *read):
            vars(self).pop(name, None)
