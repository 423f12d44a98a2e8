"""How the headline came about: the squared score as a table that adds up, and every addition on the way."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby, pairwise
from typing import Any

from fingerlab.core.text import (
    amount,
    decimals_for,
    estimate_text,
    fixed,
    percent,
    printed,
    score_decimals,
    score_text,
    screen_unit,
)
from fingerlab.diagnosis.answer.error_parts import EQUATIONS, EquationError, ExcludedByMotion, ScorePart
from fingerlab.diagnosis.answer.results import Candidate, Diagnosis
from fingerlab.diagnosis.score.calibration import Verdict
from fingerlab.diagnosis.settings import LACK_OF_FIT
from fingerlab.report.diagnosis_words import (
    FAMILY_TITLES,
    PHASE_WORDS,
    UNEXPLAINED,
    WORTH_A_DRAFT,
    called,
    called_in_sentence,
    effect_title,
    error_stays,
    in_sentence,
    indistinguishable,
    judged_on,
    listed,
    needless_title,
    on_the_path,
    shown_best_first,
    worth_adding,
)
from fingerlab.report.line_units import LineUnits
from fingerlab.report.parameter_words import held_words, parameter_title

EQUATION_NAMES = {name: one.name for name, one in EQUATIONS.items()} | {"tip_depth": "the tip's depth"}

ASIDE_WORDS = {
    "ramp": "start and edges",
    "slack": "cable slack",
    "standstill": "standstill",
    "spikes": "spikes",
    "gap": "lost",
}
"""Why a moment is left aside, in as few words as it can be said."""

WEIGHED_LESS = ("standstill",)
"""Of these, what is judged all the same, only less."""

ASIDE_HELP = {
    "ramp": "The start-up of a run, and the edges of filters and gaps: no equation is judged there.",
    "slack": "The cable may hang loose: its length counts by 0.1 mm there, or not at all.",
    "standstill": "The motor stands: weighed less there, for friction that sticks may hold any torque.",
    "spikes": "Single samples far off their neighbours were put on the line between those.",
    "gap": "Samples that were lost: bridged where they were few, else left out.",
}
"""What that means."""

LARGEST_PARTS = 3
"""So many parts of a score are named in a sentence; the rest is one number."""
WORTH_NAMING = 0.05
"""Of the squared score; the floor is 1."""


def runs_words(runs: Sequence[str]) -> str:
    """``001``, ``001 to 004``."""
    return runs[0] if len(runs) == 1 else f"{runs[0]} to {runs[-1]}"


@dataclass(frozen=True)
class ScoreRow:
    """The runs of one motion: what each equation adds, in the columns' order (empty: it says nothing there).

    ``samples``: their share of all samples. ``aside``: what was left aside of them, with its share.
    ``values``: numbers of the cells; an equation may miss less than its floor.
    """

    runs: tuple[str, ...]
    title: str
    samples: str
    cells: tuple[str, ...]
    values: tuple[float, ...]
    together: str
    aside: str


@dataclass(frozen=True)
class ScoreTable:
    """Cells sum to the last row and column, and with ``floor`` to ``squared``, digit by digit.

    ``equations``: ids of the columns; ``titles`` of these.
    """

    equations: tuple[str, ...]
    titles: tuple[str, ...]
    rows: tuple[ScoreRow, ...]
    sums: tuple[str, ...]
    together: str
    floor: str
    squared: str


def score_table(diagnosis: Diagnosis) -> ScoreTable | None:
    """The squared score by runs and equations; None where its parts are not known."""
    parts = diagnosis.score_parts
    if not parts:
        return None
    equations = tuple(name for name in EQUATION_NAMES if any(part.equation == name for part in parts))
    decimals = max(3 - math.floor(math.log10(max(diagnosis.score**2, 1.0))), 0)
    unit = 10.0**-decimals
    steps = list(zip(parts, apportioned([part.squared for part in parts], unit), strict=True))

    def sum_of(chosen: Sequence[tuple[ScorePart, int]]) -> float:
        return sum(count for _, count in chosen) * unit

    def sum_text(chosen: Sequence[tuple[ScorePart, int]]) -> str:
        return fixed(sum_of(chosen), decimals)

    rows = []
    for (runs, phase, cable), group in groupby(steps, lambda step: _motion(step[0])):
        mine = list(group)
        cells = {name: [step for step in mine if step[0].equation == name] for name in equations}
        how = [PHASE_WORDS.get(phase, phase), *([] if cable == "none" else [cable])]
        rows.append(
            ScoreRow(
                runs,
                f"{runs_words(runs)}, {', '.join(how)}",
                percent(mine[0][0].samples, counted=True),
                tuple(sum_text(cell) if cell else "" for cell in cells.values()),
                tuple(map(sum_of, cells.values())),
                sum_text(mine),
                _aside_words(
                    [one for one in diagnosis.excluded_by_motion if _motion(one) == (runs, phase, cable)]
                ),
            )
        )
    return ScoreTable(
        equations,
        tuple(EQUATION_NAMES[name][:1].upper() + EQUATION_NAMES[name][1:] for name in equations),
        tuple(rows),
        tuple(sum_text([step for step in steps if step[0].equation == name]) for name in equations),
        sum_text(steps),
        fixed(1.0, decimals),
        fixed(1.0 + sum(count for _, count in steps) * unit, decimals),
    )


def _motion(one: ScorePart | ExcludedByMotion) -> tuple[tuple[str, ...], str, str]:
    return one.runs, one.phase, one.cable


def apportioned(values: Sequence[float], step: float) -> list[int]:
    """Whole numbers of steps that sum to the rounded sum: each is rounded, the largest remainders up."""
    exact = [value / step for value in values]
    found = [math.floor(value) for value in exact]
    missing = round(sum(exact)) - sum(found)
    order = sorted(range(len(exact)), key=lambda k: found[k] - exact[k])
    for k in order[:missing]:
        found[k] += 1
    return found


def _aside_words(found: Sequence[ExcludedByMotion]) -> str:
    return ", ".join(aside_text(one.reason, one.share) for one in found)


def aside_text(reason: str, share: float) -> str:
    """Why, and how much of the time: ``cable slack 14 %``."""
    return f"{ASIDE_WORDS.get(reason, reason)} {percent(share, counted=True)}"


def score_sentence(diagnosis: Diagnosis) -> str:
    """What the squared error is the sum of, largest first; empty where that is not known, or one part."""
    parts = sorted(diagnosis.score_parts, key=lambda part: -part.squared)
    named = [part for part in parts[:LARGEST_PARTS] if part.squared > WORTH_NAMING]
    if not named or len(parts) == 1:
        return ""
    rest = sum(part.squared for part in parts) - sum(part.squared for part in named)
    # All to the same decimals, and so that the sentence adds up.
    decimals = score_decimals(diagnosis.score**2)
    unit = 10.0**-decimals
    steps = apportioned([*(part.squared for part in named), rest], unit)
    *each, others = (fixed(count * unit, decimals) for count in steps)
    said = ", ".join(f"{text} for {_part(part)}" for text, part in zip(each, named, strict=True))
    square = fixed(1.0 + sum(steps) * unit, decimals)
    whole = f"The square of this error, {square}, is the sum of 1 for the floor, {said}"
    return f"{whole}, and {others} for all other runs and equations."


def _part(part: ScorePart) -> str:
    many = "s" if len(part.runs) > 1 else ""
    return f"{EQUATION_NAMES.get(part.equation, part.equation)} in run{many} {runs_words(part.runs)}"


def aside_sentence(diagnosis: Diagnosis) -> str:
    """What share of the time is left aside, or weighed less, and why; empty where that is not known."""
    whole = sum(one.seconds / one.share for one in diagnosis.excluded_by_motion if one.reason == "ramp")
    if not whole > 0:
        return ""
    shares = {
        reason: sum(one.seconds for one in diagnosis.excluded_by_motion if one.reason == reason) / whole
        for reason in ASIDE_WORDS
    }
    said = {
        "ramp": "the start of the runs and the edges of filters",
        "slack": "the cable's length where it may hang loose",
    }
    found = [(words, shares[reason]) for reason, words in said.items() if shares[reason] > 0]
    text = [f"{words} ({percent(share, counted=True)})" for words, share in found]
    sentences = [f"Left aside of the time: {listed(text)}."] if text else []
    if shares["standstill"] > 0:
        still = percent(shares["standstill"], counted=True)
        sentences.append(f"Standstill ({still}) is weighed less, for friction may hold any torque there.")
    if shares["spikes"] > 0:
        spikes = percent(shares["spikes"], counted=True)
        sentences.append(
            f"Single samples that jump ({spikes} of the time) were put on the line between their neighbours."
        )
    return " ".join(sentences)


def loose_sentence(diagnosis: Diagnosis) -> str:
    """Why the cable's length may be many floors off where the whole is near the floor; empty where it is not.

    A family's error counts every sample in full, the score hardly those at which the cable may hang loose.
    """
    loose = [one for one in diagnosis.run_shares if one.equation == "cable_kinematics" and one.left_aside > 0]
    if not (loose and "cable_kinematics" in _far_rows(diagnosis)):
        return ""
    worst = max(loose, key=lambda one: one.squared)
    return (
        "The cable's length is that far off where the cable may hang loose, as for "
        f"{percent(worst.left_aside, counted=True)} of run {worst.run}: its row counts these moments in "
        "full, the error over all equations by 0.1 mm or not at all."
    )


def rubbing_sentence(diagnosis: Diagnosis) -> str:
    """Why rows may stand many floors above a whole that is near its floor in contact; empty where none does.

    A third of what the tip's friction seems to be is noise to the score: no law tells how a tip sticks.
    """
    limit, far = FAR_ABOVE * diagnosis.score, _far_rows(diagnosis)
    apart = {k: one for k, one in far.items() if one.rmse < limit * math.hypot(one.floor, one.rubbing)}
    if not apart:
        return ""
    allowed = listed([amount(error.rubbing, error.unit, 2) for error in apart.values()])
    return (
        f"{_row_of(apart)} {'stands' if len(apart) == 1 else 'stand'} that far above the floor in contact: "
        f"how a tip sticks and rubs is known only about, and the error over all allows {allowed} rms for it, "
        "which the rows count in full."
    )


def unseen_sentence(diagnosis: Diagnosis) -> str:
    """Why rows may stand far above a whole that is near its floor: what only the runs left out could tell.

    A row takes the runs as the others foretell them; the score allows for how little the others tell.
    """
    apart = {k: one for k, one in _far_rows(diagnosis).items() if 0.0 < FAR_ABOVE * one.seen < one.rmse}
    if not apart:
        return ""
    seen = listed([amount(error.seen, error.unit, 2) for error in apart.values()])
    return (
        f"{_row_of(apart)} {'is' if len(apart) == 1 else 'are'} of runs as the other runs foretell them, "
        "which hardly tell some constants of these; the error over all allows for that. Where the fit has "
        f"seen all runs, {seen} are left."
    )


def _far_rows(diagnosis: Diagnosis) -> dict[str, EquationError]:
    """Families whose error is far above the whole, where the whole is near its floor."""
    if diagnosis.score**2 - 1.0 > LACK_OF_FIT:
        return {}
    limit = FAR_ABOVE * diagnosis.score
    return {name: error for name, error in diagnosis.errors.items() if error.rmse > limit * error.floor}


def _row_of(families: Collection[str]) -> str:
    titles = listed([in_sentence(FAMILY_TITLES.get(family, family)) for family in families])
    return f"The row of {titles}" if len(families) == 1 else f"The rows of {titles}"


def below_sentence(diagnosis: Diagnosis) -> str:
    """Why the whole is at the floor where every family is below it; empty where none is, or one is not."""
    times = [one.rmse / one.floor for one in diagnosis.errors.values() if one.floor > 0]
    if not times or max(times) > CLEARLY_BELOW:
        return ""
    return "What is below its floor counts as 1: a floor is no less than what a bench could ever read."


CLEARLY_BELOW = 0.9
"""Times the floor; above it rounding alone tells 1 from it."""
FAR_ABOVE = 1.5
"""Factor between a row's error, in floors, and that over all from which on a reader asks why; assumed."""


