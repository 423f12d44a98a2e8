"""Pictures of one run beside "where": loops over angle or tension, and how the residual is like itself.

A loop that is wide where the model's is thin is a loss that the model lacks; a residual that resembles itself
some time later, or that stands out of its spectrum at some frequency, is no noise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fingerlab.diagnosis.answer.results import Comparison
from fingerlab.diagnosis.answer.where import JOINTS
from fingerlab.diagnosis.settings import NARROW_CUTOFF_HZ, NARROW_RATE_HZ
from fingerlab.sessions.model import Array, Run
from fingerlab.signals.prepare import LEAST_FOR_SPECTRUM, amplitude_density

LONGEST_LAG_S = 4.0
"""Of the autocorrelation: four periods of the thesis' usual motion."""
SURE = 1.96
"""Standard deviations of a 95 % interval."""


@dataclass(frozen=True)
class Shape:
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


def _over(comparison: Comparison, source: str, words: tuple[str, str], title: str) -> Shape | None:
    place = comparison.coordinates.get(source)
    if place is None:
        return None
    up = ("Measured and modelled", comparison.unit)
    curves = {"measured": (place, comparison.measured), "modelled": (place, comparison.modelled)}
    return Shape(title, words, up, curves)


def angle_loop(comparison: Comparison) -> Shape | None:
    """Measured and modelled over the joint's angle, or the motor's; None where neither is known."""
    joint = JOINTS.get(comparison.equation, "pip")
    found = _over(
        comparison, f"joint angle {joint}", (f"{joint.upper()} angle", "rad"), "Loop over the angle"
    )
    return found or _over(comparison, "motor angle", ("Motor angle", "rad"), "Loop over the angle")


def tension_loop(comparison: Comparison) -> Shape | None:
    """Measured and modelled over the cable's tension; None where there is no cable."""
    return _over(comparison, "tension", ("Cable tension", "N"), "Loop over the tension")


def autocorrelation(comparison: Comparison) -> Shape | None:
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
    return Shape("Autocorrelation of the residual", ("Later by", "s"), ("Correlation", "1"), curve, chance)


def spectrum(comparison: Comparison) -> Shape | None:
    """Amplitude density of the residual up to the low-pass, beside a white floor; None: it is too short."""
    time, residual = _longest(comparison)
    found = amplitude_density(residual, 1.0 / float(np.median(np.diff(time)))) if len(time) > 1 else None
    if found is None:
        return None
    frequency, amplitude = (values[found[0] <= NARROW_CUTOFF_HZ] for values in found)
    floor: Array = np.full(len(frequency), comparison.floor / np.sqrt(NARROW_CUTOFF_HZ))
    curves: dict[str, tuple[Array, Array]] = {
        "residual": (frequency, amplitude),
        "floor": (frequency, floor),
    }
    up = ("Amplitude density", f"{comparison.unit}/√Hz")
    return Shape("Spectrum of the residual", ("Frequency", "Hz"), up, curves)


SHAPES: Mapping[str, Callable[[Comparison], Shape | None]] = {
    "angle_loop": angle_loop,
    "tension_loop": tension_loop,
    "autocorrelation": autocorrelation,
    "spectrum": spectrum,
}


def _longest(comparison: Comparison) -> tuple[Array, Array]:
    """Time and residual of the longest stretch that is told without a break."""
    residual = comparison.measured - comparison.modelled
    known = np.flatnonzero(np.isfinite(residual))
    parts = np.split(known, np.flatnonzero(np.diff(known) > 1) + 1)
    longest = max(parts, key=len)
    return comparison.time[longest], residual[longest]


FULL_RATE_CHANNELS = {
    "mcp_torque": "motor_torque", "pip_torque": "motor_torque", "motor_torque": "motor_torque",
    "cable_kinematics": "motor_position", "endpoint_force_pip": "endpoint_force",
    "endpoint_force_mcp": "endpoint_force",
}  # fmt: skip
"""Channel behind the measured side of each equation."""
MOST_SAMPLES = 3_000_000
"""Of a run that is read at its full rate: an hour of it is told no better by more points than pixels."""
CLOSE_ENOUGH = 0.9
"""Share of the filtered side that the channel has to tell, else it is not what is measured (assumed)."""


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
    width = max(int(run.sample_rate_hz / NARROW_RATE_HZ), 1)
    smooth = np.convolve(raw, np.full(width, 1.0 / width), mode="same")  # its noise would shrink the factor
    inertial = comparison.coordinates.get("motor acceleration", np.zeros(len(comparison.time)))
    if channel != "motor_torque":
        inertial = np.zeros(len(comparison.time))
    near = np.interp(comparison.time, time, smooth)
    known = np.isfinite(comparison.measured) & np.isfinite(inertial) & np.isfinite(near)
    told = comparison.measured[known]
    if len(told) < LEAST_FOR_SPECTRUM or not np.std(told) > 0:
        return None
    sides = np.stack((near[known], inertial[known]), axis=1)
    (factor, inertia), *_ = np.linalg.lstsq(sides, told, rcond=None)
    missed = told - sides @ (factor, inertia)
    if float(np.var(missed)) > (1.0 - CLOSE_ENOUGH) * float(np.var(told)):
        return None
    slow = np.interp(time, comparison.time[known], inertia * inertial[known])
    return time, np.asarray(factor * raw + slow)
