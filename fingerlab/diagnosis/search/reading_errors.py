"""Channels that read late, as behind a filter, at another scale, or something where there is nothing.

A load cell behind its amplifier's filter lags behind the cable's torque and the joints, in contact alone;
angle sensors lag behind the motor's channels and the load cell; a current's lag, or its scale, is that of
every torque. No effect of a finger does what these do, and none can be judged beside them. So where the best
model leaves much, or such an error alone explains nearly all that the bare one does, it is taken off the
channel, and everything is searched anew.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import numpy as np

from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.bench_constants import is_borne_out
from fingerlab.diagnosis.score.fitted_model import FittedModel, at_found_shapes
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import lacks_fit
from fingerlab.diagnosis.search.grid_refinement import refine_grid
from fingerlab.diagnosis.settings import (
    FAR_LEFT,
    FOLLOWING_ROUNDS,
    HALF_LEFT,
    LAG_SHARE,
    LEAST_FALL,
    LEAST_FALL_BEYOND,
    LEAST_IN_CONTACT,
    LEAST_READING_LAG_S,
    LEAST_SHARE,
    MODELS_BESIDE_ERRORS,
    MOST_ANGLE_GAIN,
    MOST_ANGLE_ZERO,
    MOST_FORCE_ZERO_N,
    MOST_READING_GAIN,
    MOST_READING_LAG_S,
    NEARLY_RIGHT,
    SETTLED_LAG,
)
from fingerlab.diagnosis.signals.reading_errors import (
    CHANNELS,
    FORCE,
    JOINTS,
    MCP,
    MOTOR,
    NO_ERROR,
    PIP,
    TORQUE,
    ReadingError,
)
from fingerlab.effects.base import BESIDE_A_FINGER, Effect, Row, Shape, Term
from fingerlab.effects.transmission import pull_terms
from fingerlab.physics import nominal
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import Array

READING = "reading_of_"
"""How the ids of errors begin, as long as they stand in a model."""
_Work = TypeVar("_Work")


def _changes(values: Array, rate_hz: float) -> Mapping[str, Array]:
    """What each number of a :class:`ReadingError` adds to a channel that reads ``values``, (n,)."""
    rate = np.gradient(values, 1.0 / rate_hz)
    each = (-np.ones_like(values), values, rate, np.gradient(rate, 1.0 / rate_hz))
    return dict(zip(ReadingError._fields, each, strict=True))


def _of_force(names: Sequence[str], motion: Motion, shape: Shape) -> list[Term]:
    """What a wrong force leaves out in both joints; nothing in free motion."""
    if motion.force is None:
        nothing = np.zeros_like(motion.time)
        return [Term(row, name, nothing, "joint") for row in (Row.MCP, Row.PIP) for name in names]
    change = _changes(motion.force, motion.sample_rate_hz)
    levers = zip((Row.MCP, Row.PIP), motion.contact_levers, strict=True)
    return [Term(row, name, lever * change[name], "joint") for row, lever in levers for name in names]


def _of_torque(names: Sequence[str], motion: Motion, shape: Shape) -> list[Term]:
    """What a wrong torque leaves out: in both joints as a tension, and in the cable's stretch."""
    change = _changes(motion.torque, motion.sample_rate_hz)
    if motion.finger is None:
        return [Term(Row.BENCH, name, -change[name]) for name in names]
    pulls = [(name, -change[name] / motion.radius) for name in names]
    return [term for name, pull in pulls for term in pull_terms(name, pull)]


def _of_position(names: Sequence[str], motion: Motion, shape: Shape) -> list[Term]:
    """What a wrong position of the motor leaves out: of the cable's way, and of what the rotor takes."""
    change = _changes(motion.position, motion.sample_rate_hz)
    bend = _changes(motion.acceleration, motion.sample_rate_hz)
    rotor, terms = (motion.motor.inertia or 0.0) / motion.radius, list[Term]()
    for name in names:
        terms += [Term(Row.CABLE, name, -motion.radius * change[name]), *pull_terms(name, rotor * bend[name])]
    return terms