def apart_sentence(diagnosis: Diagnosis) -> str:
    """Why the one row of a motor alone is far from the error over all; empty where it is not."""
    found, errors = diagnosis.row_and_score, diagnosis.errors
    error = errors.get("motor_torque", errors.get("motor_force"))
    if found is None or error is None or not error.floor > 0:
        return ""
    row = error.rmse / error.floor
    whole = math.log(diagnosis.score / row)
    if abs(whole) < math.log(FAR_ABOVE):
        return ""
    said = {
        found.stuck: "the row counts in full the moments at which the motor sticks, where friction may hold "
        "any torque, and the error over all hardly counts them",
        found.runs: "the row's floor holds all that runs differ by, of which the error over all takes off "
        "only what friction of another size in each run would look like"
        if found.runs > 1.0
        else "the error over all takes off what friction of another size in each run would look like, and "
        "the row does not",
    }
    speaking = {math.log(factor) / whole: words for factor, words in said.items()}
    reasons = [speaking[share] for share in sorted(speaking, reverse=True) if share > A_REASON]
    if not reasons:
        return ""
    here = f"The error over all is {score_text(diagnosis.score)} floors and the row's {score_text(row)}, for "
    adds = " What adds up is the table “What the error is made of” of report and window."
    return f"{here}{'; and '.join(reasons)}.{adds if diagnosis.score_parts else ''}"


