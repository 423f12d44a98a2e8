"""Simulated sessions as files: written run by run, sealed where asked, revealed later.

A seal keeps an honest person honest: a look at the file's attributes does not give the effects away. It is
not cryptography; whoever reads this module can open it.
"""

from __future__ import annotations

import base64
import hashlib
import json
import secrets
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.plain_data import parsed, read_object
from fingerlab.sessions import Run, Session, SessionWriter, open_session
from fingerlab.sessions.model import CHANNEL_UNITS, ArrayReader
from fingerlab.twin.effects import EFFECTS, check_effects
from fingerlab.twin.protocols import RATE_HZ, Preset, RunPlan
from fingerlab.twin.recording import Recorded, simulate_session

SEALED = "sealed"
SIMULATION = "simulation"
NOTHING = 0.15
"""Probability that ``--hidden`` leaves the bench as the nominal model has it."""

STRENGTH_RANGE = (0.6, 1.6)
"""A hidden effect has between these times its default strength, evenly in the logarithm."""

DIGEST_CHARACTERS = 16
SEAL_CHARACTERS = 1200
MOST_SEALED = 1 << 16
"""Bytes of what is sealed."""
"""Every seal is filled up to this length, so that its length says nothing."""

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Written:
    """What was written: the file, its runs, seconds a run, and the seed (None where sealed)."""

    path: Path
    protocol: str
    runs: int
    seconds: float
    seed: int | None
    effects: Mapping[str, Mapping[str, float]] | None

    def to_json(self) -> dict[str, Any]:
        """For ``simulate --json``; a sealed session tells neither effect nor seed."""
        return {
            "session": str(self.path),
            "protocol": self.protocol,
            "runs": self.runs,
            "seconds": self.seconds,
            "seed": self.seed,
            "sealed": self.effects is None,
            "effects": None if self.effects is None else {k: dict(v) for k, v in self.effects.items()},
        }


def new_seed() -> int:
    """A seed that nobody has chosen."""
    return secrets.randbits(32)


def write_session(
    path: Path,
    preset: Preset,
    protocol: str,
    plans: Sequence[RunPlan],
    effects: Mapping[str, Mapping[str, float]],
    seed: int,
    hidden: bool = False,
    progress: Progress | None = None,
    practice: bool = False,
) -> Written:
    """Simulate the runs of ``plans`` and write them as one session.

    With ``hidden`` an effect is picked by the seed (or none) and sealed; the file then tells neither
    it nor the seed. With ``practice`` it is always an effect that the usual protocols show.

    Raises:
        UserError: the file exists already or cannot be written, or a run is impossible.
    """
    hidden = hidden or practice
    chosen = (
        pick_hidden([p.phase for p in plans], _hidden_rng(seed), practice)
        if hidden
        else check_effects(effects, "The call")
    )
    facts: dict[str, Any] = {"protocol": protocol, "preset": preset.name}
    if hidden:
        attributes = {SEALED: seal({**facts, "effects": chosen, "seed": seed})}
    else:
        facts |= {"effects": chosen, "seed": seed}
        attributes = {}
    attributes |= {SIMULATION: json.dumps(facts), "tags": json.dumps(["simulated"])}
    seconds = 0.0
    with SessionWriter(
        path, preset.rig, f"simulated session, {protocol} protocol", attributes=attributes, float32=True
    ) as writer:
        for k, run in enumerate(simulate_session(preset, plans, chosen, seed)):
            plan = run.plan
            writer.add_run(
                plan.phase,
                plan.cable,
                RATE_HZ,
                plan.trajectory,
                run.channels,
                {**plan.attributes, "complete": True},
            )
            seconds += len(run.channels["motor_command"]) / RATE_HZ
            if progress is not None:
                progress((k + 1) / len(plans), f"run {k + 1} of {len(plans)}")
    return Written(path, protocol, len(plans), seconds, None if hidden else seed, None if hidden else chosen)


def simulated_session(
    preset: Preset, protocol: str, plans: Sequence[RunPlan], seed: int, progress: Progress | None = None
) -> Session:
    """Simulate a session and keep it in memory, for an analysis that needs no file."""
    runs = []
    for k, recorded in enumerate(simulate_session(preset, plans, {}, seed)):
        runs.append(_run_in_memory(f"{k + 1:03d}", recorded))
        if progress is not None:
            progress((k + 1) / len(plans), f"run {k + 1} of {len(plans)}")
    name = f"{preset.name}, {protocol} protocol, seed {seed}"
    return Session(Path(name), name, "", preset.rig, tuple(runs))


