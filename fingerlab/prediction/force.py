"""Endpoint force of a contact run from the motor's channels and the joints, without the load cell.

The equations' residual is a function of the force that is assumed at the fingertip: r(F) = 0 gives the
modelled force. The residual is evaluated at a few levels of force, the same all through the run, and is
taken for a straight line between them: all built-in terms are proportional to the force, or to whether the
tip is held, be it by its force or by its height. How a tip rubs, and where it was set down, follow from how
the force came to be, and a force that is the same all through the run knows neither; so the residual is
evaluated at the modelled force, too, and the levels are moved to meet it there. What is solved is then the
very equation that the model was fitted with. What the load cell read takes no part.

Coefficients are the fit's own (``equations.columns``), and so is what a delay does to the motor's
channels: within a millisecond their slope, beyond that the fit's interpolation between kept shifts. The value
of a delay was found with that interpolation; another one would shift the channels by something else.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.diagnosis.equations.coefficients import (
    DELAY,
    SHIFT_SAMPLES,
    SLOPE,
    Coefficients,
    delay_weights,
    key_of,
    scale_key,
)
from fingerlab.diagnosis.equations.features import (
    Feature,
    base_columns,
    grown_columns,
    shares_of_arms,
    shifted_columns,
    turned_columns,
)
from fingerlab.diagnosis.gram.decimation import counted
from fingerlab.diagnosis.settings import LIFTED_M, SLIP_STIFFNESSES
from fingerlab.diagnosis.signals.filters import decimate
from fingerlab.diagnosis.signals.reading_errors import ReadingErrors, in_reduced_units, with_errors
from fingerlab.diagnosis.signals.scales import SI, Scales, reduced_rig, reduced_run
from fingerlab.diagnosis.signals.segments import segments_of
from fingerlab.effects.base import Effect, Row
from fingerlab.effects.transmission import as_effects_see_it
from fingerlab.physics.motion import TOUCHING_FORCE_N, Motion, tip_depth
from fingerlab.sessions.model import CABLE_NAMES, Array, BoolArray, Run, Session
from fingerlab.sessions.trajectory import named_frequency
from fingerlab.signals.periods import MINIMUM_PERIODS, PeriodGrid, settles

LEVELS_N = (-1.0, 0.0, TOUCHING_FORCE_N, 1.0)
"""Forces at which the residual is evaluated, N: below, between and above the bends of the built-in terms."""
ROUNDS = 4
"""How a tip rubs follows from the force, which follows from how it rubs: solved by turns. Each
turn lowers what is left by the friction coefficient; the first knows of no rubbing."""
NONE_KNOWN: ReadingErrors = {}
JOINT_ROWS = {"pip": Row.PIP, "mcp": Row.MCP}


@dataclass(frozen=True)
class Stretch:
    """One stretch of a contact run, of at most a minute.

    Attributes:
        time: s into the run, (n,). measured: force that the load cell read, N, (n,), low-passed as all is;
            NaN where none was read.
        motion: signals at the wide rate, without a force.
        frequency_hz: of the cycle; 0 where the motor does not repeat one.
        scales: the reduced units in which all of it is told.
    """

    run: str
    time: Array
    measured: Array
    motion: Motion
    frequency_hz: float
    scales: Scales = SI


def contact_stretches(
    session: Session, run: Run, scales: Scales = SI, errors: ReadingErrors = NONE_KNOWN
) -> Iterator[Stretch]:
    """The stretches of a contact run, in reduced units.

    Args:
        errors: of its channels' readings, SI; they are taken off.

    Raises:
        UserError: the rig gives no finger, or a channel is missing, not a number, or too short.
    """
    if session.rig.finger is None:
        raise UserError(f"{session.path} gives no finger constants; its rig text needs 'finger'.")
    cell = run.has("endpoint_force") and bool(np.all(np.isfinite(run.channel("endpoint_force"))))
    run, rig = reduced_run(run, scales), reduced_rig(session.rig, scales)
    run = with_errors(run, in_reduced_units(errors, scales))
    measured = [_narrowed(m, m.force) for m in segments_of(run, rig) if m.force is not None] if cell else []
    # Read as free motion, so that what the load cell says cannot enter the prediction.
    for number, motion in enumerate(segments_of(replace(run, phase="on_air"), rig)):
        time = _narrowed(motion, motion.time)
        read = measured[number] if measured else np.full(len(time), np.nan)
        yield Stretch(run.name, time, read, motion, _cycle_hz(run, motion), scales)


def _cycle_hz(run: Run, motion: Motion) -> float:
    """Frequency that the trajectory names, if the motor truly repeats at it; else 0."""
    frequency = named_frequency(run)
    if not 0 < frequency < motion.sample_rate_hz / 4:
        return 0.0
    period = motion.sample_rate_hz / frequency
    position = motion.position[motion.lead :]
    grid = PeriodGrid(0.0, period, int((len(position) - 1) // period))
    if grid.count < MINIMUM_PERIODS:
        return 0.0
    return frequency if settles(position, grid) else 0.0


def _narrowed(motion: Motion, values: Array) -> Array:
    """What a fit would judge of a stretch: behind its lead, low-passed and decimated, (n,)."""
    return decimate(values[counted(motion)])


def solved_forces(
    stretch: Stretch, effects: Sequence[Effect], values: Mapping[str, float], where: str
) -> dict[str, Array]:
    """Force that the PIP and the MCP equation imply, N, (n,) each; NaN where the force has no lever.

    Args:
        effects: those of the model, each with one shape. values: of the unknowns by key; nuisances that
            were not fitted are zero; all in the stretch's units. where: the model's name, for the error's
            sentence.

    Raises:
        UserError: the moment arms of the run's cable, or an effect's strength, are not among the values.
    """
    motion = stretch.motion
    force: Array | None = None
    roots: dict[str, Array] = {}
    for _ in range(ROUNDS):
        wide, held = level_residuals(motion, effects, values, where, force)
        still = _narrowed(motion, held.astype(float)) > 0.5
        narrowed = {n: np.stack([_narrowed(motion, one) for one in levels]) for n, levels in wide.items()}
        roots = {name: _root(levels, still) for name, levels in narrowed.items()}
        force = _throughout(stretch, _mean(roots), _mean({n: _root(one, held) for n, one in wide.items()}))
    return roots


def _throughout(stretch: Stretch, force: Array, unsmoothed: Array) -> Array:
    """The force at every sample of a stretch's motion, N.

    Before the first that is judged it is ``unsmoothed``, and only where the tip is as high as later, when it
    presses: of a finger that has yet to move, friction lets the motor's torque say nothing.
    """
    time = stretch.motion.time
    judged = np.interp(time, stretch.time, force)
    lead = time < stretch.time[0]
    depth = tip_depth(stretch.motion)
    on = depth[~lead & (judged >= TOUCHING_FORCE_N)]
    if not len(on):
        return judged
    reached = (depth > on.min() - LIFTED_M) & (depth < on.max() + LIFTED_M)
    return np.where(lead, np.where(reached, unsmoothed, 0.0), judged)


def forces_of_motion(
    motion: Motion, effects: Sequence[Effect], values: Mapping[str, float], where: str, rubs_as: Array
) -> dict[str, Array]:
    """The same at every sample of a motion that was not recorded but thought of: nothing is filtered.

    ``rubs_as`` (N, (n,)) is the force that the motion is meant to make, by which the tip rubs.
    """
    levels, held = level_residuals(motion, effects, values, where, rubs_as)
    return {name: _root(level, held) for name, level in levels.items()}


def _mean(roots: Mapping[str, Array]) -> Array:
    """Force (N, (n,)) that all equations together imply; none where none has a lever."""
    every = np.stack(list(roots.values()))
    known = np.isfinite(every)
    total = np.where(known, every, 0.0).sum(axis=0)
    return np.asarray(np.maximum(total / np.maximum(known.sum(axis=0), 1), 0.0))


def level_residuals(
    motion: Motion,
    effects: Sequence[Effect],
    values: Mapping[str, float],
    where: str,
    force: Array | None = None,
) -> tuple[dict[str, Array], BoolArray]:
    """Residuals of both equations as tensions at each of ``LEVELS_N``, N, (levels, n), and where it is held.

    Held, (n,), is a tip that is no lower and no higher than where it presses, whatever its force: for it
    the last two levels make the line.

    Args:
        force: N, (n,), by whose ups and downs the tip rubs, and at which the levels' residuals are those of
            the equations themselves; None: it does not rub.
    """
    zero = np.zeros_like(motion.time)
    rubbing = replace(motion, phase="contact", force=zero if force is None else force, _memory={})
    for stiffness in SLIP_STIFFNESSES:
        rubbing.tip_slip_force(stiffness)
    levels = [
        _residuals(motion.pressed_by(np.full_like(motion.time, level), rubbing), effects, values, where)
        for level in LEVELS_N
    ]
    result = {name: np.stack([level[row] for level in levels]) for name, row in JOINT_ROWS.items()}
    if force is None:
        return result, np.zeros(len(zero), dtype=bool)
    own, held = _residuals(rubbing, effects, values, where), _held(motion, force)
    for name, row in JOINT_ROWS.items():
        result[name] = result[name] + (own[row] - _between(result[name], force, held))
    return result, held


def _held(motion: Motion, force: Array) -> BoolArray:
    """Where the tip is as high as in the middle of all that it presses, (n,)."""
    on = force >= TOUCHING_FORCE_N
    if not on.any():
        return np.zeros(len(force), dtype=bool)
    depth = tip_depth(motion)
    return np.asarray(np.abs(depth - np.median(depth[on])) < LIFTED_M)


def _between(levels: Array, force: Array, held: BoolArray) -> Array:
    """Residuals at a force by straight lines between the levels, drawn on beyond them, (n,).

    Args:
        levels: (levels, n). force: N, (n,). held: takes the last line, (n,).
    """
    ends = np.array(LEVELS_N)
    last = len(ends) - 2
    piece = np.where(held, last, np.clip(np.searchsorted(ends, force, side="right") - 1, 0, last))
    at = np.arange(len(force))
    share = (force - ends[piece]) / np.diff(ends)[piece]
    return np.asarray(levels[piece, at] * (1.0 - share) + levels[piece + 1, at] * share)


def wound_beyond(motion: Motion, effects: Sequence[Effect], values: Mapping[str, float], where: str) -> Array:
    """Angle by which the motor is wound beyond what joints and tension call for, rad, (n,).

    Its mean is by how much the motor's zero lies elsewhere than in the runs of the fit.
    """
    rows = (Row.CABLE,)
    return np.asarray(_residuals(motion, effects, values, where, rows)[Row.CABLE] / motion.radius)


def _residuals(
    motion: Motion,
    effects: Sequence[Effect],
    values: Mapping[str, float],
    where: str,
    rows: Sequence[Row] = tuple(JOINT_ROWS.values()),
) -> dict[Row, Array]:
    """Residuals of equations, (n,) each: every feature times its coefficient.

    Those of the joints are tensions, N, that of the cable a length, m.
    """
    found = [(f, column) for f, column in _columns(motion, effects, values) if f.row in rows]
    features = [feature for feature, _ in found]
    _check(features, CABLE_NAMES[motion.cable_sign], values, where)
    terms = Coefficients(features, {key: place for place, key in enumerate(values)}, delayed=False)
    coefficients = terms.of(np.array(list(values.values())), (motion.cable_sign,))[0]
    sums = {row: np.zeros_like(motion.time) for row in rows}
    for (feature, column), h in zip(found, coefficients, strict=True):
        if h != 0.0:
            sums[feature.row] += h * column
    return sums


def _columns(
    motion: Motion, effects: Sequence[Effect], values: Mapping[str, float]
) -> Iterator[tuple[Feature, Array]]:
    """All columns, the motor's channels as late as the fit has found them."""
    yield from base_columns(motion)
    delayed = any(one.special == "delay" for one in effects)
    cable = CABLE_NAMES[motion.cable_sign]
    weights, _ = delay_weights(values.get(DELAY, 0.0), delayed)
    for feature, column in shifted_columns(motion):
        late = [weights[k] * _late(column, int(k), motion.sample_rate_hz) for k in np.flatnonzero(weights)]
        yield feature, sum(late[1:], late[0])
    motion = as_effects_see_it(motion, effects)
    shares = shares_of_arms(motion, effects)
    for one in effects:
        others = {name for name, gain in one.gains.items() if gain.cable not in ("", cable)}
        for term in one.columns(motion, one.shapes[0]):
            if term.gain in others:
                continue
            known = Feature(term.row, term.gain, term.constant, term.scale, owner=one.id)
            share = shares.get(term.row) if term.scale == "joint" and one.arms is None else None
            yield known, term.values if share is None else term.values * share
        for feature, column in turned_columns(motion, one, 0):
            yield feature, column * shares.get(feature.row, 1.0)
        yield from grown_columns(motion, one, 0)


