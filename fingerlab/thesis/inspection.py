"""A fit with what shows how it came about: regions in time, points of each line, delays, kinematic arms."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.core.text import ParameterEstimate
from fingerlab.physics.nominal import cable_wound
from fingerlab.rig.file import Rig
from fingerlab.sessions.model import Array, Session
from fingerlab.signals.periods import (
    REGIONS,
    consecutive_mask,
    recognise,
    region_mask,
    speed_threshold,
    usable,
)
from fingerlab.thesis.fitting import SessionFit, assemble, on_air_runs
from fingerlab.thesis.onair import OnAirRun, RegionFit, reduce_run
from fingerlab.thesis.prediction import delayed
from fingerlab.thesis.traces import CLOUD_POINTS, JOINTS, FitSpec, Joint, Traces, quantile, trace

LARGEST_CONDITION = 1e8
"""Of the normal equations: beyond it the angles move as one and only their sum is known (assumed)."""


@dataclass(frozen=True)
class CableSums:
    """Centred normal equations of one run: ``matrix`` (2, 2), rad^2; ``right`` (2,), rad m."""

    cable: str
    matrix: Array
    right: Array


def cable_sums(traces: Traces, rig: Rig) -> CableSums:
    """Reduce one run. Each run keeps its own x0, because the motor is zeroed anew."""
    signals = traces.signals
    assert signals.mcp is not None
    assert signals.pip is not None
    part = slice(*usable(len(signals), signals.sample_rate_hz))
    angles = signals.cable_sign * np.stack([signals.mcp[part], signals.pip[part]])
    angles = angles - angles.mean(axis=1, keepdims=True)
    wound = cable_wound(rig.motor, signals.motor_position[part])
    return CableSums(traces.cable, angles @ angles.T, angles @ (wound - wound.mean()))


def kinematic_arms(runs: Sequence[CableSums]) -> dict[Joint, ParameterEstimate] | None:
    """Both moment arms of one cable, m, with 90 % intervals.

    The interval is cluster-robust with the runs as clusters (Liang and Zeger 1986), Student's t with runs - 1
    degrees of freedom; NaN bounds for a single run. None where the two angles move as one.
    """
    matrix = sum((run.matrix for run in runs), np.zeros((2, 2)))
    right = sum((run.right for run in runs), np.zeros(2))
    if not runs or not np.linalg.cond(matrix) < LARGEST_CONDITION:
        return None
    inverse = np.linalg.inv(matrix)
    arms = inverse @ right
    half = np.full(2, np.nan)
    if len(runs) > 1:
        scores = np.stack([run.right - run.matrix @ arms for run in runs])
        count = len(runs)
        variance = inverse @ (scores.T @ scores) @ inverse * count / (count - 1.0)
        half = quantile(count - 1) * np.sqrt(np.diag(variance))
    return {
        joint: ParameterEstimate(float(arms[i]), "m", float(arms[i] - half[i]), float(arms[i] + half[i]))
        for i, joint in enumerate(JOINTS)
    }


LINE_POINTS = 40


@dataclass(frozen=True)
class Plane:
    """Points of one joint and region of a run: tension (N) and LHS (N m), (k,), thinned.

    ``x``, ``line``, ``half`` draw the run's own line and half its 90 % interval; ``pooled`` that of all runs
    of the cable, None without one. Shapes (``LINE_POINTS``,).
    """

    tension: Array
    lhs: Array
    x: Array
    line: Array
    half: Array
    r2: float
    pooled: Array | None


@dataclass(frozen=True)
class FitView:
    """One on-air run as the fit saw it.

    Attributes:
        time: s from the start of the average period, (k,). speed: rad/s, (k,), by joint; both empty for a
            run that does not repeat.
        thresholds: rad/s by joint. spans: region, start and stop (s) in the average period, by joint.
        planes: by joint and region; those that the run shows.
    """

    name: str
    cable: str
    time: Array
    speed: Mapping[Joint, Array]
    thresholds: Mapping[Joint, float]
    spans: Mapping[Joint, tuple[tuple[str, float, float], ...]]
    planes: Mapping[tuple[Joint, str], Plane]


@dataclass(frozen=True)
class Inspection:
    """Everything that there is to see of a fit.

    Attributes:
        kinematic: moment arms (m) that the cable wound on the pulley gives, by cable and joint; an entry is
            missing where the angles move as one.
        delays_s: delay of LHS after tension, by joint: of each region (method ``findsignal``), else of the
            whole period by cross-correlation; name of the series, and one value a run of ``views``, s.
    """

    fit: SessionFit
    views: Mapping[str, FitView]
    kinematic: Mapping[str, Mapping[Joint, ParameterEstimate]]
    delays_s: Mapping[Joint, Mapping[str, tuple[float, ...]]]


def inspect_session(session: Session, spec: FitSpec, progress: Progress | None = None) -> Inspection:
    """Fit a session and keep what shows how; run by run, so that memory holds no recording.

    Raises:
        UserError: as :func:`fingerlab.thesis.fitting.fit_session`.
    """
    if spec.method == "whole" and spec.delay == "findsignal":
        raise UserError(
            "The delay 'findsignal' belongs to a region and the method 'whole run' has none; "
            "choose regions, or the delay by cross-correlation."
        )
    runs = on_air_runs(session)
    reduced: list[OnAirRun] = []
    views: dict[str, FitView] = {}
    sums: list[CableSums] = []
    for number, run in enumerate(runs):
        if progress is not None:
            progress(number / len(runs), f"run {run.name}")
        traces = trace(run, session.rig)
        one = reduce_run(traces, [spec])
        reduced.append(one)
        sums.append(cable_sums(traces, session.rig))
        if spec in one.fits:
            views[one.name] = _view(traces, one, spec)
    fit = assemble(session, spec, reduced)
    used = {name for names in fit.used.values() for name in names}
    views = {name: _with_pooled(view, fit) for name, view in views.items() if name in used}
    kinematic = {}
    for cable in fit.cables:
        arms = kinematic_arms([one for one in sums if one.cable == cable])
        if arms is not None:
            kinematic[cable] = arms
    return Inspection(fit, views, kinematic, _delays(fit, tuple(views)))


def _view(traces: Traces, run: OnAirRun, spec: FitSpec) -> FitView:
    curves = run.curves
    planes: dict[tuple[Joint, str], Plane] = {}
    for (joint, region), fit in run.fits[spec].items():
        found = _points(traces, joint, region, spec, fit)
        if found is not None and fit.line is not None:
            planes[joint, region] = _plane(*found, fit)
    if curves is None:
        return FitView(run.name, run.cable, np.empty(0), {}, {}, {}, planes)
    count = len(curves.tension)
    time = np.arange(count) * curves.period_s / count
    thresholds = {joint: speed_threshold(curves.speed[joint], spec.threshold) for joint in JOINTS}
    spans = {joint: region_spans(curves.speed[joint], thresholds[joint], curves.period_s) for joint in JOINTS}
    return FitView(run.name, run.cable, time, curves.speed, thresholds, spans, planes)


def region_spans(speed: Array, threshold: float, period_s: float) -> tuple[tuple[str, float, float], ...]:
    """Region, start and stop (s) one after another through the average period."""
    labels = recognise(speed, threshold)
    edges = [0, *(np.flatnonzero(np.diff(labels)) + 1).tolist(), len(labels)]
    step = period_s / len(labels)
    return tuple((REGIONS[labels[a]], a * step, b * step) for a, b in itertools.pairwise(edges))


def _points(
    traces: Traces, joint: Joint, region: str, spec: FitSpec, fit: RegionFit
) -> tuple[Array, Array] | None:
    """Tension, delayed as in the fit, and LHS of one region; thinned."""
    rate, grid = traces.signals.sample_rate_hz, traces.grid
    if spec.method == "whole":
        part = slice(*usable(len(traces.tension), rate))
        x = delayed(traces.tension, round(fit.delay_s * rate))[part]
        return _thinned(x, traces.lhs[joint][part])
    if grid is None:
        return None
    speed = grid.mean(traces.speed[joint])
    labels = recognise(speed, speed_threshold(speed, spec.threshold))
    find = region_mask if spec.method == "regions" else consecutive_mask
    mask = find(labels, next(r for r in REGIONS if r == region))
    if mask is None or not np.isfinite(fit.delay_s):
        return None
    x = grid.fold(traces.tension, fit.delay_s * rate)[:, mask]
    return _thinned(x.ravel(), grid.fold(traces.lhs[joint])[:, mask].ravel())


def _thinned(x: Array, y: Array) -> tuple[Array, Array]:
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    step = max(len(x) // CLOUD_POINTS, 1)
    return x[::step].copy(), y[::step].copy()


def _plane(x: Array, y: Array, fit: RegionFit) -> Plane:
    assert fit.line is not None
    ends = np.linspace(float(x.min()), float(x.max()), LINE_POINTS)
    line = fit.line.slope * ends + fit.line.intercept
    return Plane(x, y, ends, line, fit.line.half_width(ends), fit.line.r2, None)


def _with_pooled(view: FitView, fit: SessionFit) -> FitView:
    sign = 1.0 if view.cable == "flexion" else -1.0
    planes = {}
    for key, plane in view.planes.items():
        found = fit.cables[view.cable][key].pooled
        line = None if found is None else sign * found.moment_arm.value * plane.x + found.loss.value
        planes[key] = replace(plane, pooled=line)
    return replace(view, planes=planes)


def _delays(fit: SessionFit, names: tuple[str, ...]) -> dict[Joint, dict[str, tuple[float, ...]]]:
    runs = {run.name: run for run in fit.runs}
    result: dict[Joint, dict[str, tuple[float, ...]]] = {}
    for joint in JOINTS:
        if fit.spec.delay == "findsignal":
            result[joint] = {
                region: tuple(runs[name].fits[fit.spec][joint, region].delay_s for name in names)
                for region in fit.spec.regions
            }
        else:
            result[joint] = {
                "whole": tuple(
                    runs[name].delays_s[joint]["xcorr"] if joint in runs[name].delays_s else float("nan")
                    for name in names
                )
            }
    return result
