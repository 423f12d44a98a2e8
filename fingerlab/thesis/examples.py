"""A few seconds of one run, kept as they are for the figures that show a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fingerlab.sessions.model import Array, Run
from fingerlab.signals.periods import usable
from fingerlab.signals.regions import REGIONS, recognise, region_mask, speed_threshold
from fingerlab.thesis.specs import FOUR_REGIONS, JOINTS, Joint
from fingerlab.thesis.traces import Traces

SHOWN_PERIODS = 3
SHOWN_SAMPLES = 6000
"""Kept at most, so that a slow trajectory does not fill memory."""

CLOUD_POINTS = 3000


@dataclass(frozen=True)
class Example:
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


def example(run: Run, traces: Traces) -> Example:
    """Cut the first whole periods (or a few seconds) out of a run."""
    signals, grid = traces.signals, traces.grid
    start, stop = usable(len(signals), signals.sample_rate_hz)
    length = int(SHOWN_PERIODS * signals.sample_rate_hz)
    if grid is not None:
        start, length = int(grid.start), int(SHOWN_PERIODS * grid.period)
    stop = min(stop, start + min(length, SHOWN_SAMPLES))
    assert signals.mcp is not None
    part = slice(start, stop)
    return Example(
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
