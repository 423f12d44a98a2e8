"""The few words that the lab makes of a diagnosis, beside the sentences that the report shares. No Qt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from fingerlab.core.text import NO_BREAK, decimals_for, fixed, percent, score_text, screen_unit
from fingerlab.diagnosis.answer.error_parts import Comparison, EquationError
from fingerlab.diagnosis.answer.results import Candidate, Diagnosis, Failure
from fingerlab.diagnosis.score.calibration import Verdict
from fingerlab.report.diagnosis_words import (
    NOTHING_WORDS,
    PHASE_WORDS,
    UNKNOWN_WORDS,
    better_chance,
    called,
    could_hide,
    error_stays,
    exchange_words,
    held_sentence,
    holds,
    improbable_rivals,
    in_sentence,
    indistinguishable,
    left_open,
    listed,
    needed_together,
    needless_title,
    not_asked_sentence,
    not_shown,
    on_the_path,
    one_run,
    rivalled,
    unsure,
    worth_adding,
    would_show,
)
from fingerlab.report.documents import meaning
from fingerlab.rig.file import changed_words
from fingerlab.sessions.model import Session
from fingerlab.sessions.trajectory import trajectory_words

from .controller import ModelHistory

FLOOR_HELP, SCORE_HELP = meaning("floor"), meaning("score")


OUTCOME_TITLES: dict[str, str] = {
    Verdict.NOTHING_MISSING: NOTHING_WORDS,
    Verdict.NOT_IN_CATALOGUE: UNKNOWN_WORDS,
}
NAMED = 4
"""Effects that are named where room is short; the rest is counted, and marked in the list."""
RUN_KEYS = ("kind", "amplitude_deg", "frequency_hz")
"""What tells runs apart in a list; the rest of a trajectory is in the session file."""


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
    if diagnosis.verdict == Verdict.MISSING_EFFECT and diagnosis.candidates:
        return diagnosis.candidates[0].effect
    unknown = diagnosis.verdict == Verdict.NOT_IN_CATALOGUE
    return Verdict.NOT_IN_CATALOGUE if unknown else Verdict.NOTHING_MISSING


AS_GOOD_AS_SAID = 0.5
"""Probability below which a headline says that it names the likeliest alone."""


def verdict_headline(diagnosis: Diagnosis) -> str:
    """The verdict in as few words as it can be said."""
    with_held = f" (with {len(diagnosis.held)} held)" if diagnosis.held else ""
    return _verdict(diagnosis) + with_held


def _verdict(diagnosis: Diagnosis) -> str:
    if diagnosis.better is not None:
        chance = percent(better_chance(diagnosis)).replace(" ", NO_BREAK)
        return f"Rather {exchange_words(diagnosis.better, diagnosis)}, {chance}"
    if diagnosis.verdict == Verdict.NOTHING_MISSING:
        hider = could_hide(diagnosis)
        if hider is not None:
            chance = percent(hider.probability).replace(" ", NO_BREAK)
            return f"No effect is shown to be missing; {in_sentence(hider.title)} could hide, {chance}"
        if unsure(diagnosis):
            chance = percent(diagnosis.probability_nothing).replace(" ", NO_BREAK)
            return f"No effect is shown to be missing; that none is, {chance}"
        seen = " that these data could show" if not_shown(diagnosis) else ""
        return f"{'Nothing more' if diagnosis.model else 'Nothing'} is missing{seen}"
    if diagnosis.verdict == Verdict.NOT_IN_CATALOGUE:
        sure = diagnosis.probability_unknown >= AS_GOOD_AS_SAID
        chance = percent(diagnosis.probability_unknown).replace(" ", NO_BREAK)
        return f"What is missing {'is not' if sure else 'may not be'} in the catalogue, {chance}"
    best = diagnosis.candidates[0]
    sure = best.probability >= AS_GOOD_AS_SAID or len(indistinguishable(diagnosis)) < 2
    chance = percent(best.probability).replace(" ", NO_BREAK)
    return f"Missing{'' if sure else ', likeliest'}: {in_sentence(best.title)}, {chance}"


def set_words(diagnosis: Diagnosis) -> str:
    """Which effects these data cannot tell apart, or could not have shown where nothing is missing.

    And that the floor is no bench's own, where it is none.
    """
    some = "In some runs no motion" if diagnosis.partly_repeats else "No motion"
    floor = "" if diagnosis.repeats else f" {some} repeats: the floor is a bound."
    said = _set_words(diagnosis) + floor, held_sentence(diagnosis), _exchange_note(diagnosis)
    return " ".join(filter(None, said))


def bench_words(diagnosis: Diagnosis) -> tuple[str, str]:
    """What was found of the bench itself: the first of it, and all of it a line each; empty: nothing."""
    texts = [finding.text for finding in diagnosis.bench]
    if not texts:
        return "", ""
    more = f" And {len(texts) - 1} more." if len(texts) > 1 else ""
    return f"The bench: {texts[0]}{more}", "\n".join(texts)


def _set_words(diagnosis: Diagnosis) -> str:
    if not_shown(diagnosis):
        hidden, weak = left_open(diagnosis)
        text = f"They could not have shown: {_named(diagnosis, hidden)}." if hidden else ""
        text += f"{' ' if text else ''}Too weak to tell: {_named(diagnosis, weak)}." if weak else ""
        text = " ".join(filter(None, (text, not_asked_sentence(diagnosis))))
        shown = would_show(diagnosis)
        return f"{text} The proposed run would show {_named(diagnosis, shown)}." if shown else text
    titles = [in_sentence(called(diagnosis, name)) for name in indistinguishable(diagnosis)]
    others = [in_sentence(called(diagnosis, name)) for name in improbable_rivals(diagnosis)]
    also = f"Less likely, but not ruled out: {listed(others)}." if others else ""
    if also and len(titles) < 2:
        return also
    if diagnosis.better is not None and len(titles) < 2:
        return f"That the model is right as it is: {percent(diagnosis.probability_nothing)}."
    if len(titles) < 2:
        if diagnosis.verdict == Verdict.NOT_IN_CATALOGUE:
            what = "what the path leaves" if worth_adding(diagnosis) else "it"
            return f"None of the {len(diagnosis.candidates)} effects tried explains {what}."
        if titles and needed_together(diagnosis):
            return "Not enough by itself: the path needs several effects together."
        told = " The error stays: the rig's constants speak for it." if error_stays(diagnosis) else ""
        return f"Told apart from every other effect.{told}" if titles else "No effect is called for."
    return f"Cannot be told apart here: {listed(titles)}.{' ' if also else ''}{also}"


def _exchange_note(diagnosis: Diagnosis) -> str:
    """What the mark in the list says; empty where no effect of the model has a rival."""
    rivals = any(one.replaces for one in diagnosis.candidates)
    return f"{EXCHANGE_MARK}: in place of an effect of the model." if rivals else ""


EXCHANGE_MARK = "⇄"
"""Of an effect that would take the place of one of the model's."""


