"""Endpoint force of contact runs from parameters that were fitted on air (thesis sections 4.1, 4.2, 5).

The thesis fits with an extension cable and predicts with a flexion cable. In our sign convention the
moment arm is a magnitude: it carries over, and the cable sign s is that of the contact run. The loss L
is carried over as it stands, as the thesis did.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fingerlab.physics.nominal import endpoint_force
from fingerlab.sessions.model import Array
from fingerlab.signals.periods import REGIONS, PeriodGrid, normalise, recognise, speed_threshold, usable
from fingerlab.thesis.onair import Parameters, thin
from fingerlab.thesis.traces import Joint, Traces, coefficient_of_determination

FORCE_PHASES = ("loading", "peak", "unloading", "rest")
"""Parts of the force cycle: the measured force rises, stays high, falls, stays low."""

FORCE_PHASE_THRESHOLD = 10.0
"""Per cent of the range of the force's rate that parts a rise or fall from a stay (as for the joints)."""


@dataclass(frozen=True)
class ParameterSet:
    """Parameters of one joint's equation, to predict with.

    Several regions: the contact run's own joint speed picks between them, with the jumps that this
    gives. One region: it holds throughout.
    """

    name: str
    joint: Joint
    cable: str
    regions: Mapping[str, Parameters]
    threshold: float = 10.0

    @property
    def switches(self) -> bool:
        """Whether the parameters change with the region."""
        return len(self.regions) > 1


@dataclass(frozen=True)
class ForcePrediction:
    """One contact run against one parameter set. Forces in N; NaN where the run cannot tell.

    Attributes:
        r2: (4.1) over the usable samples. normalised_r2: over the average period, each scaled to 0..1.
        peak_measured, peak_modelled: mean of the maxima of each period. share: their ratio.
        rmse: over the usable samples. error_by_phase: mean of modelled less measured, by ``FORCE_PHASES``.
        measured, modelled: average period, thinned; empty for a run that does not repeat.
    """

    r2: float
    normalised_r2: float
    peak_measured: float
    peak_modelled: float
    share: float
    rmse: float
    error_by_phase: Mapping[str, float]
    measured: Array
    modelled: Array
    period_s: float


def predicted_force(traces: Traces, parameters: ParameterSet, contact_angle: float = 0.0) -> Array:
    """Modelled force at each sample of a run, N, shape (n,); NaN where no parameters apply.

    Args:
        contact_angle: rad, as in :func:`fingerlab.physics.nominal.contact_lever_pip`.
    """
    joint = parameters.joint
    lever = traces.lever(joint, contact_angle)
    # A force line through the joint has no lever, and one behind it would turn the push into a pull.
    lever = np.where(lever > 0, lever, np.nan)
    rate = traces.signals.sample_rate_hz

    def force(region: Parameters) -> Array:
        shifted = delayed(traces.tension, round(region.delay_s * rate))
        return endpoint_force(
            traces.lhs[joint],
            traces.signals.cable_sign,
            region.moment_arm.value,
            region.loss.value,
            shifted,
            lever,
        )

    if not parameters.switches:
        return force(next(iter(parameters.regions.values())))
    result = np.full(len(traces.tension), np.nan)
    labels = sample_labels(traces, joint, parameters.threshold)
    for number, name in enumerate(REGIONS):
        if name in parameters.regions:
            here = labels == number
            result[here] = force(parameters.regions[name])[here]
    return result


def delayed(values: Array, samples: int) -> Array:
    """A signal delayed by whole samples, same shape; NaN where the run does not reach."""
    if samples == 0:
        return values
    result = np.full_like(values, np.nan)
    if samples > 0:
        result[samples:] = values[:-samples]
    else:
        result[:samples] = values[-samples:]
    return result


def sample_labels(traces: Traces, joint: Joint, percent: float) -> Array:
    """Region of each sample of a run by its own average speed, shape (n,); -1 where it does not repeat."""
    grid = traces.grid
    if grid is None:
        return np.full(len(traces.tension), -1)
    speed = grid.mean(traces.speed[joint])
    labels = recognise(speed, speed_threshold(speed, percent))
    phase = np.mod(np.arange(len(traces.tension)) - grid.start, grid.period) / grid.period
    return np.asarray(labels[np.minimum((phase * grid.phases).astype(int), grid.phases - 1)])


def judge(traces: Traces, modelled: Array) -> ForcePrediction:
    """Compare a modelled force, shape (n,), N, with the load cell of the run."""
    measured = traces.signals.force
    if measured is None:
        measured = np.full(len(modelled), np.nan)
    rate = traces.signals.sample_rate_hz
    return judge_forces(measured, modelled, rate, traces.grid, usable(len(modelled), rate))


