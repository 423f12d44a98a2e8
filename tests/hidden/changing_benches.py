"""Benches that change from session to session: numbers with errors drawn at once, and simulated ones.

Nothing here comes from ``fingerlab/batch``, but for the names of a table's columns.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fingerlab.batch.table import Options, Task, diagnose_file
from fingerlab.sessions.model import Array
from fingerlab.twin.bench import draw_truth
from fingerlab.twin.effects import EFFECTS
from fingerlab.twin.protocols import PROTOCOLS, Preset, RunPlan, load_preset
from fingerlab.twin.session import write_session

Row = dict[str, Any]
KINDS = ("nothing", "step", "new", "gone", "wear", "warm_up", "odd")
START = datetime(2026, 3, 2, 9, tzinfo=UTC)
BENCH = {
    "param.arm_mcp@extension": ("m", 0.0105, 5e-5),
    "param.arm_pip@extension": ("m", 0.0085, 5e-5),
    "param.loss_mcp@extension": ("N m", 2e-4, 1e-4),
    "param.loss_pip@extension": ("N m", 1e-4, 7e-5),
    "param.offset@extension": ("m", 1.7e-3, 1e-4),
}
"""Unit, level and error of a session, of numbers that are always there; of a short session of the practice
bench."""
STRENGTHS = {
    "coulomb_friction.coulomb_mcp": ("N m", 2.5e-3, 2e-5),
    "coulomb_friction.coulomb_pip": ("N m", 1.8e-3, 2e-5),
    "viscous_friction.viscous_pip": ("N m s/rad", 2e-3, 1e-4),
    "motor_coulomb_friction.coulomb": ("N m", 5e-3, 3e-5),
    "motor_viscous_friction.viscous": ("N m s/rad", 1e-3, 3e-5),
}
"""The same of strengths of effects; the level is that of a bench that has the effect."""
SMALLEST, LARGEST = 3.0, 30.0
"""A change, in standard deviations by which sessions scatter; drawn evenly in the logarithm."""
FOUND = 0.9
"""Share of sessions in which an effect that is there is found missing; in the others it stays alone."""


@dataclass(frozen=True)
class Changing:
    """A sequence of sessions, and what was done to the bench.

    Attributes:
        kind: one of ``KINDS``. rows: as in a batch's table. units: of its columns. column: of the number that
            changed; empty: none. place: number of sessions before a step, or of the odd one; -1: none.
        size: of the change, SI. certain: size over the scatter of sessions.
    """

    kind: str
    rows: tuple[Row, ...]
    units: Mapping[str, str]
    column: str = ""
    place: int = -1
    size: float = 0.0
    certain: float = 0.0


def times(rng: np.random.Generator, count: int, sittings: bool) -> Array:
    """Days at which sessions are taken: one each time, or three or four in each of some sittings."""
    if not sittings:
        return np.cumsum(np.exp(rng.uniform(0.0, np.log(10.0), count)))
    days, day = [], 0.0
    while len(days) < count:
        day += float(rng.integers(1, 6))
        pauses = rng.uniform(15.0, 40.0, int(rng.integers(3, 5)))
        days += list(day + np.concatenate(([0.0], np.cumsum(pauses)[:-1])) / 1440.0)
    return np.array(days[:count])


def course_of(kind: str, rng: np.random.Generator, days: Array) -> tuple[Array, int]:
    """How much of the change every session has, and its place."""
    count = len(days)
    place, at = int(rng.integers(1, count)), np.arange(count)
    if kind in ("step", "new"):
        return (at >= place).astype(float), place
    if kind == "gone":
        return (at < place).astype(float), place
    if kind == "wear":
        pace = days - days[0] if rng.random() < 0.5 else at.astype(float)
        return pace / pace[-1], -1
    if kind == "warm_up":
        begins = np.concatenate(([True], np.diff(days) > 0.2))
        since = (days - days[begins][np.cumsum(begins) - 1]) * 1440.0
        return 1.0 - np.exp(-since / rng.uniform(10.0, 60.0)), -1
    if kind == "odd":
        place = int(rng.integers(0, count))
        return (at == place).astype(float), place
    return np.zeros(count), -1


def drawn(kind: str, seed: int, count: int, rough: bool = False) -> Changing:
    """A bench of ten numbers over some sessions, of which one changes, by its values and errors alone.

    Args:
        rough: sessions scatter with far tails (Student's t of 3 degrees of freedom, at the same variance),
            which no law foresees.
    """
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    days = times(rng, count, kind == "warm_up" or rng.random() < 0.3)
    strong = kind in ("new", "gone") or (kind in ("step", "wear", "warm_up") and rng.random() < 0.6)
    chosen = str(rng.choice(list(STRENGTHS if strong else BENCH)))
    shape, place = course_of(kind, rng, days)
    rows = [_row(k, day) for k, day in enumerate(days)]
    told: dict[str, Any] = {}
    for name, (_, level, error) in {**BENCH, **STRENGTHS}.items():
        error *= float(np.exp(rng.uniform(np.log(0.5), np.log(3.0))))
        own = float(rng.uniform(0.3, 1.0))
        scatter = error * float(np.exp(rng.uniform(np.log(0.1), np.log(2.0))))
        spread = float(np.hypot(own * error, scatter))
        usual = rng.standard_t(3.0, count) / np.sqrt(3.0) if rough else rng.standard_normal(count)
        noise = spread * usual
        common = np.sqrt(1.0 - own**2) * error * rng.standard_normal()
        change = np.zeros(count)
        if name == chosen and kind != "nothing":
            by = spread * float(np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST))))
            sign = 1.0 if kind in ("new", "gone") else float(rng.choice((-1.0, 1.0)))
            if strong and kind not in ("new", "gone"):
                by = min(by, 0.8 * level)
            change = sign * by * shape
            seen = sign * by * (float(shape.max()) if kind == "warm_up" else 1.0)
            told = {"size": -by if kind == "gone" else seen, "certain": abs(seen) / spread}
        if name in BENCH:
            _tell(rows, name, level + common + noise + change, error)
            continue
        here = name == chosen and (strong and kind != "nothing")
        base = level if here and kind not in ("new", "gone") else 0.0
        values = np.maximum(base + common + noise + change, 0.0)
        _tell(rows, f"alone.{name}", values, error)
        if here:
            _find(rows, name, base + change > 0, rng)
    column = (f"param.{chosen}" if strong else chosen) if kind != "nothing" else ""
    return Changing(kind, tuple(rows), units_of_bench(), column, place, **told)


def _row(number: int, day: float) -> Row:
    when = (START + timedelta(days=float(day))).isoformat()
    return {
        "session": f"s{number}.h5", "sha256": str(number), "created": when, "error": None, "score": 1.0,
        "final_score": 1.0, "final_model": [], "set": [], "recorded_seconds": 120.0,
    }  # fmt: skip


def _tell(rows: Sequence[Row], column: str, values: Array, error: float) -> None:
    for row, value in zip(rows, values, strict=True):
        half = 1.645 * error
        row |= {column: float(value), f"{column}.low": float(value - half)}
        row[f"{column}.high"] = float(value + half)


def _find(rows: Sequence[Row], name: str, there: Array, rng: np.random.Generator) -> None:
    """Where an effect is there, most sessions have it in their last model."""
    for row, present in zip(rows, there, strict=True):
        if present and rng.random() < FOUND:
            row["final_model"] = [name.partition(".")[0]]
            for end in ("", ".low", ".high"):
                row[f"param.{name}{end}"] = row[f"alone.{name}{end}"]


def units_of_bench() -> dict[str, str]:
    """Units of all columns of drawn benches."""
    every = {name: unit for name, (unit, _, _) in BENCH.items()}
    return every | {f"{kind}.{name}": unit for name, (unit, _, _) in STRENGTHS.items()
                    for kind in ("alone", "param")}  # fmt: skip


def drawn_pair(kind: str, seed: int, count: int) -> tuple[list[Row], list[Row], str]:
    """Sessions of two benches, and the effect that both have, alike ("same") or not ("differs"), or one."""
    rng = np.random.default_rng([seed, 77, len(kind)])
    name = str(rng.choice(list(STRENGTHS)))
    _, level, error = STRENGTHS[name]
    error *= float(np.exp(rng.uniform(np.log(0.5), np.log(3.0))))
    strength = level * float(np.exp(rng.uniform(np.log(0.3), np.log(1.6))))
    other = strength * float(np.exp(rng.choice((-1.0, 1.0)) * rng.uniform(np.log(1.4), np.log(4.0))))
    on = {"same": (strength, strength), "differs": (strength, other)}
    on |= {"first": (strength, 0.0), "second": (0.0, strength)}
    benches = []
    for side, present in zip(("left", "right"), on[kind], strict=True):
        rows = [_row(k, day) | {"session": f"{side}/s{k}.h5", "sha256": f"{side}{k}"}
                for k, day in enumerate(times(rng, count, False))]  # fmt: skip
        own = float(rng.uniform(0.3, 1.0))
        scatter = error * float(np.exp(rng.uniform(np.log(0.1), np.log(2.0))))
        common = np.sqrt(1.0 - own**2) * error * rng.standard_normal()
        noise = np.hypot(own * error, scatter) * rng.standard_normal(count)
        _tell(rows, f"alone.{name}", np.maximum(present + common + noise, 0.0), error)
        _find(rows, name, np.full(count, present > 0), rng)
        benches.append(rows)
    return benches[0], benches[1], name.partition(".")[0]


WEAKEST, STRONGEST = 0.25, 1.2
"""All strengths of a simulated sequence are multiplied by a number between these, evenly in the logarithm."""
RUNS, SECONDS = 8, 8.0
"""Runs on air of a simulated session, and seconds of each: short, so that a sequence takes half a minute."""


@dataclass(frozen=True)
class Plan:
    """What is done to a simulated bench: ``strengths`` are multiples of the effect's default, a session each;
    ``arms``: what its moment arms are multiplied by; ``days`` at which the sessions are taken."""

    kind: str
    effect: str
    strengths: tuple[float, ...]
    days: tuple[float, ...]
    place: int = -1
    arms: tuple[float, ...] = ()


def plans(seed: int) -> Iterator[Plan]:
    """The sequences of simulated sessions, what happens when drawn by the seed."""
    rng = np.random.default_rng(seed)

    def plan(kind: str, effect: str, ends: tuple[float, float] = (0.0, 1.0), arms: float = 1.0) -> Plan:
        count = int(rng.integers(6, 9))
        days = times(rng, count, kind == "warm_up")
        shape, place = course_of(kind, rng, days)
        if kind in ("step", "new", "gone"):  # two sessions on either side at least
            place = int(rng.integers(2, count - 1))
            shape = (np.arange(count) >= place).astype(float)
        size = float(np.exp(rng.uniform(np.log(WEAKEST), np.log(STRONGEST))))
        strengths = size * (ends[0] + (ends[1] - ends[0]) * shape) if effect else np.zeros(count)
        factors = 1.0 + size * (arms - 1.0) * shape if arms != 1.0 else np.ones(count)
        return Plan(kind, effect, tuple(strengths), tuple(days), place, tuple(factors))

    yield plan("nothing", "")
    yield plan("nothing", "")
    yield plan("new", "motor_coulomb_friction")
    yield plan("new", "coulomb_friction")
    yield plan("new", "viscous_friction")
    yield plan("gone", "motor_viscous_friction", (1.0, 0.0))
    yield plan("gone", "coulomb_friction", (1.0, 0.0))
    yield plan("step", "motor_coulomb_friction", (0.7, 1.3))
    yield plan("step", "", arms=1.06)
    yield plan("wear", "motor_coulomb_friction", (0.5, 1.8))
    yield plan("wear", "viscous_friction", (0.6, 1.8))
    yield plan("warm_up", "motor_viscous_friction", (1.6, 0.8))


def bench_of(seed: int, arms: float = 1.0) -> Preset:
    """The practice bench with its tolerances drawn once, so that every session has the same machine."""
    preset = load_preset()
    truth = draw_truth(preset, np.random.default_rng(seed))
    known = {**truth.factors, "sign": truth.sign, "phase": truth.phase}
    own = {cable: tuple(arms * arm for arm in pair) for cable, pair in truth.arms.items()}
    numbers = {**preset.numbers, "arms": {**own, "spread": 0.0}}
    numbers["contact"] = {**preset.numbers["contact"], "posture": truth.posture, "posture_spread": 0.0}
    return replace(preset, known=known, numbers=numbers)


def simulated(plan: Plan, seed: int, folder: Path, name: str = "s") -> list[Row]:
    """The sessions of a plan recorded on one simulated bench and diagnosed, each by itself."""
    rows = []
    for k, (strength, day) in enumerate(zip(plan.strengths, plan.days, strict=True)):
        path = folder / f"{name}{k}.h5"
        effects: dict[str, dict[str, float]] = {}
        if plan.effect and strength > 0:
            values, first = EFFECTS[plan.effect].defaults(), EFFECTS[plan.effect].parameters[0].name
            effects = {plan.effect: {**values, first: values[first] * strength}}
        bench = bench_of(seed, plan.arms[k] if plan.arms else 1.0)
        write_session(path, bench, "short", _runs(), effects, seed=1000 * seed + k)
        with h5py.File(path, "r+") as file:
            file.attrs["created"] = (START + timedelta(days=float(day))).isoformat()
        outcome = diagnose_file(Task(str(path), path.name), Options())
        rows.append(json.loads(json.dumps({**outcome.row, "units": outcome.units})))
        path.unlink()
    return rows


def _runs() -> list[RunPlan]:
    every = PROTOCOLS["on-air"](2.0)[:RUNS]
    return [RunPlan(p.phase, p.cable, {**p.trajectory, "duration_s": SECONDS}) for p in every]


def simulated_pairs(kind: str, effect: str, seed: int, folder: Path) -> list[Row]:
    """Three sessions each of two simulated benches, "left" and "right", as of :func:`drawn_pair`."""
    on = {"same": (1.0, 1.0), "differs": (0.6, 1.5), "first": (1.0, 0.0), "second": (0.0, 1.0)}[kind]
    rows = []
    for number, (side, strength) in enumerate(zip(("left", "right"), on, strict=True)):
        plan = Plan("nothing", effect, (strength,) * 3, (0.0, 2.0, 5.0))
        for row in simulated(plan, 2 * seed + number, folder, side):
            rows.append({**row, "session": f"{side}/{row['session']}"})
    return rows
