"""Sentences that the window makes of a diagnosis. No Qt, no numbers of its own."""

from __future__ import annotations

from fingerlab.identify.results import Candidate, Comparison, Diagnosis, EquationError, Failure
from fingerlab.sessions.model import Session

from fingerlab.report.screen import decimals_for, fixed, percent, score_text
from fingerlab.report.screen import ScreenUnit, screen_unit
from .history import History

NOTHING = "nothing_missing"
UNKNOWN = "not_in_catalogue"
NO_BREAK = "\u00a0"
OUTCOME_TITLES = {NOTHING: "Nothing missing", UNKNOWN: "Not in the catalogue"}
PHASES = {"on_air": "on air", "contact": "contact", "motor_bench": "motor bench", "free": "free"}


PROPER_NAMES = ("Coulomb", "Stribeck", "Dahl", "Maxwell")


def lower_first(title: str) -> str:
    """A title inside a sentence; one that starts with a name or an abbreviation keeps its capitals."""
    if title[:2].isupper() or title.startswith(PROPER_NAMES):
        return title
    return title[:1].lower() + title[1:]


def failure_words(failure: Failure | None) -> str:
    """What the finger does in the worst stretch; equation, run and time are seen beside it anyway."""
    if failure is None:
        return "no stretch stands out"
    place, _, words = failure.text.partition(": ")
    return (words or place).partition(";")[0].strip()


def find_candidate(diagnosis: Diagnosis, effect: str) -> Candidate | None:
    return next((c for c in diagnosis.candidates if c.effect == effect), None)


def best_choice(diagnosis: Diagnosis) -> str:
    """The effect id or outcome that the verdict names."""
    if diagnosis.verdict == "missing_effect" and diagnosis.candidates:
        return diagnosis.candidates[0].effect
    return UNKNOWN if diagnosis.verdict == UNKNOWN else NOTHING


def verdict_sentence(diagnosis: Diagnosis) -> str:
    """The verdict as a headline."""
    added = "Nothing more is missing" if diagnosis.model else "Nothing is missing"
    if diagnosis.verdict == NOTHING:
        return added
    if diagnosis.verdict == UNKNOWN:
        return "What is missing is not in the catalogue"
    best = diagnosis.candidates[0]
    return f"Missing: {lower_first(best.title)}, {percent(best.probability)}"


def set_sentence(diagnosis: Diagnosis) -> str:
    """Which effects these data cannot tell apart."""
    titles = [
        lower_first(c.title) for name in diagnosis.set if (c := find_candidate(diagnosis, name)) is not None
    ]
    if len(titles) < 2:
        return "Told apart from every other effect." if titles else "No effect is called for."
    return f"Cannot be told apart here: {', '.join(titles[:-1])} and {titles[-1]}."


def outcome_explanation(outcome: str, diagnosis: Diagnosis) -> str:
    """The evidence for one of the two outcomes that are no effect."""
    score = score_text(diagnosis.score)
    model = "The model" if diagnosis.model else "The nominal model"
    if outcome == NOTHING:
        chance = percent(diagnosis.probability_nothing)
        return (
            f"{model} misses held-out runs by {score} times what the bench itself repeats; 1.0 would be "
            f"perfect. Probability that no effect is missing: {chance}."
        )
    chance = percent(diagnosis.probability_unknown)
    return (
        f"{model} misses held-out runs by {score} times the floor. Probability that the cause is none of the "
        f"{len(diagnosis.candidates)} effects tried: {chance}. The picture shows what is left to explain."
    )


def step_results(diagnosis: Diagnosis, history: History) -> dict[str, str]:
    """What each of the five steps found, in a few words; a step not yet done is left out."""
    results = {"compare": f"error {score_text(diagnosis.score)} × floor"}
    results["where"] = failure_words(diagnosis.failure)
    if diagnosis.verdict == "missing_effect":
        best = diagnosis.candidates[0]
        results["missing"] = f"{best.title} {percent(best.probability).replace(' ', NO_BREAK)}"
    elif diagnosis.verdict == UNKNOWN:
        results["missing"] = "not in the catalogue"
    else:
        results["missing"] = "nothing more" if history.now.added else "nothing"
    if history.now.added:
        results["add"] = " + ".join(history.title(effect) for effect in history.now.added)
    if diagnosis.verdict == NOTHING:
        results["true"] = "yes, on held-out runs"
    elif history.now.added or diagnosis.verdict == UNKNOWN:
        results["true"] = "not yet"
    return results


