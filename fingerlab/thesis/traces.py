"""What the thesis' analysis sees of one run, cut into periods, and straight lines through clouds of it.

Interval of a coefficient (90 %). Neighbouring samples of a low-passed signal are not independent, so
the variance has two parts. *What differs between blocks* (periods within a run, runs when several are
pooled) enters by the cluster-robust sandwich estimator, which allows any correlation inside a block
(Liang and Zeger 1986); the quantile is Student's t with blocks - 1 degrees of freedom. *What repeats in
every period* is misfit of the model that no further period averages away: it counts once, as the
low-pass leaves two independent values per cycle of its cut-off (2 x 5 Hz) and not as many as samples.

Of a run stand here first what can be asked of it (method, delay, threshold), last the seconds kept for
figures.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.text import LEVEL, ParameterEstimate
from fingerlab.physics.nominal import (
    JointMotion,
    contact_lever_mcp,
    contact_lever_pip,
    mcp_torque,
    pip_torque,
    tension,
)
from fingerlab.rig.file import Finger, Rig
from fingerlab.sessions.model import Array, Run
from fingerlab.sessions.trajectory import named_frequency
from fingerlab.signals.periods import (
    REGIONS,
    THRESHOLDS_PERCENT,
    PeriodGrid,
    period_grid,
    recognise,
    region_mask,
    repeats,
    settles,
    speed_threshold,
    usable,
)
from fingerlab.signals.prepare import THESIS_CUTOFF_HZ, Signals, prepare


@dataclass(frozen=True)
class RegressionSums:
    """Counts, means and centred sums of x and y over blocks; every array of shape (blocks,)."""

    count: Array
    mean_x: Array
    mean_y: Array
    xx: Array
    xy: Array
    yy: Array

    @classmethod
    def of_rows(cls, x: Array, y: Array) -> RegressionSums:
        """One block a row, from x and y of shape (rows, samples); rows that hold NaN are left out."""
        whole = np.isfinite(x).all(axis=1) & np.isfinite(y).all(axis=1)
        if not whole.all():
            x, y = x[whole], y[whole]
        mean_x, mean_y = x.mean(axis=1), y.mean(axis=1)
        dx, dy = x - mean_x[:, None], y - mean_y[:, None]
        count = np.full(len(x), float(x.shape[1]))
        return cls(count, mean_x, mean_y, _dot(dx, dx), _dot(dx, dy), _dot(dy, dy))

    @classmethod
    def joined(cls, parts: Sequence[RegressionSums]) -> RegressionSums:
        """All blocks of all parts, one after another."""
        names = ("count", "mean_x", "mean_y", "xx", "xy", "yy")
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))

    def __len__(self) -> int:
        return len(self.count)

    def merged(self) -> RegressionSums:
        """The same samples as one block (parallel-axis theorem, no loss of digits to large means)."""
        n = self.count.sum()
        mx, my = float(self.count @ self.mean_x / n), float(self.count @ self.mean_y / n)
        dx, dy = self.mean_x - mx, self.mean_y - my
        sums = (
            n,
            mx,
            my,
            self.xx.sum() + self.count @ dx**2,
            self.xy.sum() + self.count @ (dx * dy),
            self.yy.sum() + self.count @ dy**2,
        )
        return RegressionSums(*(np.array([float(v)]) for v in sums))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->i", a, b))


@dataclass(frozen=True)
class Misfit:
    """The part of a fit's residual that repeats in every period.

    Attributes:
        variance: its mean square, (unit of y)^2. independent: independent values in one period's region.
    """

    variance: float
    independent: float


@dataclass(frozen=True)
class RegressionLine:
    """``y = slope x + intercept`` by least squares, with standard errors and R2 (4.1).

    ``covariance`` is that of slope and intercept, from which follows how sure the line is at each x.
    """

    slope: float
    intercept: float
    r2: float
    slope_error: float
    intercept_error: float
    freedom: int
    samples: int
    blocks: int
    covariance: float

    def half_width(self, x: Array) -> Array:
        """Half the 90 % interval of the line at each x, same shape, unit of y; NaN for a single block."""
        if self.freedom < 1:
            return np.full_like(x, np.nan)
        variance = self.intercept_error**2 + 2.0 * x * self.covariance + x**2 * self.slope_error**2
        return quantile(self.freedom) * np.sqrt(np.maximum(variance, 0.0))

    def slope_estimate(self, unit: str, sign: float = 1.0) -> ParameterEstimate:
        """``sign`` times the slope with its 90 % interval."""
        return self._estimate(sign * self.slope, self.slope_error, unit)

    def intercept_estimate(self, unit: str) -> ParameterEstimate:
        """The intercept with its 90 % interval."""
        return self._estimate(self.intercept, self.intercept_error, unit)

    def _estimate(self, value: float, error: float, unit: str) -> ParameterEstimate:
        half = error * quantile(self.freedom) if self.freedom > 0 else np.nan
        return ParameterEstimate(value, unit, value - half, value + half)


def quantile(freedom: int) -> float:
    """Student's t that leaves 5 % on either side."""
    from scipy.stats import t as student  # slow to import

    return float(student.ppf(0.5 + LEVEL / 2, freedom))