def _late(values: Array, shift: int, rate: float) -> Array:
    """A channel at a kept shift, or its derivative; what falls out at the ends is in the margin."""
    if shift == SLOPE:
        return np.asarray(np.gradient(values, 1.0 / rate))
    return np.roll(values, SHIFT_SAMPLES[shift])


def _check(features: Sequence[Feature], cable: str, values: Mapping[str, float], where: str) -> None:
    """Refuse values without one that an effect or a routing of its own needs; other nuisances are zero."""
    for feature in features:
        key = key_of(feature, cable)
        joint = feature.row in JOINT_ROWS.values()
        if joint and feature.owner is not None and feature.scale not in ("direct", "joint"):
            raise UserError(
                f"The effect '{feature.owner}' puts a term of scale '{feature.scale}' into a joint's "
                "equation; its terms there should be of scale 'joint' or 'direct'."
            )
        if feature.owner is not None and not feature.shares_nuisance and key and key not in values:
            raise UserError(
                f"{where} lacks the value of '{key}'; save the model again with 'diagnose --save'."
            )
        own = [key] if feature.per_cable else []
        if any(one and one not in values for one in [*own, scale_key(feature, cable)]):
            raise UserError(
                f"{where} was not fitted with the {cable} cable; fit a model to a session that has runs "
                "with it."
            )


def _root(residual: Array, held: BoolArray) -> Array:
    """Force at which the residual, (levels, n), crosses zero; (n,), N. ``held`` takes the last line."""
    levels = np.array(LEVELS_N)
    slope = np.diff(residual, axis=0) / np.diff(levels)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        places = levels[:-1, None] - residual[:-1] / slope
    low, high = levels[:-1].copy(), levels[1:].copy()
    low[0], high[-1] = -np.inf, np.inf
    inside = (places >= low[:, None]) & (places <= high[:, None]) & np.isfinite(places)
    # Where no piece holds its own root the last one, of a tip that is held, is drawn on.
    piece = np.where(inside.any(axis=0) & ~held, inside.argmax(axis=0), len(low) - 1)
    root = places[piece, np.arange(places.shape[1])]
    return np.asarray(np.where(np.isfinite(root), root, np.nan))