def judge_forces(
    measured: Array, modelled: Array, sample_rate_hz: float, grid: PeriodGrid | None, span: tuple[int, int]
) -> ForcePrediction:
    """Compare two forces, shape (n,) each, N.

    Args:
        grid: the run's whole periods; None for a run that does not repeat.
        span: first and one-past-last sample to compare.
    """
    y, f = measured[slice(*span)], modelled[slice(*span)]
    error = f - y
    good = np.isfinite(error)
    mean_y, mean_f, period_s = np.empty(0), np.empty(0), 0.0
    if grid is not None:
        mean_y, mean_f = _column_means(grid.fold(measured)), _column_means(grid.fold(modelled))
        period_s = grid.period / sample_rate_hz
    peak_y, peak_f = mean_peak(measured, grid, span), mean_peak(modelled, grid, span)
    return ForcePrediction(
        r2=coefficient_of_determination(y, f),
        normalised_r2=normalised_r2(mean_y, mean_f) if grid is not None else normalised_r2(y, f),
        peak_measured=peak_y,
        peak_modelled=peak_f,
        share=peak_f / peak_y if peak_y > 0 else float("nan"),
        rmse=float(np.sqrt(np.mean(error[good] ** 2))) if good.any() else float("nan"),
        error_by_phase=_error_by_phase(mean_y, mean_f),
        measured=thin(mean_y),
        modelled=thin(mean_f),
        period_s=period_s,
    )


def normalised_r2(measured: Array, modelled: Array) -> float:
    """R2 (4.1) of two forces, each scaled to run from 0 to 1; NaN where either stands still."""
    both = np.isfinite(measured) & np.isfinite(modelled)
    if both.sum() < 2 or np.ptp(measured[both]) == 0 or np.ptp(modelled[both]) == 0:
        return float("nan")
    return coefficient_of_determination(normalise(measured[both]), normalise(modelled[both]))


def mean_peak(force: Array, grid: PeriodGrid | None, span: tuple[int, int]) -> float:
    """Mean of the largest force of each period, N; the largest of the span where it does not repeat."""
    start, stop = span
    if grid is None and stop > start:
        grid = PeriodGrid(start, stop - start, 1)
    if grid is None:
        return float("nan")
    folded = grid.fold(force)
    some = np.isfinite(folded).any(axis=1)
    return float(np.mean(np.nanmax(folded[some], axis=1))) if some.any() else float("nan")


def _column_means(folded: Array) -> Array:
    count = np.isfinite(folded).sum(axis=0)
    total = np.nansum(folded, axis=0)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def _error_by_phase(measured: Array, modelled: Array) -> Mapping[str, float]:
    if len(measured) < 3 or not np.isfinite(measured).all():
        return {name: float("nan") for name in FORCE_PHASES}
    # The average period closes on itself, so the rate does too.
    even = _closed(measured)
    rate = (np.roll(even, -1) - np.roll(even, 1)) / 2.0
    labels = recognise(rate, speed_threshold(rate, FORCE_PHASE_THRESHOLD))
    error = modelled - measured
    result = {}
    for number, name in enumerate(FORCE_PHASES):
        part = error[(labels == number) & np.isfinite(error)]
        result[name] = float(part.mean()) if len(part) else float("nan")
    return result


def _closed(period: Array) -> Array:
    """An average period without the step between its ends that a drift leaves, shape (n,).

    One step would else be the fastest rise of all, beside which loading and unloading count as standstills.
    """
    step = (period[0] - period[-1]) - ((period[1] - period[0]) + (period[-1] - period[-2])) / 2.0
    return np.asarray(period + step * np.arange(len(period)) / len(period))


@dataclass(frozen=True)
class AngleStep:
    """One contact angle of the sweep: average period of the modelled force, its peak and R2."""

    angle_deg: float
    modelled: Array
    peak: float
    r2: float


SWEEP_DEG = (0.0, 15.0, 30.0, 45.0, 60.0)
"""Angles of thesis figure 5.2."""


def angle_sweep(
    traces: Traces, parameters: ParameterSet, angles_deg: tuple[float, ...] = SWEEP_DEG
) -> tuple[AngleStep, ...]:
    """Predict one contact run with the contact force leaning further and further (thesis figure 5.2).

    The thesis lets the force lean so that its lever about the PIP joint shrinks and the predicted force
    grows; that is a negative ``contact_angle`` of the nominal equations, whose positive sense leans away
    from the base. Where the lever reaches zero no force explains the torque and the force is NaN.
    R2 is over the average period.
    """
    steps = []
    for angle in angles_deg:
        result = judge(traces, predicted_force(traces, parameters, -np.radians(angle)))
        r2 = coefficient_of_determination(result.measured, result.modelled)
        steps.append(AngleStep(angle, result.modelled, result.peak_modelled, r2))
    return tuple(steps)
