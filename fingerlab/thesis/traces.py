"""What the thesis' analysis sees of one run: tension, joint torques and speeds, cut into periods.

First what can be asked of it (method, delay and threshold); last the few seconds that are kept for figures.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.physics.nominal import (
    JointMotion,
    contact_lever_mcp,
    contact_lever_pip,
    mcp_torque,
    pip_torque,
    tension,
)
from fingerlab.rig.constants import Finger, Rig
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
from fingerlab.signals.prepare import Signals, prepare

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
    signals = prepare(run, rig)
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