def _of_joints(sensors: Sequence[str], names: Sequence[str], motion: Motion, shape: Shape) -> list[Term]:
    """What angles that go by a little of their rate change in the joints' torques and the cable's way.

    Args:
        sensors: those of the two joints, or of one.
    """
    if motion.joints is None:
        return []
    finger, joints = motion.finger_and_joints
    force = 0.0 if motion.force is None else motion.force
    rate_hz, terms = motion.sample_rate_hz, []
    off = {sensor.removesuffix("_angle") for sensor in sensors}

    def torques(at: nominal.JointMotion) -> tuple[Array, Array]:
        """What both joints take, N m; the levers of the contact force go with the angles."""
        mcp = nominal.mcp_torque(finger, at).total
        pip = nominal.pip_torque(finger, at).total
        mcp = mcp + force * nominal.contact_lever_mcp(finger, at.mcp, at.pip)
        return mcp, pip + force * nominal.contact_lever_pip(finger, at.mcp, at.pip)

    usual = torques(joints)
    for name in names:
        change = {
            key: _changes(values, rate_hz)[name] if _is_off(key, off, name) else np.zeros_like(values)
            for key, values in vars(joints).items()
        }
        most = max(float(np.max(np.abs(change[joint]))) for joint in off)
        step = SMALL_TURN / max(most, 1e-12)
        moved = nominal.JointMotion(**{key: v + step * change[key] for key, v in vars(joints).items()})
        slopes = ((b - a) / step for a, b in zip(usual, torques(moved), strict=True))
        terms += [Term(row, name, s, "joint") for row, s in zip((Row.MCP, Row.PIP), slopes, strict=True)]
        terms += [
            Term(Row.CABLE, name, change["mcp"], "arm_mcp"),
            Term(Row.CABLE, name, change["pip"], "arm_pip"),
        ]
    return terms


def _is_off(key: str, off: Set[str], name: str) -> bool:
    """Whether a number of a joint's reading changes an angle or rate of the motion: a zero has no rate."""
    joint, _, rate = key.partition("_")
    return joint in off and not (rate and name == "zero")


SMALL_TURN = 1e-4
"""By how much an angle is turned, rad, to see what its torques change by."""


def _up_to(most: float, unit: str, least: float | None = None) -> Parameter:
    return Parameter(unit, -most if least is None else least, most, 0.25 * most)


_EITHER_WAY = {
    "zero": _up_to(MOST_FORCE_ZERO_N, "N"),
    "gain": _up_to(MOST_READING_GAIN, "1"),
    "lag": _up_to(MOST_READING_LAG_S, "s"),
    # Half its square of a pure delay, nothing of a filter of first order.
    "lag_square": _up_to(MOST_READING_LAG_S**2, "s^2"),
}
# Angles, or a torque, that came early would be a law of motion instead: viscous friction, or a late cable.
_LATE = {
    "lag": _up_to(MOST_READING_LAG_S, "s", 0.0),
    "lag_square": _up_to(MOST_READING_LAG_S**2, "s^2", 0.0),
}
# Of a joint's angle: a sensor that was clamped askew, or a calibration of another one.
_OF_ANGLE = _EITHER_WAY | {
    "zero": _up_to(MOST_ANGLE_ZERO, "rad"),
    "gain": _up_to(MOST_ANGLE_GAIN, "1"),
}
_COLUMNS: Mapping[str, Callable[[Sequence[str], Motion, Shape], list[Term]]] = {
    FORCE: _of_force,
    TORQUE: _of_torque,
    MOTOR: _of_position,
    **{sensors: partial(_of_joints, CHANNELS[sensors]) for sensors in (JOINTS, MCP, PIP)},
}


@dataclass(frozen=True)
class Suspect:
    """A channel, and which numbers of its :class:`ReadingError` may be wrong; ``simpler``: fewer of them."""

    channel: str
    names: tuple[str, ...]
    simpler: tuple[tuple[str, ...], ...] = ()

    @property
    def id(self) -> str:
        """Of the effect that it is."""
        return f"{READING}{self.channel}_{'_'.join(self.names)}"

    @property
    def most_left(self) -> float:
        """Squared score above one up to which it is believed, if it is of the motion."""
        return NEARLY_RIGHT if self.channel == TORQUE and "gain" in self.names else FAR_LEFT

    @property
    def of_an_angle(self) -> bool:
        """Whether a joint's angle is read at another scale or zero: what springs, weights, levers go with."""
        return self.channel in (MCP, PIP) and "lag" not in self.names

    def effect(self, either_way: bool = False) -> Effect:
        """It as an effect of a model; of the bench, and so in no catalogue.

        Args:
            either_way: it may be early as well, as beside a lag that was found.
        """
        late_alone = self.channel not in (FORCE, MOTOR) and "lag" in self.names and not either_way
        ranges = _LATE if late_alone else _OF_ANGLE if self.of_an_angle else _EITHER_WAY
        return Effect(
            id=self.id,
            title="Errors of a channel's reading",
            family="Sensors",
            acts_on=("endpoint_force", "joint_torque", "cable_kinematics"),
            gains={name: ranges[name] for name in self.names},
            columns=partial(_COLUMNS[self.channel], self.names),
            coordinate="force",
            equation=Row.PIP,
            explanation="A channel reads something else than there is.",
            reveal="",
            bench=BESIDE_A_FINGER if self.channel == TORQUE else False,
            phases=("contact",) if self.channel == FORCE else (),
        )

    def found_in(self, fitted: FittedModel) -> ReadingError:
        """The error as a model has it."""
        return ReadingError(**{name: fitted.values.get(f"{self.id}.{name}", 0.0) for name in self.names})


