"""Where a model fails: the residual over phase, speed, angle and time; its loops and its recurrence.

What is missing from a model shows in the place where it fails: friction at a speed, a spring at an angle, a
wrong sensor in one run alone.

A loop that is wide where the model's is thin is a loss that the model lacks; a residual that resembles itself
some time later, or that stands out of its spectrum at some frequency, is no noise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.diagnosis.answer.error_parts import Comparison
from fingerlab.diagnosis.settings import (
    BINS,
    CLOSE_ENOUGH,
    LEAST_SAMPLES,
    LONGEST_LAG_S,
    MOST_SAMPLES,
    NARROW_CUTOFF_HZ,
    NARROW_RATE_HZ,
    OUTLYING,
    PHASE_BINS,
    SHORTEST_S,
    SURE,
    Z90,
)
from fingerlab.sessions.model import Array, IntArray, Run
from fingerlab.signals.prepare import LEAST_FOR_SPECTRUM, amplitude_density


@dataclass(frozen=True)
class Coordinate:
    """What a residual can be drawn against.

    Attributes:
        id, title: name in the code, and for people.
        unit: SI. sources: names in ``Comparison.coordinates``, the first that is there; ``{}`` is the joint.
    """

    id: str
    title: str
    unit: str
    sources: tuple[str, ...] = ()


COORDINATES = {
    one.id: one
    for one in (
        Coordinate("phase", "Phase of the stroke", "rad"),
        Coordinate("speed", "Joint speed", "rad/s", ("joint speed {}",)),
        Coordinate("angle", "Joint angle", "rad", ("joint angle {}",)),
        Coordinate("tension", "Cable tension", "N", ("tension",)),
        Coordinate("motor_angle", "Motor angle", "rad", ("motor angle",)),
        Coordinate("motor_speed", "Motor speed", "rad/s", ("motor speed",)),
        Coordinate("position", "Position", "m", ("position",)),
        Coordinate("axis_speed", "Speed", "m/s", ("speed",)),
        Coordinate("time", "Time in the run", "s", ("time",)),
        Coordinate("run", "Run", ""),
    )
}
JOINTS = {"mcp_torque": "mcp", "endpoint_force_mcp": "mcp"}
"""Joint whose speed and angle count for an equation; the PIP joint's for the others."""


@dataclass(frozen=True)
class Profile:
    """The residual of one equation over one coordinate. Arrays have the shape (bins,); NaN: too few samples.

    Attributes:
        edges: shape (bins + 1,), in the coordinate's unit; 0, 1, 2 ... where bins are runs.
        runs: (session, run, phase) of each bin where bins are runs, else empty.
        mean, half: mean residual and half of its 90 % interval; rms: root mean square; in ``unit``.
        floor: repeatability of the bench, in ``unit``.
        worst: the bin with the largest root mean square.
    """

    equation: str
    coordinate: Coordinate
    unit: str
    floor: float
    edges: Array
    runs: tuple[tuple[str, str, str], ...]
    mean: Array
    half: Array
    rms: Array
    worst: int

    @property
    def centres(self) -> Array:
        """Middles of the bins."""
        return np.asarray(0.5 * (self.edges[1:] + self.edges[:-1]))


def profile(comparisons: Sequence[Comparison], equation: str, coordinate: str) -> Profile | None:
    """The residual of an equation over all runs, in bins of a coordinate.

    The interval counts only as many samples as are independent, behind the low-pass.

    Args:
        comparisons: of a diagnosis, all equations. coordinate: id in :data:`COORDINATES`.

    Returns:
        None where the runs do not tell the coordinate (a bench has no joint) or never vary it.
    """
    from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE

    chosen = COORDINATES[coordinate]
    placed = [
        (one, place) for one in comparisons
        if one.equation == equation and (place := _place(one, chosen, comparisons)) is not None
    ]  # fmt: skip
    if not placed:
        return None
    residual = np.concatenate([_missed(one) for one, _ in placed])
    place = np.concatenate([place for _, place in placed])
    known = np.isfinite(residual) & np.isfinite(place)
    residual, place = residual[known], place[known]
    runs = _runs(comparisons) if coordinate == "run" else ()
    edges = _edges(place, chosen, len(runs))
    if edges is None or not len(residual):
        return None
    count = len(edges) - 1
    number = _numbers(place, edges)
    many = np.bincount(number, minlength=count).astype(float)
    many[many < LEAST_SAMPLES] = np.nan
    if not np.isfinite(many).any():
        return None
    mean = np.bincount(number, residual, count) / many
    square = np.bincount(number, residual**2, count) / many
    spread = np.sqrt(np.maximum(square - mean**2, 0.0))
    rms = np.sqrt(square)
    return Profile(
        equation, chosen, placed[0][0].unit,
        float(np.average([one.floor for one, _ in placed], weights=[len(one.time) for one, _ in placed])),
        edges, runs, mean, Z90 * spread / np.sqrt(np.maximum(many * EFFECTIVE_SHARE, 1.0)), rms,
        int(np.nanargmax(rms)),
    )  # fmt: skip