def fit_line(blocks: RegressionSums, misfit: Misfit | None = None) -> RegressionLine | None:
    """Least-squares line through the samples behind ``blocks``; None where x does not vary."""
    if len(blocks) == 0:
        return None
    total = blocks.merged()
    n, mx, my = total.count[0], total.mean_x[0], total.mean_y[0]
    sxx, sxy, syy = total.xx[0], total.xy[0], total.yy[0]
    if n < 3 or not sxx > 1e-18 * n * max(mx**2, 1e-300):
        return None
    slope = sxy / sxx
    residual = max(syy - slope * sxy, 0.0)
    # Scores of each block about the overall mean of x, where slope and level are uncorrelated.
    offset = blocks.mean_x - mx
    error = blocks.mean_y - my - slope * offset
    level_score = blocks.count * error
    slope_score = blocks.xy - slope * blocks.xx + offset * level_score
    g = len(blocks)
    scale = g / (g - 1.0) if g > 1 else np.nan
    slope_variance = scale * float(slope_score @ slope_score) / sxx**2
    level_variance = scale * float(level_score @ level_score) / n**2
    cross = scale * float(slope_score @ level_score) / (sxx * n)
    if misfit is not None:
        spread = misfit.variance / max(misfit.independent - 2.0, 1.0)
        slope_variance += spread / (sxx / n)
        level_variance += spread
    intercept_variance = level_variance + mx**2 * slope_variance - 2.0 * mx * cross
    return RegressionLine(
        slope=float(slope),
        intercept=float(my - slope * mx),
        r2=float(1.0 - residual / syy) if syy > 0 else float("nan"),
        slope_error=float(np.sqrt(slope_variance)),
        intercept_error=float(np.sqrt(max(intercept_variance, 0.0))),
        freedom=g - 1,
        samples=int(n),
        blocks=g,
        covariance=float(cross - mx * slope_variance),
    )


def repeating_misfit(
    x: Array, y: Array, line: RegressionLine, seconds: float, cutoff_hz: float = THESIS_CUTOFF_HZ
) -> Misfit:
    """Misfit that the average period still shows, from its samples in one region.

    Args:
        x, y: the average period inside the region, shape (k,). seconds: how long the region lasts.
        cutoff_hz: of the filter, Hz, to which the samples are as good as two a period.
    """
    error = y - line.slope * x - line.intercept
    return Misfit(float(np.mean(error**2)), 2.0 * cutoff_hz * seconds)


def coefficient_of_determination(measured: Array, modelled: Array) -> float:
    """R2 of (4.1) over the samples where both are numbers; NaN where nothing varies."""
    both = np.isfinite(measured) & np.isfinite(modelled)
    if both.sum() < 2:
        return float("nan")
    y, f = measured[both], modelled[both]
    total = float(np.sum((y - y.mean()) ** 2))
    return 1.0 - float(np.sum((y - f) ** 2)) / total if total > 0 else float("nan")


Joint = Literal["mcp", "pip"]
Method = Literal["regions", "flexion-extension", "whole"]
Delay = Literal["none", "xcorr", "findsignal", "finddelay"]

JOINTS: tuple[Joint, ...] = ("mcp", "pip")
JOINT_TITLES = {"mcp": "MCP", "pip": "PIP"}


