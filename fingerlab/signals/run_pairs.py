"""Two benches, or two days, run by run: the same motion on both, laid over one another in phase.

A periodic run is folded into cycles; its phase begins where the fundamental of the motor's position rises
through its mean, so that neither the moment at which recording began nor a delay of the whole bench counts.
Other motions are laid over one another in time, by the shift at which the motor's positions fit best. A
difference is weighed against what one cycle differs by from another of the same run.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.progress import SILENT, Watch
from fingerlab.sessions.model import CHANNEL_UNITS, Array, Run, Session
from fingerlab.sessions.trajectory import commanded_frequency
from fingerlab.signals.periods import period_grid, settles, usable

POINTS = 200
"""Of a cycle."""
RATE_HZ = 100.0
"""At which other motions are compared."""
EXACT = 1e-6
"""Share of a channel's own spread below which cycles are no measurements (assumed)."""
MOST_SHIFT_S = 2.0
"""Within which the start of one may lie off that of the other (assumed)."""
COMPARED = tuple(name for name in CHANNEL_UNITS if name not in ("time", "motor_command", "motor_current"))


@dataclass(frozen=True)
class ChannelPair:
    """One channel in two runs of one motion, SI.

    Attributes:
        first, second: mean cycle, or course, (m,).
        scatter: deviation of one cycle from the others of its run, (m,); NaN where no cycle repeats.
        offset: mean of the second less the first. rms: root mean square of the rest of their difference.
        usual: root mean square of the scatter; NaN: not told.
        largest_at: where the difference is largest, on the axis of :class:`RunPair`.
    """

    first: Array
    second: Array
    scatter: Array
    offset: float
    rms: float
    usual: float
    largest_at: float

    @property
    def times(self) -> float:
        """How many times the usual scatter the difference is, offset and all; NaN: not told."""
        whole = float(np.hypot(self.offset, self.rms))
        return whole / self.usual if self.usual > 0 else float("nan")


@dataclass(frozen=True)
class RunPair:
    """Two runs of one motion.

    Attributes:
        axis: phase, 0 to 1 of a cycle, or time, s, (m,). periodic: which of the two.
        channels: those that both have. cycles: of either run; 0 where it is not periodic.
        lag: by which the second was shifted to lie over the first, s; of a periodic run within half a cycle.
    """

    first: Run
    second: Run
    axis: Array
    periodic: bool
    cycles: tuple[int, int]
    lag: float
    channels: Mapping[str, ChannelPair] = field(default_factory=dict)


def paired(a: Session, b: Session) -> tuple[list[tuple[Run, Run]], list[Run], list[Run]]:
    """Runs of one motion on either, in the order taken; and what has no partner in the first, in the second.

    First those that were told just the same; then those of one phase, cable, kind and frequency.
    """
    keys: tuple[Callable[[Run], Hashable], ...] = (_exactly, _nearly)
    left, right, pairs = list(a.runs), list(b.runs), list[tuple[Run, Run]]()
    for key in keys:
        for run in list(left):
            other = next((one for one in right if key(one) == key(run)), None)
            if other is not None:
                pairs.append((run, other))
                left.remove(run)
                right.remove(other)
    order = {run.name: number for number, run in enumerate(a.runs)}
    return sorted(pairs, key=lambda pair: order[pair[0].name]), left, right


def _nearly(run: Run) -> Hashable:
    trajectory = run.trajectory
    return run.phase, run.cable, str(trajectory.get("kind")), str(trajectory.get("frequency_hz"))


def _exactly(run: Run) -> Hashable:
    return run.phase, run.cable, repr(sorted((key, repr(value)) for key, value in run.trajectory.items()))


@dataclass(frozen=True)
class SessionPair:
    """Two sessions run by run.

    Attributes:
        pairs: runs of one motion. only_first, only_second: runs without a partner.
        refused: why some pairs could not be compared, a sentence each.
    """

    first: Session
    second: Session
    pairs: tuple[RunPair, ...]
    only_first: tuple[Run, ...]
    only_second: tuple[Run, ...]
    refused: tuple[str, ...]


def compare_sessions(a: Session, b: Session, watch: Watch = SILENT) -> SessionPair:
    """Every run of one session beside the run of the same motion of another.

    Raises:
        UserError: no motion is in both, or their axes are told of other arcs. Cancelled: the user asked
            for it.
    """
    if a.rig.line_radius != b.rig.line_radius:
        raise UserError(
            f"{a.path.name} is {_axis_words(a)} and {b.path.name} {_axis_words(b)}; compare sessions of one "
            "kind of axis, imported with the same --radius."
        )
    pairs, left, right = paired(a, b)
    if not pairs:
        raise UserError(
            f"{a.path.name} and {b.path.name} have no motion in common; compare sessions with runs of the "
            "same phase, cable, kind and frequency."
        )
    found, refused = [], []
    for number, (one, two) in enumerate(pairs):
        watch.tell(number / len(pairs), f"comparing run {one.name}")
        try:
            found.append(compare_runs(one, two))
        except UserError as error:
            refused.append(str(error))
    return SessionPair(a, b, tuple(found), tuple(left), tuple(right), tuple(refused))


