"""What the motor was told to do: in words, its frequency, and read from the recording where nobody wrote it.

Files of other programs do not say how often a motion comes again; fits, reviews and the diagnosis need to
know.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.polynomial.legendre import legvander

from fingerlab.rig.file import changed_words
from fingerlab.sessions.model import Array, Run

LOOK_RATE_HZ = 100.0
"""Samples a second that are looked at."""
LEAST_CYCLES = 3
"""A motion that came again less often is not called repeated."""
REPEATED = 0.01
"""Share of the variance by which cycles may differ and are still the same; assumed."""
HARMONICS, DRIFT_DEGREE = 8, 3
"""What is fitted to find the cycle's length exactly: that many harmonics, and a polynomial for a drift."""
UNLIKE = 0.25
"""Two moments are another part of the motion once they differ by this share; assumed."""
SETTLE_S = 2.0
"""A command begins with a ramp, 1.5 s on the bench, s; the rest is for others."""
SINE = 1e-3
"""A command that leaves a sine by no larger share of its variance is one; assumed."""
FIGURES = 4
"""Digits that are kept of what was read."""


def named_frequency(run: Run) -> float:
    """Frequency that the trajectory names, Hz; 0 where it names none. A chirp names one, too."""
    value = run.trajectory.get("frequency_hz")
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        return 0.0
    return float(value)


def commanded_frequency(run: Run) -> float | None:
    """Cycles a second of a run that was told a sine, Hz; None: it was not, or does not say."""
    named = named_frequency(run)
    return named if run.trajectory.get("kind") == "sine" and named > 0 else None


def recognised(command: Array, rate: float) -> dict[str, Any] | None:
    """The trajectory of a motor that was told a sine, as in the session format; None where it was not.

    Args:
        command: rad at the pulley, shape (n,), from the start of the run, ``rate`` samples a second.
    """
    settled = command[round(SETTLE_S * rate) :]
    step = max(int(rate / LOOK_RATE_HZ), 1)
    settled = settled[::step]
    if len(settled) < LEAST_CYCLES or not np.isfinite(settled).all():
        return None
    frequency = found_frequency(settled, rate / step)
    if frequency is None:
        return None
    phase = 2 * np.pi * frequency * np.arange(len(settled)) * step / rate
    basis = np.stack((np.ones_like(phase), np.cos(phase), np.sin(phase)), axis=1)
    offset, *wave = np.linalg.lstsq(basis, settled, rcond=None)[0]
    rest = settled - basis @ np.array([offset, *wave])
    if float(np.var(rest)) > SINE * float(np.var(settled)):
        return None
    amplitude, about = np.degrees(np.hypot(*wave)), np.degrees(offset)
    sine = {"frequency_hz": frequency, "amplitude_deg": amplitude, "offset_deg": about}
    return {"kind": "sine", **{name: float(f"{value:.{FIGURES}g}") for name, value in sine.items()}}