@dataclass(frozen=True)
class FitSpec:
    """One way to fit moment arms and losses.

    Attributes:
        method: ``regions`` (four, section 4.1), ``flexion-extension`` (section 4.2) or ``whole``
            (every usable sample of a run, whatever the finger does).
        delay: ``none``; ``xcorr``, cross-correlation with the period as a circle; ``findsignal``, least
            squared distance, one delay a region; ``finddelay``, cross-correlation as Matlab's function
            does it, which the thesis used and which is biased towards zero.
        threshold: per cent of the joint's speed range that parts motion from standstill.
    """

    method: Method = "regions"
    delay: Delay = "none"
    threshold: float = THRESHOLDS_PERCENT[0]

    @property
    def regions(self) -> tuple[str, ...]:
        """Ids of the regions that the method tells apart."""
        if self.method == "regions":
            return REGIONS
        return ("flexion", "extension") if self.method == "flexion-extension" else ("whole",)

    @property
    def title(self) -> str:
        """In words, for tables and figures."""
        if self.method == "whole":
            return "whole run" if self.delay == "none" else f"whole run, delay by {self.delay}"
        delay = "no delay" if self.delay == "none" else f"delay by {self.delay}"
        name = "four regions" if self.method == "regions" else "flexion and extension"
        return f"{name}, threshold {self.threshold:g} %, {delay}"


FOUR_REGIONS = FitSpec("regions", "none", 10)
"""Section 4.1."""

THESIS_DELAYS: tuple[Delay, ...] = ("none", "finddelay", "findsignal")
"""The three columns of figure 4.15."""


def thesis_specs() -> tuple[FitSpec, ...]:
    """Every fit that chapters 4 and 5 report."""
    grid = (FitSpec("flexion-extension", d, t) for d in THESIS_DELAYS for t in THRESHOLDS_PERCENT)
    return (FOUR_REGIONS, *grid)


@dataclass(frozen=True)
class Traces:
    """One run on the way into the analysis; arrays of shape (n,), SI.

    Attributes:
        tension: cable tension T at the pulley, N. lhs: left-hand side of each joint's equation, N m.
        speed: joint speeds, rad/s. grid: the whole periods, None for a run that does not repeat.
    """

    signals: Signals
    finger: Finger
    cable: str
    tension: Array
    lhs: Mapping[Joint, Array]
    speed: Mapping[Joint, Array]
    grid: PeriodGrid | None
    frequency_hz: float

    def lever(self, joint: Joint, contact_angle: float = 0.0) -> Array:
        """Lever of the contact force about a joint, m, shape (n,)."""
        angles = self.signals.mcp, self.signals.pip
        assert angles[0] is not None
        assert angles[1] is not None
        lever = contact_lever_pip if joint == "pip" else contact_lever_mcp
        return lever(self.finger, angles[0], angles[1], contact_angle)


def trace(run: Run, rig: Rig) -> Traces:
    """Read, filter and evaluate one finger run.

    Raises:
        UserError: the rig knows no finger or no pulley, or the run lacks a channel that the equations need.
    """
    if rig.finger is None:
        raise UserError("The session's rig gives no finger; 'finger' (masses, lengths, springs) is needed.")
    for channel in ("mcp_angle", "pip_angle"):
        if not run.has(channel):
            raise UserError(f"Run {run.name} has no channel '{channel}'; the joint equations need it in rad.")
    signals = prepare(run)
    motion = joint_motion(signals)
    return Traces(
        signals,
        rig.finger,
        run.cable,
        tension(rig.motor, signals.motor_torque, signals.motor_acceleration),
        {"mcp": mcp_torque(rig.finger, motion).total, "pip": pip_torque(rig.finger, motion).total},
        {"mcp": motion.mcp_velocity, "pip": motion.pip_velocity},
        run_grid(run, signals),
        named_frequency(run),
    )


