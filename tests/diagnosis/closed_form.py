"""Recordings from equations written out again here, apart from the project's equations and its simulated rig.

A free finger is integrated under a given cable tension; in contact the force and the PIP
angle are given and the two joint equations are solved for tension and MCP angle. What is wrong with the model
is a closed form too. Everything in SI units.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.signal import lfilter

from fingerlab.rig.file import Finger, Motor, Rig
from fingerlab.sessions.model import Array, Run, Session

RATE = 1000.0
RADIUS = 0.015
INERTIA = 3.0e-4
NOMINAL = Finger(0.012, 0.014, 0.0225, 0.024, 2.1e-6, 2.9e-6, 0.12, 0.06, wrist_angle=np.radians(15.0))
CALLIPER = dict.fromkeys(("proximal_half_length", "distal_half_length"), 0.002)
"""Relative tolerance of measured lengths, a tenth of a millimetre: a weight's moment is as uncertain."""
RIG = Rig(NOMINAL, Motor(pulley_radius=RADIUS, inertia=INERTIA), {"inertia": 0.2, **CALLIPER})
OFF_NOMINAL = {"proximal_mass": 1.02, "distal_mass": 0.985, "mcp_stiffness": 1.015, "pip_stiffness": 0.985}
"""True over nominal value, within the tolerance of 2 %."""
PRE_ROLL_S = 3.0
STEP = 4e-3  # s, of the integration; the finger's fastest motion takes 80 ms a cycle


@dataclass(frozen=True)
class Missing:
    """What the bench has and the nominal model has not; all absent by default."""

    viscous: tuple[float, float] = (0.0, 0.0)  # N m s/rad
    cubic: tuple[float, float] = (0.0, 0.0)  # N m/rad^3
    tilt: float = 0.0  # rad
    compliance: float = 0.0  # m/N
    stiffens_at: float = 0.0  # N, k^2 / k2 of a cable with the tension k x + k2 x^2; 0: k2 is none
    lag: float = 0.0  # s by which what the cable gives lags behind its tension, to first order
    delay: float = 0.0  # s
    motor_coulomb: float = 0.0  # N m
    motor_viscous: float = 0.0  # N m s/rad
    let_out: float = 0.0  # m of loose cable for each N that the tension would be negative
    read_share: float = 1.0  # of the contact force that the load cell reads
    give: float = 5e-5  # m/N by which the fingertip sinks; a printed one hardly does
    stop: tuple[float, float] = (-1.0, 0.0)  # where the PIP joint meets round faces, rad; N m/rad^1.5
    strange: float = 0.0  # N m, amplitude of a joint torque that no effect of the catalogue has


@dataclass(frozen=True)
class Bench:
    """One bench: true arms (m) by cable, losses (N m), true constants, and sensor noise (one sd)."""

    arms: dict[int, tuple[float, float]] = field(
        default_factory=lambda: {-1: (0.0104, 0.0083), 1: (0.0117, 0.0058)}
    )
    losses: tuple[float, float] = (-0.0008, 0.0005)
    trace: float = 1.2e-4  # N m s/rad, a trace of viscous friction that every model allows for
    finger: Finger = field(
        default_factory=lambda: Finger(**{k: v * OFF_NOMINAL.get(k, 1.0) for k, v in vars(NOMINAL).items()})
    )
    missing: Missing = field(default_factory=Missing)
    angle_noise: float = 2.0e-4
    torque_noise: float = 4.0e-4
    position_noise: float = 2.0e-5
    force_noise: float = 4.0e-3


def tones(time: Array, parts: Sequence[tuple[float, float, float]]) -> tuple[Array, Array, Array]:
    """Sum of sines of (amplitude, Hz, rad) with its first and second derivative."""
    result = [np.zeros_like(time) for _ in range(3)]
    for amplitude, frequency, phase in parts:
        w = 2 * np.pi * frequency
        result[0] = result[0] + amplitude * np.sin(w * time + phase)
        result[1] = result[1] + amplitude * w * np.cos(w * time + phase)
        result[2] = result[2] - amplitude * w**2 * np.sin(w * time + phase)
    return result[0], result[1], result[2]


def masses(f: Finger, q2: Any, m: Any = np) -> tuple[Any, Any, Any]:
    """Mass matrix entries, kg m^2; ``m`` is the module whose cosine fits: numpy, or math for one number."""
    l1, l2, m1, m2 = f.proximal_half_length, f.distal_half_length, f.proximal_mass, f.distal_mass
    c = m.cos(q2)
    m11 = f.proximal_inertia + m1 * l1**2 + m2 * (4 * l1**2 + l2**2 + 4 * l1 * l2 * c)
    return m11, m2 * (l2**2 + 2 * l1 * l2 * c), m2 * l2**2 + f.distal_inertia + 0.0 * c