_LATE_NAMES = ("lag", "lag_square")
LATE_FORCE = Suspect(FORCE, _LATE_NAMES)
FORCE_ALONE = Suspect(FORCE, ("zero", *_LATE_NAMES), (("zero",), _LATE_NAMES))
LATE_MOTION = tuple(Suspect(channel, _LATE_NAMES) for channel in (JOINTS, MCP, PIP, MOTOR, TORQUE))
"""Seen in free motion, too, where a law of motion may pass for them: asked for where no law does enough."""
TORQUE_SCALE = Suspect(TORQUE, ("gain",))
"""A spring or a load cell's span may pass for it: asked for when all that is missing was looked for."""

ANGLE_READINGS = tuple(Suspect(channel, ("zero", "gain"), (("zero",), ("gain",))) for channel in (MCP, PIP))
"""Springs, weights and levers go with the angles: for what they do a law may pass, or several."""


@dataclass(frozen=True)
class _Tried:
    """A model, and the same beside the error of a suspect, held out."""

    without: FittedModel
    suspect: Suspect
    fitted: FittedModel


def find_reading_error(
    reduction: Reduction, models: Sequence[FittedModel], ended: bool
) -> tuple[Suspect, FittedModel] | None:
    """What is wrong with a channel's reading beyond what was known, and the model that holds it.

    None: with it none of the models leaves far less than the first one does without, or that leaves little;
    nor does it explain nearly all that the last one leaves, and more than the first one does. Where no effect
    is borne out, an error that explains a share may stand in the way of all of them. A simpler error that
    leaves about as much is taken for it.

    Args:
        models: the best first, the one as given last.
        ended: the search has ended; else it has taken its first step.
    """
    best, given = models[0], models[-1]
    lacking = lacks_fit(best, NEARLY_RIGHT)
    suspects = list(LATE_MOTION) if lacking else []
    longer = len(best.choices) > len(given.choices) + 1
    suspects += [TORQUE_SCALE] if ended and (lacking or longer) else []
    suspects += ANGLE_READINGS if ended and lacks_fit(best, 2.0 * LEAST_FALL) else []
    could_be = [one for one in (best, given) if lacks_fit(one, NEARLY_RIGHT)]
    if any(one.misfit_in_contact > LEAST_IN_CONTACT * one.misfit for one in could_be):
        suspects.append(FORCE_ALONE if reduction.zero_in_the_air is None else LATE_FORCE)
    if not suspects:
        return None
    tried = [one for model in _nearest(models, lacking) for one in _beside(reduction, model, suspects)]

    def explains_all(one: _Tried) -> bool:
        left = min((1.0 - LAG_SHARE) * given.misfit, best.misfit)
        return one.without is given and one.fitted.misfit < left

    def leaves_far_less(one: _Tried) -> bool:
        told_soon = ended or one.suspect.channel == FORCE
        share = HALF_LEFT if told_soon else 1.0 - LAG_SHARE
        return lacking and one.fitted.misfit < share * best.misfit

    def stands_for_others(one: _Tried) -> bool:
        fewer = len(one.without.choices) < len(best.choices)
        return one.suspect is TORQUE_SCALE and fewer and not lacks_fit(one.fitted, NEARLY_RIGHT)

    def stands_for_a_law(one: _Tried) -> bool:
        much = min(HALF_LEFT * best.misfit, LEAST_FALL_BEYOND * best.count)
        fall = best.misfit - one.fitted.misfit
        return one.suspect.of_an_angle and fall > max(LEAST_FALL * best.count, much)

    def stands_in_the_way(one: _Tried) -> bool:
        none_found = ended and len(best.choices) == len(given.choices)
        return lacking and none_found and one.fitted.misfit < (1.0 - LEAST_SHARE) * best.misfit

    for holds in (explains_all, leaves_far_less, stands_for_others, stands_for_a_law, stands_in_the_way):
        found = list(filter(holds, tried))
        if found:
            most = min(one.fitted.misfit + LEAST_FALL_BEYOND * one.fitted.count for one in found)
            plainest = min(
                found,
                key=lambda one: (one.fitted.misfit > most, len(one.without.choices), one.fitted.misfit),
            )
            return _simplest(reduction, plainest)
    return None


