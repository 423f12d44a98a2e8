"""Regression of LHS on tension, region by region: one run reduced to sums, then all runs pooled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.core.text import ParameterEstimate
from fingerlab.sessions.model import Array
from fingerlab.signals.periods import (
    PeriodGrid,
    consecutive_mask,
    cross_correlation_delay,
    finddelay,
    findsignal_delay,
    recognise,
    region_mask,
    speed_threshold,
    usable,
)
from fingerlab.signals.prepare import thesis_cutoff_hz
from fingerlab.thesis.traces import (
    JOINTS,
    FitSpec,
    Joint,
    Misfit,
    RegressionLine,
    RegressionSums,
    Traces,
    fit_line,
    repeating_misfit,
)

LONGEST_DELAY_S = 0.5
"""Delays looked for in a run that does not repeat, s either way; half a period of the 1 Hz protocol."""

KEPT_PHASES = 500
"""Phases of an average period that are kept for figures; a memory bound, no part of the analysis."""

BLOCK_S = 1.0
"""Length of a block of a run that does not repeat, s: long against the 5 Hz filter (assumed)."""


@dataclass(frozen=True)
class AveragePeriod:
    """Average period of one run, thinned to at most ``KEPT_PHASES`` phases; SI, arrays (phases,)."""

    period_s: float
    tension: Array
    lhs: Mapping[Joint, Array]
    speed: Mapping[Joint, Array]


@dataclass(frozen=True)
class RegionFit:
    """One line: one run, one joint, one region. ``line`` is None where the region was not found."""

    line: RegressionLine | None
    sums: RegressionSums | None = None
    misfit: Misfit | None = None
    delay_s: float = 0.0


RegionKey = tuple[Joint, str]


@dataclass(frozen=True)
class OnAirRun:
    """All that is kept of an on-air run.

    ``fits[spec][joint, region]`` holds the lines; a spec that needs a periodic run is absent from a run
    that is not. ``delays_s[joint]`` holds the delay of the whole period by each method, s.
    """

    name: str
    cable: str
    cable_sign: int
    frequency_hz: float
    periods: int
    curves: AveragePeriod | None
    fits: Mapping[FitSpec, Mapping[RegionKey, RegionFit]]
    delays_s: Mapping[Joint, Mapping[str, float]]


def reduce_run(traces: Traces, specs: Sequence[FitSpec]) -> OnAirRun:
    """Reduce one on-air run to what the fits ``specs`` and the figures need."""
    grid = traces.grid
    fits: dict[FitSpec, Mapping[RegionKey, RegionFit]] = {}
    delays: dict[Joint, Mapping[str, float]] = {}
    folded = {} if grid is None else {joint: _FoldedJoint(traces, joint, grid) for joint in JOINTS}
    for joint, work in folded.items():
        delays[joint] = {name: work.seconds(work.whole_delay(name)) for name in ("xcorr", "finddelay")}
    for spec in specs:
        if spec.method == "whole":
            fits[spec] = {(joint, "whole"): _whole(traces, joint, spec, folded) for joint in JOINTS}
        elif grid is not None:
            fits[spec] = {(j, r): folded[j].fit(spec, r) for j in JOINTS for r in spec.regions}
    signals = traces.signals
    return OnAirRun(
        signals.run_name,
        traces.cable,
        signals.cable_sign,
        traces.frequency_hz,
        0 if grid is None else grid.count,
        None if grid is None else average_period(traces, grid),
        fits,
        delays,
    )


def average_period(traces: Traces, grid: PeriodGrid) -> AveragePeriod:
    """The average period of tension, LHS and speed, thinned for keeping."""
    return AveragePeriod(
        grid.period / traces.signals.sample_rate_hz,
        thin(grid.mean(traces.tension)),
        {joint: thin(grid.mean(traces.lhs[joint])) for joint in JOINTS},
        {joint: thin(grid.mean(traces.speed[joint])) for joint in JOINTS},
    )


def thin(curve: Array) -> Array:
    """At most ``KEPT_PHASES`` evenly spaced values of a curve, as a copy."""
    if len(curve) <= KEPT_PHASES:
        return curve.copy()
    return np.asarray(curve[(np.arange(KEPT_PHASES) * len(curve)) // KEPT_PHASES])


class _FoldedJoint:
    """One joint of a periodic run, folded once and shifted as each spec asks."""

    def __init__(self, traces: Traces, joint: Joint, grid: PeriodGrid) -> None:
        self.traces, self.grid = traces, grid
        self.rate = traces.signals.sample_rate_hz
        self.lhs = grid.fold(traces.lhs[joint])
        self.mean_lhs = np.asarray(self.lhs.mean(axis=0))
        self.mean_speed = grid.mean(traces.speed[joint])
        self.signed_tension = traces.signals.cable_sign * grid.mean(traces.tension)
        self._shifted: dict[float, Array] = {}

    def fit(self, spec: FitSpec, region: str) -> RegionFit:
        labels = recognise(self.mean_speed, speed_threshold(self.mean_speed, spec.threshold))
        find = region_mask if spec.method == "regions" else consecutive_mask
        mask = find(labels, region)  # type: ignore[arg-type]
        if mask is None:
            return RegionFit(None, delay_s=float("nan"))
        if spec.delay == "findsignal":
            lag = findsignal_delay(self.mean_lhs, self.signed_tension, mask)
        else:
            lag = self.whole_delay(spec.delay)
        x, y = self.shifted_tension(lag)[:, mask], self.lhs[:, mask]
        sums = RegressionSums.of_rows(x, y)
        line = fit_line(sums)
        if line is None:
            return RegionFit(None, delay_s=self.seconds(lag))
        seconds = float(mask.sum()) * self.grid.period / self.grid.phases / self.rate
        misfit = repeating_misfit(
            np.nanmean(x, axis=0), self.mean_lhs[mask], line, seconds, thesis_cutoff_hz(self.rate)
        )
        return RegionFit(fit_line(sums, misfit), sums, misfit, self.seconds(lag))

    def whole_delay(self, method: str) -> int:
        """Delay of the whole average period, in phases."""
        if method == "none":
            return 0
        estimate = finddelay if method == "finddelay" else cross_correlation_delay
        return estimate(self.mean_lhs, self.signed_tension)

    def seconds(self, lag: int) -> float:
        return lag * self.grid.period / self.grid.phases / self.rate

    def shifted_tension(self, lag: int) -> Array:
        if lag not in self._shifted:
            shift = lag * self.grid.period / self.grid.phases
            self._shifted[lag] = self.grid.fold(self.traces.tension, shift)
        return self._shifted[lag]


def _whole(traces: Traces, joint: Joint, spec: FitSpec, folded: Mapping[Joint, _FoldedJoint]) -> RegionFit:
    """A line through every usable sample of a run, periodic or not, in blocks of about a second."""
    rate = traces.signals.sample_rate_hz
    shift = 0 if spec.delay == "none" else round(_run_delay_s(traces, joint, spec, folded) * rate)
    start, stop = usable(len(traces.tension), rate)
    start = max(start, shift)
    stop = min(stop, len(traces.tension) + min(shift, 0))
    size = max(round(BLOCK_S * rate), 3)
    rows = (stop - start) // size
    if rows < 1:
        return RegionFit(None, delay_s=shift / rate)
    end = start + rows * size
    x = traces.tension[start - shift : end - shift].reshape(rows, size)
    y = traces.lhs[joint][start:end].reshape(rows, size)
    sums = RegressionSums.of_rows(x, y)
    return RegionFit(fit_line(sums), sums, None, shift / rate)


def _run_delay_s(traces: Traces, joint: Joint, spec: FitSpec, folded: Mapping[Joint, _FoldedJoint]) -> float:
    """Delay of a whole run, s: from its average period, or from the run itself where it does not repeat."""
    if joint in folded:
        return folded[joint].seconds(folded[joint].whole_delay(spec.delay))
    rate = traces.signals.sample_rate_hz
    start, stop = usable(len(traces.tension), rate)
    if stop - start < 3:
        return 0.0
    signed = traces.signals.cable_sign * traces.tension[start:stop]
    return finddelay(traces.lhs[joint][start:stop], signed, round(LONGEST_DELAY_S * rate)) / rate


MINIMUM_RUN_BLOCKS = 3
"""From this many runs on, runs are the blocks of the interval; below it, their periods are."""


@dataclass(frozen=True)
class Spread:
    """Values of one number over runs, NaN where a run has none; mean and deviation over those that do."""

    values: tuple[float, ...]

    @property
    def mean(self) -> float:
        """Mean over the runs that have the number."""
        good = self._good()
        return float(np.mean(good)) if good else float("nan")

    @property
    def deviation(self) -> float:
        """Sample standard deviation over the runs; NaN for fewer than two."""
        good = self._good()
        return float(np.std(good, ddof=1)) if len(good) > 1 else float("nan")

    def _good(self) -> list[float]:
        return [v for v in self.values if np.isfinite(v)]


@dataclass(frozen=True)
class Parameters:
    """Moment arm and loss of one joint in one region, as fitted on one cable.

    ``moment_arm`` is the magnitude a or b (m): s times the slope. A negative one means that the torque
    did not follow the cable. ``loss`` is the friction loss L (N m), ``delay_s`` the mean delay (s).
    """

    joint: Joint
    region: str
    cable: str
    moment_arm: ParameterEstimate
    loss: ParameterEstimate
    r2: float
    delay_s: float
    samples: int
    runs: tuple[str, ...]


@dataclass(frozen=True)
class RegionResult:
    """One joint and region over all runs of a cable; ``pooled`` None where no run showed the region."""

    pooled: Parameters | None
    runs: tuple[str, ...]
    r2: Spread
    delays_s: Spread
    moment_arms: Spread
    losses: Spread


CableFit = Mapping[tuple[Joint, str], RegionResult]


def pool(runs: Sequence[OnAirRun], spec: FitSpec) -> CableFit:
    """Pool the runs of one cable. Runs that the spec could not use are left out."""
    used = [run for run in runs if spec in run.fits]
    return {(j, r): _pool_region(used, spec, j, r) for j in JOINTS for r in spec.regions}


def _pool_region(runs: Sequence[OnAirRun], spec: FitSpec, joint: Joint, region: str) -> RegionResult:
    fits = [run.fits[spec][joint, region] for run in runs]
    found = [(run, fit) for run, fit in zip(runs, fits, strict=True) if fit.sums is not None]
    pooled = None
    line = _pooled_line([fit for _, fit in found])
    if line is not None:
        sign = float(found[0][0].cable_sign)
        pooled = Parameters(
            joint,
            region,
            found[0][0].cable,
            line.slope_estimate("m", sign),
            line.intercept_estimate("N m"),
            line.r2,
            float(np.mean([fit.delay_s for _, fit in found])),
            line.samples,
            tuple(run.name for run, _ in found),
        )
    return RegionResult(
        pooled,
        tuple(run.name for run in runs),
        Spread(tuple(_of(fit, "r2") for fit in fits)),
        Spread(tuple(fit.delay_s for fit in fits)),
        Spread(tuple(run.cable_sign * _of(fit, "slope") for run, fit in zip(runs, fits, strict=True))),
        Spread(tuple(_of(fit, "intercept") for fit in fits)),
    )


def _of(fit: RegionFit, name: str) -> float:
    return float(getattr(fit.line, name)) if fit.line is not None else float("nan")


def _pooled_line(fits: Sequence[RegionFit]) -> RegressionLine | None:
    sums = [fit.sums for fit in fits if fit.sums is not None]
    if not sums:
        return None
    blocks = RegressionSums.joined([s.merged() for s in sums] if len(sums) >= MINIMUM_RUN_BLOCKS else sums)
    misfits = [fit.misfit for fit in fits if fit.misfit is not None]
    misfit = None
    if misfits:
        # The misfit repeats from run to run as it does from period to period: averaged, not divided.
        misfit = Misfit(
            float(np.mean([m.variance for m in misfits])), float(np.mean([m.independent for m in misfits]))
        )
    return fit_line(blocks, misfit)