def rest(bench: Bench, q1: Any, q2: Any, w1: Any, w2: Any, m: Any = np) -> tuple[Any, Any]:
    """Everything on the left-hand side but the acceleration: Coriolis, gravity, springs, what is missing."""
    f, x = bench.finger, bench.missing
    l1, l2, m1, m2, g = (
        f.proximal_half_length, f.distal_half_length, f.proximal_mass, f.distal_mass, f.gravity,
    )  # fmt: skip
    alpha = f.wrist_angle + x.tilt
    h = 2 * m2 * l1 * l2 * m.sin(q2)
    g2 = -m2 * g * l2 * m.cos(q1 + q2 - alpha)
    g1 = -(m1 + 2 * m2) * g * l1 * m.cos(alpha - q1) + g2
    odd = x.strange * m.sin(23.0 * q1 + 0.4) * m.cos(17.0 * q2) if x.strange else 0.0
    left1 = -h * w2 * (2 * w1 + w2) + g1 + f.mcp_stiffness * q1 + x.cubic[0] * q1**3
    left2 = h * w1**2 + g2 + f.pip_stiffness * q2 + x.cubic[1] * q2**3
    left1 = left1 + (bench.trace + x.viscous[0]) * w1 - bench.losses[0] + odd
    left2 = left2 + (bench.trace + x.viscous[1]) * w2 - bench.losses[1] - 0.7 * odd
    if x.stop[1]:
        left2 = left2 - x.stop[1] * (0.5 * (x.stop[0] - q2 + abs(x.stop[0] - q2))) ** 1.5
    return left1, left2


Line = tuple[int, float, tuple[tuple[float, float, float], ...]]
"""Cable sign, mean tension (N) and its tones (N, Hz, rad) of a free run."""


@lru_cache(maxsize=64)
def free_motion(line: Line, numbers: tuple[float, ...], seconds: float) -> tuple[Array, Array]:
    """A free finger, its cable slack where the tension would be negative: time (m,) and state (m, 4).

    Integrated by the rule of Runge and Kutta of fourth order, from so long before time zero that nothing is
    left of the start.
    """
    bench = _unpacked(numbers)
    f, (sign, mean, parts) = bench.finger, line
    steps = round((PRE_ROLL_S + seconds) / STEP)
    half = -PRE_ROLL_S + 0.5 * STEP * np.arange(2 * steps + 1)
    pull = np.maximum(mean + tones(half, parts)[0], 0.0).tolist()
    a, b = sign * bench.arms[sign][0], sign * bench.arms[sign][1]

    def slope(k: int, q1: float, q2: float, w1: float, w2: float) -> tuple[float, float, float, float]:
        left1, left2 = rest(bench, q1, q2, w1, w2, math)
        m11, m12, m22 = masses(f, q2, math)
        f1, f2 = a * pull[k] - left1, b * pull[k] - left2
        det = m11 * m22 - m12 * m12
        return w1, w2, (m22 * f1 - m12 * f2) / det, (m11 * f2 - m12 * f1) / det

    def ahead(y: Sequence[float], s: Sequence[float], step: float) -> list[float]:
        return [v + step * d for v, d in zip(y, s, strict=True)]

    y = [a * pull[0] / f.mcp_stiffness, b * pull[0] / f.pip_stiffness, 0.0, 0.0]
    way = [y]
    for k in range(steps):
        one = slope(2 * k, *y)
        two = slope(2 * k + 1, *ahead(y, one, 0.5 * STEP))
        three = slope(2 * k + 1, *ahead(y, two, 0.5 * STEP))
        four = slope(2 * k + 2, *ahead(y, three, STEP))
        y = [
            v + STEP / 6 * (s1 + 2 * s2 + 2 * s3 + s4)
            for v, s1, s2, s3, s4 in zip(y, one, two, three, four, strict=True)
        ]
        way.append(y)
    return half[::2], np.array(way)


def _packed(bench: Bench) -> tuple[float, ...]:
    """What decides how a free finger moves: the key under which its motion is kept."""
    x = bench.missing
    return (
        *vars(bench.finger).values(), *bench.arms[-1], *bench.arms[1], *bench.losses, bench.trace, *x.viscous,
        *x.cubic, x.tilt, x.strange, *x.stop,
    )  # fmt: skip


def _unpacked(numbers: tuple[float, ...]) -> Bench:
    finger, rest_of = Finger(*numbers[:10]), numbers[10:]
    a, b, c, d, loss1, loss2, trace, v1, v2, c1, c2, tilt, strange, edge, stiffness = rest_of
    missing = Missing((v1, v2), (c1, c2), tilt, strange=strange, stop=(edge, stiffness))
    return Bench({-1: (a, b), 1: (c, d)}, (loss1, loss2), trace, finger, missing)