def _axis_words(session: Session) -> str:
    radius = session.rig.line_radius
    return f"of a linear axis kept as an arc of {1e3 * radius:g} mm" if radius else "of an axis that turns"


def compare_runs(first: Run, second: Run) -> RunPair:
    """Lay two runs of one motion over one another.

    Raises:
        UserError: they are too short, or a file can no longer be read.
    """
    names = [name for name in COMPARED if first.has(name) and second.has(name)]
    a, b = first.load(names), second.load(names)
    # A force that was never read stands there as NaN.
    names = [name for name in names if np.isfinite(a[name]).all() and np.isfinite(b[name]).all()]
    folded = _folded(first, a, names), _folded(second, b, names)
    if folded[0] is not None and folded[1] is not None:
        (one, start, period), (two, other, _) = folded[0], folded[1]
        lag = (other - start + 0.5) % 1.0 - 0.5
        axis = np.arange(POINTS) / POINTS
        channels = {name: _pair(one[name], two[name], axis) for name in names}
        counts = tuple(len(cycles[names[0]]) for cycles in (one, two))
        return RunPair(first, second, axis, True, (counts[0], counts[1]), lag * period, channels)
    return _in_time(first, second, a, b, names)


def _folded(
    run: Run, samples: Mapping[str, Array], names: Sequence[str]
) -> tuple[dict[str, Array], float, float] | None:
    """Cycles of every channel, (cycles, POINTS); where their phase begins, in cycles; the period, s."""
    frequency = commanded_frequency(run)
    grid = None if frequency is None else period_grid(run.length, run.sample_rate_hz, frequency)
    if frequency is None or grid is None or not settles(samples["motor_position"], grid):
        return None
    fundamental = np.fft.rfft(grid.mean(samples["motor_position"]))[1]
    start = float((-np.angle(fundamental) - 0.5 * np.pi) / (2.0 * np.pi)) % 1.0
    at = (np.arange(POINTS) / POINTS + start) % 1.0 * grid.phases
    cycles = {}
    for name in names:
        rows = grid.fold(samples[name])
        whole = np.concatenate((rows, rows[:, :1]), axis=1)  # the end is the beginning
        places = np.arange(grid.phases + 1)
        cycles[name] = np.stack([np.interp(at, places, row) for row in whole])
    return cycles, start, 1.0 / frequency


def _pair(one: Array, two: Array, axis: Array) -> ChannelPair:
    """Cycles of a channel in both runs, (cycles, m) each."""
    first, second = np.mean(one, axis=0), np.mean(two, axis=0)
    if len(one) > 1 and len(two) > 1:
        scatter = np.sqrt(0.5 * (np.var(one, axis=0, ddof=1) + np.var(two, axis=0, ddof=1)))
    else:
        scatter = np.full(len(axis), np.nan)
    difference = second - first
    offset = float(np.mean(difference))
    rest = difference - offset
    usual = float(np.sqrt(np.mean(scatter**2)))
    if usual <= EXACT * float(np.std(first)):  # no sensor does that: the cycles are copies of one another
        usual = float("nan")
    largest = float(axis[int(np.argmax(np.abs(rest)))])
    return ChannelPair(first, second, scatter, offset, float(np.sqrt(np.mean(rest**2))), usual, largest)


def _in_time(
    first: Run, second: Run, a: Mapping[str, Array], b: Mapping[str, Array], names: Sequence[str]
) -> RunPair:
    """Other motions, in time."""
    one, two = (_slow(run, samples, names) for run, samples in ((first, a), (second, b)))
    shift = _best_shift(one["motor_position"], two["motor_position"])
    start, other = max(-shift, 0), max(shift, 0)
    length = min(len(one[names[0]]) - start, len(two[names[0]]) - other)
    if length < RATE_HZ:
        raise UserError(
            f"Runs {first.name} and {second.name} share less than a second of motion, too little to lay one "
            "over the other; compare longer ones."
        )
    axis = np.arange(length) / RATE_HZ
    channels = {
        name: _pair(one[name][None, start : start + length], two[name][None, other : other + length], axis)
        for name in names
    }
    return RunPair(first, second, axis, False, (0, 0), shift / RATE_HZ, channels)


def _slow(run: Run, samples: Mapping[str, Array], names: Sequence[str]) -> dict[str, Array]:
    """Channels as means over hundredths of a second, without the start and the end of the run."""
    begin, end = usable(run.length, run.sample_rate_hz)
    width = max(round(run.sample_rate_hz / RATE_HZ), 1)
    count = max((end - begin) // width, 0)
    return {
        name: samples[name][begin : begin + count * width].reshape(count, width).mean(axis=1)
        for name in names
    }


def _best_shift(one: Array, two: Array) -> int:
    """Samples by which the second comes later, by the correlation of both."""
    most = int(MOST_SHIFT_S * RATE_HZ)
    length = min(len(one), len(two))
    if length < 2 * most:
        return 0
    a, b = one[:length] - one[:length].mean(), two[:length] - two[:length].mean()
    found = np.fft.irfft(np.fft.rfft(b, 2 * length) * np.conj(np.fft.rfft(a, 2 * length)))
    both = np.concatenate((found[-most:], found[: most + 1]))
    return int(np.argmax(both)) - most
