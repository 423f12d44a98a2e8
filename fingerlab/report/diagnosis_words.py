"""A diagnosis in sentences, for terminal, page and window: plain words first, then numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import exp

from fingerlab.core.text import in_sentence as in_sentence
from fingerlab.core.text import listed as listed
from fingerlab.core.text import percent, score_text, significant
from fingerlab.diagnosis.answer.results import Candidate, Diagnosis, Failure, OtherModel
from fingerlab.diagnosis.score.calibration import Verdict
from fingerlab.diagnosis.settings import LACK_OF_FIT
from fingerlab.effects import CATALOGUE, find_effect
from fingerlab.report.parameter_words import held_words

Named = Callable[[Diagnosis, str], str]
"""What gives an effect's title in a diagnosis."""

FAMILY_TITLES = {
    "joint_torque": "Joint torque",
    "cable_kinematics": "Cable length",
    "motor_torque": "Motor torque",
    "motor_force": "Motor force",
    "endpoint_force": "Endpoint force",
}
"""Families of equations in an operator's words."""

PHASE_WORDS = {
    "on_air": "on air",
    "contact": "in contact",
    "motor_bench": "motor bench",
    "free": "free motion",
}

NOTHING_WORDS, UNKNOWN_WORDS = "Nothing missing", "Not in the catalogue"
"""The two outcomes that are no effect; both are results."""

WORTH_A_DRAFT = 3.0
"""Floors from which on a path's end leaves so much that the catalogue hardly holds what it is (assumed)."""
UNEXPLAINED = 1.25
"""From this multiple of the floor on, the page says that something is left; below it is scatter, assumed."""

NEARLY_AS_LIKELY = 1.1
"""Log odds (three to one) below which "True" is not said of one of two models; assumed."""

CLEARLY_BETTER = 3.0
"""Log odds (twenty to one) from which on one model is told from another without a further recording."""

IMPROBABLE = 0.01
"""Probability, as it is told, up to which an effect that is not ruled out is named apart from those that are
like each other; assumed."""

TWICE, TENTH = 2.0, 0.1
"""... and so is one that leaves so many times the error of the likeliest, and is so much less probable."""


def effect_title(effect: str) -> str:
    """An effect's title by its id."""
    one = find_effect(effect)
    return effect.replace("_", " ").capitalize() if one is None else one.title


def kept_titles(effects: Sequence[str], titles: Sequence[str] | None) -> tuple[str, ...]:
    """Titles of effects that a table keeps; by their ids where it keeps none, as older ones do."""
    if titles and len(titles) == len(effects):
        return tuple(titles)
    return tuple(map(effect_title, effects))


def called(diagnosis: Diagnosis, effect: str) -> str:
    """An effect's title as it was found in these recordings: what goes once a turn is a weight, no ripple.

    As a candidate first, then on the error path, then in the model as given.
    """
    found = [one.title for one in diagnosis.candidates if one.effect == effect]
    found += [step.title for step in diagnosis.path if step.added == effect and step.title]
    return next(iter(found), diagnosis.titles.get(effect) or effect_title(effect))


def on_the_path(diagnosis: Diagnosis, effect: str) -> str:
    """The same of an effect that the error path adds, or that the model at its end holds."""
    return diagnosis.titles.get(effect) or called(diagnosis, effect)


def called_in_sentence(diagnosis: Diagnosis, effects: Sequence[str], of: Named = called) -> str:
    """``Coulomb friction and cable stretch``, as effects were found.

    Args:
        of: what gives their titles, :func:`called` or :func:`on_the_path`.
    """
    return listed([in_sentence(of(diagnosis, effect)) for effect in effects])


def model_words(model: Sequence[str], diagnosis: Diagnosis | None = None) -> str:
    """``the nominal model``, or with what was put into it.

    Args:
        diagnosis: that found it; None: effects are called as in the catalogue.
    """
    titles = [effect_title(e) if diagnosis is None else on_the_path(diagnosis, e) for e in model]
    return "the nominal model" + (f" with {listed([in_sentence(t) for t in titles])}" if model else "")