def free_run(bench: Bench, line: Line, rng: np.random.Generator, seconds: float, number: int) -> Run:
    sign, mean, parts = line
    at, way = free_motion(line, _packed(bench), seconds)
    path = CubicHermiteSpline(at, way[:, :2], way[:, 2:])
    time = np.arange(round(seconds * RATE)) / RATE
    undisturbed = mean + tones(time, parts)[0]
    loose = bench.missing.let_out * np.maximum(-undisturbed, 0.0)
    trajectory = {"kind": "sine" if len(parts) == 1 else "multisine", "frequency_hz": parts[0][1]}
    return _record(
        bench, sign, time, path(time).T, path(time - bench.missing.delay).T, np.maximum(undisturbed, 0.0),
        loose, None, trajectory, rng, f"{number + 1:03d}",
    )  # fmt: skip


def contact_run(
    bench: Bench, mean: float, swing: float, frequency: float, rng: np.random.Generator, seconds: float,
    name: str,
) -> Run:  # fmt: skip
    """The tip on the load cell: a force of ``mean`` plus a sine of ``swing`` (N); the PIP joint yields.

    With the arms of :class:`Bench` the flexion cable holds up any force in about one posture, as on a finger
    whose tip is held by the cell.
    """
    time = np.arange(round(seconds * RATE)) / RATE
    delay = bench.missing.delay
    angles, tension, force = _press(bench, time, mean, swing, frequency)
    late = _press(bench, time - delay, mean, swing, frequency) if delay else (angles, tension, force)
    trajectory = {"kind": "sine", "frequency_hz": frequency}
    return _record(
        bench, 1, time, angles, late[0], tension, np.zeros_like(time), bench.missing.read_share * late[2],
        trajectory, rng, name,
    )  # fmt: skip


def _press(
    bench: Bench, time: Array, mean: float, swing: float, frequency: float
) -> tuple[Array, Array, Array]:
    """Angles (2, n), tension and normal force, (n,), of a pressing finger; the load cell holds the tip up."""
    f = bench.finger
    cycle = np.arange(200) / (200 * frequency)
    beat = tones(cycle, [(1.0, frequency, 0.4)])[0]

    def sunk(yielding: float) -> float:
        """Amplitude of the tip's depth, m, where the PIP angle swings by so much, rad."""
        (q1, q2), _, _ = _posed(bench, cycle, mean, swing, frequency, yielding)
        first, second = q1 - f.wrist_angle, q1 + q2 - f.wrist_angle
        depth = 2 * f.proximal_half_length * np.sin(first) + 2 * f.distal_half_length * np.sin(second)
        return float(2 * np.mean(depth * beat))

    still, moved = sunk(0.0), sunk(1e-3)
    yielding = 1e-3 * (bench.missing.give * swing - still) / (moved - still)
    return _posed(bench, time, mean, swing, frequency, yielding)


def _posed(
    bench: Bench, time: Array, mean: float, swing: float, frequency: float, yielding: float
) -> tuple[Array, Array, Array]:
    """The same for a PIP angle that swings by ``yielding`` (rad); the MCP angle by Newton steps."""
    a, b = bench.arms[1]
    f = bench.finger
    s0, s1, s2 = tones(time, [(1.0, frequency, 0.4)])
    force, q2 = mean + swing * s0, 0.34 + yielding * s0
    w2, a2 = yielding * s1, yielding * s2

    def balance(q1: Array, w1: Array, a1: Array) -> tuple[Array, Array]:
        """What the MCP equation misses (N m), and the tension that the PIP equation gives (N)."""
        m11, m12, m22 = masses(f, q2)
        left1, left2 = rest(bench, q1, q2, w1, w2)
        lever2 = 2 * f.distal_half_length * np.cos(q1 + q2 - f.wrist_angle)
        lever1 = lever2 + 2 * f.proximal_half_length * np.cos(f.wrist_angle - q1)
        pull = (left2 + m12 * a1 + m22 * a2 + lever2 * force) / b
        return left1 + m11 * a1 + m12 * a2 + lever1 * force - a * pull, pull

    # The MCP angle repeats with the force; five harmonics hold it to better than a microradian.
    turn = 2 * np.pi * frequency
    order = np.arange(6)
    cosines, sines = np.cos(np.outer(time, order) * turn), np.sin(np.outer(time, order) * turn)
    q1 = np.full_like(time, 0.3)
    w1, a1 = np.zeros_like(time), np.zeros_like(time)
    basis = np.hstack((cosines, sines[:, 1:]))
    project = np.linalg.solve(basis.T @ basis, basis.T)
    for _ in range(6):
        missed, _ = balance(q1, w1, a1)
        q1 = q1 - missed * 1e-6 / (balance(q1 + 1e-6, w1, a1)[0] - missed)
        c = project @ q1
        even, odd = c[:6], np.concatenate(([0.0], c[6:]))
        speed = turn * order
        q1 = cosines @ even + sines @ odd
        w1 = cosines @ (speed * odd) - sines @ (speed * even)
        a1 = -cosines @ (speed**2 * even) - sines @ (speed**2 * odd)
    return np.stack((q1, q2)), balance(q1, w1, a1)[1], force