A_REASON = 0.25
"""Share of that factor's logarithm from which on a reason is told (assumed)."""


def row_words(diagnosis: Diagnosis) -> str:
    """Why rows of the table say other than the error over all; empty where none does."""
    said = (
        below_sentence(diagnosis),
        loose_sentence(diagnosis),
        unseen_sentence(diagnosis) or rubbing_sentence(diagnosis),
        apart_sentence(diagnosis),
    )
    return " ".join(filter(None, said))


def score_words(diagnosis: Diagnosis) -> str:
    """All of these sentences."""
    said = score_sentence(diagnosis), row_words(diagnosis), aside_sentence(diagnosis)
    return " ".join(filter(None, said))


@dataclass(frozen=True)
class StoryStep:
    """One step from model to model. Scores are errors on runs left out of the fit, in floors.

    Attributes:
        came, went: ids of the effects that were added, and of those that were given up.
        before, after: score. chance: probability that was given to what came, 0 to 1; None: not ranked.
        evidence: what spoke for it, in words of the diagnosis before the step.
        held: what was held from this step on, in words, where that changed.
        titles: what these effects are called as they were found, by id; others as in the catalogue.
    """

    came: tuple[str, ...]
    went: tuple[str, ...]
    before: float
    after: float
    chance: float | None
    evidence: str
    held: str = ""
    titles: Mapping[str, str] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """``Coulomb joint friction``, ``Stribeck friction in place of Coulomb friction``."""
        if self.held and not (self.came or self.went):
            return self.held[:1].upper() + self.held[1:]
        came, went = map(self._named, (self.came, self.went))
        if came and went:
            return f"{came} in place of {in_sentence(went)}"
        return came or f"{went} taken out"

    def _named(self, effects: Sequence[str]) -> str:
        titles = [self.titles.get(one) or effect_title(one) for one in effects]
        return listed([*titles[:1], *map(in_sentence, titles[1:])]) if titles else ""

    @property
    def row(self) -> tuple[str, str, str, str]:
        """Title, error before, error after, probability: for a table."""
        chance = "–" if self.chance is None else percent(self.chance)
        return self.title, score_text(self.before), score_text(self.after), chance

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "added": list(self.came), "removed": list(self.went), "score_before": self.before,
            "score": self.after, "probability": self.chance, "evidence": self.evidence,
            **({"held": self.held} if self.held else {}),
        }  # fmt: skip


