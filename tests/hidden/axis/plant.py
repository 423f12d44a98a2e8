"""An axis of any size under inverse dynamics: it shares no law, filter or integrator with the program.

The motion is prescribed, as a stiff position loop makes it, with an error of tracking; the torque follows
from rotor, friction, load and spring. Friction is LuGre's (Canudas de Wit et al. 1995): one bristle whose
deflection is integrated along the motion in steps of a sample, where the program has spring-sliders or a
function of speed. It differs along the stroke and wanders with time as that of real machines does.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.random import Generator
from scipy.interpolate import make_interp_spline

from fingerlab.rig.file import Motor, Rig
from fingerlab.sessions.model import Array, Run, Session

UNEVEN, WANDERS = 0.03, 0.02
"""Share of the friction by which it differs along the stroke, and by which it wanders in a run; assumed."""
RATES_HZ = (100.0, 250.0, 500.0, 1000.0, 2000.0, 5000.0)
MOTIONS = ("sines", "laps", "same laps", "fourier")


@dataclass(frozen=True)
class Axis:
    """A machine and how it is tried.

    Attributes:
        torque: size of its friction, N m; all else follows it.
        amplitude: of its motion, rad. speed: rad/s at the fastest.
        coulomb, viscous, stribeck, spring, ripple: shares of ``torque``; viscous at the fastest ``speed``,
            stribeck what is more at rest, spring at the ``amplitude``, ripple of ``order`` periods a turn.
        per_load: friction as a share of the load.
        power: of the speed in the viscous share; 1 is the law of the text books.
        inertial: torque of the rotor at its fastest, as a share of ``torque``.
        noise: of a sample of the torque, as a share of ``torque``.
        motion: one of ``MOTIONS``. rate: Hz. seconds: of a run.
        load: size of the largest known load, as a share of ``torque``; 0: there is none.
    """

    torque: float = 1.0
    amplitude: float = 0.6
    speed: float = 2.0
    coulomb: float = 1.0
    viscous: float = 0.0
    stribeck: float = 0.0
    spring: float = 0.0
    ripple: float = 0.0
    order: float = 12.0
    per_load: float = 0.0
    power: float = 1.0
    inertial: float = 0.3
    noise: float = 0.01
    motion: str = "sines"
    rate: float = 500.0
    seconds: float = 12.0
    runs: int = 6
    load: float = 0.0
    seed: int = 0
    told: Mapping[str, object] = field(default_factory=dict)


def session(axis: Axis) -> Session:
    """The runs that were taken of it; nothing in them says what is in the machine."""
    rng = np.random.default_rng(axis.seed)
    uneven = rng.uniform(0.0, 2.0 * math.pi, 2)
    runs = tuple(_run(axis, k, rng, uneven) for k in range(axis.runs))
    return Session(Path("axis.h5"), "an axis", "2026-11-01T09:00:00+00:00", Rig(None, Motor()), runs)


def _run(axis: Axis, number: int, rng: Generator, uneven: Array) -> Run:
    time = np.arange(int(axis.seconds * axis.rate)) / axis.rate
    command = _command(axis, number, time)
    lag = 0.01 * axis.amplitude / axis.speed  # of a stiff loop: a hundredth of the stroke's time
    position = np.interp(time - lag, time, command)
    position = position + 1e-4 * axis.amplitude * _slow_noise(rng, time, 3.0)
    speed = np.gradient(position, time)
    load = np.zeros_like(time)
    if axis.load:
        level = axis.load * axis.torque * (number % 4) / 3.0
        load = level * (1.0 + 0.1 * np.sin(2.0 * math.pi * 0.4 * time + rng.uniform(0.0, 6.0)))
    wave = 1.0 + UNEVEN * np.sin(1.7 * position / axis.amplitude + uneven[0])
    wave = wave + WANDERS * _slow_noise(rng, time, 0.2)
    torque = wave * _friction(axis, position, speed, load) + load
    # A rotor whose torque is "inertial" at the fastest speed over the time of a stroke.
    torque = torque + axis.inertial * axis.torque * np.gradient(speed, time) / (
        axis.speed**2 / axis.amplitude
    )
    torque = torque + axis.spring * axis.torque * position / axis.amplitude
    torque = torque + axis.ripple * axis.torque * np.sin(axis.order * position + uneven[1])
    torque = torque + 0.02 * axis.torque + axis.noise * axis.torque * rng.standard_normal(len(time))
    step = 2.0 * math.pi / 2**17  # of an encoder
    channels = {
        "motor_position": np.rint(position / step) * step,
        "motor_torque": torque,
        **({"load_torque": load} if axis.load else {}),
    }
    told = axis.told or {"kind": "custom"}
    return Run.from_arrays(
        channels, name=f"{number + 1:03d}", phase="motor_bench", cable="none", sample_rate_hz=axis.rate,
        trajectory=told,
    )  # fmt: skip


def _command(axis: Axis, number: int, time: Array) -> Array:
    """Position that the axis is told, rad; it begins at rest."""
    pace = 1.0 if axis.motion == "same laps" else (1.0, 0.35, 0.6, 0.2, 0.8, 0.12)[number % 6]
    fastest = pace * axis.speed
    start = np.clip(time / min(1.0, axis.seconds / 6.0), 0.0, 1.0)
    start = start * start * (3.0 - 2.0 * start)
    if axis.motion == "sines":
        return start * axis.amplitude * np.sin(fastest / axis.amplitude * time)
    if axis.motion == "fourier":  # as robots are identified: five harmonics of a slow wave
        base = fastest / axis.amplitude / 3.0
        shares = np.random.default_rng(77 + number).uniform(-1.0, 1.0, (5, 2)) / np.arange(1, 6)[:, None]
        wave = sum(
            a * np.sin((k + 1) * base * time) + b * (np.cos((k + 1) * base * time) - 1.0)
            for k, (a, b) in enumerate(shares)
        )
        return start * axis.amplitude * np.asarray(wave) / np.abs(shares).sum() * 2.0
    # Laps there and back at an even speed, with rounded corners.
    phase = fastest * time / (2.0 * axis.amplitude)
    lap = 1.0 - np.abs((phase % 2.0) - 1.0)  # 0 to 1 and back
    smooth = max(int(0.08 * axis.amplitude / fastest * axis.rate), 3)
    window = np.hanning(smooth + 2)[1:-1]
    padded = np.concatenate((np.full(smooth, lap[0]), lap, np.full(smooth, lap[-1])))
    rounded = np.convolve(padded, window / window.sum(), "same")[smooth:-smooth]
    return axis.amplitude * (2.0 * rounded - 1.0)


def _friction(axis: Axis, position: Array, speed: Array, load: Array) -> Array:
    """LuGre's bristle and what grows with speed, N m."""
    slow = 0.05 * axis.speed
    holds = axis.torque * (axis.coulomb + axis.stribeck * np.exp(-((speed / slow) ** 2)))
    holds = holds + axis.per_load * np.abs(load)
    travel = 0.01 * axis.amplitude  # over which it builds up
    ways = np.abs(np.diff(position, prepend=position[0])) / travel
    keeps, forward = np.exp(-ways).tolist(), np.sign(speed).tolist()
    state, states = 0.0, []
    for keep, sense in zip(keeps, forward, strict=True):
        state = sense + (state - sense) * keep if sense else state
        states.append(state)
    share = np.abs(speed / axis.speed) ** axis.power * np.sign(speed)
    return np.asarray(holds * np.array(states) + axis.viscous * axis.torque * share)


