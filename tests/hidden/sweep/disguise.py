"""A recorded session as a bench of another size, rate, noise and care would have recorded it.

Sizes change nothing but units: masses, lengths and times of bench, gravity, controller and motion alike are
multiplied, which is a machine that obeys the same equations. Dirt is what real benches do to good recordings.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from fingerlab.rig.file import CONSTANT_UNITS, Rig
from fingerlab.sessions import Run, Session
from fingerlab.sessions.model import CHANNEL_UNITS, Array

Channels = dict[str, Array]

NOISE = {"motor_current": 0.020, "mcp_angle": math.radians(0.05), "pip_angle": math.radians(0.05)}
NOISE |= {"endpoint_force": 0.015}
"""Usual noise of the channels of a bench of the thesis' size, SI; both engines have it already."""


@dataclass(frozen=True)
class Size:
    """Units of mass, length and time of a bench, as multiples of another's."""

    mass: float = 1.0
    length: float = 1.0
    time: float = 1.0

    def of(self, unit: str) -> float:
        """The factor of a quantity in an SI unit of the session format or the rig file."""
        force = self.mass * self.length / self.time**2
        torque = force * self.length
        known = {
            "s": self.time, "rad": 1.0, "A": 1.0, "": 1.0, "N": force, "m": self.length, "kg": self.mass,
            "kg m^2": self.mass * self.length**2, "m/s^2": self.length / self.time**2,
            "N m": torque, "N m/rad": torque, "N m/A": torque,
        }  # fmt: skip
        return known[unit]


def with_channels(session: Session, change: Callable[[Channels], Channels]) -> Session:
    """The session with every run's channels changed; their number of samples may change, too."""
    runs = []
    for run in session.runs:
        channels = change(run.load())
        runs.append(
            Run.from_arrays(
                channels, name=run.name, phase=run.phase, cable=run.cable,
                sample_rate_hz=run.sample_rate_hz, trajectory=run.trajectory, attributes=run.attributes,
            )
        )  # fmt: skip
    return replace(session, runs=tuple(runs))


def resized(session: Session, size: Size) -> Session:
    """The session of the same bench in other units: every quantity in it, of rig and command, too."""

    def scaled(channels: Channels) -> Channels:
        return {name: values * size.of(CHANNEL_UNITS[name]) for name, values in channels.items()}

    runs = [
        replace(
            run, sample_rate_hz=run.sample_rate_hz / size.time, trajectory=_slower(run.trajectory, size.time)
        )
        for run in with_channels(session, scaled).runs
    ]
    return replace(session, runs=tuple(runs), rig=_resized_rig(session.rig, size))


def _resized_rig(rig: Rig, size: Size) -> Rig:
    def scaled(part: Any) -> Any:
        known = {name: value for name, value in vars(part).items() if value is not None}
        return replace(part, **{name: value * size.of(CONSTANT_UNITS[name]) for name, value in known.items()})

    return replace(rig, finger=scaled(rig.finger) if rig.finger else None, motor=scaled(rig.motor))


def _slower(trajectory: Mapping[str, Any], time: float) -> dict[str, Any]:
    """A told motion with its times multiplied and its frequencies divided."""

    def scaled(key: str, value: Any) -> Any:
        power = 1 if key.endswith("_s") else -1 if key.endswith("_hz") else 0
        if not power or isinstance(value, str):
            return value
        return [v * time**power for v in value] if isinstance(value, list) else value * time**power

    return {key: scaled(key, value) for key, value in trajectory.items()}


def decimated(session: Session, every: int) -> Session:
    """One of ``every`` samples, as a slower converter takes them: nothing is filtered before."""
    if every == 1:
        return session
    fewer = with_channels(session, lambda channels: {k: v[::every] for k, v in channels.items()})
    runs = [replace(run, sample_rate_hz=run.sample_rate_hz / every) for run in fewer.runs]
    return replace(fewer, runs=tuple(runs))


def noisier(session: Session, times: float, rng: np.random.Generator) -> Session:
    """White noise added, so that every channel has so many ``times`` its usual noise."""
    more = math.sqrt(max(times**2 - 1.0, 0.0))

    def added(channels: Channels) -> Channels:
        noise = {
            name: spread * more * rng.standard_normal(len(channels[name]))
            for name, spread in NOISE.items()
            if name in channels
        }
        return _with_current(session, channels, noise)

    return with_channels(session, added)


def _with_current(session: Session, channels: Channels, added: Mapping[str, Array]) -> Channels:
    """Channels with something added; the torque is what current and torque constant make of it."""
    changed = {**channels, **{name: channels[name] + more for name, more in added.items()}}
    if "motor_current" in added:
        motor = session.rig.motor
        gain = motor.torque_constant * motor.gear_ratio
        changed["motor_torque"] = channels["motor_torque"] + gain * added["motor_current"]
    return changed


ANGLES = ("mcp_angle", "pip_angle")
MEASURED = (*ANGLES, "endpoint_force", "motor_current")


def _zeros(session: Session, rng: np.random.Generator, channels: Channels) -> Channels:
    moved = {
        n: np.full(len(channels[n]), math.radians(0.4) * rng.standard_normal())
        for n in ANGLES
        if n in channels
    }
    return _with_current(session, channels, moved)


def _offset(session: Session, rng: np.random.Generator, channels: Channels) -> Channels:
    count = len(channels["motor_current"])
    return _with_current(session, channels, {"motor_current": np.full(count, 0.03 * rng.standard_normal())})


def _hum(session: Session, rng: np.random.Generator, channels: Channels) -> Channels:
    wave = np.sin(2 * math.pi * 50.0 * channels["time"] + rng.uniform(0, 2 * math.pi))
    return _with_current(session, channels, {"motor_current": 0.05 * wave})


def _spikes(session: Session, rng: np.random.Generator, channels: Channels) -> Channels:
    found = {}
    for name in MEASURED:
        if name in channels:
            values = channels[name]
            hit = rng.random(len(values)) < 1.0 / 2000.0
            found[name] = hit * rng.choice([-1.0, 1.0], len(values)) * 2.0 * np.ptp(values)
    return _with_current(session, channels, found)


def _gaps(session: Session, rng: np.random.Generator, channels: Channels) -> Channels:
    kept = np.ones(len(channels["time"]), dtype=bool)
    for start in rng.integers(1, len(kept) - 10, max(len(kept) // 3000, 1)):
        kept[start : start + int(rng.integers(1, 5))] = False
    return {name: values[kept] for name, values in channels.items()}


def _skew(session: Session, rng: np.random.Generator, channels: Channels) -> Channels:
    late = [name for name in (*ANGLES, "endpoint_force") if name in channels]
    time, shift = channels["time"], 1.5e-3
    name = late[0] if late else "motor_position"
    return {**channels, name: np.interp(time - shift, time, channels[name])}


KINDS = {"zeros": _zeros, "offset": _offset, "spikes": _spikes, "gaps": _gaps, "hum": _hum, "skew": _skew}
DIRT = tuple(KINDS)
"""Zeros of the angle sensors that move by 0.4 degrees from run to run; an offset of the amplifier, 30 mA,
that does; one sample in two thousand a spike; a few samples lost every three seconds; hum of 50 mA; one
channel 1.5 ms late."""


def dirty(session: Session, kinds: tuple[str, ...], rng: np.random.Generator) -> Session:
    """The session with the kinds of dirt named, in that order."""
    for kind in kinds:
        session = with_channels(session, partial(KINDS[kind], session, rng))
    return session
