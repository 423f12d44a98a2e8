"""The drafted laws as everybody gets them: terms, coefficients, scores, and what cause it looks like."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from threadpoolctl import threadpool_limits

from fingerlab.core.errors import UserError
from fingerlab.core.progress import SILENT, Watch
from fingerlab.core.text import ParameterEstimate, estimate_text, listed, percent, score_text
from fingerlab.diagnosis.answer.curves import Display
from fingerlab.diagnosis.answer.results import Fingerprint
from fingerlab.diagnosis.draft.search import Draft, Law, draft
from fingerlab.diagnosis.draft.terms import ANGLE, PAIRED, PLACES, DraftTerm
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.settings import DRAFT_LEAST, DRAFT_LEAST_SHARE, Z90


@dataclass(frozen=True)
class LawTerm:
    """One term of a drafted law.

    Attributes:
        place: key of ``terms.PLACES``. where: the same in a sentence. words, latex: the function.
        variables: what it depends on. coefficients: SI, by name, with 90 % intervals.
        reduced: the coefficients in the units of the fit. term: what computes it.
    """

    place: str
    where: str
    words: str
    latex: str
    variables: tuple[str, ...]
    coefficients: Mapping[str, ParameterEstimate]
    reduced: Mapping[str, float]
    term: DraftTerm = field(repr=False)

    @property
    def sentence(self) -> str:
        """Where it acts and with what coefficients."""
        said = [estimate_text(one) for one in self.coefficients.values()]
        each, half = ", ".join(said), len(said) // 2
        if self.place in PAIRED:
            each = f"{', '.join(said[:half])} (MCP) and {', '.join(said[half:])} (PIP)"
        return f"{self.where}: {each} times {self.words}"


@dataclass(frozen=True)
class DraftLaw:
    """A law drafted from what a model leaves of its recordings.

    Attributes:
        terms: the most important first. beside: ids of the effects of the model that it stands beside.
        score_before, score: held-out error of that model without the law and with it, in floors.
        simpler: with its first term alone, the first two, and so on; the last is ``score``.
        catalogue: id of the effect of the catalogue that does best beside the model at the end of the path,
            or its last one. catalogue_score: held-out error with that, in the same floors.
        cause: a sentence on what kind of cause it looks like.
        fingerprint: what the model leaves and what the law tells of it; None where it was not asked for.
    """

    terms: tuple[LawTerm, ...]
    beside: tuple[str, ...]
    score_before: float
    score: float
    simpler: tuple[float, ...]
    catalogue: str | None
    catalogue_score: float
    cause: str
    law: Law = field(repr=False, compare=False)
    fingerprint: Fingerprint | None = field(default=None, repr=False, compare=False)

    @property
    def variables(self) -> tuple[str, ...]:
        """What the law depends on, the most important first."""
        return tuple(dict.fromkeys(v for term in self.terms for v in term.variables))

    @property
    def title(self) -> str:
        """What it is in a few words."""
        first = self.terms[0]
        more = f" and {len(self.terms) - 1} more" if len(self.terms) > 1 else ""
        return f"{first.where} by {first.words}{more}"

    @property
    def equation(self) -> str:
        """LaTeX that matplotlib's mathtext can draw, one line for each place."""
        lines: dict[str, list[str]] = {}
        for number, term in enumerate(self.terms, 1):
            subject = PLACES[term.place].subject
            lines.setdefault(subject, []).append(rf"C_{{{number}}}\,{term.latex}")
        return r", \qquad ".join(f"{subject} = {' + '.join(parts)}" for subject, parts in lines.items())

    @property
    def story(self) -> str:
        """All of it in words, with effects by their ids."""
        return self.told(str)

    def told(self, named: Callable[[str], str]) -> str:
        """Its terms, its error against those of the catalogue and of its own simpler forms, and its cause.

        Args:
            named: id of an effect -> what it is called.
        """
        beside = f" beside {', '.join(map(named, self.beside))}" if self.beside else ""
        lines = [f"  {term.sentence}" for term in self.terms]
        lines.append(
            f"  error on runs left out{beside}: {self.score_before:.2f} without it, "
            f"{', '.join(f'{score:.2f}' for score in self.simpler)} floors with "
            + ("it" if len(self.terms) == 1 else "its first term, then each further one")
            + f"; the catalogue's best: {self.catalogue_score:.2f}"
            + (f" ({named(self.catalogue)})" if self.catalogue else "")
        )
        return "\n".join([*lines, f"  {self.cause}"])

    def to_json(self) -> dict[str, Any]:
        """One of the objects under "draft"."""
        return {
            "terms": [
                {
                    "where": term.place,
                    "words": term.words,
                    "latex": term.latex,
                    "code": [term.term.code(part) for part in term.term.parts],
                    "variables": list(term.variables),
                    "coefficients": {name: vars(one) for name, one in term.coefficients.items()},
                }
                for term in self.terms
            ],
            "beside": list(self.beside),
            "score_before": self.score_before,
            "score": self.score,
            "simpler": list(self.simpler),
            "catalogue": {"effect": self.catalogue, "score": self.catalogue_score},
            "variables": list(self.variables),
            "cause": self.cause,
            "equation": self.equation,
        }


