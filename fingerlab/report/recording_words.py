"""Recordings in sentences: runs too short, a machine that was changed, and which run to record next."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from fingerlab.core.text import amount, listed, percent, run_names, score_text
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.diagnosis.score.calibration import Verdict
from fingerlab.report.diagnosis_words import (
    CLEARLY_BETTER,
    PHASE_WORDS,
    called_in_sentence,
    not_shown,
    would_show,
)
from fingerlab.rig.file import read_intervention
from fingerlab.sessions import Session, open_session
from fingerlab.sessions.trajectory import trajectory_words

NO_CHANCE = 0.005
"""Probability that is told as "< 1 %": no run is proposed for it."""

MOST_PAIRED_NAMES = 3
"""So many effects are named beside a pair's difference, those that tell it best."""

LEAST_PAIRED = 0.02
"""... and by so much of its floor better than the model as given; assumed."""


def short_runs_words(path: Path) -> str:
    """Which runs of a motor alone are too short for a diagnosis, and why; empty where none is.

    How long they have to be depends on the machine: what is logged or moves slowly is looked at slowly.
    """
    from fingerlab.diagnosis.settings import LEAST_RATE_HZ, SETTLING_SHARE, SHORTEST_STRETCH_S
    from fingerlab.diagnosis.signals.scales import LEAST_SECONDS, find_scales, reduced_run
    from fingerlab.diagnosis.signals.segments import is_too_short

    session = open_session(path)
    scales = find_scales([session])
    analysed = [(run, reduced_run(run, scales)) for run in session.runs if run.phase == "motor_bench"]
    short = [run for run, one in analysed if is_too_short(one)]
    if not short:
        return ""
    rate = min(run.sample_rate_hz for run, _ in analysed)
    by_rate = scales.time <= 2.0 ** math.ceil(math.log2(LEAST_RATE_HZ / rate) - 0.01)
    why = f"it is logged {rate:.3g} times a second" if by_rate else "it moves slowly"
    names = ", ".join(run.name for run in short[:5]) + (", ..." if len(short) > 5 else "")
    lasts = sorted(run.seconds for run in short)
    span = f"{lasts[0]:.1f}" if lasts[-1] - lasts[0] < 0.1 else f"{lasts[0]:.1f} to {lasts[-1]:.1f}"
    return (
        f"Run{'s' if len(short) > 1 else ''} {names} last{'' if len(short) > 1 else 's'} {span} s, too short "
        f"for a diagnosis: it leaves out {LEAST_SECONDS * SETTLING_SHARE * scales.time:.3g} s in which the "
        f"machine settles, and its filters need {SHORTEST_STRETCH_S * scales.time:.3g} s of what follows, so "
        f"that of this machine it needs {LEAST_SECONDS * scales.time:.3g} s a run, for {why}. "
        f"Record longer runs{', or log faster' if by_rate else ''}."
    )


def paired_sentence(diagnosis: Diagnosis) -> str:
    """What models make of runs before a known change of the machine and with it; empty without such."""
    sentences = []
    for pair in diagnosis.paired:
        where = f"Run {pair.before} and the same motion {pair.words} (run {pair.after}"
        where += f" of {Path(pair.sessions[1]).name})" if len(set(pair.sessions)) > 1 else ")"
        misses = f"the model as given misses their difference by {score_text(pair.score)} times its floor"
        each = sorted((k, n) for n, k in pair.with_effect.items() if k < pair.score - LEAST_PAIRED)
        best = [
            f"{called_in_sentence(diagnosis, [name])} by {score_text(score)}"
            for score, name in each[:MOST_PAIRED_NAMES]
        ]
        sentences.append(f"{where}: {misses}" + (f", with {listed(best)}." if best else "."))
    return " ".join(sentences)


