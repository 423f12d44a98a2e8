"""A whole session of the second bench: what is wrong goes in, a file comes out."""

from __future__ import annotations

import dataclasses
import json
import math
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.sessions import SessionWriter

from .bench import NOMINAL, Bench, draw_bench
from .effects import EFFECTS
from .model import build
from .sensors import read
from .simulate import run
from .trajectories import RATE_HZ, command

CREATED = "2026-11-01T09:00:00+00:00"
POSTURE = (0.40, 0.36)  # rad, MCP and PIP where the finger meets the load cell; assumed
PRESS = {"kind": "sine", "frequency_hz": 1.0}
CONTACT_FORCE = 1.2  # N, mean force that the operator aims for; assumed
PRESS_AMPLITUDE_DEG = 2.0
APPROACH_DEG, APPROACH_DEG_S = 50.0, 10.0


@dataclasses.dataclass(frozen=True)
class Plan:
    """One run to take; a contact run's offset is found by an approach."""

    phase: str
    cable: str
    trajectory: dict[str, Any]


def _wave(kind: str, amplitude: float, frequency: float, offset: float, **more: Any) -> dict[str, Any]:
    return {"kind": kind, "amplitude_deg": amplitude, "frequency_hz": frequency, "offset_deg": offset, **more}


def _rich() -> list[Plan]:
    extension = [
        _wave("sine", 15.0, 1.0, 22.0),
        _wave("sine", 11.0, 0.5, 23.0),
        _wave("sine", 12.0, 2.0, 22.0),
        _wave("chirp", 11.0, 0.6, 22.0, end_frequency_hz=3.2),
        _wave("multisine", 16.0, 1.0, 23.0, frequencies_hz=[0.35, 0.8, 1.3, 2.1]),
        _wave("multisine", 14.0, 1.0, 25.0, frequencies_hz=[0.5, 1.1, 1.7, 2.9]),
        _wave("steps", 13.0, 0.7, 22.0, seed=3),
    ]
    flexion = [_wave("sine", 9.0, 1.0, 15.0), _wave("chirp", 8.0, 0.6, 15.0, end_frequency_hz=3.0)]
    return (
        [Plan("on_air", "extension", wave) for wave in extension]
        + [Plan("on_air", "flexion", wave) for wave in flexion]
        + [Plan("contact", "flexion", PRESS)] * 3
    )


def _thesis() -> list[Plan]:
    free = _wave("sine", 15.0, 1.0, 22.0)
    return [Plan("on_air", "extension", free)] * 10 + [Plan("contact", "flexion", PRESS)] * 10


PROTOCOLS = {"rich": (_rich, 20.0), "thesis": (_thesis, 30.0)}


def record(
    path: str | Path,
    protocol: str,
    effects: Mapping[str, float | None],
    seed: int,
    duration_s: float | None = None,
    kept: Sequence[int] | None = None,
) -> dict[str, Any]:
    """Take a session with the named effects in the bench.

    Args:
        path: file to write; must not exist. protocol: ``rich`` or ``thesis``.
        effects: catalogue id -> strength in the unit of ``effects.EFFECTS``, or None to draw one.
        seed: same seed, same bench, same noise. duration_s: of each run; 20 s and 30 s as a rule.
        kept: numbers of the protocol's runs that are taken; None: all.

    Returns:
        What was put in: protocol, seed, strength by effect, and the true bench.
    """
    bench, strengths, rng = bench_with(effects, seed)
    plans, seconds = PROTOCOLS[protocol]
    seconds = duration_s or seconds
    taken = plans() if kept is None else [plans()[i] for i in kept]
    press = find_press(bench)
    with SessionWriter(
        path, json.dumps(NOMINAL), f"second engine, {protocol}", created=CREATED, float32=True
    ) as writer:
        for plan in taken:
            wave = {**press, **plan.trajectory}
            wear = 1.0 + bench.wander * float(np.clip(rng.standard_normal(), -2, 2))
            channels = _take(bench, plan, command(wave, seconds), wear, rng)
            writer.add_run(plan.phase, plan.cable, RATE_HZ, wave, channels)
    return {
        "protocol": protocol,
        "seed": seed,
        "effects": strengths,
        "press": press,
        "bench": dataclasses.asdict(bench),
    }


def bench_with(
    effects: Mapping[str, float | None], seed: int
) -> tuple[Bench, dict[str, float], np.random.Generator]:
    """The bench of a seed with the named effects, their strengths, and what its runs are drawn by."""
    rng = np.random.default_rng([seed, 77])
    bench, strengths = draw_bench(rng), {}
    for name, value in effects.items():
        own = np.random.default_rng([seed, zlib.crc32(name.encode())])  # benches alike, effects not in step
        strengths[name] = EFFECTS[name].draw(own) if value is None else float(value)
        EFFECTS[name].change(bench, strengths[name], own)
    return bench, strengths, rng


def _take(
    bench: Bench, plan: Plan, wanted: np.ndarray, wear: float, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    built = build(bench, plan.cable, plan.phase == "contact", POSTURE, wear)
    return read(bench, run(bench, built, plan.cable, wanted, wear), wanted, rng)


def find_press(bench: Bench) -> dict[str, float]:
    """Offset of the contact runs, degrees at the pulley: where a slow approach meets the wanted force.

    Raises:
        RuntimeError: the finger does not press hard enough wherever the motor stands.
    """
    built = build(bench, "flexion", True, POSTURE, 1.0)
    approach = np.radians(np.arange(0.0, APPROACH_DEG, APPROACH_DEG_S / RATE_HZ))
    slow = run(bench, built, "flexion", approach, 1.0)
    reached = np.flatnonzero(slow.force > CONTACT_FORCE)
    if reached.size == 0:
        raise RuntimeError("the finger does not press hard enough on the load cell")
    return {"offset_deg": math.degrees(slow.motor[reached[0]]), "amplitude_deg": PRESS_AMPLITUDE_DEG}