def stretches_in(found: Profile, bin_: int, comparison: Comparison) -> list[tuple[float, float]]:
    """When a run was in a bin: starts and ends, s. All of it, or nothing, where bins are runs."""
    time = comparison.time
    if found.runs:
        here = (comparison.session, comparison.run) == found.runs[bin_][:2]
        return [(float(time[0]), float(time[-1]))] if here and len(time) else []
    place = _place(comparison, found.coordinate, (comparison,))
    if place is None or len(time) < 2:
        return []
    inside = np.isfinite(place) & np.isfinite(_missed(comparison))
    inside &= _numbers(np.nan_to_num(place), found.edges) == bin_
    change = np.flatnonzero(np.diff(np.concatenate(([False], inside, [False])).astype(np.int8)))
    half = 0.5 * float(np.median(np.diff(time)))
    joined: list[tuple[float, float]] = []
    for start, stop in zip(change[::2], change[1::2], strict=True):
        begin, end = float(time[start]) - half, float(time[stop - 1]) + half
        if joined and begin - joined[-1][1] < SHORTEST_S:
            begin = joined.pop()[0]
        joined.append((begin, end))
    return joined


def worst_run(found: Profile, bin_: int, comparisons: Sequence[Comparison]) -> Comparison | None:
    """The comparison of the profile's equation that misses most within a bin; None where none was in it."""
    best: tuple[float, Comparison] | None = None
    for one in comparisons:
        if one.equation != found.equation:
            continue
        square = np.square(one.measured - one.modelled)
        inside = np.zeros(len(one.time), dtype=bool)
        for start, stop in stretches_in(found, bin_, one):
            inside |= (one.time >= start) & (one.time <= stop)
        inside &= np.isfinite(square)
        if inside.sum() >= LEAST_SAMPLES and (best is None or float(square[inside].mean()) > best[0]):
            best = float(square[inside].mean()), one
    return best[1] if best is not None else None


def _missed(one: Comparison) -> Array:
    """The residual; NaN where the finger stands still and the model, which sticks there, says nothing."""
    residual = np.array(one.measured - one.modelled)
    for aside in one.aside:
        if aside.reason == "standstill":
            residual[(one.time >= aside.start) & (one.time <= aside.stop)] = np.nan
    return residual


def _numbers(place: Array, edges: Array) -> IntArray:
    """The bin of each sample; what lies beyond the edges belongs to the outermost ones."""
    return np.clip(np.digitize(place, edges) - 1, 0, len(edges) - 2)


def _runs(comparisons: Sequence[Comparison]) -> tuple[tuple[str, str, str], ...]:
    return tuple(dict.fromkeys((one.session, one.run, one.phase) for one in comparisons))


def _place(one: Comparison, chosen: Coordinate, everything: Sequence[Comparison]) -> Array | None:
    """The coordinate at the comparison's times."""
    if chosen.id == "run":
        return np.full(len(one.time), float(_runs(everything).index((one.session, one.run, one.phase))))
    if chosen.id == "time":
        return one.time
    if chosen.id == "phase":
        return _phase(one)
    joint = JOINTS.get(one.equation, "pip")
    names = [source.format(joint) for source in chosen.sources]
    return next((one.coordinates[name] for name in names if name in one.coordinates), None)


def _phase(one: Comparison) -> Array | None:
    """Where in its stroke the motor is, rad, 0 to 2 pi; of a sine the sine's own phase.

    From position and speed, each over its range, so that no command needs to be known: 0 in the middle of the
    way forth, pi/2 at the far end, pi in the middle of the way back.
    """
    position, speed = (_of_motor(one, name) for name in ("angle", "speed"))
    if position is None or speed is None:
        return None
    low, high = np.quantile(position, (OUTLYING, 1 - OUTLYING))
    fastest = float(np.quantile(np.abs(speed), 1 - OUTLYING))
    if not (high > low and fastest > 0):
        return None
    across = (position - 0.5 * (low + high)) / (0.5 * (high - low))
    return np.asarray(np.mod(np.arctan2(across, speed / fastest), 2 * np.pi))