def next_experiment_sentence(diagnosis: Diagnosis, radius: float = 0.0) -> str | None:
    """What to record next and what that would tell apart or show; None where nothing is called for.

    Args:
        radius: of the arc as which a linear axis is told, m, whose motion is told in mm; 0: it turns.
    """
    proposal = diagnosis.next_experiment
    if not proposal:
        return None
    phase, cable = str(proposal.get("phase") or ""), str(proposal.get("cable") or "none")
    run = _motion_words(proposal.get("trajectory"), radius)
    run += f", {PHASE_WORDS.get(phase, phase)}" if phase else ""
    run += f", {cable} cable" if cable != "none" else ""
    change = proposal.get("intervention")
    run += f", {read_intervention(change, 'The proposal').words()}" if change else ""
    purpose, alone = _purpose_words(diagnosis), proposal.get("chance_alone")
    text = f"Record next: {run}."
    text += f" {purpose}{_gain_words(proposal.get('expected_separation'))}." if purpose else ""
    if not isinstance(alone, int | float):
        return text
    if not run_proposed(diagnosis):
        return (
            f"No run is known that would settle it: after the best, {run}, the chance that the true one "
            f"stands alone is {percent(alone)}."
        )
    if diagnosis.verdict == Verdict.NOTHING_MISSING:
        return f"{text} The chance that the run settles that is {percent(alone)}."
    return f"{text} The chance that the true one then stands alone is {percent(alone)}."


def run_proposed(diagnosis: Diagnosis) -> bool:
    """Whether a run is proposed that has a chance to settle what is missing."""
    if not diagnosis.next_experiment:
        return False
    chance = diagnosis.next_experiment.get("chance_alone")
    return not (isinstance(chance, int | float) and chance < NO_CHANCE)


def next_experiment_words(diagnosis: Diagnosis, radius: float = 0.0) -> str:
    """What to record next, or that nothing is known to be worth recording; ``radius`` as of the sentence."""
    sentence = next_experiment_sentence(diagnosis, radius)
    if sentence is not None:
        return sentence
    if diagnosis.verdict == Verdict.NOTHING_MISSING and not not_shown(diagnosis):
        return "No further recording is called for."
    settled = diagnosis.better is None or diagnosis.better.log_odds > CLEARLY_BETTER
    if diagnosis.verdict == Verdict.MISSING_EFFECT and len(diagnosis.set) < 2 and settled:
        return "No further recording is needed to tell what is missing."
    return "No recording is known that would tell more."


def _purpose_words(diagnosis: Diagnosis) -> str:
    """What the proposed run would tell; one that looks for what was not seen separates it from nothing."""
    effects = would_show(diagnosis)
    if effects and diagnosis.verdict == Verdict.NOTHING_MISSING:
        return f"It would show {called_in_sentence(diagnosis, effects)}, if there"
    if len(effects) > 1:
        first, others = (called_in_sentence(diagnosis, part) for part in (effects[:1], effects[1:]))
        return f"It would tell {first} from {others}"
    return ""


def _motion_words(trajectory: object, radius: float) -> str:
    """The motor's motion, and the known load where there is one; along a line where ``radius``, m, is one."""
    if not isinstance(trajectory, Mapping):
        return str(trajectory or "a run")
    rest = dict(trajectory)
    load = rest.pop("load_torque", None)
    words = trajectory_words(rest, radius)
    if not isinstance(load, (int, float)) or load == 0:
        return words
    known = amount(load / radius, "N") if radius else amount(load, "N m")
    return f"{words}, against a known load of {known}"


def _gain_words(gain: object) -> str:
    """Expected gain in log evidence (nats), beside what it takes to decide."""
    if not isinstance(gain, (int, float)):
        return ""
    return f" (expected gain in log evidence {'over 100' if gain > 100 else f'{gain:.1f}'}; 5 decides)"


MOST_ABOVE = 4
"""Of runs that are told one by one above a figure."""


def recorded_words(sessions: Iterable[Session]) -> str:
    """Sessions by file and day, as they stand above a figure: ``bench.h5, recorded 2026-05-03``."""
    return " + ".join(f"{one.path.name}, recorded {one.created[:10]}" for one in sessions)


def figure_source(session: Session, model: str, runs: Sequence[str]) -> str:
    """What a figure is of, as it stands above it: session with its day, model, runs."""
    return f"{recorded_words([session])}; {model}; {run_names(runs, MOST_ABOVE)}"