def suspects(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Ids of the effects one of which is missing, as far as these data can tell; none where nothing is."""
    return () if diagnosis.verdict == Verdict.NOTHING_MISSING else diagnosis.set


def not_shown(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Where nothing is missing: ids of the effects that may be there all the same, unseen in these data."""
    return diagnosis.set if diagnosis.verdict == Verdict.NOTHING_MISSING else ()


def left_open(diagnosis: Diagnosis) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Where nothing is missing: ids of what these data could not have shown, and of what shows too weakly."""
    visible = {c.effect for c in diagnosis.candidates if c.detectable}
    unseen = not_shown(diagnosis)
    return tuple(e for e in unseen if e not in visible), tuple(e for e in unseen if e in visible)


def not_asked_sentence(diagnosis: Diagnosis) -> str:
    """Which effects were not tried, as no run of a finger has the force at its tip; empty where one has."""
    if "joint_torque" not in diagnosis.errors or "endpoint_force" in diagnosis.errors:
        return ""
    tried = {*(c.effect for c in diagnosis.candidates), *diagnosis.model}
    touching = [name for name, one in CATALOGUE.items() if "contact" in one.phases and name not in tried]
    if not touching:
        return ""
    names = listed([in_sentence(effect_title(name)) for name in touching])
    return f"No run tells the force at the fingertip, so these were not asked: {names}."


def hidden_sentence(diagnosis: Diagnosis) -> str:
    """What these data could not show besides what the other sentences name; empty where there is nothing."""
    named = {*not_shown(diagnosis), *suspects(diagnosis), *worth_adding(diagnosis)}
    hidden = tuple(c.effect for c in diagnosis.candidates if not c.detectable and c.effect not in named)
    if not hidden:
        return ""
    names = called_in_sentence(diagnosis, hidden)
    if not_shown(diagnosis):
        return f"Less likely, and as little to be seen in these data: {names}."
    return f"These data could not show, at a plausible strength: {names}."


def would_show(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Ids of the effects that the proposed run is about; the two outcomes that are no effect are left out."""
    proposal = diagnosis.next_experiment or {}
    outcomes = (Verdict.NOTHING_MISSING, Verdict.NOT_IN_CATALOGUE)
    return tuple(str(one) for one in proposal.get("separates") or () if one not in outcomes)


def shown_best_first(diagnosis: Diagnosis) -> tuple[Candidate, ...]:
    """The suspects in their order, then the others as ranked."""
    by_id, first = {c.effect: c for c in diagnosis.candidates}, suspects(diagnosis)
    leading = [by_id[effect] for effect in first if effect in by_id]
    return (*leading, *(c for c in diagnosis.candidates if c.effect not in first))


def suspected(diagnosis: Diagnosis) -> tuple[Candidate, ...]:
    """The candidates among the suspects, in their order."""
    return tuple(c for c in shown_best_first(diagnosis) if c.effect in suspects(diagnosis))


def _floor(diagnosis: Diagnosis) -> str:
    """What errors are told in multiples of."""
    return "the bench's own repeatability" if diagnosis.repeats else "its floor"


def alone(diagnosis: Diagnosis) -> bool:
    """Whether there is one run, which nothing could be left out of: the fit has seen what it is judged by."""
    return one_run(diagnosis) and not diagnosis.held_out_by_parts


def one_run(diagnosis: Diagnosis) -> bool:
    """Whether there is one run."""
    return [len(one.runs) for one in diagnosis.held_out] == [1]


def judged_on(diagnosis: Diagnosis) -> str:
    """What the errors are of: ``runs left out of the fit``."""
    if diagnosis.held_out_by_parts:
        return f"parts of the {'one run' if one_run(diagnosis) else 'runs'} left out of the fit"
    return "the one run there is, which the fit has seen," if alone(diagnosis) else "runs left out of the fit"


def how_judged(diagnosis: Diagnosis) -> str:
    """How the errors came about, in a sentence or two."""
    again = "record a second one to see whether the model holds."
    if alone(diagnosis):
        return f"There is one run, which the fit has seen: {again}"
    if not diagnosis.held_out_by_parts:
        return "Every run was left out of the fit once and then predicted."
    every = "Every part of it" if one_run(diagnosis) else "Every part of both runs"
    said = f"{every} was left out of the fit once and then predicted"
    return f"There is one run. {said}: {again}" if one_run(diagnosis) else f"{said}."


def floor_sentence(diagnosis: Diagnosis) -> str:
    """What the floor stands on where no repetition tells it; empty where one does."""
    if diagnosis.repeats:
        return ""
    some = "In some of these runs no motion" if diagnosis.partly_repeats else "No motion in these runs"
    return (
        f"{some} comes again, so that the floor is an estimate: what the best model leaves, or where that is "
        "less an all-purpose fit that knows no physics. The noise is at most that; a sine of a few cycles "
        "would tell it."
    )


def verdict_sentence(diagnosis: Diagnosis) -> str:
    """The answer in one plain sentence with its numbers; another where they stand on little."""
    return " ".join(
        filter(
            None,
            (
                _verdict_sentence(diagnosis),
                needless_sentence(diagnosis),
                floor_sentence(diagnosis),
                held_sentence(diagnosis),
            ),
        )
    )


def held_sentence(diagnosis: Diagnosis) -> str:
    """That all of it holds for what somebody held; empty where nothing was."""
    if not diagnosis.held:
        return ""
    return f"All of this is with {held_words(diagnosis.held, diagnosis.line_radius)}, by hand."


def _verdict_sentence(diagnosis: Diagnosis) -> str:
    model, score = model_words(diagnosis.model, diagnosis), score_text(diagnosis.score)
    error = f"its error on {judged_on(diagnosis)} is {score} times {_floor(diagnosis)}"
    if diagnosis.better is not None:
        judged = rival(diagnosis)
        chance = f"{percent(judged.probability)} probable, and " if judged is not None else ""
        return f"{better_sentence(diagnosis)} It is {chance}{_likelier(diagnosis.better.log_odds)}."
    if diagnosis.verdict == Verdict.NOTHING_MISSING:
        more = "Nothing more" if diagnosis.model else "Nothing"
        chance = percent(diagnosis.probability_nothing)
        hider = could_hide(diagnosis)
        if hider is not None:
            return (
                f"No effect is shown to be missing from {model}, but {in_sentence(hider.title)} could hide "
                f"({percent(hider.probability)} probable, that nothing is missing {chance}): {error}."
            )
        if not holds(diagnosis):
            return f"No effect is shown to be missing from {model} ({chance} probable), although {error}."
        if unsure(diagnosis):
            return (
                f"No effect is shown to be missing from {model}, but that none is has a probability of only "
                f"{chance}: {error}."
            )
        seen = " that these data could show" if not_shown(diagnosis) else ""
        return (
            f"{more} is missing from {model}{seen} ({chance} probable): {error}, and 1 is the best that "
            "can be."
        )
    if diagnosis.verdict == Verdict.NOT_IN_CATALOGUE or not diagnosis.candidates:
        chance = percent(diagnosis.probability_unknown)
        return (
            f"Something is missing from {model} that is not in the catalogue ({chance} probable): {error}"
            f"{_explained_in_part(diagnosis)}{unexplained_words(diagnosis)}.{kind_of_unknown(diagnosis)}"
        )
    best = shown_best_first(diagnosis)[0]
    several = len(indistinguishable(diagnosis)) > 1
    one = "At least one" if needed_together(diagnosis) else "One"
    fall = (
        f"with {'the first of them' if several else 'it'} the error on {judged_on(diagnosis)} falls "
        f"from {score} to {score_text(best.score)} times {_floor(diagnosis)}"
    )
    if error_stays(diagnosis):
        fall = f"{error} with it as well, and what speaks for it are the rig's constants"
    fall += _as_well(diagnosis, best)
    if several:
        alike = indistinguishable(diagnosis)
        together = percent(sum(c.probability for c in diagnosis.candidates if c.effect in alike))
        return (
            f"{one} of these is missing from {model} ({together} probable), and these data cannot tell "
            f"which: {called_in_sentence(diagnosis, alike)}; {fall}."
        )
    title, chance = in_sentence(best.title), percent(best.probability)
    return f"{title[:1].upper()}{title[1:]} is missing from {model} ({chance} probable): {fall}."


def kind_of_unknown(diagnosis: Diagnosis) -> str:
    """What kind of cause it is that no law of a motor's state tells; empty where nothing says so."""
    told = diagnosis.torque_noise
    if told is None:
        return ""
    share = percent(1.0 - told.share)
    if told.told_by == "memory":
        return (
            f" It depends on what came before: a law with memory tells {share} of what no law of angle, "
            "speed, acceleration and load does, as of a transmission that winds up, or has play."
        )
    if told.told_by == "runs":
        return (
            f" It differs from run to run: a law of each run's own tells {share} of what no law of all runs "
            "does, as of a mass, a friction or a gain that was another one."
        )
    return ""


def _explained_in_part(diagnosis: Diagnosis) -> str:
    """What the path explains of what is not in the catalogue; empty where it explains nothing."""
    added = worth_adding(diagnosis)
    if not added:
        return ""
    names, left = called_in_sentence(diagnosis, added, on_the_path), score_text(diagnosis.path[-1].score)
    return f"; {names} {'explain' if len(added) > 1 else 'explains'} a part of it, down to {left}"


def unexplained_words(diagnosis: Diagnosis) -> str:
    """The end of a sentence: that no effect explains what is missing, or what those of the path leave.

    Where one would explain it down to what a bench leaves, and is not borne out all the same, it is named.
    """
    effects = f"the {len(diagnosis.candidates)} effects tried"
    if worth_adding(diagnosis):
        return f", and none of {effects} explains what is left"
    best = min(diagnosis.candidates, key=lambda one: one.score, default=None)
    if best is None or best.score > UNEXPLAINED:
        return f", and none of {effects} explains it"
    return (
        f"; of {effects} {in_sentence(best.title)} comes nearest, with {score_text(best.score)} floors, and "
        f"is not borne out ({percent(best.probability)} probable)"
    )


def indistinguishable(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Of the effects that cannot be ruled out, the likeliest and those that are nearly as good as it.

    What is improbable, or a tenth as likely and leaves twice the error, could be told from it.
    """
    judged = {one.effect: one for one in diagnosis.candidates}
    first = judged.get(diagnosis.set[0]) if diagnosis.set else None
    if first is None:
        return diagnosis.set

    def alike(name: str) -> bool:
        one = judged.get(name, first)
        poor = one.score > TWICE * first.score and one.probability < TENTH * first.probability
        return round(100 * one.probability) > 100 * IMPROBABLE and not poor

    return (first.effect, *filter(alike, diagnosis.set[1:]))


def improbable_rivals(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Effects that cannot be ruled out although they are improbable, or leave much more than the others."""
    return tuple(name for name in diagnosis.set if name not in indistinguishable(diagnosis))


def could_hide(diagnosis: Diagnosis) -> Candidate | None:
    """Where nothing is missing: the likeliest effect, if it is likelier than that; None where it is not."""
    if diagnosis.verdict != Verdict.NOTHING_MISSING or not diagnosis.candidates:
        return None
    likeliest = max(diagnosis.candidates, key=lambda one: one.probability)
    return likeliest if likeliest.probability > diagnosis.probability_nothing else None


def unsure(diagnosis: Diagnosis) -> bool:
    """Whether nothing is missing by the verdict, and that is less probable than that something is."""
    return diagnosis.verdict == Verdict.NOTHING_MISSING and diagnosis.probability_nothing < EVEN


EVEN = 0.5
"""Probability from which on an answer is likelier than all others together."""


def holds(diagnosis: Diagnosis) -> bool:
    """Whether the model as given is all that these recordings call for, and leaves what a bench leaves."""
    return diagnosis.verdict == Verdict.NOTHING_MISSING and diagnosis.score <= UNEXPLAINED


def rivalled(diagnosis: Diagnosis) -> bool:
    """Whether a model with an effect exchanged is nearly as likely as the model as given."""
    return any(one.log_odds > -NEARLY_AS_LIKELY for one in diagnosis.as_good)


def rival(diagnosis: Diagnosis) -> Candidate | None:
    """The candidate that makes the better model; None where there is no such one among the candidates."""
    other = diagnosis.better
    if other is None:
        return None
    made = set(other.removed), set(other.added)
    return next((c for c in diagnosis.candidates if (set(c.replaces), {c.effect}) == made), None)


def better_chance(diagnosis: Diagnosis) -> float:
    """Probability of the better model: as the table tells it, else by its odds against the model as given."""
    judged = rival(diagnosis)
    if judged is not None:
        return judged.probability
    return 1.0 / (1.0 + exp(-diagnosis.better.log_odds)) if diagnosis.better is not None else 0.0


def exchange_words(other: OtherModel, diagnosis: Diagnosis) -> str:
    """``Stribeck friction in place of Coulomb friction``."""
    came, went = (called_in_sentence(diagnosis, names) for names in (other.added, other.removed))
    return f"{came} in place of {went}"


def better_sentence(diagnosis: Diagnosis) -> str:
    """That another model of the same recordings is better, and by how much; empty where none is."""
    other = diagnosis.better
    if other is None:
        return ""
    before, after = score_text(diagnosis.score), score_text(other.score)
    words = exchange_words(other, diagnosis)
    said = (
        f"leaves about the same error, {after} times {_floor(diagnosis)}, and is the likelier law"
        if after == before or other.score > diagnosis.score
        else f"takes the error on {judged_on(diagnosis)} from {before} to {after} times {_floor(diagnosis)}"
    )
    return f"Another model of these recordings is better: {words} {said}."


def needless_title(diagnosis: Diagnosis) -> str:
    """The effect that the model does not need, as it stands in a sentence; empty where it needs each."""
    smaller = diagnosis.smaller
    return "" if smaller is None else in_sentence(on_the_path(diagnosis, smaller.removed))


def needless_sentence(diagnosis: Diagnosis) -> str:
    """That the model does as well without one of its effects; empty where it needs each."""
    smaller = diagnosis.smaller
    if smaller is None:
        return ""
    after, before = score_text(smaller.score), score_text(diagnosis.score)
    times = f"times {_floor(diagnosis)}"
    stays = after == before
    said = f"stays at {before} {times}" if stays else f"is {after} instead of {before} {times}"
    why = "" if stays else ", too little to tell the two apart"
    title = on_the_path(diagnosis, smaller.removed)
    return f"{title} is not needed in the model: without it the error on {judged_on(diagnosis)} {said}{why}."


def as_good_sentence(diagnosis: Diagnosis) -> str:
    """Which other models these data cannot tell from the best one; empty where there are none."""
    if not diagnosis.as_good:
        return ""
    said = [f"{exchange_words(one, diagnosis)} ({score_text(one.score)})" for one in diagnosis.as_good]
    least = "the better model" if diagnosis.better is not None else model_words(diagnosis.model, diagnosis)
    return f"These data cannot tell {least} from one with {' or '.join(said)}."


def _likelier(log_odds: float) -> str:
    """How many times likelier, as far as that is worth a number."""
    times = exp(min(log_odds, 700.0))
    return "more than 1000 times as likely" if times > 1000.0 else f"{significant(times, 2)} times as likely"


def _as_well(diagnosis: Diagnosis, best: Candidate) -> str:
    """What else the error path adds, with the error that it ends at."""
    more = [effect for effect in worth_adding(diagnosis) if effect != best.effect]
    if not more:
        return ""
    names, end = called_in_sentence(diagnosis, more, on_the_path), score_text(diagnosis.path[-1].score)
    if best.effect not in worth_adding(diagnosis):  # the path is another one
        return f", and with {names} instead to {end}"
    return f", and with {names} as well to {end}"


def needed_together(diagnosis: Diagnosis) -> str:
    """The effects of a path that needs several, as they stand in a sentence; empty where one is enough."""
    added = worth_adding(diagnosis)
    if diagnosis.verdict != Verdict.MISSING_EFFECT or diagnosis.better is not None or len(added) < 2:
        return ""
    return called_in_sentence(diagnosis, added, on_the_path)


def set_sentence(diagnosis: Diagnosis) -> str:
    """What the data cannot tell apart, or could not have shown where nothing is missing."""
    if not_shown(diagnosis):
        hidden, weak = left_open(diagnosis)
        text = "These data leave open whether one of these is missing."
        unseen, seen = (called_in_sentence(diagnosis, names) for names in (hidden, weak))
        text += f" They could not have shown, at a plausible strength: {unseen}." if hidden else ""
        text += f" What they show of these is too weak to tell: {seen}." if weak else ""
        return " ".join(filter(None, (text, not_asked_sentence(diagnosis))))
    if diagnosis.set and diagnosis.verdict == Verdict.NOT_IN_CATALOGUE:
        names = called_in_sentence(diagnosis, diagnosis.set)
        return f"Stronger than is thought possible, it could still be one of these: {names}."
    besides = _outcomes_left_open(diagnosis)
    alike, others = indistinguishable(diagnosis), improbable_rivals(diagnosis)
    if len(diagnosis.set) > 1:
        same = called_in_sentence(diagnosis, alike)
        text = f"These data cannot tell apart {same}." if len(alike) > 1 else ""
        if others:
            named = listed(_judged(diagnosis, others))
            text = " ".join(filter(None, (text, f"Less likely, but not ruled out: {named}.")))
        if needed_together(diagnosis):
            return (
                f"{text} That is of effects one at a time; the path needs {needed_together(diagnosis)} "
                f"together.{besides}"
            )
        return (
            f"{text} The one that is truly missing is meant to be among these {len(diagnosis.set)} in 95 % "
            f"of such cases.{besides}"
        )
    if diagnosis.set:
        first = called(diagnosis, diagnosis.set[0])
        if needed_together(diagnosis):
            return (
                f"No single effect is told apart: the path needs {needed_together(diagnosis)} together. Of "
                f"effects one at a time {in_sentence(first)} is the likeliest.{besides}"
            )
        return f"{first} is told apart from every other effect of the catalogue.{besides}"
    if diagnosis.verdict == Verdict.NOTHING_MISSING:
        text = "No effect is called for, so there is nothing to tell apart."
        return " ".join(filter(None, (text, not_asked_sentence(diagnosis))))
    if worth_adding(diagnosis):
        return "What is left is of no effect of the catalogue, so there is nothing to tell apart."
    return "No effect of the catalogue is justified, so there is nothing to tell apart."


def _judged(diagnosis: Diagnosis, effects: Sequence[str]) -> list[str]:
    """Effects with their probability and the error that they leave: ``cable stretch (1 %, 12.3 floors)``."""
    by_id = {one.effect: one for one in diagnosis.candidates}
    return [
        f"{in_sentence(one.title)} ({percent(one.probability)}, {score_text(one.score)} floors)"
        for one in (by_id[name] for name in effects if name in by_id)
    ]


def _outcomes_left_open(diagnosis: Diagnosis) -> str:
    """Where an effect is missing: which of the two other answers cannot be ruled out; empty where none."""
    if diagnosis.calibration is None or diagnosis.verdict != Verdict.MISSING_EFFECT:
        return ""
    said = {
        Verdict.NOTHING_MISSING: "nothing is missing",
        Verdict.NOT_IN_CATALOGUE: "it is not in the catalogue",
    }
    if diagnosis.score**2 - 1.0 > LACK_OF_FIT:  # so much is left by no bench that lacks nothing
        del said[Verdict.NOTHING_MISSING]
    still = [words for name, words in said.items() if name in diagnosis.calibration.cannot_be_ruled_out]
    return f" Nor can it be ruled out that {' or that '.join(still)}." if still else ""


def calibration_sentence(diagnosis: Diagnosis) -> str:
    """What the probabilities were learned from, and how usual this session is; empty if unknown."""
    said = diagnosis.calibration
    if said is None or not said.fitted:
        return ""
    text = (
        f"The probabilities were fitted to {said.fitted} trials on simulated benches (table {said.version}); "
        f"in trials that were not fitted to they are off by {100 * said.error:.1f} percentage points on "
        f"average, and {percent(said.coverage)} of the sets hold the truth."
    )
    if not said.unusual:
        return f"{text} This session is like those: {percent(said.typicality)} of them are less usual."
    return (
        f"{text} This session is unlike nearly all of those: {'; '.join(said.unusual)}. So its probabilities "
        "were drawn towards one another and claim less."
    )


def error_stays(diagnosis: Diagnosis) -> bool:
    """Whether the effect that is missing does not bring the error down: the rig's constants tell it alone."""
    if diagnosis.verdict != Verdict.MISSING_EFFECT or len(diagnosis.path) != 2:
        return False
    before, after = diagnosis.path
    return score_text(before.score) == score_text(after.score)


def worth_adding(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Ids of the effects that the error path adds, in order."""
    return tuple(step.added for step in diagnosis.path if step.added is not None)


def failure_sentence(failure: Failure | None) -> str:
    """Where the model is furthest off."""
    if failure is None:
        return "No stretch stands out."
    text = failure.text.strip().rstrip(".")
    return f"{text[:1].upper()}{text[1:]}."