def _of_motor(one: Comparison, quantity: str) -> Array | None:
    """The motor's "angle", "speed" or "acceleration"; of an axis along a line its own, SI."""
    along = one.coordinates.get("position" if quantity == "angle" else quantity)
    return one.coordinates.get(f"motor {quantity}", along)


def _edges(place: Array, chosen: Coordinate, runs: int) -> Array | None:
    if chosen.id == "run":
        return np.arange(runs + 1, dtype=float) - 0.5 if runs > 1 else None
    if chosen.id == "phase":
        return np.linspace(0.0, 2 * np.pi, PHASE_BINS + 1)
    if not len(place):
        return None
    low, high = np.quantile(place, (OUTLYING, 1 - OUTLYING))
    return np.linspace(low, high, BINS + 1) if high > low else None


def most_orderly(profiles: Mapping[str, Profile]) -> str:
    """The coordinate whose bins' means explain the largest share of the residual."""

    def order(found: Profile) -> float:
        known = np.isfinite(found.rms)
        return float(np.sum(found.mean[known] ** 2) / max(float(np.sum(found.rms[known] ** 2)), 1e-300))

    return max(profiles, key=lambda name: order(profiles[name]), default="")


@dataclass(frozen=True)
class ResidualFigure:
    """Curves of one run over one another.

    Attributes:
        title: what it is. across, up: words and SI unit of the axes. curves: x and y, (n,) each, by name.
        chance: half the height of what noise alone would leave, in the unit of ``up``; 0: not told.
    """

    title: str
    across: tuple[str, str]
    up: tuple[str, str]
    curves: Mapping[str, tuple[Array, Array]]
    chance: float = 0.0


def _over(comparison: Comparison, source: str, words: tuple[str, str], title: str) -> ResidualFigure | None:
    place = comparison.coordinates.get(source)
    if place is None:
        return None
    up = ("Measured and modelled", comparison.unit)
    place = _finer(place)
    curves = {
        "measured": (place, _finer(comparison.measured)),
        "modelled": (place, _finer(comparison.modelled)),
    }
    return ResidualFigure(title, words, up, curves)


FINER = 6
"""Points of a loop for each sample: the samples are those of a low-passed signal, which is smooth between."""


def _finer(values: Array) -> Array:
    """A curve through samples, (n,) to (FINER (n - 1) + 1,), by cubics of Hermite; NaN in a gap."""
    if len(values) < 2:
        return values
    left, right = np.append(np.nan, np.diff(values)), np.append(np.diff(values), np.nan)
    slope = np.where(np.isnan(left), right, np.where(np.isnan(right), left, 0.5 * (left + right)))
    slope = np.nan_to_num(slope)  # a sample alone between gaps
    share = np.arange(FINER)[:, np.newaxis] / FINER
    rest = 1.0 - share
    first = rest**2 * ((1.0 + 2.0 * share) * values[:-1] + share * slope[:-1])
    second = share**2 * ((1.0 + 2.0 * rest) * values[1:] - rest * slope[1:])
    result = np.append((first + second).T.ravel(), np.nan)
    result[::FINER] = values
    return np.asarray(result)


def angle_loop(comparison: Comparison) -> ResidualFigure | None:
    """Measured and modelled over the joint's angle, the motor's or a position; None where none is known."""
    joint = JOINTS.get(comparison.equation, "pip")
    found = _over(
        comparison, f"joint angle {joint}", (f"{joint.upper()} angle", "rad"), "Loop over the angle"
    )
    found = found or _over(comparison, "position", ("Position", "m"), "Loop over the position")
    return found or _over(comparison, "motor angle", ("Motor angle", "rad"), "Loop over the angle")


def tension_loop(comparison: Comparison) -> ResidualFigure | None:
    """Measured and modelled over the cable's tension; None where there is no finger at the cable's end.

    Of a motor alone the tension is its torque over the radius: what is measured, drawn over itself.
    """
    if not any(name.startswith("joint") for name in comparison.coordinates):
        return None
    return _over(comparison, "tension", ("Cable tension", "N"), "Loop over the tension")


