"""Columns that a run is asked for.

The order is decided here and nowhere else: a layout is made from the first run of a kind, and every later
reading of any run meets the same columns in the same order. A delay keeps the motor's channels at several
shifts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from fingerlab.diagnosis.equations.coefficients import NO_SHIFT, SLOPE
from fingerlab.diagnosis.equations.features import (
    Feature,
    Layout,
    base_columns,
    beside_a_finger,
    grown_columns,
    shares_of_arms,
    shifted_columns,
    turned_columns,
)
from fingerlab.diagnosis.equations.parameters import nuisance_ranges, spread_of
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Effect, Row, Term
from fingerlab.effects.transmission import LATE, as_effects_see_it
from fingerlab.physics.motion import Motion
from fingerlab.sessions.model import Array, IntArray, Session

Column = tuple[Array, int | None, bool, Callable[[], Feature]]
"""Values at the wide rate, shift, whether a user's own effect brings them, and what makes their feature."""


def all_columns(motion: Motion, effects: Sequence[Effect]) -> Iterator[Column]:
    """All features in order: those of every model, then those of the effects."""
    yield from _as_routed(motion, _common_columns(motion))
    yield from effect_columns(motion, effects)


def _as_routed(motion: Motion, columns: Iterator[Column]) -> Iterator[Column]:
    """The columns of a run whose cable may have been guided otherwise, at known shares of its moment arms.

    Arms are told as they usually are: what an equation divides by its own arm is divided by the share here,
    and what it multiplies is multiplied. Each such column is a signal of its own.
    """
    change = motion.intervention
    if change is None:
        yield from columns
        return
    shares = {Row.MCP: 1.0 / change.mcp_arm, Row.PIP: 1.0 / change.pip_arm}
    arms = {"arm_mcp": change.mcp_arm, "arm_pip": change.pip_arm}
    for values, shift, own, make in columns:
        feature = make()
        share = shares.get(feature.row) if feature.scale == "joint" else arms.get(feature.scale)
        yield (values if share is None else values * share), shift, own, make


def _common_columns(motion: Motion) -> Iterator[Column]:
    """The features of every model; a motor channel comes once for every shift, with the same values."""
    for feature, values in base_columns(motion):
        yield values, None, False, partial(replace, feature)
    for feature, values in shifted_columns(motion):
        shifts: Sequence[int | None] = [None] if motion.finger is None else range(SLOPE + 1)
        for k in shifts:
            yield values, k, False, partial(replace, feature, shift=k)


def effect_columns(motion: Motion, effects: Sequence[Effect]) -> Iterator[Column]:
    """The features of the effects that act in such a run, in order."""
    return _as_routed(motion, _of_effects(motion, effects))


def _of_effects(motion: Motion, effects: Sequence[Effect]) -> Iterator[Column]:
    alone = motion.finger is None
    motion = as_effects_see_it(motion, effects)
    shares = shares_of_arms(motion, effects)
    for effect in effects:
        if alone and not effect.bench:
            continue
        own = of_the_user(effect)
        for index, shape in enumerate(effect.shapes):
            for t in effect.columns(motion, shape):
                share = shares.get(t.row) if t.scale == "joint" and effect.arms is None else None
                values = t.values if share is None else t.values * share
                yield values, None, own, partial(_feature, t, effect.id, index)
            for feature, values in turned_columns(motion, effect, index):
                share = shares.get(feature.row)
                yield values if share is None else values * share, None, False, partial(replace, feature)
            for feature, values in grown_columns(motion, effect, index):
                yield values, None, False, partial(replace, feature)


def _feature(term: Term, owner: str, shape: int) -> Feature:
    return Feature(term.row, term.gain, term.constant, term.scale, owner=owner, shape=shape)


def of_the_user(effect: Effect) -> bool:
    """Whether it is none of the built-in effects; those may come with refined shapes."""
    known = CATALOGUE.get(effect.id)
    return known is None or known.columns is not effect.columns