def set_help(diagnosis: Diagnosis) -> str:
    """Where the words on the set had to leave some out: all of them."""
    hidden = not_shown(diagnosis)
    titles = [in_sentence(called(diagnosis, name)) for name in hidden]
    return f"These data leave open: {listed(titles)}." if len(hidden) > NAMED else ""


def _named(diagnosis: Diagnosis, effects: Sequence[str]) -> str:
    titles = [in_sentence(called(diagnosis, effect)) for effect in effects]
    more = len(titles) - NAMED
    return listed(titles) if more <= 0 else listed([*titles[:NAMED], f"{more} more"])


def outcome_explanation(outcome: str, diagnosis: Diagnosis) -> str:
    """The evidence for one of the two outcomes that are no effect."""
    score = score_text(diagnosis.score)
    model = "The model" if diagnosis.model else "The nominal model"
    if outcome == Verdict.NOTHING_MISSING:
        chance = percent(diagnosis.probability_nothing)
        left = " What is left to it is what these data could not have shown." if not_shown(diagnosis) else ""
        return (
            f"{model} misses {_runs(diagnosis)} by {score} times what the bench itself repeats; 1.0 would be "
            f"perfect. Probability that no effect is missing: {chance}.{left}"
        )
    chance = percent(diagnosis.probability_unknown)
    return (
        f"{model} misses {_runs(diagnosis)} by {score} times the floor. Probability that the cause is none "
        f"of the {len(diagnosis.candidates)} effects tried: {chance}. The picture shows what is left over."
    )


def _runs(diagnosis: Diagnosis) -> str:
    return "the one run" if one_run(diagnosis) else "held-out runs"