def autocorrelation(comparison: Comparison) -> ResidualFigure | None:
    """How alike the residual is to itself some time later, 1 at once; None where too little is told."""
    time, residual = _longest(comparison)
    if len(residual) < LEAST_FOR_SPECTRUM:
        return None
    from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE

    step = float(np.median(np.diff(time)))
    residual = residual - residual.mean()
    power = np.abs(np.fft.rfft(residual, 2 * len(residual))) ** 2
    alike = np.fft.irfft(power)[: min(int(LONGEST_LAG_S / step) + 1, len(residual) // 2)]
    if not alike[0] > 0:
        return None
    lag = step * np.arange(len(alike))
    chance = SURE / float(np.sqrt(EFFECTIVE_SHARE * len(residual)))
    correlation: Array = np.asarray(alike / alike[0], dtype=float)
    curve: dict[str, tuple[Array, Array]] = {"residual": (np.asarray(lag, dtype=float), correlation)}
    return ResidualFigure(
        "Autocorrelation of the residual", ("Later by", "s"), ("Correlation", "1"), curve, chance
    )


def spectrum(comparison: Comparison) -> ResidualFigure | None:
    """Amplitude density of the residual up to the low-pass, beside a white floor; None: it is too short."""
    time, residual = _longest(comparison)
    rate = _rate_hz(time)
    found = amplitude_density(residual, rate) if len(time) > 1 else None
    if found is None:
        return None
    cutoff = rate * NARROW_CUTOFF_HZ / NARROW_RATE_HZ  # of the machine's own pace
    frequency, amplitude = (values[found[0] <= cutoff] for values in found)
    floor: Array = np.full(len(frequency), comparison.floor / np.sqrt(cutoff))
    curves: dict[str, tuple[Array, Array]] = {
        "residual": (frequency, amplitude),
        "floor": (frequency, floor),
    }
    up = ("Amplitude density", f"{comparison.unit}/√Hz")
    return ResidualFigure("Spectrum of the residual", ("Frequency", "Hz"), up, curves)


RESIDUAL_FIGURES: Mapping[str, Callable[[Comparison], ResidualFigure | None]] = {
    "angle_loop": angle_loop,
    "tension_loop": tension_loop,
    "autocorrelation": autocorrelation,
    "spectrum": spectrum,
}


def _rate_hz(time: Array) -> float:
    """Samples a second of the times (s) of a comparison; 0 of fewer than two."""
    return 1.0 / float(np.median(np.diff(time))) if len(time) > 1 else 0.0


def _longest(comparison: Comparison) -> tuple[Array, Array]:
    """Time and residual of the longest stretch that is told without a break."""
    residual = comparison.measured - comparison.modelled
    known = np.flatnonzero(np.isfinite(residual))
    parts = np.split(known, np.flatnonzero(np.diff(known) > 1) + 1)
    longest = max(parts, key=len)
    return comparison.time[longest], residual[longest]


FULL_RATE_CHANNELS = {
    "mcp_torque": "motor_torque", "pip_torque": "motor_torque", "motor_torque": "motor_torque",
    "motor_force": "motor_torque", "cable_kinematics": "motor_position",
    "endpoint_force_pip": "endpoint_force", "endpoint_force_mcp": "endpoint_force",
}  # fmt: skip
"""Channel behind the measured side of each equation."""


def full_rate(comparison: Comparison, run: Run) -> tuple[Array, Array] | None:
    """Time, s, and the measured side as it was recorded, (n,) each; None where one channel does not tell it.

    The channel times what makes it the filtered side (an arm, a radius, a gain), found from both; of a torque
    the rotor's inertia is taken off as it was filtered.
    """
    channel = FULL_RATE_CHANNELS.get(comparison.equation, "")
    if not run.has(channel) or run.length > MOST_SAMPLES:
        return None
    samples = run.load(["time", channel])
    time, raw = samples["time"] - samples["time"][0], samples[channel]
    width = max(int(run.sample_rate_hz / (_rate_hz(comparison.time) or NARROW_RATE_HZ)), 1)
    smooth = np.convolve(raw, np.full(width, 1.0 / width), mode="same")  # its noise would shrink the factor
    inertial = _of_motor(comparison, "acceleration")
    if inertial is None or channel != "motor_torque":
        inertial = np.zeros(len(comparison.time))
    near = np.interp(comparison.time, time, smooth)
    known = np.isfinite(comparison.measured) & np.isfinite(inertial) & np.isfinite(near)
    measured = comparison.measured[known]
    if len(measured) < LEAST_FOR_SPECTRUM or not np.std(measured) > 0:
        return None
    sides = np.stack((near[known], inertial[known]), axis=1)
    (factor, inertia), *_ = np.linalg.lstsq(sides, measured, rcond=None)
    missed = measured - sides @ (factor, inertia)
    if float(np.var(missed)) > (1.0 - CLOSE_ENOUGH) * float(np.var(measured)):
        return None
    slow = np.interp(time, comparison.time[known], inertia * inertial[known])
    return time, np.asarray(factor * raw + slow)