def error_unit(error: EquationError, *more: EquationError) -> ScreenUnit:
    """One unit for all errors of one equation, so that before and after compare at a glance."""
    largest = max(max(e.rmse, e.floor) for e in (error, *more))
    return screen_unit(error.unit, largest)


def error_texts(before: EquationError, now: EquationError) -> tuple[str, str, str, str]:
    """Error before, error now, floor and unit, with the digits that the floor calls for."""
    unit = error_unit(now, before)
    decimals = min(decimals_for(now.floor * unit.factor * 0.3), 3)
    rmse_before, rmse_now, floor = (
        fixed(value * unit.factor, decimals) for value in (before.rmse, now.rmse, now.floor)
    )
    return rmse_before, rmse_now, floor, unit.symbol


def run_text(comparison: Comparison, session: Session | None, many: bool) -> str:
    """A run in the list: number, phase, cable, what the motor did."""
    parts = [PHASES.get(comparison.phase, comparison.phase)]
    run = next((r for r in session.runs if r.name == comparison.run), None) if session else None
    if run is not None:
        if run.cable != "none":
            parts.append(run.cable)
        trajectory = trajectory_text(dict(run.trajectory))
        if trajectory:
            parts.append(trajectory)
    text = f"Run {comparison.run} · {', '.join(parts)}"
    return f"{session.path.stem}: {text}" if many and session is not None else text


def trajectory_text(trajectory: dict[str, object]) -> str:
    """``sine 1 Hz, 15°``."""
    kind = str(trajectory.get("kind", "")).replace("_", " ")
    details = []
    frequency = _number(trajectory.get("frequency_hz"))
    if frequency is not None:
        details.append(f"{frequency:.3g} Hz")
    else:
        low, high = (_number(trajectory.get(key)) for key in ("start_hz", "stop_hz"))
        if low is not None and high is not None:
            details.append(f"{low:.3g} to {high:.3g} Hz")
    amplitude = _number(trajectory.get("amplitude_deg"))
    if amplitude is not None:
        details.append(f"{amplitude:.3g}°")
    return f"{kind} {', '.join(details)}".strip()


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def sessions_text(sessions: tuple[Session, ...]) -> str:
    """What is open: file, title and the number of runs by phase."""
    names = ", ".join(session.path.name for session in sessions)
    counts: dict[str, int] = {}
    for session in sessions:
        for run in session.runs:
            counts[run.phase] = counts.get(run.phase, 0) + 1
    total = sum(counts.values())
    phases = ", ".join(f"{count} {PHASES.get(phase, phase)}" for phase, count in counts.items())
    return f"{names} · {total} run{'s' if total != 1 else ''}: {phases}" if total else f"{names} · no runs"


def parameter_words(name: str) -> str:
    """A parameter's name in words."""
    words = name.removesuffix("_deg").split("_")
    capitals = {"mcp": "MCP", "pip": "PIP", "coulomb": "Coulomb", "stribeck": "Stribeck"}
    return " ".join(capitals.get(word, word) for word in words)


def next_experiment_text(diagnosis: Diagnosis, history: History) -> str:
    """What to record next, and what that would tell apart."""
    wanted = diagnosis.next_experiment
    if not wanted:
        if diagnosis.verdict == NOTHING:
            return "No further recording is called for."
        return "No recording is known that would tell more."
    raw = wanted.get("trajectory")
    trajectory = trajectory_text(raw) if isinstance(raw, dict) else str(raw or "")
    phase = PHASES.get(str(wanted.get("phase", "")), str(wanted.get("phase", "")))
    separates = wanted.get("separates") or ()
    names = [lower_first(history.title(str(effect))) for effect in separates]
    text = f"Record next: {trajectory or 'a run'}{', ' + phase if phase else ''}."
    return f"{text} It would tell apart {' and '.join(names)}." if len(names) > 1 else text