def _record(
    bench: Bench, sign: int, time: Array, angles: Array, late: Array, tension: Array, loose: Array,
    force: Array | None, trajectory: dict[str, object], rng: np.random.Generator, name: str,
) -> Run:  # fmt: skip
    """Motor and sensors: cable wound, torque with the motor's own losses, and noise on every channel."""
    a, b = bench.arms[sign]
    x = bench.missing
    stretching = lagging(tension, x.lag) if x.lag else tension
    if x.stiffens_at:
        stretching = 0.5 * x.stiffens_at * (np.sqrt(1.0 + 4.0 * stretching / x.stiffens_at) - 1.0)
    wound = 0.004 + sign * (a * angles[0] + b * angles[1]) + x.compliance * stretching - loose
    position = wound / RADIUS
    speed = np.gradient(position, 1 / RATE)
    torque = RADIUS * tension + INERTIA * np.gradient(speed, 1 / RATE)
    torque = torque + x.motor_coulomb * np.sign(speed) + x.motor_viscous * speed

    def noisy(values: Array, spread: float) -> Array:
        return values + spread * rng.standard_normal(len(time))

    channels = {
        "motor_command": position,
        "motor_position": noisy(position, bench.position_noise),
        "motor_torque": noisy(torque, bench.torque_noise),
        "mcp_angle": noisy(late[0], bench.angle_noise),
        "pip_angle": noisy(late[1], bench.angle_noise),
        "endpoint_force": np.full_like(time, np.nan) if force is None else noisy(force, bench.force_noise),
        "time": time,
    }
    return Run.from_arrays(
        channels, name=name, phase="on_air" if force is None else "contact",
        cable="flexion" if sign > 0 else "extension", sample_rate_hz=RATE, trajectory=trajectory,
    )  # fmt: skip


def lagging(values: Array, lag: float) -> Array:
    """A first-order lag (s) of values that are linear between samples, at rest before the first."""
    share = np.exp(-1.0 / (RATE * lag))
    even = lag * RATE * (1.0 - share)
    steps = lfilter([1.0 - even, even - share], [1.0, -share], values - values[0])
    return np.asarray(values[0] + steps)


def with_motor_torque(run: Run, law: Callable[[Array], Array]) -> Run:
    """The run with a motor torque (N m) by a law of its speed (rad/s).

    The command is the pulley's angle without noise, so that it tells the speed.
    """
    channels = run.load()
    speed = np.gradient(channels["motor_command"], 1.0 / run.sample_rate_hz)
    channels["motor_torque"] = channels["motor_torque"] + law(speed)
    return Run.from_arrays(
        channels, name=run.name, phase=run.phase, cable=run.cable, sample_rate_hz=run.sample_rate_hz,
        trajectory=run.trajectory,
    )  # fmt: skip


def session(
    bench: Bench, seed: int = 1, contact: int = 3, seconds: float = 10.0, mean: float = 4.0
) -> Session:
    """Five free runs with the extension cable, three with the flexion cable, and ``contact`` pressing ones.

    ``mean`` is the mean tension (N) of the first run, whose swing is 2 N.
    """
    rng = np.random.default_rng(seed)
    lively = ((0.7, 0.4, 0.1), (0.6, 0.9, 1.3), (0.5, 1.5, 2.2), (0.5, 2.3, 3.0))
    plan: tuple[Line, ...] = (
        (-1, mean, ((2.0, 1.0, 0.0),)),
        (-1, 4.0, ((2.0, 0.5, 1.0),)),
        (-1, 4.0, ((1.2, 2.0, 0.4),)),
        (-1, 4.2, lively),
        (-1, 4.5, tuple((p[0], p[1] * 1.3, p[2] + 1) for p in lively)),
        (1, 3.0, ((1.5, 1.0, 0.0),)),
        (1, 3.0, ((1.0, 2.0, 0.5),)),
        (1, 3.5, lively),
    )
    runs = [free_run(bench, line, rng, seconds, i) for i, line in enumerate(plan)]
    for k in range(contact):
        swing, frequency = (0.4, 0.6, 0.5)[k % 3], (1.0, 1.0, 0.6)[k % 3]
        runs.append(contact_run(bench, 1.2, swing, frequency, rng, seconds, f"{len(runs) + 1:03d}"))
    return Session(Path("closed-form.h5"), "closed form", "2026-11-01T09:00:00+01:00", RIG, tuple(runs))
