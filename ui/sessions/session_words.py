"""How the browser says what it knows."""

from __future__ import annotations

from datetime import datetime

from fingerlab.core.text import percent, score_text
from fingerlab.library.index import UNWRITTEN, SessionFacts
from fingerlab.library.notes import Verdict
from fingerlab.report.diagnosis_words import effect_title, in_sentence, listed
from fingerlab.sessions.model import Run
from fingerlab.sessions.trajectory import run_told

PHASE_WORDS = {"on_air": "on air", "contact": "contact", "motor_bench": "motor bench", "free": "free"}


def run_words(run: Run) -> str:
    """``Run 002 · on air, extension, sine, 15°, 1 Hz``."""
    cable = "" if run.cable == "none" else f", {run.cable}"
    return f"Run {run.name} · {PHASE_WORDS.get(run.phase, run.phase)}{cable}, {run_told(run)}"


def duration(seconds: float) -> str:
    """``42 s``, ``3 min 05 s``, ``10 h 00 min``."""
    whole = round(seconds)
    if whole < 60:
        return f"{seconds:.1f} s" if seconds < 10 else f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


def clock_time(when: datetime | None, stored: str) -> tuple[str, str]:
    """Date and time of day, both as stored: the clock that the lab notes were written by."""
    if when is None:
        return stored or "–", ""
    return f"{when:%Y-%m-%d}", f"{when:%H:%M:%S}"


def phases_text(facts: SessionFacts) -> str:
    """The phases, the first two by name."""
    words = [PHASE_WORDS.get(phase, phase) for phase in facts.phases]
    return "\n".join(words[:2]) + (f" +{len(words) - 2}" if len(words) > 2 else "")


def quality_text(facts: SessionFacts) -> str:
    """What is wrong with the recording, or that nothing is."""
    if facts.problem:
        known = next((words for words in (UNWRITTEN, "cut off") if words in facts.problem), None)
        return known or "✗ unreadable"
    if not facts.flags:
        return "✓ clean"
    return "\n".join(f"! {flag}" for flag in facts.flags[:2])


def verdict_text(verdict: Verdict | None) -> str:
    """The verdict in two lines, or nothing where no table holds one."""
    if verdict is None:
        return ""
    if verdict.effects and not unseen_in(verdict):
        # Several are those that the session cannot tell apart.
        words = " or ".join(effect_title(effect) for effect in verdict.effects)
    else:
        words = verdict.verdict.replace("_", " ")
    sure = "" if verdict.probability is None else percent(verdict.probability)
    return f"{words}\n{'outdated' if verdict.outdated else sure}"


def unseen_in(verdict: Verdict) -> tuple[str, ...]:
    """Where nothing is missing: ids of the effects that the session could not have shown."""
    return verdict.effects if verdict.verdict == "nothing_missing" else ()


def verdict_help(verdict: Verdict | None) -> str:
    """Where the verdict comes from."""
    if verdict is None:
        return "Not diagnosed yet: no table of 'fingerlab batch' in this folder holds it."
    error = "" if verdict.score is None else f" Final error: {score_text(verdict.score)} times the floor."
    old = " The session was written after the table." if verdict.outdated else ""
    unseen = [in_sentence(effect_title(effect)) for effect in unseen_in(verdict)]
    left = f" It leaves open, at a plausible strength: {listed(unseen)}." if unseen else ""
    return f"{' '.join(verdict_text(verdict).split())}, from {verdict.table.name}.{error}{left}{old}"