def story(models: Sequence[Diagnosis]) -> tuple[StoryStep, ...]:
    """The steps between diagnoses of models in the order in which they were made."""
    return tuple(_step(before, now) for before, now in pairwise(models))


def evidence_for(effects: Sequence[str], before: Diagnosis) -> str:
    """What a diagnosis says for effects, each once; empty where it has not judged them."""
    return " ".join(printed(one.explanation) for one in _judged(effects, before))


def _judged(effects: Sequence[str], diagnosis: Diagnosis) -> list[Candidate]:
    by_id = {candidate.effect: candidate for candidate in diagnosis.candidates}
    return [by_id[effect] for effect in effects if effect in by_id]


def _step(before: Diagnosis, now: Diagnosis) -> StoryStep:
    came = tuple(effect for effect in now.model if effect not in before.model)
    went = tuple(effect for effect in before.model if effect not in now.model)
    judged = _judged(came[:1], before)
    return StoryStep(
        came,
        went,
        before.score,
        now.score,
        judged[0].probability if judged else None,
        evidence_for(came, before),
        "" if now.held == before.held else held_words(now.held, now.line_radius) or "nothing held any more",
        {name: on_the_path(now if name in came else before, name) for name in (*came, *went)},
    )


def error_rows_of_story(models: Sequence[Diagnosis]) -> list[tuple[str, ...]]:
    """Family, its error with each model in turn, its floor with the last, and the unit: for a table."""
    rows = []
    for family, last in models[-1].errors.items():
        errors = [model.errors.get(family) for model in models]
        unit = screen_unit(last.unit, max(*(one.rmse for one in errors if one is not None), last.floor))
        floor = last.floor * unit.factor
        decimals = decimals_for(floor / 3.0) if floor > 0 else 3
        shown = ["–" if one is None else fixed(one.rmse * unit.factor, decimals) for one in errors]
        rows.append((FAMILY_TITLES.get(family, family), *shown, fixed(floor, decimals), unit.symbol))
    return rows


