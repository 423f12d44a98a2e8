"""Blind trials: what is put in, what the diagnosis says of the file alone, and whether that was right."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from click.testing import CliRunner

from fingerlab.cli.main import cli
from fingerlab.identify.diagnosis import diagnose
from fingerlab.identify.results import Diagnosis
from fingerlab.sessions import open_session

WEAKEST, STRONGEST = 0.6, 1.6
"""Strengths are drawn between these multiples of the simulated bench's default, evenly in their logarithm."""


@dataclass(frozen=True)
class Trial:
    """One blind trial.

    Attributes:
        source: ``twin`` or ``engine``. protocol: ``rich`` or ``thesis``.
        effects: ids put into the bench. seed: of the bench, its noise and the strengths.
        left_out: effects taken out of the catalogue, so that nothing in it is right.
        proposed: whether the proposed experiment is recorded too, and diagnosed with the session.
    """

    source: str
    protocol: str
    effects: tuple[str, ...]
    seed: int
    left_out: tuple[str, ...] = ()
    proposed: bool = False

    @property
    def key(self) -> str:
        return json.dumps(asdict(self), sort_keys=True)

    @property
    def strengths(self) -> list[float]:
        """Multiples of the default strength, one for each effect."""
        rng = np.random.default_rng([self.seed, len(self.effects), sum(map(ord, "".join(self.effects)))])
        return list(np.exp(rng.uniform(np.log(WEAKEST), np.log(STRONGEST), len(self.effects))))


def singles(source: str, protocol: str, ids: Sequence[str], seeds: Sequence[int]) -> Iterator[Trial]:
    """One effect each; under the thesis' protocol the proposed experiment follows."""
    for name in ids:
        for seed in seeds:
            yield Trial(source, protocol, (name,), seed, proposed=protocol == "thesis" and source == "twin")


def nothing(source: str, protocol: str, seeds: Sequence[int]) -> Iterator[Trial]:
    """Benches with nothing but noise and tolerances."""
    for seed in seeds:
        yield Trial(source, protocol, (), seed)


def pairs(source: str, ids: Sequence[str], count: int, seed: int) -> Iterator[Trial]:
    """Two effects each, drawn from all pairs."""
    every = list(combinations(ids, 2))
    chosen = np.random.default_rng(seed).permutation(len(every))[:count]
    for k in chosen:
        yield Trial(source, "rich", every[int(k)], seed + int(k))


def outside(source: str, ids: Sequence[str], seeds: Sequence[int]) -> Iterator[Trial]:
    """One effect each that the catalogue does not hold."""
    for name in ids:
        for seed in seeds:
            yield Trial(source, "rich", (name,), seed, left_out=(name,))


def run(trial: Trial) -> dict[str, Any]:
    """Record, diagnose, and compare with the truth; a failure is a result, too."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "session.h5"
        try:
            _record(trial, path)
            first = diagnose([open_session(path)], with_curves=False, left_out=trial.left_out)
            result = {"trial": asdict(trial), **_told(trial, first)}
            if trial.proposed and first.next_experiment is not None:
                more = Path(folder) / "proposed.h5"
                _record_proposed(trial, first.next_experiment, more)
                both = [open_session(path), open_session(more)]
                again = diagnose(both, with_curves=False, left_out=trial.left_out)
                result["after"] = _told(trial, again)
        except Exception as error:  # the sweep goes on, and the table counts it as wrong
            return {"trial": asdict(trial), "failed": f"{type(error).__name__}: {error}"}
    return result


def _record(trial: Trial, path: Path) -> None:
    if trial.source == "engine":
        from tests.hidden.engine.session import record

        record(path, trial.protocol, dict.fromkeys(trial.effects), trial.seed)
        return
    asked = [f"{name}=x{k:.4f}" for name, k in zip(trial.effects, trial.strengths, strict=True)]
    _simulate("--protocol", trial.protocol, *_effects(asked), "--seed", str(trial.seed), "--out", str(path))


def _record_proposed(trial: Trial, proposal: dict[str, Any], path: Path) -> None:
    asked = [f"{name}=x{k:.4f}" for name, k in zip(trial.effects, trial.strengths, strict=True)]
    _simulate(
        *("--trajectory", json.dumps(proposal["trajectory"]), "--phase", proposal["phase"]),
        *("--cable", proposal["cable"], *_effects(asked), "--seed", str(trial.seed), "--out", str(path)),
    )


def _effects(asked: Sequence[str]) -> list[str]:
    return [word for one in asked for word in ("--effect", one)]


def _simulate(*arguments: str) -> None:
    done = CliRunner().invoke(cli, ["simulate", *arguments])
    if done.exit_code != 0:
        raise RuntimeError(done.output.strip().splitlines()[-1])


def _told(trial: Trial, said: Diagnosis) -> dict[str, Any]:
    order = [c.effect for c in said.candidates]
    return {
        "verdict": said.verdict,
        "first": order[0] if order else "",
        "probability": said.candidates[0].probability if order else 0.0,
        "nothing": said.probability_nothing,
        "unknown": said.probability_unknown,
        "set": list(said.set),
        "ranks": [order.index(name) if name in order else -1 for name in trial.effects],
        "score": said.score,
        "path": [(step.added, step.score) for step in said.path],
        "proposal": (said.next_experiment or {}).get("phase"),
        "seconds": said.seconds,
    }
