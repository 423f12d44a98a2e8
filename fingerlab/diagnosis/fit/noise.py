"""How much of a group's products is noise, and how far an equation can be trusted.

What does not repeat from cycle to cycle was set apart in the reading; here it is told for one sample, cut
back where it would exceed what the recordings hold, and taken from other runs where nothing repeats. The
weights of the equations follow from the bench's own repeatability. Where nothing repeats, noise and misfit
look alike. All that a model leaves is its noise then: its weights are those of greatest likelihood, and a
model that leaves less is rewarded by its density alone.

Two things are open at rest that are not in motion. An encoder that does not move shows its own step instead
of noise that averages out. And friction that sticks may hold any torque up to that at which it slides; where
in between depends on the last few hundredths of a degree, which no sensor of the rig tells. Both are a
covariance that the equations get on top of their noise, at those moments alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fingerlab.diagnosis.equations.coefficients import NO_SHIFT
from fingerlab.diagnosis.equations.features import Layout
from fingerlab.diagnosis.equations.model import Model
from fingerlab.diagnosis.equations.parameters import RUBS, SLIPS
from fingerlab.diagnosis.gram.state_law import left_out_covariance, without_run_means
from fingerlab.diagnosis.gram.sums import Group, Reduced
from fingerlab.diagnosis.settings import (
    GRAM_RIDGE,
    LEAST_DEPTH_SPREAD_M,
    LEAST_LENGTH_SPREAD_M,
    LEAST_TENSION_SPREAD_N,
    LEAST_TORQUE_SPREAD,
    MOST_NOISE,
    RUN_VARIATION,
    TIP_FRICTION_SPREAD,
)
from fingerlab.effects.base import Row
from fingerlab.sessions.model import Array, BoolArray, IntArray


def noise_of_a_sample(group: Group, square: Any = slice(None)) -> Array:
    """What noise adds to the products of signals at one sample, (signals, signals), or to a part of them."""
    return np.asarray(group.noise[square] / max(group.noise_samples, 1.0))


def limited_noise(group: Group, signals: IntArray) -> tuple[Array, Array, Array]:
    """What noise adds to the products of some signals at a sample, (n, n) each.

    At a slack one, at a taut one at which the motor moves, and at one at which it stands.

    It is cut back to what such moments hold in every combination of these signals: the noise is read from
    the runs with a cycle, and in a combination that those runs happen to excite more than the others it
    would exceed the whole, and a fit could run away along it. Only the signals of one model are looked at
    together, for so many as the catalogue has would share out the noise of a short recording among them
    until none were left.

    Args:
        signals: of a model, each once, (n,).
    """
    square = np.ix_(signals, signals)
    noise = noise_of_a_sample(group, square)
    if group.noise_samples <= 0:
        return noise, noise, noise
    whole = group.whole
    every = whole.products[square]
    limited = slack = _limited(noise, every / whole.samples)
    # Each by its own moments: the equations' weights differ, and what one has too much the other cannot lack.
    taut, samples = every, whole.taut_samples
    if whole.slack is not None:
        slack = _limited(limited, whole.slack[square] / max(whole.slack_samples, 1))
        taut = every - whole.slack[square]
        limited = _limited(limited, taut / max(samples, 1))
    # Where a motor alone sticks, what acts there alone has its noise there: taken from the motion it would
    # leave less than nothing. A finger that stands has the noise of its own sensors at all times.
    if whole.rest is None or not group.on_bench or samples <= whole.rest_samples:
        return slack, limited, limited
    moving = _limited(limited, (taut - whole.rest[square]) / (samples - whole.rest_samples))
    return slack, moving, _limited(limited, whole.rest[square] / max(whole.rest_samples, 1))


def _limited(noise: Array, whole: Array) -> Array:
    """``noise`` cut back to a share of ``whole`` in every direction; both (n, n), of one sample."""
    size = np.diag(whole)
    live = np.flatnonzero(size > 0)
    among = np.ix_(live, live)
    scale = 1.0 / np.sqrt(size[live])
    units = np.outer(scale, scale)
    share, every = noise[among] * units, whole[among] * units
    limited = np.zeros_like(noise)
    if _definite(MOST_NOISE * every - share):
        limited[among] = noise[among]
        return limited
    # In units of the whole (its Cholesky factor) the noise is a share between 0 and 1 in every direction.
    factor = _factor(every)
    half = np.linalg.solve(factor, share)
    shares, directions = np.linalg.eigh(np.linalg.solve(factor, half.T))
    # Put together from its parts: what is cut off may be so much that a difference would be rounding.
    reach = factor @ directions
    limited[among] = (reach * np.clip(shares, 0.0, MOST_NOISE)) @ reach.T / units
    return limited


def _definite(products: Array) -> bool:
    try:
        np.linalg.cholesky(products)
    except np.linalg.LinAlgError:
        return False
    return True


def _factor(products: Array) -> Array:
    """Cholesky factor of products with ones on the diagonal, lifted to be definite, (n, n)."""
    ridge = GRAM_RIDGE * np.eye(len(products))
    try:
        return np.asarray(np.linalg.cholesky(products + ridge))
    except np.linalg.LinAlgError:
        # Products of the taut moments are those of all less those of the slack ones: where nearly all is
        # slack, what is left of a signal may be rounding, which is no product of anything.
        sizes, directions = np.linalg.eigh(products)
        return np.asarray(np.linalg.cholesky((directions * np.maximum(sizes, 0.0)) @ directions.T + ridge))


def fill_missing_noise(reduced: Reduced) -> None:
    """Groups without a repeated cycle take the noise of the others with the same equations, per sample.

    First of those that press on the load cell as they do, or do not: how a tip rubs is noise in contact
    alone. A bench that never repeats takes that of the current, which is the same in a finger's runs; without
    those, what no law of its state would tell of the torque.
    """
    for on_bench in (False, True):
        alike = [g for g in reduced.groups if g.on_bench == on_bench]
        known = [g for g in alike if g.noise_samples > 0]
        if known:
            for phase in (False, True):
                like = [g for g in known if g.in_contact == phase] or known
                pooled = sum((g.noise for g in like[1:]), like[0].noise)
                samples = sum(g.noise_samples for g in like)
                _share_noise([g for g in alike if g.in_contact == phase], pooled, samples)
        elif on_bench and alike:
            variance = torque_noise(reduced)
            bounded = variance == 0.0
            if bounded:
                moves = reduced.constants is not None and reduced.constants.move_torque
                variance = reduced.torque_noise.share * untold_variance(reduced, alike, moves)
            signal = _signal(reduced.layout, Row.BENCH, None)
            noise = np.zeros((reduced.layout.signal_count,) * 2)
            noise[signal, signal] = variance
            for group in alike if variance > 0 else []:
                group.bounded = bounded
            _share_noise(alike if variance > 0 else [], noise, 1.0)


def untold_variance(reduced: Reduced, groups: Sequence[Group], zeros_move: bool) -> float:
    """Variance that no law of the state tells of a motor's torque, (N m)^2; 0: not known.

    Args:
        zeros_move: whether every run's torque has a constant of its own beside that law.
    """
    late = reduced.late_is_no_noise or reduced.layout.late_torque
    runs = [without_run_means(g.state_products) if zeros_move else g.state_products for g in groups]
    found = [
        left_out_covariance(each, late=late, in_parts=g.in_parts)
        for each, g in zip(runs, groups, strict=True)
    ]
    return max((float(one[0, 0]) for one in found if one is not None), default=0.0)


DERIVATIVES = {"bench_trace": 1, "bench_inertia": 2, "rotor_inertia": 2}
"""Which derivative of a motor's angle an unknown of its own equation multiplies; the last beside a finger."""


