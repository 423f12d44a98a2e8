"""All runs of one cable together: the regression on concatenated regions (thesis section 4.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.models.file import ParameterEstimate
from fingerlab.thesis.onair import OnAirRun, RegionFit
from fingerlab.thesis.regression import Line, Misfit, Sums, fit_line
from fingerlab.thesis.specs import JOINTS, FitSpec, Joint

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


def _pooled_line(fits: Sequence[RegionFit]) -> Line | None:
    sums = [fit.sums for fit in fits if fit.sums is not None]
    if not sums:
        return None
    blocks = Sums.joined([s.merged() for s in sums] if len(sums) >= MINIMUM_RUN_BLOCKS else sums)
    misfits = [fit.misfit for fit in fits if fit.misfit is not None]
    misfit = None
    if misfits:
        # The misfit repeats from run to run as it does from period to period: averaged, not divided.
        misfit = Misfit(
            float(np.mean([m.variance for m in misfits])), float(np.mean([m.independent for m in misfits]))
        )
    return fit_line(blocks, misfit)