def _run_in_memory(name: str, recorded: Recorded) -> Run:
    channels = dict(recorded.channels)
    length = len(channels["motor_command"])
    channels["time"] = np.arange(length) / RATE_HZ
    plan = recorded.plan
    return Run(
        name=name,
        phase=plan.phase,
        cable=plan.cable,
        sample_rate_hz=RATE_HZ,
        trajectory=plan.trajectory,
        length=length,
        units={channel: CHANNEL_UNITS[channel] for channel in channels},
        reader=ArrayReader(channels),
        attributes=plan.attributes,
    )


def reveal_session(path: Path) -> dict[str, Any]:
    """What a simulated session has that its nominal model has not, whether sealed or told openly.

    Returns:
        ``effects`` (id -> parameter -> value, SI), ``seed``, ``protocol``, ``preset``, ``sealed``.

    Raises:
        UserError: the file is no session, or not a simulated one, or its seal is damaged.
    """
    attributes = open_session(path).attributes
    if SEALED in attributes:
        return _with_effects(unseal(str(attributes[SEALED]), str(path)), path, sealed=True)
    if SIMULATION in attributes:
        text = attributes[SIMULATION]
        what = f"{path}, attribute '{SIMULATION}',"
        return _with_effects(read_object(text, what, "simulate the session again"), path, sealed=False)
    raise UserError(
        f"{path} was not simulated by FingerLab, so there is nothing to reveal; "
        f"give a session from 'simulate'."
    )


def _with_effects(revealed: dict[str, Any], path: Path, sealed: bool) -> dict[str, Any]:
    effects = revealed.get("effects")
    numbers = effects.values() if isinstance(effects, dict) else [None]
    if not all(isinstance(n, dict) and all(isinstance(v, int | float) for v in n.values()) for n in numbers):
        raise UserError(
            f"{path} was simulated, but does not say with which effects and numbers; simulate it again."
        )
    return {**revealed, "sealed": sealed}


def _hidden_rng(seed: int) -> np.random.Generator:
    """Independent of the bench and its noise: the same seed without ``hidden`` draws the same bench."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2**31,)))


def pick_hidden(
    phases: Sequence[str], rng: np.random.Generator, practice: bool = False
) -> dict[str, dict[str, float]]:
    """One effect that acts in at least one of ``phases``, all equally likely, or none.

    For ``practice`` always one of those that show, at its default strength or stronger.
    """
    possible = [e for e in EFFECTS.values() if e.phases & set(phases)]
    possible = [e for e in possible if e.practised] if practice else possible
    effect = possible[int(rng.integers(len(possible)))]
    weakest, strongest = STRENGTH_RANGE
    factor = float(np.exp(rng.uniform(*np.log((1.0 if practice else weakest, strongest)))))
    if rng.random() < NOTHING and not practice:
        return {}
    values = effect.defaults()
    first = effect.parameters[0]
    values[first.name] = float(np.clip(values[first.name] * factor, first.low, first.high))
    return {effect.id: values}


def seal(content: Mapping[str, Any]) -> str:
    """Seal a JSON object into text of constant length."""
    text = json.dumps(content, sort_keys=True).encode("utf-8")
    digest = hashlib.sha256(text).hexdigest()[:DIGEST_CHARACTERS]
    body = base64.b64encode(zlib.compress(text, 9)).decode("ascii")
    filler = hashlib.shake_256(text).hexdigest(SEAL_CHARACTERS // 2)
    return (digest + body + "." + filler)[:SEAL_CHARACTERS]


def unseal(text: str, where: str) -> dict[str, Any]:
    """Open a seal.

    Raises:
        UserError: the text is no seal, or was changed.
    """
    digest, body = text[:DIGEST_CHARACTERS], text[DIGEST_CHARACTERS:].partition(".")[0]
    try:
        content = zlib.decompressobj().decompress(base64.b64decode(body, validate=True), MOST_SEALED)
        if hashlib.sha256(content).hexdigest()[:DIGEST_CHARACTERS] != digest:
            raise ValueError("its digest does not match")
        result: dict[str, Any] = parsed(content.decode())
    except (ValueError, zlib.error) as error:
        raise UserError(f"The seal of {where} is damaged ({error}); simulate the session again.") from None
    return result
