"""One blind trial from bench to verdict: only files lie between what goes in and what is said."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from click.testing import CliRunner

from fingerlab.cli.main import cli
from fingerlab.diagnosis import DiagnosisOptions, diagnose
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.diagnosis.score.calibration import session_features
from fingerlab.prediction import fit_extended, predict_extended
from fingerlab.sessions import Session, open_session
from tests.hidden.sweep.trials import Trial

TOLD_CANDIDATES = 6
"""So many of the best candidates keep their probabilities in the results."""
LEAST_PROBABILITY = 1e-300
"""Odds are counted down to here; beyond, a probability is zero in double precision."""


def run(trial: Trial, recordings: Path | None = None, own_size: bool = False) -> dict[str, Any]:
    """Record, diagnose, and keep what was said; a failure is a result, too.

    Args:
        recordings: folder in which sessions of varied benches are kept, and taken from when they are there.
        own_size: leave varied benches at the thesis' size.

    With ``proposed``, the proposed experiment is recorded on the same bench wherever the set has more than
    one member or the first is wrong, and both sessions are diagnosed together: ``after``.
    """
    if trial.varied:
        return _run_varied(trial, recordings, own_size)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "session.h5"
        try:
            record(trial, path)
            first = diagnose(
                [open_session(path)], with_curves=False, options=DiagnosisOptions(left_out=trial.left_out)
            )
            result = {"trial": asdict(trial), **told(trial, first)}
            if len(trial.effects) < 2 and not trial.left_out:
                result["coverage"] = coverage(open_session(path), first)
            if trial.proposed and first.next_experiment is not None and not _settled(trial, first):
                result["after"] = after(trial, path, first)
        except Exception as error:  # the sweep goes on, and the table counts it as wrong
            return {"trial": asdict(trial), "failed": f"{type(error).__name__}: {error}"}
    return result


def _run_varied(trial: Trial, recordings: Path | None, own_size: bool) -> dict[str, Any]:
    """The same for a bench of the population: its session may be there already, and one diagnosis is made."""
    from tests.hidden.sweep.surroundings import open_varied, record_varied, surroundings

    about: dict[str, Any] = {"trial": asdict(trial), "surroundings": asdict(surroundings(trial))}
    with tempfile.TemporaryDirectory() as folder:
        kept = Path(folder) if recordings is None else recordings
        path = kept / f"{trial.seed}.h5"
        try:
            if not path.exists():
                record_varied(trial, path)
            session = open_session(path) if own_size else open_varied(trial, path)
            said = diagnose([session], with_curves=False, options=DiagnosisOptions(left_out=trial.left_out))
            return {**about, **told(trial, said), **features(session, said)}
        except Exception as error:  # the sweep goes on, and the table counts it as wrong
            return {**about, "failed": f"{type(error).__name__}: {error}"}


def _settled(trial: Trial, said: Diagnosis) -> bool:
    """Whether the true effect alone is in the set."""
    return tuple(said.set) == trial.effects


def record(trial: Trial, path: Path) -> None:
    if trial.source == "engine":
        from tests.hidden.engine.session import record

        record(path, trial.protocol, dict.fromkeys(trial.effects), trial.seed)
        return
    simulate("--protocol", trial.protocol, *asked(trial), "--seed", str(trial.seed), "--out", str(path))


def after(trial: Trial, path: Path, first: Diagnosis) -> dict[str, Any]:
    """The proposed run taken on the same bench, as its JSON stands, and the diagnosis of both sessions."""
    proposal, more = dict(first.next_experiment or {}), path.with_name("proposed.h5")
    simulate(
        *("--trajectory", json.dumps(proposal), *asked(trial)),
        *("--seed", str(trial.seed), "--out", str(more)),
    )
    both = diagnose(
        [open_session(path), open_session(more)],
        with_curves=False,
        options=DiagnosisOptions(left_out=trial.left_out),
    )
    separates = [str(name) for name in proposal["separates"]]
    if not set(separates) & set(trial.effects):  # of a truth that is not named its foremost rival counts
        separates = [*trial.effects, separates[-1] if separates[-1] == "nothing_missing" else separates[0]]
    return {
        **told(trial, both),
        "proposal": proposal,
        "expected": float(proposal["expected_separation"]),
        "gained": gained(trial, separates, first, both),
        "predicted": None if first.predicted is None else asdict(first.predicted),
        "odds": [plain_odds(first), plain_odds(both)],
    }


def gained(trial: Trial, separates: Sequence[str], before: Diagnosis, after: Diagnosis) -> float | None:
    """Log odds of the true effect against its rival that the proposed run brought; None: not among them."""
    true = [name for name in separates if name in trial.effects]
    if len(true) != 1:
        return None
    rival = next(name for name in separates if name not in trial.effects)
    return log_odds(after, true[0], rival) - log_odds(before, true[0], rival)


def log_odds(said: Diagnosis, one: str, other: str) -> float:
    """Of one effect against another, nats; limited by what a probability can hold."""
    told = {c.effect: c.probability for c in said.candidates} | {"nothing_missing": said.probability_nothing}
    known = {name: max(p, LEAST_PROBABILITY) for name, p in told.items()}
    return math.log(known.get(one, LEAST_PROBABILITY)) - math.log(known.get(other, LEAST_PROBABILITY))


def coverage(session: Session, said: Diagnosis) -> dict[str, float] | None:
    """How many of the held-out force samples lie in the 90 % interval of the final model, all contact runs.

    ``share`` 0 to 1, ``runs``, and the mean ``half_width``, N; None where no run has an interval.
    """
    if not any(run.phase == "contact" for run in session.runs):
        return None
    model = fit_extended([session], said.final_model)
    by_model = predict_extended(session, model, "the fitted model").runs
    runs = by_model.get("extended", by_model["nominal"])
    judged = [run for run in runs if run.held_out and math.isfinite(run.coverage)]
    if not judged:
        return None
    return {
        "share": float(np.mean([run.coverage for run in judged])),
        "runs": float(len(judged)),
        "half_width": float(np.mean([run.half_width for run in judged])),
    }


def asked(trial: Trial) -> list[str]:
    """The trial's effects as ``simulate`` takes them."""
    pairs = zip(trial.effects, trial.strengths, strict=True)
    return [word for name, k in pairs for word in ("--effect", f"{name}=x{k:.4f}")]