def joint_motion(signals: Signals) -> JointMotion:
    """The joints' angles, speeds and accelerations of a run that has them."""
    parts = (
        signals.mcp,
        signals.pip,
        signals.mcp_velocity,
        signals.pip_velocity,
        signals.mcp_acceleration,
        signals.pip_acceleration,
    )
    for part in parts:
        if part is None or not np.isfinite(part).all():
            raise UserError(
                f"Run {signals.run_name} has joint angles that are missing or not numbers; "
                "the joint equations need both angles throughout."
            )
    mcp, pip, mcp_v, pip_v, mcp_a, pip_a = (p for p in parts if p is not None)
    return JointMotion(mcp, pip, mcp_v, pip_v, mcp_a, pip_a)


def run_grid(run: Run, signals: Signals) -> PeriodGrid | None:
    """The run's whole periods where its motor truly repeats at the trajectory's frequency, else None."""
    grid = period_grid(len(signals), run.sample_rate_hz, named_frequency(run))
    return grid if grid is not None and repeats(signals.motor_position, grid) else None


def settled(traces: Traces) -> Traces:
    """A run to predict, with its period also where that is known only from when the finger has settled.

    A fit needs a run that repeats throughout; a finger that presses settles for a few seconds, and what a
    model predicts of it can be judged all the same.
    """
    if traces.grid is not None:
        return traces
    signals = traces.signals
    grid = period_grid(len(signals), signals.sample_rate_hz, traces.frequency_hz)
    known = grid is not None and settles(signals.motor_position, grid)
    return replace(traces, grid=grid) if known else traces


SHOWN_PERIODS = 3
SHOWN_SAMPLES = 6000
"""Kept at most, so that a slow trajectory does not fill memory."""

CLOUD_POINTS = 3000


@dataclass(frozen=True)
class RunExcerpt:
    """Some periods of one run; arrays of shape (k,), SI; ``cloud`` is over the whole run, thinned.

    Attributes:
        raw_mcp, mcp: angle as recorded and filtered, rad. cloud: tension and LHS by joint and region.
        start, stop: samples of the run that are shown, from the start of a period. period_samples: 0 where
            the run does not repeat.
    """

    run: str
    time: Array
    raw_mcp: Array
    mcp: Array
    speed: Mapping[Joint, Array]
    tension: Array
    lhs: Mapping[Joint, Array]
    force: Array | None
    start: int
    stop: int
    period_samples: float
    cloud: Mapping[tuple[Joint, str], tuple[Array, Array]]

    def cut(self, values: Array) -> Array:
        """The shown stretch of a signal of the whole run, as a copy."""
        return values[self.start : self.stop].copy()


def example(run: Run, traces: Traces) -> RunExcerpt:
    """Cut the first whole periods (or a few seconds) out of a run."""
    signals, grid = traces.signals, traces.grid
    start, stop = usable(len(signals), signals.sample_rate_hz)
    length = int(SHOWN_PERIODS * signals.sample_rate_hz)
    if grid is not None:
        start, length = int(grid.start), int(SHOWN_PERIODS * grid.period)
    stop = min(stop, start + min(length, SHOWN_SAMPLES))
    assert signals.mcp is not None
    part = slice(start, stop)
    return RunExcerpt(
        signals.run_name,
        signals.time[part].copy(),
        run.channel("mcp_angle", start, stop),
        signals.mcp[part].copy(),
        {joint: traces.speed[joint][part].copy() for joint in JOINTS},
        traces.tension[part].copy(),
        {joint: traces.lhs[joint][part].copy() for joint in JOINTS},
        None if signals.force is None else signals.force[part].copy(),
        start,
        stop,
        0.0 if grid is None else grid.period,
        _clouds(traces),
    )


def _clouds(traces: Traces) -> Mapping[tuple[Joint, str], tuple[Array, Array]]:
    grid = traces.grid
    if grid is None:
        return {}
    tension = grid.fold(traces.tension)
    clouds: dict[tuple[Joint, str], tuple[Array, Array]] = {}
    for joint in JOINTS:
        lhs, speed = grid.fold(traces.lhs[joint]), grid.mean(traces.speed[joint])
        labels = recognise(speed, speed_threshold(speed, FOUR_REGIONS.threshold))
        for region in REGIONS:
            mask = region_mask(labels, region)
            if mask is not None:
                x, y = tension[:, mask].ravel(), lhs[:, mask].ravel()
                step = max(len(x) // CLOUD_POINTS, 1)
                clouds[joint, region] = (np.array(x[::step]), np.array(y[::step]))
    return clouds
