"""Joints of robot arms, drives and spindles as their users log them: a motor under its own loop, integrated.

Each is one inertia under gravity, with LuGre's bristle (Canudas de Wit et al. 1995) under Stribeck's curve,
friction that grows with speed by a power and with the torque that the gear carries, ripple, and a deadband or
coarse encoder in the log. All runs of a machine are integrated together, in steps of 0.1 ms at most, Euler's
with the bristle told exactly over a step. The program inverts the dynamics of one axis, with spring-sliders
or functions of speed for friction; it shares no equation of motion, integrator or law with this.

Sizes are those of published machines, each said where it stands; what no source tells is assumed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numba
import numpy as np
from click.testing import CliRunner
from scipy.interpolate import CubicSpline
from scipy.io import savemat
from scipy.signal import lfilter

from fingerlab.cli.main import cli
from fingerlab.sessions.model import Array

Commands = Callable[[Array], Array]
"""What the loop is told: time (n,), s -> positions (runs, n)."""


@dataclass(frozen=True)
class Joint:
    """A machine and its log, SI; of a linear one a torque is a force, an angle a way and an inertia a mass.

    Attributes:
        inertia, coulomb, static, viscous: as they say; ``static`` beyond Coulomb's at rest.
        slow: Stribeck's speed. bristle: way over which friction reverses.
        power: of the speed that friction grows with beyond Coulomb's. per_torque: friction as a share of what
            the gear carries.
        uneven: share by which Coulomb friction differs between the directions.
        weight: gravity's torque at most; upright: angle of the link at position zero against the horizontal.
        ripple: amplitude, at ``order`` periods a turn.
        offset: of the torque's measurement. loads: known ones of the runs; told: whether the log has them.
        command: what the loop is told. seconds, rate, runs: of the log.
        step: of the encoder, torque_step, noise: of the torque as logged.
        sense: 1, or -1 where the encoder counts against the torque.
        held: after so many samples the encoder is read again.
        late: time constant of the filter through which the torque is logged, s.
        jitter: by so much of a sample each comes early or late, and one in thirty not at all.
        truth: the effects that are in it; of those in braces any will do. inside: the same in words.
    """

    command: Commands
    inertia: float
    coulomb: float = 0.0
    static: float = 0.0
    slow: float = 0.05
    bristle: float = 1e-3
    viscous: float = 0.0
    power: float = 1.0
    per_torque: float = 0.0
    uneven: float = 0.0
    weight: float = 0.0
    upright: float = 0.0
    ripple: float = 0.0
    order: float = 0.0
    offset: float = 0.0
    loads: Sequence[float] = ()
    told: bool = True
    seconds: float = 15.0
    rate: float = 1000.0
    runs: int = 4
    step: float = 1e-5
    torque_step: float = 0.0
    noise: float = 0.0
    sense: float = 1.0
    held: int = 1
    late: float = 0.0
    jitter: float = 0.0
    linear: bool = False
    seed: int = 0
    truth: Sequence[frozenset[str]] = ()
    inside: str = ""


@numba.njit
def _moved(
    told: Array, rise: Array, bend: Array, times: int, short: float, hold: float, gain: float, damp: float,
    inertia: float, coulomb: float, static: float, slow: float, reach: float, viscous: float, power: float,
    per_torque: float, uneven: float, weight: float, upright: float, ripple: float, order: float,
) -> Array:  # fmt: skip
    """Angle and torque of the drive, every ``times`` steps, (samples, 2)."""
    angle, speed, bristle = told[0], 0.0, 0.0
    stiff = coulomb / reach
    inner = 0.3 * math.sqrt(stiff * inertia)
    kept = np.empty((len(told) // times + 1, 2))
    for k in range(len(told)):
        carried = weight * math.cos(angle + upright) + hold
        drive = inertia * bend[k] + carried + gain * (told[k] - angle) + damp * (rise[k] - speed)
        if k % times == 0:
            kept[k // times, 0], kept[k // times, 1] = angle, drive
        level = static * math.exp(-abs(speed / slow)) + per_torque * abs(carried)
        level += coulomb * (1.0 + uneven * np.sign(speed))
        rub = 0.0
        if coulomb > 0.0 and speed != 0.0:
            way = np.sign(speed) * reach * level / coulomb
            moved = way + (bristle - way) * math.exp(-abs(speed) * short / abs(way))
            rub = stiff * moved + inner * (moved - bristle) / short
            bristle = moved
        elif coulomb > 0.0:
            rub = stiff * bristle
        rub += viscous * np.sign(speed) * abs(speed) ** power
        wave = ripple * math.sin(order * angle + 0.4)
        speed += short * (drive - carried - rub - wave) / inertia
        angle += short * speed
    return kept[: (len(told) - 1) // times + 1]


def motion_of(joint: Joint) -> tuple[Array, Array, Array, Array]:
    """Time (n,), position, torque of the drive and known load, (runs, n), as they truly were."""
    rng = np.random.default_rng([joint.seed, 7])
    times = max(round(1e4 / joint.rate), 1)
    short = 1.0 / (joint.rate * times)
    fine = np.arange(int(joint.seconds * joint.rate) * times) * short
    told = joint.command(fine)
    rise = np.gradient(told, short, axis=1)
    bend = np.gradient(rise, short, axis=1)
    travel = max(float(np.ptp(told)), 1e-9)
    quick = 2.0 * np.pi * 8.0  # of the loop
    gain = max(joint.inertia * quick**2, 200.0 * (joint.coulomb + joint.static) / travel)
    damp = 2.0 * math.sqrt(gain * joint.inertia)
    hold = np.resize(np.asarray(joint.loads or (0.0,), float), len(told))
    every = []
    for k, wander in enumerate(1.0 + 0.01 * rng.standard_normal(len(told))):
        every.append(
            _moved(
                told[k], rise[k], bend[k], times, short, hold[k], gain, damp, joint.inertia,
                wander * joint.coulomb, joint.static, joint.slow, joint.bristle, joint.viscous, joint.power,
                joint.per_torque, joint.uneven, joint.weight, joint.upright, joint.ripple, joint.order,
            )
        )  # fmt: skip
    found = np.moveaxis(np.stack(every), 2, 0)
    time = np.arange(found.shape[2]) / joint.rate
    return time, found[0], found[1], np.broadcast_to(hold[:, None], found[1].shape)


def logged(joint: Joint) -> list[dict[str, Array]]:
    """The log of each run: time, position, torque, and load where the machine tells one; each (n,), SI."""
    time, position, torque, load = motion_of(joint)
    rng = np.random.default_rng([joint.seed, 11])
    if joint.late:
        kept = math.exp(-1.0 / joint.rate / joint.late)
        torque = lfilter([1.0 - kept], [1.0, -kept], torque, axis=1)
    torque = torque + joint.offset + joint.noise * rng.standard_normal(torque.shape)
    if joint.torque_step:
        torque = np.rint(torque / joint.torque_step) * joint.torque_step
    position = np.rint(joint.sense * position / joint.step) * joint.step
    position = position[:, np.arange(position.shape[1]) // joint.held * joint.held]
    runs = []
    for k in range(len(position)):
        run = {"t": time, "q": position[k], "tau": torque[k]}
        if joint.loads and joint.told:
            run["load"] = load[k] + 0.3 * joint.noise * rng.standard_normal(len(time))
        if joint.jitter:
            taken = np.sort(time + joint.jitter / joint.rate * rng.standard_normal(len(time)))
            taken = taken[rng.random(len(time)) > 1.0 / 30.0]
            run = {name: CubicSpline(time, values)(taken) for name, values in run.items()} | {"t": taken}
        runs.append(run)
    return runs


def imported(joint: Joint, folder: Path) -> Path:
    """The session that ``fingerlab import`` makes of the logs, a MAT file each."""
    paths, session = [], folder / "axis.h5"
    for k, run in enumerate(logged(joint)):
        paths.append(str(folder / f"log{k + 1}.mat"))
        savemat(paths[-1], run)
    units = ("m", "N") if joint.linear else ("rad", "N m")
    words = f"time=t:s,position=q:{units[0]},torque=tau:{units[1]}"
    if joint.loads and joint.told:
        words += f",load=load:{units[1]}"
    done = CliRunner().invoke(cli, ["import", "--axis", *paths, "--map", words, "--out", str(session)])
    assert done.exit_code == 0, done.output
    return session


# ## What they are told


def fourier(amplitude: float, base: float, runs: int, seed: int = 0, terms: int = 5) -> Commands:
    """Sums of sines over a base, Hz, as arms are identified (Swevers et al. 1997); from rest."""
    rng = np.random.default_rng([seed, 3])
    shares = rng.uniform(-1.0, 1.0, (runs, terms, 2)) / np.arange(1, terms + 1)[:, None]

    def told(time: Array) -> Array:
        wave = 2.0 * np.pi * base * np.arange(1, terms + 1)[:, None] * time
        every = shares[:, :, 0] @ np.sin(wave) + shares[:, :, 1] @ (np.cos(wave) - 1.0)
        every = amplitude * every / np.abs(every).max()
        start = np.clip(time / 0.5, 0.0, 1.0)
        return np.asarray(every * start * start * (3.0 - 2.0 * start))

    return told


def moves(travel: float, speed: float, acceleration: float, rests: Sequence[float]) -> Commands:
    """There and back by even accelerations, with a rest, s, at either end, one value for each run.

    Where the ``speed`` is never reached there is nothing between speeding up and slowing down: bang-bang.
    """

    def told(time: Array) -> Array:
        found = []
        for number, rest in enumerate(rests):
            fastest = speed * (1.0, 0.6, 0.3, 0.8, 0.45)[number % 5] if len(rests) > 1 else speed
            fastest = min(fastest, np.sqrt(travel * acceleration))
            ramp = fastest / acceleration
            even = max(travel - fastest * ramp, 0.0) / fastest
            knots = np.array([0.0, ramp, ramp + even, 2.0 * ramp + even, 2.0 * ramp + even + rest])
            period = 2.0 * knots[-1]
            phase = np.mod(time, period)
            back = phase >= knots[-1]
            phase = np.where(back, phase - knots[-1], phase)
            speeds = np.interp(phase, knots, [0.0, fastest, fastest, 0.0, 0.0]) * np.where(back, -1.0, 1.0)
            found.append(np.cumsum(speeds) * (time[1] - time[0]))
        return np.stack(found)

    return told


def sines(amplitude: float, paces: Sequence[float]) -> Commands:
    """A sine a run, Hz, from rest."""

    def told(time: Array) -> Array:
        start = np.clip(time / 0.5, 0.0, 1.0)
        start = start * start * (3.0 - 2.0 * start)
        return np.stack([amplitude * start * np.sin(2.0 * np.pi * pace * time) for pace in paces])

    return told


def turning(speeds: Sequence[float], ramps: float = 0.2) -> Commands:
    """A spindle that goes through even speeds, rad/s, one after the other, in steps with ramps."""

    def told(time: Array) -> Array:
        found = []
        for number, fastest in enumerate(speeds):
            levels = fastest * np.array([0.3, 1.0, 0.6, 0.15, 0.8])
            knots = [[k * 0.2 + 0.1 * ramps, (k + 1) * 0.2] for k in range(5)]
            every = np.interp(time, time[-1] * np.concatenate(knots), np.repeat(np.roll(levels, number), 2))
            found.append(np.cumsum(every) * (time[1] - time[0]))
        return np.stack(found)

    return told


RUBS = frozenset({"motor_coulomb_friction", "motor_presliding", "motor_stribeck_friction"})
VISCOUS, LOADED, RIPPLE, SPRING = (
    frozenset({name})
    for name in ("motor_viscous_friction", "load_dependent_friction", "torque_ripple", "motor_spring")
)
WEIGHT = SPRING | RIPPLE
"""Gravity of a link follows the cosine of its angle: over a short travel a spring, over a long one a wave."""

EMPS = Joint(
    moves(0.25, 9.0, 1.2, (0.3,)), 95.1, 20.4, 2.0, viscous=203.5, slow=0.01, bristle=2e-5, offset=-3.2,
    runs=1, seconds=24.8, step=1e-6, noise=4.0, linear=True, truth=(RUBS, VISCOUS),
    inside="20.4 N, 203.5 N s/m; 95 kg",
)  # fmt: skip
"""An axis with a ball screw (Janot, Gautier and Brunot 2019); bristle, static friction and noise assumed."""

ARM = Joint(
    fourier(1.2, 0.1, 4), 1.25, 7.1, 1.5, viscous=8.2, power=0.7, slow=0.04, bristle=8e-4, step=2e-6,
    noise=0.4, torque_step=0.05, truth=(RUBS, VISCOUS),
    inside="7.1 N m, and 8.2 N m at 1 rad/s that grow with the speed to the 0.7",
)  # fmt: skip
"""Of the order of what is published for the axes of a small industrial arm (Janot, Vandanjon and Gautier
2014: 7 to 8 N m and 6 to 8 N m s/rad at its shoulder, 22 N m of gravity); all else assumed."""

LARGE = Joint(
    moves(1.2, 1.2, 2.5, (1.5, 1.0, 2.0)), 40.0, 30.0, 8.0, viscous=45.0, slow=0.03, bristle=1e-3, runs=3,
    seconds=20.0, rate=250.0, step=1e-5, noise=2.0, torque_step=0.5, truth=(RUBS, VISCOUS),
    inside="30 N m, 45 N m s/rad",
)  # fmt: skip
"""An industrial arm's base; assumed."""