def simulate(*arguments: str) -> None:
    """``fingerlab simulate`` as a user would call it.

    Raises:
        RuntimeError: with the command's sentence, where it failed.
    """
    done = CliRunner().invoke(cli, ["simulate", *arguments])
    if done.exit_code != 0:
        raise RuntimeError(str(done.exception or done.output.strip().splitlines()[-1]))


def features(session: Session, said: Diagnosis) -> dict[str, Any]:
    """What a calibration is fitted to, so that it can be fitted again without a trial: odds and session."""
    usual, kind = session_features(session.runs, said.errors.values(), said.score, said.path[-1].score)
    return {"odds": plain_odds(said), "session": usual, "phases": kind}


def plain_odds(said: Diagnosis) -> dict[str, Any]:
    """The odds of a diagnosis before they are calibrated, as plain data."""
    odds = said.odds
    assert odds is not None
    return {
        "effects": list(odds.effects),
        "found": odds.found.tolist(),
        "hidden": odds.hidden.tolist(),
        "nothing": odds.nothing,
        "unknown": odds.unknown,
        "ruled_out": list(odds.ruled_out),
    }


def told(trial: Trial, said: Diagnosis) -> dict[str, Any]:
    """What a diagnosis said, as far as the tables need it."""
    order = [c.effect for c in said.candidates]
    known = {c.effect: c for c in said.candidates}
    kept = dict.fromkeys([*order[:TOLD_CANDIDATES], *(name for name in trial.effects if name in known)])
    proposal: Mapping[str, Any] = said.next_experiment or {}
    return {
        "verdict": said.verdict,
        "first": order[0] if order else "",
        "probability": said.candidates[0].probability if order else 0.0,
        "nothing": said.probability_nothing,
        "unknown": said.probability_unknown,
        "set": list(said.set),
        "ranks": [order.index(name) if name in order else -1 for name in trial.effects],
        "detectable": [name in known and known[name].detectable for name in trial.effects],
        "candidates": {name: [known[name].probability, known[name].score] for name in kept},
        "score": said.score,
        "path": [(step.added, step.score) for step in said.path],
        "proposal": dict(proposal) or None,
        "seconds": said.seconds,
    }