def draft_laws(
    reduction: Reduction,
    last: FittedModel | None,
    given: FittedModel | None,
    candidates: Sequence[str] = (),
    watch: Watch = SILENT,
    with_curves: bool = False,
) -> tuple[DraftLaw, ...]:
    """Two or three laws for what the last model leaves; none where it leaves what every bench does.

    Args:
        reduction: that was given to the diagnosis (``kept``). last, given: of that diagnosis.
        candidates: ids of the catalogue's effects, the best first; it is told what the law beats.
        with_curves: whether a plot of each is wanted.

    Raises:
        UserError: the diagnosis keeps no model, or a run cannot be read. Cancelled: the user asked for it.
    """
    if last is None or given is None:
        raise UserError("This diagnosis holds no fitted model; make it anew to draft a law from it.")
    models = [last] if last.effect_ids == given.effect_ids else [last, given]
    with threadpool_limits(limits=1, user_api="blas"):
        found = draft(reduction, models, candidates, watch)
        seen = [_seen_and_drafted(reduction, law) if with_curves else None for law in found.laws]
    each = zip(found.laws, seen, strict=True)
    return tuple(replace(_draft_law(found, law), fingerprint=curve) for law, curve in each)


def nothing_drafted(last: FittedModel | None) -> str:
    """Why no law is drafted beside the last model of a path."""
    score = 1.0 if last is None else last.score
    left = f"No law is drafted: the last model leaves {score_text(score)} floors"
    if score**2 - 1.0 <= DRAFT_LEAST:
        return f"{left}, no more than a bench does that misses nothing."
    return (
        f"{left}, but no term of the library explains {percent(DRAFT_LEAST_SHARE, True)} of their square "
        "on runs left out."
    )


def _seen_and_drafted(reduction: Reduction, law: Law) -> Fingerprint | None:
    """The remainder binned over what the law's first term is seen against, and the whole law's own curve."""
    display = Display()
    reduced = law.scorer.reduced
    reduction.shown(reduced.layout.effects, display.keep)
    first = law.fitted.choices[len(law.base.choices)].effect
    return display.fingerprint_between(reduced, first, law.base, law.fitted)


def _draft_law(found: Draft, law: Law) -> DraftLaw:
    terms = tuple(_term(law, term) for term in law.terms)
    return DraftLaw(
        terms=terms,
        beside=tuple(law.base.effect_ids),
        score_before=law.base.score,
        score=law.fitted.score,
        simpler=tuple(step.score for step in law.steps),
        catalogue=found.best,
        catalogue_score=found.best_score,
        cause=cause(terms),
        law=law,
    )


def _term(law: Law, term: DraftTerm) -> LawTerm:
    fitted, scales = law.fitted, law.fitted.model.layout.scales
    spread = fitted.fit.deviations_at(fitted.temperature())
    coefficients, reduced = {}, {}
    for gain, unit in zip(term.gains, term.units, strict=True):
        place = fitted.model.index[f"{term.id}.{gain}"]
        value, width = float(fitted.fit.values[place]), Z90 * float(spread[place])
        size = scales.of(unit)
        coefficients[gain] = ParameterEstimate(
            value * size, unit, (value - width) * size, (value + width) * size
        )
        reduced[gain] = value
    where = PLACES[term.place].title
    return LawTerm(
        term.place, where, term.words, term.parts[0].latex, term.variables, coefficients, reduced, term
    )


KINDS: tuple[tuple[tuple[str, ...], str, str], ...] = (
    (("motor phase",), "repeats with the motor", "teeth, poles or a gear that runs out"),
    (("end of travel",), "begins near an end of the travel", "a stop, or parts that meet there"),
    (("slack",), "acts while there is hardly any tension", "a cable that hangs loose"),
    (("lateness",), "comes late", "channels that are sampled or filtered later than the motor's"),
    (("past",), "remembers the past", "something that creeps, warms or lags"),
    (
        ("way since reversal",),
        "builds up on the way after each reversal",
        "play, or parts that give before they slide",
    ),
    (("tension", "load", "force"), "grows with load", "contact that is pressed together, or parts that give"),
    (("direction",), "depends on direction", "dry friction, or something that works one way"),
    (("joint speed", "motor speed"), "grows with speed", "a fluid, grease, or an eddy current"),
    (("joint acceleration", "motor acceleration"), "follows acceleration", "a mass that is not counted"),
    (("gravity",), "follows the posture to the vertical", "a weight"),
    (("other joint",), "couples the joints", "a tendon, skin or wire across both"),
    (
        ("joint angle", "motor angle"),
        "depends on the angle",
        "a spring, a lever that changes, or a sensor's error",
    ),
    (("time",), "changes over time", "drift or warming"),
)
"""Variables, what a law that depends on them does, and what does so; what comes first says more."""
SENSOR = "a sensor that reads false: its magnet off the axis, its calibration, its warming"
"""What an error of a reading looks like, whatever it depends on but lateness."""


def cause(terms: Iterable[LawTerm]) -> str:
    """A sentence on what kind of cause a law looks like, by its first term before the others."""
    first, *others = terms
    does, looks = _kinds(first)
    more = [say for term in others for say in _kinds(term)[0] if say not in does]
    sentence = f"The first term {listed(does)}: it looks like {looks}."
    return f"{sentence} Further terms: {listed(list(dict.fromkeys(more)))}." if more else sentence


def _kinds(term: LawTerm) -> tuple[list[str], str]:
    found = [(say, looks) for which, say, looks in KINDS if set(which) & set(term.variables)]
    false = PLACES[term.place].unit == ANGLE and "lateness" not in term.variables
    return [say for say, _ in found], SENSOR if false else found[0][1]