def layout_of(
    motion: Motion,
    session: Session,
    effects: Sequence[Effect],
    beside_finger: bool = False,
    speed: float = 0.0,
    tip_sticks: bool = False,
) -> Layout:
    """The features in the order in which :func:`all_columns` gives them.

    ``beside_finger``: if it is a run of the motor alone, the motor is that of a finger's runs. ``speed``,
    ``tip_sticks``: see :func:`nuisance_ranges`.
    """
    features: list[Feature] = []
    signals: list[int] = []
    known: dict[tuple[int, int | None], int] = {}
    kept: list[Array] = []  # so that no array's identity is given to a later one
    count = base = 0
    for values, shift, own, make in all_columns(motion, effects):
        feature = make()
        if beside_finger and motion.finger is None:
            feature = beside_a_finger(feature, session.rig)
        base += feature.owner is None
        kept.append(values)
        # What is one array in two equations is one signal; a user's own code is not relied on for that.
        key = id(values), None if shift == NO_SHIFT else shift
        place = count if own else known.setdefault(key, count)
        count = max(count, place + 1)
        features.append(feature)
        signals.append(place)
    rate = min((run.sample_rate_hz for run in session.runs), default=math.inf)
    ranges = nuisance_ranges(session.rig, rate, speed, tip_sticks)
    return Layout(
        tuple(features), ranges, tuple(effects), np.arange(base),
        np.array(signals), spread_of(session.rig),
    )  # fmt: skip


@dataclass(frozen=True)
class ReadRequest:
    """What is asked of a run: its kind's features as signals, of which the first ``common`` every model has.

    ``signals`` (features,) count from ``start``, the kind's first signal among those of all runs.
    ``cached`` (signals,) says which signal of the first reading each is, -1 for those to be formed;
    ``formed`` are the positions of the effects that bring the latter, and ``features`` the signals of every
    effect's features in order. ``first``: there was no reading before.
    ``seek_cycle``: no run says how often its motion repeats. ``orders``: periods a turn at which a torque may
    repeat with the angle of a motor alone. ``by_state``: what a law of the state tells of a finger's signals
    is wanted, see ``gram.state_law``. ``in_parts``: the runs are few, and each is left out part by part.
    """

    signals: IntArray
    common: int
    start: int
    cached: IntArray
    formed: tuple[int, ...]
    features: tuple[IntArray, ...]
    first: bool
    seek_cycle: bool = False
    orders: tuple[float, ...] = ()
    by_state: bool = False
    in_parts: bool = False


def asked_of(
    layout: Layout, effects: Sequence[Effect], first: Layout | None, start: int, anew: bool, seek_cycle: bool
) -> ReadRequest:
    """What a layout asks of the runs of its kind.

    Args:
        first: layout of the first reading; None: this is it. anew: the columns of all effects are to be
            formed, those that the first reading knew, too.
    """
    cached, formed = np.full(layout.signal_count, -1), []
    common = len(layout.base)
    if first is not None:
        cached[layout.signals[:common]] = first.signals[:common]
    # All columns of effects are others then.
    late = any(shape.get(LATE) for e in effects for shape in e.shapes)
    grown = any(e.arms is not None and len(e.shapes) == 1 and any(e.shapes[0].values()) for e in effects)
    known = {} if first is None or anew or late or grown else {e.id: e for e in first.effects}
    for number, effect in enumerate(effects):
        before = known.get(effect.id)
        if first is None or before is None or not _same_columns(effect, before):
            formed.append(number)
            continue
        for shape in range(len(effect.shapes)):
            mine, theirs = layout.indices(effect.id, shape), first.indices(effect.id, shape)
            cached[layout.signals[mine]] = first.signals[theirs]
    features = tuple(
        np.concatenate([layout.signals[layout.indices(e.id, k)] for k in range(len(e.shapes))] or [NONE])
        for e in effects
    )
    return ReadRequest(
        layout.signals, common, start, cached, tuple(formed), features, first is None, seek_cycle
    )


NONE = np.zeros(0, dtype=int)


def _same_columns(one: Effect, other: Effect) -> bool:
    return one.columns is other.columns and list(one.shapes) == list(other.shapes)


def joined(finger: Layout, *bench: Layout) -> Layout:
    """The features of all runs, those of the motor alone last."""
    if not bench:
        return finger
    return replace(
        finger,
        features=(*finger.features, *bench[0].features),
        base=np.concatenate((finger.base, len(finger.features) + bench[0].base)),
        signals=np.concatenate((finger.signals, finger.signal_count + bench[0].signals)),
    )
