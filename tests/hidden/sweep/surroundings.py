"""A population of benches: what a trial's seed draws beside the effect, and how such a session is recorded.

Size, stiffness, rotor, tolerances, number and length of runs, rate, noise and dirt are drawn; either engine
takes the runs at the thesis' size, and ``disguise`` makes of them what a bench of that size and rate records.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from fingerlab.rig.file import Rig
from fingerlab.sessions import Run, Session, SessionWriter, open_session
from fingerlab.twin.effects import EFFECTS, parse_effects
from fingerlab.twin.plant import MOTOR_BENCH
from fingerlab.twin.protocols import PROTOCOLS, RATE_HZ, Preset, load_preset
from fingerlab.twin.recording import simulate_session
from tests.hidden.sweep.disguise import DIRT, Size, decimated, dirty, noisier, resized
from tests.hidden.sweep.trials import Trial

FINGER_PROTOCOLS = ("rich", "thesis", "short")
SHARES = {"rich": 0.4, "thesis": 0.25, "short": 0.25, "motor-bench": 0.1}
"""How often each protocol is drawn, where the effect acts in it."""
OF_THE_ENGINE = 0.25
"""Share of the trials that the second engine takes, where it has the effect."""
KINDS = {"nothing": 0.2, "outside": 0.06, "pairs": 0.08}
"""Share of benches with nothing missing, with an effect that the catalogue is without, and with two effects;
all others have one."""
DIRTY = 1.0 / 3.0
SECONDS = {"rich": (6.0, 14.0), "thesis": (8.0, 20.0), "short": (3.5, 8.0), "motor-bench": (6.0, 14.0)}
"""Length of a run, s, as the bench of the thesis' size moves; evenly in the logarithm."""


@dataclass(frozen=True)
class Surroundings:
    """What a trial's bench and session are, apart from its effects.

    Attributes:
        size: units of mass, length and time as multiples of the thesis' bench.
        springs, masses, rotor: multiples of the usual constants, told by the rig file.
        tolerance: multiple of the usual tolerances, told by the rig file.
        seconds: length of a run, before the unit of time. runs: share of the protocol's runs that is taken.
        every: of so many samples at 1 kHz one is kept. noise: multiple of the usual noise.
        dirt: kinds of ``disguise.DIRT``.
    """

    size: Size
    springs: float
    masses: float
    rotor: float
    tolerance: float
    seconds: float
    runs: float
    every: int
    noise: float
    dirt: tuple[str, ...]


def surroundings(trial: Trial) -> Surroundings:
    """Those of a trial; the same seed and protocol give the same."""
    rng = np.random.default_rng([trial.seed, 18])

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    # Mass over three decades, length over one, all times from a half to twice as long.
    size = Size(between(10**-1.5, 10**1.5), between(0.3, 3.0), between(0.5, 2.0))
    count = 1 + int(rng.random() < 0.3)
    dirt = tuple(rng.choice(DIRT, count, replace=False).tolist()) if rng.random() < DIRTY else ()
    return Surroundings(
        size=size,
        springs=between(0.75, 1.35),
        masses=between(0.75, 1.35),
        rotor=between(0.6, 1.6),
        tolerance=between(0.5, 2.0),
        seconds=between(*SECONDS[trial.protocol]),
        runs=float(rng.uniform(0.35, 1.0)),
        every=int(rng.choice([1, 2, 4, 8], p=[0.4, 0.25, 0.25, 0.1])),
        noise=between(1.0, 3.0),
        dirt=dirt,
    )


def population(first: int, count: int) -> Iterator[Trial]:
    """Trials of consecutive seeds from ``first`` on.

    Effects come in turn, each as often as the others within as many trials with one effect as there are.
    """
    ids = list(EFFECTS)
    for seed in range(first, first + count):
        rng = np.random.default_rng([seed, 19])
        kind = rng.choice(["one", *KINDS], p=[1.0 - sum(KINDS.values()), *KINDS.values()])
        effects: tuple[str, ...] = ()
        if kind in ("one", "outside"):
            effects = (ids[seed * 7 % len(ids)],)  # 7 has no divisor in common with their number
        elif kind == "pairs":
            effects = tuple(sorted(rng.choice(ids, 2, replace=False).tolist()))
        source, protocol = _where(effects, rng)
        yield Trial(source, protocol, effects, seed, effects if kind == "outside" else (), varied=True)


def _where(effects: Sequence[str], rng: np.random.Generator) -> tuple[str, str]:
    """Which engine takes the runs, and by which protocol."""
    from tests.hidden.engine.effects import EFFECTS as OWN

    possible = {name: share for name, share in SHARES.items() if name in FINGER_PROTOCOLS}
    source = "engine" if rng.random() < OF_THE_ENGINE and set(effects) <= set(OWN) else "twin"
    if source == "twin" and all(MOTOR_BENCH in EFFECTS[e].phases for e in effects):
        possible = SHARES
    weights = np.array(list(possible.values()))
    return source, str(rng.choice(list(possible), p=weights / weights.sum()))