def _holds_words(diagnosis: Diagnosis) -> str:
    if one_run(diagnosis):
        return "of this one run"
    if could_hide(diagnosis) is not None or unsure(diagnosis):
        return "perhaps, an effect could hide"
    return "yes, as far as seen" if not_shown(diagnosis) else "yes, on held-out runs"


def step_results(diagnosis: Diagnosis, history: ModelHistory) -> dict[str, str]:
    """What each of the five steps found, in a few words; a step not yet done is left out."""
    results = {"compare": f"error {score_text(diagnosis.score)} × floor"}
    results["where"] = failure_words(diagnosis.failure)
    if diagnosis.verdict == Verdict.MISSING_EFFECT:
        best = diagnosis.candidates[0]
        results["missing"] = f"{best.title} {percent(best.probability).replace(' ', NO_BREAK)}"
    elif diagnosis.verdict == Verdict.NOT_IN_CATALOGUE:
        results["missing"] = "not in the catalogue"
    elif (hider := could_hide(diagnosis)) is not None:
        chance = percent(hider.probability).replace(" ", NO_BREAK)
        results["missing"] = f"none shown; {in_sentence(hider.title)} could hide, {chance}"
    elif unsure(diagnosis):
        chance = percent(diagnosis.probability_nothing).replace(" ", NO_BREAK)
        results["missing"] = f"none shown; that none is, {chance}"
    else:
        seen = " that they could show" if not_shown(diagnosis) else ""
        results["missing"] = f"{'nothing more' if history.now.added else 'nothing'}{seen}"
    if history.now.added:
        results["add"] = " + ".join(on_the_path(diagnosis, effect) for effect in history.now.added)
    if diagnosis.better is not None:
        results["true"] = "no, another is better"
    elif diagnosis.smaller is not None:
        results["true"] = f"more than needed: {needless_title(diagnosis)}"
    elif rivalled(diagnosis) and diagnosis.verdict == Verdict.NOTHING_MISSING:
        results["true"] = "perhaps, as is another"
    elif holds(diagnosis):
        results["true"] = _holds_words(diagnosis)
    elif diagnosis.verdict == Verdict.NOTHING_MISSING:
        results["true"] = "too much is left"
    elif history.now.added or diagnosis.verdict == Verdict.NOT_IN_CATALOGUE:
        results["true"] = "not yet"
    return results


def error_texts(before: EquationError, now: EquationError) -> tuple[str, str, str, str]:
    """Error before, error now, floor and unit: one unit, and the digits that the floor calls for."""
    unit = screen_unit(now.unit, max(now.rmse, now.floor, before.rmse))
    decimals = min(decimals_for(now.floor * unit.factor * 0.3), 3)
    rmse_before, rmse_now, floor = (
        fixed(value * unit.factor, decimals) for value in (before.rmse, now.rmse, now.floor)
    )
    return rmse_before, rmse_now, floor, unit.symbol


def run_text(comparison: Comparison, session: Session | None, many: bool) -> str:
    """A run in the list: number, phase, cable, what the motor did."""
    parts = [PHASE_WORDS.get(comparison.phase, comparison.phase)]
    run = next((r for r in session.runs if r.name == comparison.run), None) if session else None
    if run is not None:
        if run.cable != "none":
            parts.append(run.cable)
        radius = session.rig.line_radius if session is not None else 0.0
        parts += filter(None, (motor_words(run.trajectory, radius), changed_words(run.attributes)))
    text = f"Run {comparison.run} · {', '.join(parts)}"
    return f"{session.path.stem}: {text}" if many and session is not None else text


def motor_words(trajectory: Mapping[str, Any], radius: float = 0.0) -> str:
    """What the motor was told: kind, amplitude, frequency; ``radius``, m, of a linear axis."""
    return trajectory_words({key: trajectory[key] for key in RUN_KEYS if key in trajectory}, radius)


def sessions_text(sessions: tuple[Session, ...]) -> str:
    """What is open: files and the number of runs by phase."""
    names = ", ".join(session.path.name for session in sessions)
    counts: dict[str, int] = {}
    for session in sessions:
        for run in session.runs:
            counts[run.phase] = counts.get(run.phase, 0) + 1
    total = sum(counts.values())
    counted = {PHASE_WORDS.get(phase, phase): count for phase, count in counts.items()}
    phases = ", ".join(f"{count} {words}" if len(counted) > 1 else words for words, count in counted.items())
    if not total:
        return f"{names} · no runs"
    return f"{names} · {total} run{'s' if total != 1 else ''}: {phases}"