SHORT = Joint(
    sines(0.5, (1.0, 0.6)), 0.02, 0.6, 0.1, viscous=0.1, slow=0.1, runs=2, seconds=3.0, step=1e-4, noise=0.02,
    truth=(RUBS,), inside="0.6 N m, 0.1 N m s/rad",
)  # fmt: skip

MACHINES: Mapping[str, Joint] = {
    "ball screw, one run": EMPS,
    "ball screw, three equal runs": replace(
        EMPS, command=moves(0.25, 9.0, 1.2, (0.3, 0.3, 0.3)), runs=3, seconds=8.0
    ),
    "ball screw, quick and slow": replace(EMPS, command=moves(0.25, 0.5, 1.2, (0.2, 0.2)), runs=2),
    "shoulder turning upright": ARM,
    "shoulder against gravity": replace(
        ARM, command=fourier(1.0, 0.1, 5, 1), inertia=0.9, coulomb=8.1, static=2.0, viscous=5.7, weight=22.0,
        upright=0.3, per_torque=0.03, runs=5, seconds=10.0, truth=(RUBS, VISCOUS, WEIGHT),
        inside="8.1 N m, 5.7 N m at 1 rad/s, 22 N m of gravity",
    ),
    "elbow with a harmonic drive": replace(
        ARM, command=fourier(1.4, 0.1, 3, 2), inertia=0.35, coulomb=3.2, static=1.0, viscous=2.6, weight=6.0,
        upright=-0.8, ripple=0.8, order=200.0, runs=3, seconds=20.0, noise=0.2, truth=(RUBS, VISCOUS, WEIGHT),
        inside="3.2 N m, 2.6 N m at 1 rad/s, 6 N m of gravity, a wave of 0.8 N m at 200 a turn",
    ),
    "wrist, 100 Hz": replace(
        ARM, command=fourier(1.5, 0.1, 3, 3), inertia=0.03, coulomb=1.0, static=0.3, viscous=0.5, weight=1.5,
        upright=0.5, runs=3, rate=100.0, noise=0.05, torque_step=0.02, step=1e-4,
        truth=(RUBS, VISCOUS, WEIGHT), inside="1 N m, 0.5 N m at 1 rad/s, 1.5 N m of gravity",
    ),
    "arm under known loads": replace(
        ARM, command=fourier(1.0, 0.1, 4, 4), inertia=0.9, coulomb=6.0, viscous=4.0, per_torque=0.1,
        loads=(0.0, 15.0, 30.0, 45.0), truth=(RUBS, VISCOUS, LOADED),
        inside="6 N m and a tenth of the load, 4 N m at 1 rad/s",
    ),
    "large arm, moves and rests": replace(
        LARGE, uneven=0.03, inside="30 N m, 3 % more of it one way, 45 N m s/rad"
    ),
    "large arm against gravity": replace(
        LARGE, weight=180.0, upright=-0.4, torque_step=0.0, truth=(RUBS, VISCOUS, WEIGHT),
        inside="30 N m, 45 N m s/rad, 180 N m of gravity",
    ),
    "servo, coarse encoder": Joint(
        sines(0.8, (0.3, 0.6, 0.15)), 4e-4, 0.05, 0.02, viscous=4e-3, runs=3, slow=0.2, bristle=5e-3,
        truth=(RUBS,), inside="50 mN m, 4 mN m s/rad", seconds=12.0, rate=100.0, step=2 * np.pi / 4096,
        noise=0.002, torque_step=0.001,
    ),
    "spindle, 5 kHz": Joint(
        turning((60.0, 40.0, 80.0)), 2e-3, 0.03, viscous=2e-3, runs=3, slow=1.0, bristle=5e-3,
        truth=(VISCOUS,), inside="2 mN m s/rad, 30 mN m", seconds=6.0, rate=5000.0, step=2 * np.pi / 8192,
        noise=0.004,
    ),
    "two runs of three seconds": SHORT,
    "one run of three seconds": replace(SHORT, command=sines(0.5, (1.2,)), runs=1, seconds=3.2),
    "encoder against the torque": Joint(
        fourier(1.0, 0.15, 4, 5), 0.05, 0.8, 0.2, viscous=0.3, sense=-1.0, truth=(RUBS,), noise=0.02,
        inside="0.8 N m, 0.3 N m s/rad", step=1e-4, rate=500.0,
    ),
    "ball screw, late torque": replace(EMPS, late=0.01),
    "ball screw, uneven times": replace(EMPS, jitter=0.25),
    "ball screw, read at 100 Hz": replace(EMPS, held=10),
    "shoulder, read at 100 Hz": replace(ARM, held=10),
    "plain, sums": Joint(fourier(1.0, 0.2, 4, 6), 0.05, noise=0.005, offset=0.02),
    "plain, laps": Joint(
        moves(0.5, 0.6, 2.0, (0.2, 0.2, 0.2)), 20.0, noise=0.5, step=1e-6, linear=True, offset=1.0
    ),
    "plain, rests, 100 Hz": Joint(
        moves(1.0, 1.0, 3.0, (1.0, 0.7, 1.5)), 0.3, noise=0.03, rate=100.0, step=1e-4, seconds=20.0
    ),
    "plain, one run": Joint(
        moves(0.3, 9.0, 3.0, (0.1,)), 5.0, noise=0.3, step=1e-6, linear=True, seconds=10.0
    ),
    "plain, loads": Joint(
        fourier(1.0, 0.2, 4, 7), 0.05, noise=0.01, loads=(0.0, 0.2, 0.4, 0.6), rate=500.0
    ),
    "plain, coarse encoder": Joint(
        sines(0.5, (0.5, 0.3, 0.7)), 0.02, noise=0.005, step=2 * np.pi / 2000, runs=3, seconds=8.0, seed=2,
        torque_step=0.01,
    ),
    "plain, sines": Joint(
        sines(0.6, (0.5, 1.0, 0.25, 0.7)), 0.01, noise=0.004, step=1e-4, rate=250.0, seconds=10.0
    ),
    "plain, late torque": Joint(
        moves(0.5, 0.6, 2.0, (0.2, 0.2, 0.2)), 20.0, noise=0.5, step=1e-6, linear=True, late=0.01
    ),
    "plain, uneven times": Joint(
        moves(0.5, 0.6, 2.0, (0.2, 0.2, 0.2)), 20.0, noise=0.5, step=1e-6, linear=True, jitter=0.25
    ),
    "plain, read at 25 Hz": Joint(
        sines(0.6, (0.5, 1.0, 0.25, 0.7)), 0.01, noise=0.004, step=1e-4, rate=250.0, seconds=10.0, held=10
    ),
}  # fmt: skip
"""Of the kinds that are logged in public; the last ten have nothing that the model lacks."""