def record_varied(trial: Trial, path: Path) -> None:
    """Write the session of a trial to ``path``, as a bench of the thesis' size records it."""
    around = surroundings(trial)
    rng = np.random.default_rng([trial.seed, 20])
    session = (_by_engine if trial.source == "engine" else _by_twin)(trial, around, rng)
    session = decimated(noisier(session, around.noise, rng), around.every)
    session = dirty(session, around.dirt, rng)
    write(session, path)


def open_varied(trial: Trial, path: Path) -> Session:
    """The session that ``record_varied`` wrote, at the trial's own size."""
    return resized(open_session(path), surroundings(trial).size)


def write(session: Session, path: Path) -> None:
    """A session in memory as a file."""
    told = {"simulation": '{"population": true}'}
    with SessionWriter(path, session.rig, session.title, attributes=told, float32=True) as writer:
        for run in session.runs:
            channels = run.load()
            writer.add_run(
                run.phase, run.cable, run.sample_rate_hz, dict(run.trajectory), channels, {"complete": True}
            )


def _taken(count: int, around: Surroundings, rng: np.random.Generator, least: int = 1) -> list[int]:
    """Numbers of the runs that are taken, in order."""
    wanted = max(round(count * around.runs), min(least, count))
    return sorted(rng.choice(count, wanted, replace=False).tolist())


def _by_twin(trial: Trial, around: Surroundings, rng: np.random.Generator) -> Session:
    preset = _preset(around)
    amplitude = preset.numbers["protocol"]["contact_amplitude_deg"]
    plans = PROTOCOLS["rich" if trial.protocol == "short" else trial.protocol](amplitude)
    plans = [plans[i] for i in _chosen([p.phase for p in plans], trial.protocol, around, rng)]
    timed = [replace(p, trajectory={**p.trajectory, "duration_s": around.seconds}) for p in plans]
    pairs = zip(trial.effects, trial.strengths, strict=True)
    effects = parse_effects([f"{name}=x{k:.4f}" for name, k in pairs])
    runs = [
        Run.from_arrays(
            r.channels, name=f"{k + 1:03d}", phase=r.plan.phase, cable=r.plan.cable,
            sample_rate_hz=RATE_HZ, trajectory=r.plan.trajectory,
        )
        for k, r in enumerate(simulate_session(preset, timed, effects, trial.seed))
    ]  # fmt: skip
    return Session(Path("memory"), "population", "", preset.rig, tuple(runs))


def _preset(around: Surroundings) -> Preset:
    usual = load_preset("practice")
    finger, motor, numbers = usual.rig.finger, usual.rig.motor, usual.numbers
    assert finger is not None
    assert motor.inertia is not None
    scaled = {
        name: value * (around.springs if name.endswith("stiffness") else around.masses)
        for name, value in asdict(finger).items()
        if name.endswith(("stiffness", "mass", "inertia"))
    }
    tolerance = {
        name: min(usual.rig.tolerance_of(name) * around.tolerance, 0.25)
        for name in (*asdict(finger), "torque_constant", "pulley_radius", "inertia")
        if name not in ("wrist_angle", "gravity")
    }
    rig = Rig(replace(finger, **scaled), replace(motor, inertia=motor.inertia * around.rotor), tolerance)
    own = {**numbers["motor"], "inertia": numbers["motor"]["inertia"] * around.rotor}
    return replace(usual, rig=rig, numbers={**numbers, "motor": own})


def _by_engine(trial: Trial, around: Surroundings, rng: np.random.Generator) -> Session:
    from tests.hidden.engine.session import PROTOCOLS as OWN
    from tests.hidden.engine.session import record

    protocol = "rich" if trial.protocol == "short" else trial.protocol
    plans = OWN[protocol][0]()
    kept = _chosen([p.phase for p in plans], trial.protocol, around, rng)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "engine.h5"
        record(path, protocol, dict.fromkeys(trial.effects), trial.seed, around.seconds, kept)
        session = open_session(path)
        runs = [
            Run.from_arrays(
                run.load(), name=run.name, phase=run.phase, cable=run.cable,
                sample_rate_hz=run.sample_rate_hz, trajectory=run.trajectory,
            )
            for run in session.runs
        ]  # fmt: skip
    return replace(session, runs=tuple(runs))


def _chosen(
    phases: Sequence[str], protocol: str, around: Surroundings, rng: np.random.Generator
) -> list[int]:
    """Which of a protocol's runs are taken: of each phase two at least, of a short session some three."""
    if protocol == "short":
        return sorted(rng.choice(len(phases), 1 + round(5 * around.runs), replace=False).tolist())
    kept: list[int] = []
    for phase in dict.fromkeys(phases):
        mine = [i for i, p in enumerate(phases) if p == phase]
        most = mine if protocol != "thesis" else mine[:4]  # more of the same motion tell hardly more
        kept += [most[i] for i in _taken(len(most), around, rng, least=2)]
    return kept
