"""What a diagnosis says, as plain frozen objects; that of ``diagnose --json`` is made from them here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from fingerlab.diagnosis.answer.error_parts import (
    Budget,
    Comparison,
    EquationError,
    ExcludedByMotion,
    ExcludedTime,
    RowAndScore,
    RunShare,
    ScorePart,
)
from fingerlab.models.file import ParameterEstimate
from fingerlab.sessions.model import Array

if TYPE_CHECKING:
    from fingerlab.diagnosis.gram.reduction import Reduction
    from fingerlab.diagnosis.gram.run_constants import RunConstants
    from fingerlab.diagnosis.gram.sums import FloorFrom, TorqueNoise
    from fingerlab.diagnosis.score.calibration import CalibratedAnswer, Odds, Predicted, Verdict
    from fingerlab.diagnosis.score.fitted_model import FittedModel
    from fingerlab.diagnosis.signals.reading_errors import ReadingErrors, RunZeros


@dataclass(frozen=True)
class Fingerprint:
    """Residual of the model as given, binned over the coordinate in which an effect shows best.

    All arrays of shape (bins,). ``mean``, ``low``, ``high`` (90 % interval of the mean) and ``curve``
    (the fitted effect's own contribution in each bin) are in ``value_unit``.
    """

    equation: str
    coordinate: str
    coordinate_unit: str
    value_unit: str
    centre: Array
    mean: Array
    low: Array
    high: Array
    curve: Array


@dataclass(frozen=True)
class Candidate:
    """One effect of the catalogue, judged on these sessions.

    ``score`` is the whole model's with it added, in place of those that it ``replaces`` (ids), if any.
    ``at_bound``: a strength stands at the edge of what is allowed; beyond it, this could be what is missing.
    """

    effect: str
    title: str
    score: float
    probability: float
    in_set: bool
    parameters: Mapping[str, ParameterEstimate]
    equations: tuple[str, ...]
    explanation: str
    detectable: bool
    fingerprint: Fingerprint | None = None
    replaces: tuple[str, ...] = ()
    at_bound: bool = False


@dataclass(frozen=True)
class PathStep:
    """One step of the error path; ``added`` is None for the model as given, ``removed`` what it replaces.

    ``title``: what the added effect is called as it was found there; empty: as the catalogue calls it.
    """

    added: str | None
    score: float
    removed: str | None = None
    title: str = ""


@dataclass(frozen=True)
class OtherModel:
    """A model of the same recordings with given effects exchanged for others.

    Attributes:
        removed, added: ids of effects, against the model as given. effects: ids of all that it holds.
        score: held out, in the floors of the model as given.
        log_odds: against the model as given or, where that is likelier, the end of the path from it.
    """

    removed: tuple[str, ...]
    added: tuple[str, ...]
    effects: tuple[str, ...]
    score: float
    log_odds: float

    def to_json(self) -> dict[str, Any]:
        """The object "better_model" of ``diagnose --json``."""
        return {
            "remove": list(self.removed),
            "add": list(self.added),
            "score": self.score,
            "log_odds": self.log_odds,
        }


@dataclass(frozen=True)
class SmallerModel:
    """The model as given without an effect that it does not need.

    Attributes:
        removed: id of that effect. effects: ids of those that stay.
        score: held out, in the floors of the model as given.
    """

    removed: str
    effects: tuple[str, ...]
    score: float

    def to_json(self) -> dict[str, Any]:
        """The object "smaller_model" of ``diagnose --json``."""
        return {"remove": [self.removed], "score": self.score}


@dataclass(frozen=True)
class HeldOutRuns:
    """The model as given on runs that were told one motion, each left out of the fit that is scored on it.

    Attributes:
        runs: their names. phase, cable, trajectory: as in the session format. change: what of the machine was
            changed for them, in words.
        score: error over all equations in units of the floor; 1.0 is the floor.
    """

    runs: tuple[str, ...]
    phase: str
    cable: str
    trajectory: Mapping[str, Any]
    score: float
    change: str = ""


FINDINGS = {
    "moving_zero": "sensor_zero",
    "zero": "sensor_zero",
    "spikes": "outliers",
    "lost_samples": "gaps",
    "held": "gaps",
    "uneven_times": "gaps",
    "skew": "skew",
    "turned": "sense",
    "scale": "unit",
    "knock": "outliers",
    "rig_constant": "unit",
    "missing_channel": "dead_channel",
    "odd_run": "outliers",
}
"""Kinds of findings, and what ``diagnose --json`` calls them; the motor torque's zero is the amplifier's."""


@dataclass(frozen=True)
class BenchFinding:
    """What the recordings say of the bench itself, which is no matter of physics.

    Attributes:
        kind: "moving_zero", "zero", "spikes", "lost_samples", "uneven_times", "held", "skew", "turned",
            "scale", "knock", "rig_constant", "missing_channel", "odd_run".
        channel: that it is about, or "rig". size: how much of it, in ``unit``. runs: that show it.
        sentence: what was found. advice: what to do about it; both without a full stop.
    """

    kind: str
    channel: str
    size: float
    unit: str
    runs: tuple[str, ...]
    sentence: str
    advice: str

    @property
    def text(self) -> str:
        """Both as one sentence."""
        return f"{self.sentence}: {self.advice}."

    def to_json(self) -> dict[str, Any]:
        """The object "bench" of ``diagnose --json``."""
        amplifier = self.kind in ("zero", "moving_zero") and self.channel == "motor_torque"
        return {
            "finding": "amplifier_offset" if amplifier else FINDINGS[self.kind],
            "channel": self.channel,
            "size": {"value": self.size, "unit": self.unit},
            "sentence": f"{self.sentence}.",
            "advice": f"{self.advice[:1].upper()}{self.advice[1:]}.",
            "kind": self.kind,
            "runs": list(self.runs),
            "text": self.text,
        }


@dataclass(frozen=True)
class PairedDifference:
    """Two runs of one motion, before a known change of the machine and with it, and what models make of that.

    Attributes:
        before, after: names of the runs. sessions: that they are in.
        intervention: the change, SI, as the run tells it. words: the same in words.
        score: error of the model as given on the difference of the two, in its floors. with_effect: the same
            with an effect of the set, or of the path, by its id.
    """

    before: str
    after: str
    sessions: tuple[str, str]
    intervention: Mapping[str, float]
    words: str
    score: float
    with_effect: Mapping[str, float]


@dataclass(frozen=True)
class Failure:
    """Where the model fails worst, in words, with the stretch that shows it (seconds into a run).

    ``text`` is the whole sentence, ``moment`` only what the finger does there.
    """

    text: str
    equation: str
    run: str
    start: float
    stop: float
    session: str = ""
    moment: str = ""


@dataclass(frozen=True)
class FirstLook:
    """The model as given, before anything is looked for beside it: what can be told at once.

    Its floors are those of the answer before, and its effects may still stand on the points of their grids;
    the whole answer may tell it a little otherwise.

    Attributes:
        model: ids of its effects. score: error on held-out runs in floors. errors: by family of equations.
    """

    model: tuple[str, ...]
    score: float
    errors: Mapping[str, EquationError]


@dataclass(frozen=True)
class Diagnosis:
    """The answer to: which effect, if any, explains the reproducible part of what the model misses?

    ``parameters`` are those of the model as given, ``final_parameters`` those of ``final_model``: all
    unknowns, an effect's own as ``effect.gain``, those of a cable routing as ``name@routing``.
    ``held_out_by_parts``: the runs are few, and parts of them were left out of the fits.
    ``repeats``: motions of every kind of run came again, which tells the floor; else see ``score.floors``,
    and ``partly_repeats`` whether those of some kind did. ``floor_from``: what the floor rests on.
    ``better``: with given effects exchanged, and likelier than ``model`` and what may be missing beside it;
    the path leads there. ``as_good``: others that these data cannot tell from the best. ``smaller``: with one
    given effect taken off, which explains as much, where nothing is missing.
    ``calibration`` says what the probabilities were learned from, ``odds`` what they were before, and
    ``predicted`` what of the proposed run was.
    ``held``: unknowns that somebody held, by key, and their values, SI; all that is told holds only then.
    ``budget``: what the error of each family of equations is made of.
    ``row_and_score``: why the one row of a motor alone differs from ``score``; None beside a finger.
    ``titles``: what effects of the model as given, and of the path's end, are called as found, by id.
    ``fitted``: the model as given, as it was fitted; ``last``: the one at the end of the path.
    ``constants``: that every run has of its own; None: none were found. ``torque_noise``: how much
    is noise of what no law of the state tells of a motor's torque; the rest follows the past, or the run.
    ``reading_errors``: what was taken off the channels' readings, and ``run_zeros``: off the angles of single
    runs; both in reduced units. ``disagreeing``: session and name of runs that were left aside.
    ``line_radius``: m, of the arc of a linear axis, where what is shown is told along the line; 0: it is not.
    ``of_arc``: the same diagnosis about that arc, as it was worked out (``report/line_units.py``).
    """

    sessions: tuple[str, ...]
    model: tuple[str, ...]
    errors: Mapping[str, EquationError]
    score: float
    verdict: Verdict
    candidates: tuple[Candidate, ...]
    set: tuple[str, ...]
    path: tuple[PathStep, ...]
    final_model: tuple[str, ...]
    next_experiment: Mapping[str, Any] | None
    seconds: float
    probability_nothing: float = 0.0
    probability_unknown: float = 0.0
    parameters: Mapping[str, ParameterEstimate] = field(default_factory=dict)
    final_parameters: Mapping[str, ParameterEstimate] = field(default_factory=dict)
    comparisons: tuple[Comparison, ...] = ()
    failure: Failure | None = None
    held_out: tuple[HeldOutRuns, ...] = ()
    score_parts: tuple[ScorePart, ...] = ()
    excluded_by_motion: tuple[ExcludedByMotion, ...] = ()
    run_shares: tuple[RunShare, ...] = ()
    excluded_times: tuple[ExcludedTime, ...] = ()
    held_out_by_parts: bool = False
    repeats: bool = True
    partly_repeats: bool = False
    floor_from: FloorFrom = "cycles"
    bench: tuple[BenchFinding, ...] = ()
    better: OtherModel | None = None
    as_good: tuple[OtherModel, ...] = ()
    smaller: SmallerModel | None = None
    calibration: CalibratedAnswer | None = None
    odds: Odds | None = None
    predicted: Predicted | None = None
    paired: tuple[PairedDifference, ...] = ()
    held: Mapping[str, float] = field(default_factory=dict)
    budget: Mapping[str, Budget] = field(default_factory=dict)
    titles: Mapping[str, str] = field(default_factory=dict)
    row_and_score: RowAndScore | None = None
    fitted: FittedModel | None = field(default=None, repr=False, compare=False)
    last: FittedModel | None = field(default=None, repr=False, compare=False)
    constants: RunConstants | None = field(default=None, repr=False, compare=False)
    torque_noise: TorqueNoise | None = field(default=None, repr=False, compare=False)
    reading_errors: ReadingErrors = field(default_factory=dict, repr=False, compare=False)
    run_zeros: RunZeros = field(default_factory=dict, repr=False, compare=False)
    disagreeing: frozenset[tuple[str, str]] = field(default=frozenset(), repr=False, compare=False)
    line_radius: float = 0.0
    of_arc: Diagnosis | None = field(default=None, repr=False, compare=False)

    @property
    def computed(self) -> Diagnosis:
        """As it was worked out: what further work on the same fit begins with."""
        return self.of_arc or self

    def resume(self, reduction: Reduction) -> None:
        """Let a reduction of the same sessions go on from what this answer knows of the bench."""
        known = self.held, self.constants, self.torque_noise, self.reading_errors, self.run_zeros
        reduction.resume(*known, self.disagreeing)

    def to_json(self) -> dict[str, Any]:
        """The object that ``diagnose --json`` writes, ready for ``json.dumps``."""
        return {
            "schema": 1,
            "sessions": list(self.sessions),
            "model": list(self.model),
            "errors": {name: error.to_json() for name, error in self.errors.items()},
            "score": self.score,
            "verdict": self.verdict,
            "probability_nothing_missing": self.probability_nothing,
            "probability_not_in_catalogue": self.probability_unknown,
            "candidates": [
                {
                    "effect": c.effect,
                    "score": c.score,
                    "probability": c.probability,
                    "in_set": c.in_set,
                    "parameters": {name: vars(p) for name, p in c.parameters.items()},
                    "equations": list(c.equations),
                    "explanation": c.explanation,
                    "detectable": c.detectable,
                    **({"replaces": list(c.replaces)} if c.replaces else {}),
                    **({"at_bound": True} if c.at_bound else {}),
                }
                for c in self.candidates
            ],
            "set": list(self.set),
            "path": [
                {
                    "added": step.added,
                    **({"removed": step.removed} if step.removed else {}),
                    "score": step.score,
                }
                for step in self.path
            ],
            "final_model": list(self.final_model),
            "next_experiment": None if self.next_experiment is None else dict(self.next_experiment),
            "seconds": self.seconds,
            "floor_from_repetition": self.repeats,
            "floor_from": self.floor_from,
            "score_parts": [vars(part) | {"runs": [part.run]} for part in self.run_shares],
            "left_aside": [one.to_json() for one in self.excluded_times],
            "bench": [one.to_json() for one in self.bench],
            **({"paired": [asdict(one) for one in self.paired]} if self.paired else {}),
            "better_model": None if self.better is None else self.better.to_json(),
            "as_good_models": [one.to_json() for one in self.as_good],
            "smaller_model": None if self.smaller is None else self.smaller.to_json(),
            **({} if self.calibration is None else {"typical": self.calibration.typicality}),
            "calibration": None if self.calibration is None else self.calibration.to_json(),
            **({"held": dict(self.held)} if self.held else {}),
            **({"budget": {name: one.to_json() for name, one in self.budget.items()}} if self.budget else {}),
        }