def add_encoder_noise(reduced: Reduced) -> None:
    """Let the speed and acceleration of a motor alone be no quieter than its encoder's steps make them.

    A motion that comes again to the step has the same error in every cycle, which passes for misfit.
    """
    for group in reduced.groups:
        if not (group.on_bench and group.noise_samples > 0):
            continue
        for place, feature in enumerate(reduced.layout.features):
            order = DERIVATIVES.get(feature.parameter or "") if feature.row is Row.BENCH else None
            if order is None or feature.owner is not None:
                continue
            signal = int(reduced.layout.signals[place])
            least = group.noise_samples * group.encoder_noise[order]
            group.noise[signal, signal] = max(group.noise[signal, signal], least)


def torque_noise(reduced: Reduced) -> float:
    """Variance of the motor's torque that does not repeat in a finger's runs, (N m)^2; 0: not known."""
    known = [g for g in reduced.groups if g.noise_samples > 0 and not g.on_bench]
    if not known:
        return 0.0
    signal = _signal(reduced.layout, Row.MCP, NO_SHIFT)
    pull = min(float(g.noise[signal, signal]) / g.noise_samples for g in known)
    return max(pull, 0.0) * reduced.radius**2


def _share_noise(groups: Sequence[Group], noise: np.ndarray, samples: float) -> None:
    for group in groups:
        if group.noise_samples <= 0:
            group.noise, group.noise_samples = noise.copy(), samples


def _signal(layout: Layout, row: Row, shift: int | None) -> int:
    """The signal of the motor's torque as an equation has it."""
    return next(
        int(layout.signals[i])
        for i in layout.base
        if (f := layout.features[i]).row == row and f.constant == -1.0 and f.shift == shift
        and f.scale == "direct"
    )  # fmt: skip