def _slow_noise(rng: Generator, time: Array, bandwidth: float) -> Array:
    """Noise of standard deviation 1 that changes at about ``bandwidth``, Hz."""
    knots = np.arange(0.0, time[-1] + 2.0 / bandwidth, 0.5 / bandwidth)
    # With kinks, an axis that follows it would be hit by its rotor's inertia.
    return np.asarray(make_interp_spline(knots, rng.standard_normal(len(knots)), k=5)(time))


LAWS: Mapping[str, Mapping[str, float]] = {
    "plain": {"coulomb": 0.0, "inertial": 1.0, "viscous": 0.0},
    "coulomb": {},
    "viscous": {"coulomb": 0.0, "viscous": 1.0},
    "coulomb and viscous": {"coulomb": 0.6, "viscous": 0.6},
    "coulomb and curved viscous": {"coulomb": 0.6, "viscous": 0.6, "power": 0.6},
    "stribeck and viscous": {"coulomb": 0.6, "stribeck": 0.4, "viscous": 0.5},
    "coulomb and load": {"coulomb": 0.5, "per_load": 0.3, "load": 2.0},
    "coulomb, viscous and load": {"coulomb": 0.5, "viscous": 0.5, "per_load": 0.3, "load": 2.0},
    "coulomb and spring": {"coulomb": 0.6, "spring": 0.6},
    "coulomb and ripple": {"coulomb": 0.6, "ripple": 0.3},
}
"""What can be in the machine."""

TRUTH: Mapping[str, tuple[frozenset[str], ...]] = {
    "plain": (),
    "coulomb": (frozenset({"motor_coulomb_friction", "motor_presliding"}),),
    "viscous": (frozenset({"motor_viscous_friction"}),),
    "coulomb and viscous": (
        frozenset({"motor_coulomb_friction", "motor_presliding"}),
        frozenset({"motor_viscous_friction"}),
    ),
    "coulomb and load": (
        frozenset({"motor_coulomb_friction", "motor_presliding"}),
        frozenset({"load_dependent_friction"}),
    ),
    "coulomb and spring": (
        frozenset({"motor_coulomb_friction", "motor_presliding"}),
        frozenset({"motor_spring"}),
    ),
    "coulomb and ripple": (
        frozenset({"motor_coulomb_friction", "motor_presliding"}),
        frozenset({"torque_ripple"}),
    ),
}
TRUTH = {
    **TRUTH,
    "coulomb and curved viscous": TRUTH["coulomb and viscous"],
    "stribeck and viscous": (
        frozenset({"motor_stribeck_friction", "motor_coulomb_friction", "motor_presliding"}),
        frozenset({"motor_viscous_friction"}),
    ),
    "coulomb, viscous and load": (*TRUTH["coulomb and load"], frozenset({"motor_viscous_friction"})),
}
"""Of each law, the effects that are in it; of those in braces any will do, for they differ in the first
degree of a stroke alone."""


def drawn(law: str, seed: int) -> Axis:
    """A machine of any size with that law in it, and a session of any kind."""
    rng = np.random.default_rng([seed, *law.encode()])
    size = float(10.0 ** rng.uniform(-1.5, 1.5))
    return Axis(
        torque=size,
        amplitude=float(10.0 ** rng.uniform(-0.7, 0.3)),
        speed=float(10.0 ** rng.uniform(-0.3, 0.7)),
        noise=float(10.0 ** rng.uniform(-2.3, -1.3)),
        motion=str(rng.choice(MOTIONS)),
        rate=float(rng.choice(RATES_HZ)),
        seconds=float(rng.choice((3.2, 6.0, 12.0, 20.0))),
        runs=int(rng.integers(3, 9)),
        order=float(rng.integers(6, 41)),
        seed=seed,
        **{"inertial": float(10.0 ** rng.uniform(-1.0, 0.3)), **LAWS[law]},  # type: ignore[arg-type]
    )