def story_sentence(models: Sequence[Diagnosis]) -> str:
    """``The error ... went from 30.9 with the nominal model to 7.5 ... and 1.2 with``; empty: one model."""
    steps = story(models)
    if not steps:
        return ""
    clauses = [f"to {score_text(s.after)} with {in_sentence(s.title)}" for s in steps]
    return (
        f"The error on {judged_on(models[-1])} went from {score_text(models[0].score)} times the floor "
        f"with {'the nominal model' if not models[0].model else 'the first model'} {', then '.join(clauses)}."
    )


def path_sentence(diagnosis: Diagnosis) -> str:
    """What the error path says: how far each effect brings the error down, and what is left."""
    added = worth_adding(diagnosis)
    if not added:
        return "No effect earns its place, so the path ends where it begins."
    last = diagnosis.path[-1].score
    if error_stays(diagnosis):
        title = in_sentence(on_the_path(diagnosis, added[0]))
        return f"The error stays at {score_text(last)} with {title}: the rig's constants come back."
    steps = [
        f"{in_sentence(s.title or on_the_path(diagnosis, s.added))}{_instead(diagnosis, s.removed)} to "
        f"{score_text(s.score)}"
        for s in diagnosis.path
        if s.added is not None
    ]
    text = (
        f"From {score_text(diagnosis.path[0].score)} the error comes down with {', then with '.join(steps)}"
    )
    left = " What then remains above the floor is not explained." if last > UNEXPLAINED else ""
    left += " A law of it can be drafted (--draft, or Draft a law)." if last > WORTH_A_DRAFT else ""
    return f"{text}. No further effect earns its place.{left}"


def machine_sentence(diagnosis: Diagnosis, radius: float = 0.0) -> str:
    """Inertia and gains of a motor alone by the last model of the path, 90 %; empty beside a finger.

    Args:
        radius: of the arc as which a linear axis is told, m; 0: it turns.
    """
    found = diagnosis.final_parameters
    if "bench_inertia" not in found or any(name.startswith("arm_") for name in found):
        return ""
    titles = {key: parameter_title(key, list(found)) for key in found if key == "bench_inertia" or "." in key}
    line = LineUnits(radius)
    titles = {key: line.title(title) for key, title in titles.items()}
    words = [
        f"{title[0].lower()}{title[1:]} {estimate_text(line.estimate(found[key]))}"
        for key, title in titles.items()
    ]
    return f"The fitted machine: {'; '.join(words)} (90 %)."


def how_to_add(diagnosis: Diagnosis) -> str:
    """The options that take all of the path; where it begins with another effect than the verdict, why.

    Where the model holds an effect that it does not need, those that leave that one out.
    """
    added = worth_adding(diagnosis)
    if diagnosis.better is not None:
        return f"To exchange it: {_options(diagnosis.better.effects)}"
    if diagnosis.smaller is not None:
        kept = _options(diagnosis.smaller.effects) or "no --add"
        return f"To take {needless_title(diagnosis)} off: {kept}"
    if not added:
        return ""
    it = "it" if len(added) == 1 else "them"
    aim = f"put {it} into the model"
    if diagnosis.verdict == Verdict.NOT_IN_CATALOGUE:
        aim = (
            f"see what {'it leaves' if len(added) == 1 else 'they leave'}, though what is missing is another"
        )
    text = f"To {aim}: {_options((*diagnosis.model, *added))}"
    if diagnosis.verdict != Verdict.MISSING_EFFECT or not diagnosis.candidates:
        return text
    best = shown_best_first(diagnosis)[0]
    among_others = len(indistinguishable(diagnosis)) > 1 and added[0] in diagnosis.set
    if best.effect == added[0] or among_others:
        return text
    end, ours = score_text(diagnosis.path[-1].score), score_text(best.score)
    title = in_sentence(best.title)
    path = f"{called_in_sentence(diagnosis, added, on_the_path)}{' together' if len(added) > 1 else ''}"
    first = called_in_sentence(diagnosis, added[:1], on_the_path)
    why = f"The path begins with {first}, although {title} is likelier as the one effect"
    why += f": {path} leave{'s' * (len(added) == 1)} {end}, {title} alone {ours}"
    other = "" if best.effect in added else f" For that one: {_options((*diagnosis.model, best.effect))}"
    return f"{why}. {text}{'.' if other else ''}{other}"


def _options(effects: Sequence[str]) -> str:
    return " ".join(f"--add {name}" for name in effects)


def _instead(diagnosis: Diagnosis, removed: str | None) -> str:
    """In whose place a step of the path puts its effect; empty where it adds it."""
    return f" in place of {in_sentence(called(diagnosis, removed))}" if removed else ""