def row_covariance(
    model: Model, values: Array, group: Group, products: Array, samples: float, only: BoolArray | None = None
) -> Array:
    """Covariance (5, 5) of the equations' residuals.

    Args:
        products: of the model's active features, (k, k), over ``samples``.
        only: picks active features, (k,); None takes all.
    """
    h = model.features(values, group)
    if only is not None:
        h = np.where(only, h, 0.0)
    return products_of_rows(model, h, products) / max(samples, 1.0)


def products_of_rows(model: Model, coefficients: Array, products: Array) -> Array:
    """Products of the equations' residuals, (5, 5).

    Args:
        coefficients: of the model's active features, (k,). products: of these features, (k, k).
    """
    spread = np.zeros((len(coefficients), len(Row)))
    spread[np.arange(len(coefficients)), model.rows] = coefficients
    return np.asarray(spread.T @ products @ spread)


def noise_covariance(model: Model, values: Array, group: Group) -> Array:
    """Covariance (5, 5) of what does not repeat in the equations' residuals, of one sample."""
    if not group.repeats:
        return row_covariance(model, values, group, group.whole.of(model.pick), group.samples)
    return row_covariance(model, values, group, model.pick.among(group.noise), group.noise_samples)


def scatter_of_runs(model: Model, values: Array, group: Group, means: bool) -> Array:
    """Covariance (5, 5) of what runs told the same motion leave differently, of one sample, less the noise.

    What a cable that hangs loose leaves is no part of it.

    Args:
        means: whether what the runs leave on their averages counts. A tip holds a torque by the way in which
            it was set down, and a joint by that on which it came to rest, which no channel tells. Not where
            the runs' zeros are taken off what is left.
    """
    found, contrasts = np.zeros((len(Row), len(Row))), 0
    h = model.features(values, group)
    spread = np.zeros((len(group.noise), len(Row)))
    np.add.at(spread, (model.pick.signals, model.rows), h)
    noise = noise_covariance(model, values, group)
    for runs in group.repeated_cycles:
        # (runs, equations, harmonics)
        residuals = np.stack([spread[one.live].T @ one.harmonics for one in runs])
        residuals = residuals if means else residuals[:, :, 1:]
        apart = residuals - residuals.mean(axis=0)
        expected = (len(runs) - 1) * residuals.shape[2] * noise
        found += (np.einsum("rik,rjk->ij", apart, apart) - expected) / runs[0].samples
        contrasts += len(runs) - 1
    if not contrasts:
        return found
    if group.whole.slack is not None:
        found[Row.CABLE], found[:, Row.CABLE] = 0.0, 0.0
    sizes, directions = np.linalg.eigh(found / contrasts)
    return np.asarray((directions * np.maximum(sizes, 0.0)) @ directions.T)


def floor_covariance(model: Model, values: Array, group: Group, weights: Array, means: bool) -> Array:
    """Covariance (5, 5) of what no model can better, of one sample: of noise, and of what runs differ by.

    Where no motion was told twice, what runs differ by is what their friction does, as in the score: see
    ``random_effect_columns``.

    Args:
        means: whether what runs leave on their averages counts, see :func:`scatter_of_runs`.
    """
    floor = misfit_floor(model, values, group, weights)
    if not group.repeats:
        return floor
    if group.repeated_cycles:
        return floor + scatter_of_runs(model, values, group, means)
    products = group.whole.of(model.pick)
    for mine in model.run_varying:
        floor = floor + RUN_VARIATION**2 * row_covariance(model, values, group, products, group.samples, mine)
    return floor


def misfit_floor(model: Model, values: Array, group: Group, weights: Array) -> Array:
    """That above which a residual is misfit, (5, 5): noise, or for a motor alone that of the ``weights``.

    They stand for how well its torque repeats, which no effect has a say in; where nothing repeats they are
    the last model's, whose misfit counts as noise for all others.
    """
    if group.repeats and not group.on_bench:
        return noise_covariance(model, values, group)
    return _covariance_of(weights)


def tip_friction_covariance(model: Model, values: Array, group: Group, weights: Array) -> Array:
    """What the ``weights`` take for the tip's friction on top of the noise, (5, 5); none without contact."""
    if not (group.in_contact and group.repeats):
        return np.zeros_like(weights)
    return _covariance_of(weights) - misfit_floor(model, values, group, weights)


def _covariance_of(weights: Array) -> Array:
    """Inverse of weights over the equations that exist, zero elsewhere; shape (5, 5)."""
    exist = np.flatnonzero(np.diag(weights) > 0)
    found = np.zeros_like(weights)
    found[np.ix_(exist, exist)] = np.linalg.inv(weights[np.ix_(exist, exist)])
    return found


def encoder_spread(variance: float) -> Array:
    """Covariance (5, 5) of the equations from a standing encoder; ``variance`` in m^2 of cable."""
    spread = np.zeros((5, 5))
    spread[Row.CABLE, Row.CABLE] = variance
    return spread