def _nearest(models: Sequence[FittedModel], lacking: bool) -> list[FittedModel]:
    """The models that an error may complete, one of the same effects each, and the one as given, last.

    ``lacking``: the first one lacks fit; else an error only stands in the place of effects of it.
    """
    *others, given = models
    each = {tuple(one.effect_ids): one for one in sorted(others, key=lambda one: -one.misfit)}
    size = len(models[0].choices)
    near = [one for one in each.values() if one is not given and (lacking or len(one.choices) < size)]
    near = sorted(near, key=lambda one: one.misfit)[:MODELS_BESIDE_ERRORS]
    return [*near, given] if lacking or len(given.choices) < size else near


def _simplest(reduction: Reduction, tried: _Tried) -> tuple[Suspect, FittedModel]:
    """The suspect, or one of less that leaves about as much; friction turns round over another travel now."""
    suspect, found = tried.suspect, tried.fitted
    if len(found.choices) > 1:
        scorer, found = refine_grid(reduction, found)
        found = scorer.score_held_out(found)
    fewer = _beside(reduction, found, [replace(suspect, names=n, simpler=()) for n in suspect.simpler])
    simplest = min(fewer, key=lambda one: one.fitted.misfit, default=None)
    most = LEAST_FALL if suspect.of_an_angle else LEAST_FALL_BEYOND
    if simplest is None or simplest.fitted.misfit - found.misfit >= most * found.count:
        return suspect, found
    return simplest.suspect, simplest.fitted


def _beside(reduction: Reduction, model: FittedModel, suspects: Sequence[Suspect]) -> list[_Tried]:
    """The model with each of the errors alone; beside one that is known it may be less as well."""
    errors = [one.effect(either_way=one.channel in reduction.reading_errors) for one in suspects]
    effects = [e for e in at_found_shapes(model) if not e.id.startswith(READING)]
    scorer = Scorer(reduction.refined([*effects, *errors]))
    fits = (scorer.fit_reweighted([Choice(e) for e in (*effects, error)], model) for error in errors)
    each = zip(suspects, map(scorer.score_held_out, fits), strict=True)
    return [_Tried(model, suspect, fitted) for suspect, fitted in each]


def _followed(reduction: Reduction, suspect: Suspect, found: FittedModel) -> bool:
    """Take an error off the readings; a lag of the motion to its last, beside what was corrected of it.

    Angles that move change levers, friction and all else that is made of them. False: hardly any is left.
    """
    before = reduction.reading_errors
    error = before.get(suspect.channel, NO_ERROR).then(suspect.found_in(found))
    for _ in range(FOLLOWING_ROUNDS if suspect in LATE_MOTION else 0):
        reduction.correct_readings({**before, suspect.channel: error})
        (again,) = _beside(reduction, found, [suspect])
        found = again.fitted
        more = suspect.found_in(found)
        error = error.then(more)
        if abs(more.lag) < SETTLED_LAG * abs(error.lag):
            break
    if abs(error.lag) * reduction.scales.of("s") < LEAST_READING_LAG_S:
        error = error._replace(lag=0.0, lag_square=0.0)
    reduction.correct_readings({**before, suspect.channel: error})
    return reduction.reading_errors != before


def with_readings_corrected(
    reduction: Reduction,
    models: Sequence[FittedModel],
    again: Callable[[], _Work],
    outcome: Callable[[_Work], tuple[FittedModel, bool]],
    ended: bool = True,
) -> _Work | None:
    """The work done again with an error taken off a channel's reading; None: none is borne out.

    It is where far less is left, or no more with an effect less and nothing else missing, or with two less;
    of the motion's channels, which other laws may look like, only where little is left.

    Args:
        models: that it came to, the best first, the one as given last.
        outcome: its best model, held out, and whether nothing more is missing beside it.
        ended: whether the work has ended; else it has taken its first step.
    """
    before, best = reduction.known_of_bench, models[0]
    suspected = None if reduction.on_bench else find_reading_error(reduction, models, ended)
    if suspected is None:
        return None
    suspect, fitted = suspected
    if _followed(reduction, suspect, fitted):
        found = again()
        end, complete = outcome(found)
        fewer = len(best.choices) - len(end.choices) >= (1 if complete else 2)
        explained = suspect.channel == FORCE or not lacks_fit(end, suspect.most_left)
        if explained and (
            (fewer and end.misfit <= best.misfit)
            or is_borne_out(best, end, complete)
            or (suspect.of_an_angle and _explains_beside(best, end))
        ):
            return found
    reduction.go_back(before)
    return None


def _explains_beside(best: FittedModel, end: FittedModel) -> bool:
    """Whether a path of no more effects leaves as much less as a further effect would have to."""
    fall = best.misfit - end.misfit
    return len(end.choices) <= len(best.choices) and fall > LEAST_FALL_BEYOND * best.count