def found_frequency(position: Array, rate: float) -> float | None:
    """Cycles a second with which a motion comes again, Hz; None where it does not.

    Args:
        position: of the motor, rad, shape (n,), ``rate`` samples a second.
    """
    moved = position - position.mean()
    lag = _cycle(_unlike(moved, len(moved) // LEAST_CYCLES))
    if lag is None:
        return None
    from scipy.optimize import minimize_scalar  # takes a while to load, and is seldom needed

    usual = rate / lag
    width = 0.5 / lag  # half a sample of the cycle
    found = minimize_scalar(
        lambda f: _left(moved, f / rate), bounds=(usual * (1 - width), usual * (1 + width)), method="bounded",
        options={"xatol": 1e-7 * usual},
    )  # fmt: skip
    return float(found.x)


def _unlike(moved: Array, most: int) -> Array:
    """Mean square difference of a motion from itself a lag later, in variances, for lags up to ``most``."""
    samples = len(moved)
    if most < 1 or not float(np.ptp(moved)) > 0:
        return np.zeros(0)
    size = 1 << int(np.ceil(np.log2(2 * samples)))
    together = np.fft.irfft(np.abs(np.fft.rfft(moved, size)) ** 2, size)[: most + 1]
    energy = np.concatenate(([0.0], np.cumsum(moved**2)))
    lags = np.arange(most + 1)
    both = energy[samples - lags] + energy[samples] - energy[lags]
    return np.asarray((both - 2.0 * together) / (2.0 * (samples - lags) * float(np.var(moved))))


def _cycle(unlike: Array) -> int | None:
    """The first lag, after the motion has been another, at which it is the same again; or None."""
    away = np.flatnonzero(unlike > UNLIKE)
    if not len(away):
        return None
    back = np.flatnonzero(unlike[away[0] :] < REPEATED)
    if not len(back):
        return None
    first = int(away[0] + back[0])
    gone = np.flatnonzero(unlike[first:] >= REPEATED)
    last = first + int(gone[0]) if len(gone) else len(unlike)
    return first + int(np.argmin(unlike[first:last]))


def _left(moved: Array, frequency: float) -> float:
    """What a few harmonics of a frequency (cycles a sample) and a slow drift leave of a motion."""
    steps = np.linspace(-1.0, 1.0, len(moved))
    count = max(1, min(HARMONICS, int(0.5 / frequency) - 1))
    phase = np.pi * frequency * (len(moved) - 1) * np.outer(steps, np.arange(1, count + 1))
    basis = np.hstack((legvander(steps, DRIFT_DEGREE), np.cos(phase), np.sin(phase)))
    rest = moved - basis @ np.linalg.lstsq(basis, moved, rcond=None)[0]
    return float(rest @ rest)


POINTS = ("time_s", "angle_deg", "torque_n_m")
"""Lists of points say nothing in a line; what they span is told."""


def trajectory_words(trajectory: Mapping[str, Any], radius: float = 0.0) -> str:
    """What the motor was told to do, such as ``sine, 15°, 1 Hz, about 22°``.

    Args:
        radius: of the arc as which a linear axis is told, m, for lengths and forces in place of angles and
            torques; 0: it turns.
    """

    def angle(degrees: Any) -> str:
        if radius and isinstance(degrees, int | float):
            return f"{1e3 * radius * np.radians(degrees):.3g} mm"
        return f"{_number(degrees)}°"

    def is_rounding(degrees: Any) -> bool:
        numbers = isinstance(degrees, int | float) and isinstance(amplitude, int | float)
        return numbers and 0 < abs(degrees) < NOTHING * abs(amplitude)

    rest = dict(trajectory)
    kind = str(rest.pop("kind", "unknown"))
    for points in POINTS:
        rest.pop(points, None)
    words = "motion unknown" if kind == "unknown" else kind.replace("_", " ")
    amplitude = rest.pop("amplitude_deg", None)
    if amplitude is not None:
        words += f", {angle(amplitude)}"
    frequency = rest.pop("frequency_hz", None)
    if frequency is not None:
        words += f", {_number(frequency)} Hz"
    offset = rest.pop("offset_deg", None)
    if offset is not None and not is_rounding(offset):
        words += f", about {angle(offset)}"
    middle, half = rest.pop("offset_n_m", None), rest.pop("amplitude_n_m", None)
    if isinstance(middle, int | float) and isinstance(half, int | float):
        unit, factor = ("N", 1.0 / radius) if radius else ("mN m", 1e3)
        words += f", {_number(factor * (middle - half))} to {_number(factor * (middle + half))} {unit}"
    wanted = rest.pop("wanted_force", None)
    if isinstance(wanted, Mapping):
        words += f", for a wanted force ({', '.join(f'{k} {_number(v)}' for k, v in wanted.items())})"
    for key, value in rest.items():
        if key == "until_stopped" and value is True:
            words += ", until stopped"
        elif radius and key.endswith("_deg") and isinstance(value, int | float):
            words += f", {key.removesuffix('_deg').replace('_', ' ')} {angle(value)}"
        else:
            words += f", {_named(key, value)}"
    return words


def motion_of_run(run: Run, radius: float) -> str:
    """What the motor was told to do in a run, and what of the machine was changed for it.

    Args:
        radius: ``Rig.line_radius`` of its session, m; as for :func:`trajectory_words`.
    """
    return ", ".join(filter(None, (trajectory_words(run.trajectory, radius), changed_words(run.attributes))))


NOTHING = 1e-6
"""Share of the amplitude below which what a sine was read to go about is not told."""

UNITS = {"_s": " s", "_hz": " Hz", "_deg": "°", "_n": " N"}
"""What the end of a number's name says of its unit."""
MOST_NUMBERS = 6
"""So many numbers of a list are told one by one."""


def _named(key: str, value: Any) -> str:
    """``duration 20 s`` for ``duration_s`` and 20; ``frequencies 1, 2 Hz`` for a few."""
    values = value if isinstance(value, list | tuple) else [value]
    numbers = bool(values) and all(isinstance(one, int | float) for one in values)
    end = next((e for e in UNITS if numbers and key.endswith(e)), "")
    shown = ", ".join(map(_number, values)) if numbers and len(values) <= MOST_NUMBERS else _number(value)
    return f"{key.removesuffix(end).replace('_', ' ')} {shown}{UNITS.get(end, '')}"


def _number(value: Any) -> str:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        text = str(value)
        return text if len(text) <= 40 else text[:37] + "..."
    return f"{value:.4g}"