def change_of_weight(weights: Array, spread: Array) -> Array:
    """By how much an additional covariance changes the inverse covariance ``weights``; all (5, 5)."""
    # inverse(inverse(W) + S) = W - W S (1 + W S)^-1 W, which needs no inverse of W
    return np.asarray(-weights @ spread @ np.linalg.solve(np.eye(len(weights)) + weights @ spread, weights))


def log_widening(weights: Array, spread: Array) -> float:
    """By how much an additional covariance raises the logarithm of the covariance's determinant."""
    return float(np.linalg.slogdet(np.eye(len(weights)) + weights @ spread)[1])


def first_weights() -> Array:
    """Weights before anything is known of the noise: 20 mN, 2 um, 1 mN m, 30 um; only their order matters."""
    return np.diag([1 / 0.02**2, 1 / 0.02**2, 1 / 2e-6**2, 1 / 1e-3**2, 1 / LEAST_DEPTH_SPREAD_M**2])


def noise_weights(model: Model, values: Array, group: Group) -> Array:
    """Inverse covariance of what a model's equations leave between cycles, (5, 5).

    Args:
        values: of the model's unknowns, (p,).
    """
    covariance = noise_covariance(model, values, group)
    if group.on_bench and group.repeats:
        covariance[Row.BENCH, Row.BENCH] = torque_repeatability(model, values, group)
    if group.in_contact:
        covariance = covariance + TIP_FRICTION_SPREAD**2 * _rubbing(model, values, group)
    return _inverse(covariance, group.on_bench)


def torque_repeatability(model: Model, values: Array, group: Group) -> float:
    """Variance of a motor's torque that its own motion does not tell from cycle to cycle, (N m)^2 a sample.

    By the recording alone: no effect has a say in it, for one whose law is steep at a reversal would call
    more of the torque noise than another, and every model would be told in floors of its own. What motions
    differ by is taken off as the torque follows it; what the encoder adds to an acceleration comes on top.
    """
    features = [model.layout.features[i] for i in model.active]
    own = [
        k for k, f in enumerate(features) if f.row is Row.BENCH and f.owner is None and f.scale == "direct"
    ]
    noise = model.pick.among(group.noise)[np.ix_(own, own)] / group.noise_samples
    torque = [n for n, k in enumerate(own) if features[k].constant == -1.0 and features[k].shift is None]
    motion = [n for n, k in enumerate(own) if n not in torque and noise[n, n] > 0.0]
    variance = float(noise[np.ix_(torque, torque)].sum())
    if motion:
        spread = np.sqrt(np.diag(noise)[motion])
        across = noise[motion][:, torque].sum(axis=1) / spread
        among = noise[np.ix_(motion, motion)] / np.outer(spread, spread)
        variance -= float(across @ np.linalg.lstsq(among, across, rcond=GRAM_RIDGE)[0])
    if not group.bounded:
        coefficients = model.features(values, group)
        for k in own:
            order = DERIVATIVES.get(features[k].parameter or "")
            if order is not None:
                variance += float(coefficients[k]) ** 2 * group.encoder_noise[order]
    return max(variance, 0.0)


def _rubbing(model: Model, values: Array, group: Group) -> Array:
    """Mean products of what the tip's friction does to the equations, (5, 5).

    A tip that sticks rubs, too, and is not known better than one that slides: a usual friction at least.
    """
    values = values.copy()
    if model.tip_law == "sticks":
        k = model.index[RUBS]
        values[k] = max(values[k], model.unknowns[k].parameter.typical)
    mine = [model.layout.features[i].parameter in (RUBS, *SLIPS) for i in model.active]
    products = group.whole.of(model.pick)
    return row_covariance(model, values, group, products, group.samples, np.array(mine))


def _inverse(covariance: Array, on_bench: bool) -> Array:
    """Inverse of the noise covariance over the equations that exist, zero elsewhere; shape (5, 5)."""
    result = np.zeros((5, 5))
    if on_bench:
        result[Row.BENCH, Row.BENCH] = 1.0 / max(covariance[Row.BENCH, Row.BENCH], LEAST_TORQUE_SPREAD**2)
        return result
    spreads = [LEAST_TENSION_SPREAD_N, LEAST_TENSION_SPREAD_N, LEAST_LENGTH_SPREAD_M, LEAST_DEPTH_SPREAD_M]
    rows = np.ix_([Row.MCP, Row.PIP, Row.CABLE, Row.TIP], [Row.MCP, Row.PIP, Row.CABLE, Row.TIP])
    block = covariance[rows] + np.diag(spreads) ** 2
    scale = np.sqrt(np.diag(block))
    result[rows] = np.linalg.inv(block / np.outer(scale, scale)) / np.outer(scale, scale)
    return result
