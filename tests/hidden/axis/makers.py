"""Machines of other makers, simulated forwards, and the logs that their software writes.

A motor under a position loop drives a load through a belt or a gear: two inertias, a spring with play, an
eccentric wheel, cogging, and LuGre's friction with Stribeck's curve on the load, all integrated by LSODA
(Petzold 1983). The program inverts the dynamics of one axis and has spring-sliders or functions of speed for
friction; it shares no equation of motion, integrator or law with this. What is logged is what a drive logs:
its own position and torque, or current, rounded to their steps, in units and a text of the maker's taste.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from click.testing import CliRunner
from scipy.integrate import solve_ivp

from fingerlab.cli.main import cli
from fingerlab.sessions.model import Array

Motion = Callable[[float], float]


@dataclass(frozen=True)
class Drive:
    """Constants of a machine, SI; of a linear one a torque is a force, an angle a way and an inertia a mass.

    Attributes:
        rotor, load: inertias. stiffness, damping: of what lies between; play: its whole gap.
        eccentric: share by which the wheel's radius varies over a turn.
        coulomb, static: LuGre's level at speed and at rest. slow: Stribeck's speed. bristle: way to slide.
        viscous: in proportion to speed. per_load: friction as a share of the known load.
        cogging: order, size and phase of each line.
        loads: known loads of the runs, one after the other.
        swing, rate: of the position loop's own motion: amplitude, and Hz of the log.
    """

    rotor: float
    load: float
    stiffness: float
    damping: float
    swing: float
    rate: float
    coulomb: float = 0.0
    static: float = 0.0
    slow: float = 1.0
    bristle: float = 1e-3
    viscous: float = 0.0
    per_load: float = 0.0
    play: float = 0.0
    eccentric: float = 0.0
    cogging: Sequence[tuple[float, float, float]] = ()
    loads: Sequence[float] = (0.0,)


@dataclass(frozen=True)
class Maker:
    """A machine with its log: how a stranger would import it, and what is in it.

    Attributes:
        paces: cycles a second of each run; turns: the axis turns on so many times a second instead.
        log: writes time (s), position, torque and load as the maker's text.
        words: of ``fingerlab import`` beyond files and ``--out``. inside: what is in it, in words.
        truth: the effects that are in it; of those in braces any will do.
    """

    drive: Drive
    paces: Sequence[float]
    log: Callable[[Array, Array, Array, Array], str]
    words: Sequence[str]
    truth: Sequence[frozenset[str]]
    inside: str
    seconds: float = 12.0
    turns: Sequence[float] = ()
    noise: Mapping[str, float] = field(default_factory=dict)


def run_of(maker: Maker, number: int) -> tuple[Array, Array, Array, Array]:
    """Time (s), position, torque and known load of a run, each (n,), SI."""
    drive, told = maker.drive, _told(maker, number)
    hold = drive.loads[number % len(drive.loads)]
    # A loop ten times quicker than the motion, which friction alone does not hold back by a fiftieth of it.
    inertia = drive.rotor + drive.load
    quick = 2.0 * np.pi * 10.0 * max(maker.paces[number % len(maker.paces)], 0.5)
    gain = max(inertia * quick**2, 50.0 * (drive.static + drive.per_load * abs(hold)) / drive.swing)
    damp = 2.0 * float(np.sqrt(inertia * gain))
    step = 1e-3 / drive.rate

    def asked(t: float, angle: float, speed: float) -> float:
        rise = (told(t + step) - told(t - step)) / (2.0 * step)
        return gain * (told(t) - angle) + damp * (rise - speed) + hold

    def change(t: float, state: Array) -> list[float]:
        angle, speed, out, out_speed, bristle = state
        ratio = 1.0 + drive.eccentric * np.cos(angle)
        gap = angle + drive.eccentric * np.sin(angle) - out
        wound = gap - np.clip(gap, -0.5 * drive.play, 0.5 * drive.play)
        between = drive.stiffness * wound + drive.damping * (speed * ratio - out_speed) * (wound != 0.0)
        between = between if drive.play == 0.0 or between * wound > 0.0 else 0.0
        holds = drive.coulomb + (drive.static - drive.coulomb) * np.exp(-((out_speed / drive.slow) ** 2))
        holds += drive.per_load * abs(hold)
        slides = out_speed - abs(out_speed) * bristle / drive.bristle
        rubs = holds * bristle / drive.bristle + drive.viscous * out_speed
        cogs = sum(size * np.sin(order * angle + phase) for order, size, phase in drive.cogging)
        torque = asked(t, angle, speed)
        return [
            speed, (torque - hold - cogs - between * ratio) / drive.rotor,
            out_speed, (between - rubs) / drive.load, slides,
        ]  # fmt: skip

    time = np.arange(int(maker.seconds * drive.rate)) / drive.rate
    start = [told(0.0), 0.0, told(0.0), 0.0, 0.0]
    found = solve_ivp(
        change, (0.0, float(time[-1])), start, "LSODA", time, rtol=1e-6, atol=1e-9 * drive.swing,
        max_step=0.02 / max(maker.paces),
    )  # fmt: skip
    angle, speed = found.y[0], found.y[1]
    torque = np.array([asked(*one) for one in zip(time, angle, speed, strict=True)])
    rng = np.random.default_rng(number)

    def logged(values: Array, name: str) -> Array:
        return values + maker.noise.get(name, 0.0) * rng.standard_normal(len(values))

    load = np.full_like(time, hold) * (1.0 + 0.02 * np.sin(2.0 * np.pi * 0.3 * time))
    return time, angle, logged(torque, "torque"), logged(load, "load")


def _told(maker: Maker, number: int) -> Motion:
    """What the loop of a run is told: a sine and its third, from rest; or to turn on, faster and slower."""
    swing, pace = maker.drive.swing, 2.0 * np.pi * maker.paces[number % len(maker.paces)]
    if maker.turns:
        even = 2.0 * np.pi * maker.turns[number % len(maker.turns)]
        return lambda t: float(even * (t - np.expm1(-t) * -1.0) + 0.3 * swing * np.sin(pace * t))

    def told(t: float) -> float:
        begin = -np.expm1(-((t / 0.8) ** 3))
        return float(begin * swing * (0.85 * np.sin(pace * t) + 0.15 * np.sin(2.83 * pace * t)))

    return told


def write_logs(maker: Maker, folder: Path) -> list[Path]:
    """The logs of all runs, a text file each."""
    paths = []
    for number in range(max(len(maker.paces), len(maker.drive.loads), len(maker.turns))):
        path = folder / f"log {number + 1}.csv"
        path.write_text(maker.log(*run_of(maker, number)), encoding="utf-8")
        paths.append(path)
    return paths


def imported(maker: Maker, folder: Path) -> Path:
    """The session that ``fingerlab import`` makes of the logs of all runs."""
    logs, session = [str(path) for path in write_logs(maker, folder)], folder / "axis.h5"
    done = CliRunner().invoke(cli, ["import", "--axis", *logs, *maker.words, "--out", str(session)])
    assert done.exit_code == 0, done.output
    return session


def _text(header: str, columns: Sequence[Array], form: str, between: str = ",", comma: bool = False) -> str:
    lines = [header, *(between.join(form % value for value in row) for row in np.stack(columns, axis=1))]
    text = "\n".join(lines) + "\n"
    return text.replace(".", ",") if comma else text


def _cylinder(time: Array, way: Array, force: Array, load: Array) -> str:
    columns = (1e3 * time, np.rint(1e3 * way / 0.005) * 0.005, 1e-3 * force, 1e-3 * load)
    return _text("t [ms];x [mm];F_drive [kN];F_pressure [kN]", columns, "%.5f", ";", comma=True)


def _gear(time: Array, angle: Array, torque: Array, load: Array) -> str:
    return _text(
        "seconds,joint,tau,ext", (time, np.rint(np.degrees(angle) / 0.01) * 0.01, torque, load), "%.6g"
    )


def _belt(time: Array, angle: Array, torque: Array, load: Array) -> str:
    steps = np.rint(angle / (2.0 * np.pi) * 16384.0) / 16384.0
    return _text("position (rev)\ttorque (mNm)", (steps, 1e3 * torque), "%.6f", "\t")


def _motor(time: Array, angle: Array, torque: Array, load: Array) -> str:
    within = np.rint(np.degrees(angle % (2.0 * np.pi)) / 0.02) * 0.02  # the encoder counts one turn
    return _text("time_us;theta_deg;iq_mA", (1e6 * time, within, 1e3 * torque / 0.065), "%.2f", ";")


RUBS = frozenset({"motor_coulomb_friction", "motor_presliding", "motor_stribeck_friction"})
VISCOUS, LOADED, RIPPLE = (
    frozenset({name}) for name in ("motor_viscous_friction", "load_dependent_friction", "torque_ripple")
)

MAKERS: Mapping[str, Maker] = {
    "hydraulic cylinder, 100 Hz, kN": Maker(
        Drive(rotor=15.0, load=25.0, stiffness=4e7, damping=2e4, swing=0.08, rate=100.0, coulomb=320.0,
              static=420.0, slow=0.02, bristle=4e-4, viscous=900.0, per_load=0.08,
              loads=(500.0, 2000.0, 4000.0, 8000.0)),
        (0.3, 0.12, 0.5, 0.2, 0.4, 0.15, 0.35, 0.25), _cylinder,
        ("--map", "time=t:ms,position=x:mm,torque=F_drive:kN,load=F_pressure:kN"),
        (RUBS, LOADED),
        "seal of 320 N, and of 8 % of the load; Stribeck, 900 N s/m",
        seconds=20.0, noise={"torque": 15.0, "load": 5.0},
    ),
    "gear drive with play, 1 kHz, deg": Maker(
        Drive(rotor=0.02, load=0.15, stiffness=6e3, damping=3.0, swing=0.7, rate=1000.0, coulomb=4.0,
              static=5.2, slow=0.05, bristle=2e-3, viscous=1.2, play=2e-3, eccentric=0.01),
        (0.5, 0.2, 0.8, 0.3, 0.6), _gear,
        ("--map", "time=seconds:s,position=joint:deg,torque=tau:N m"),
        (RUBS, VISCOUS),
        "friction of 4 N m, Stribeck, 1.2 N m s/rad; play of 0.1 degrees, a wheel out of round by 1 %",
        noise={"torque": 0.05},
    ),
    "belt axis, 500 Hz, rev and mN m": Maker(
        Drive(rotor=2e-6, load=1e-5, stiffness=1.2, damping=1e-3, swing=2.5, rate=500.0, coulomb=0.028,
              static=0.03, slow=0.3, bristle=1e-2, viscous=5e-4),
        (0.5, 0.25, 1.0, 0.7), _belt,
        ("--map", "position=1:rev,torque=2:mN m", "--rate", "500"),
        (RUBS, VISCOUS),
        "belt of 1.2 N m/rad, friction of 28 mN m, 0.5 mN m s/rad",
        noise={"torque": 4e-4},
    ),
    "brushless motor, 10 kHz, one turn and mA": Maker(
        Drive(rotor=6e-5, load=6e-5, stiffness=200.0, damping=0.02, swing=1.0, rate=10000.0, coulomb=0.006,
              static=0.007, slow=0.5, bristle=5e-3, viscous=1e-4,
              cogging=((42.0, 0.02, 0.4), (84.0, 0.008, 1.9), (126.0, 0.003, 0.2), (12.0, 0.002, 2.2))),
        (0.3, 0.2, 0.4), _motor,
        ("--map", "time=time_us:us,position=theta_deg:deg,current=iq_mA:mA", "--torque-constant", "0.065"),
        (RIPPLE,),
        "cogging of 20 mN m at 42 a turn, 8 at its double, 3 at its triple, 2 at 12; friction of 6 mN m",
        seconds=8.0, turns=(0.22, 0.15, 0.3), noise={"torque": 2e-4},
    ),
}  # fmt: skip
"""What is bought or built, over four decades of torque."""
