"""Stretches of a recording that are kept to be drawn, and what a model says of one.

All is in the units of the fit, which are reduced ones where scales are not SI.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fingerlab.diagnosis.answer.error_parts import ExcludedInterval
from fingerlab.diagnosis.equations.features import FORCE
from fingerlab.diagnosis.gram.decimation import Decimated, counted
from fingerlab.diagnosis.gram.sums import Group, Reduced
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.settings import NARROW_RATE_HZ
from fingerlab.diagnosis.signals.conditions import GroupKey, group_key
from fingerlab.diagnosis.signals.filters import decimate
from fingerlab.effects.base import COORDINATE_UNITS, Row
from fingerlab.effects.transmission import winding_state
from fingerlab.physics import nominal
from fingerlab.physics.motion import Motion
from fingerlab.sessions.model import CABLE_NAMES, Array, BoolArray, Run, Session

RunOffsets = Mapping[tuple[str, str], Array]
"""What a run's own constants add to the residuals, (5,) over ``Row``, by session and run."""


@dataclass(frozen=True)
class Kept:
    """One stretch as it was reduced, with what its fingerprints are drawn against."""

    session: str
    run: str
    phase: str
    key: GroupKey
    columns: Array  # (n, features), float32
    taut: BoolArray
    rest: BoolArray
    time: Array
    coordinates: Mapping[str, Array]
    levers: tuple[Array, Array] | None  # of the contact force about MCP and PIP, m
    repaired_at: Array  # s, samples that were put right
    run_ends: float  # s


def kept_stretch(session: Session, run: Run, low: Decimated) -> Kept:
    """A stretch as the reduction forms it, to be kept."""
    motion = low.wide
    levers = None
    if motion.force is not None:
        finger, q = motion.finger_and_joints
        both = np.stack(
            (nominal.contact_lever_mcp(finger, q.mcp, q.pip), nominal.contact_lever_pip(finger, q.mcp, q.pip))
        )
        both = decimate(both[:, counted(motion)])
        levers = (both[0], both[1])
    return Kept(
        str(session.path), run.name, run.phase, group_key(run), low.columns.astype(np.float32), low.taut,
        low.rest, low.time, _coordinates(motion), levers, motion.repaired_at, run.seconds,
    )  # fmt: skip


def _coordinates(motion: Motion) -> dict[str, Array]:
    wide = {
        "time": motion.time,
        "motor speed": motion.velocity,
        "motor angle": motion.position,
        "motor acceleration": motion.acceleration,
        "tension": motion.tension,
    }
    if motion.joints is None:
        wide[TORQUE_BY_WAY] = motion.torque * winding_state(motion)
    else:
        wide[TENSION_BY_WAY] = motion.tension * winding_state(motion)
        q = motion.joints
        wide |= {
            "joint speed mcp": q.mcp_velocity,
            "joint speed pip": q.pip_velocity,
            "joint angle mcp": q.mcp,
            "joint angle pip": q.pip,
            "joint acceleration mcp": q.mcp_acceleration,
            "joint acceleration pip": q.pip_acceleration,
            "difference of joint angles": q.mcp - q.pip,
        }
    if motion.force is not None:
        wide["force"] = motion.force
    narrowed = decimate(np.stack([v[counted(motion)] for v in wide.values()]))
    return {name: narrowed[i] for i, name in enumerate(wide)}


def residual_of(fitted: FittedModel, group: Group, kept: Kept, row: Row, offsets: RunOffsets) -> Array:
    """Residual of an equation over a stretch less the run's own constant, in the fit's units (N, m, N m)."""
    h, _ = fitted.model.coefficients(fitted.fit.values, group)
    chosen = fitted.model.rows == row
    own = offsets.get((kept.session, kept.run))
    found = np.asarray(kept.columns[:, fitted.model.pick.signals[chosen]] @ h[chosen], dtype=float)
    return found if own is None else found - own[row]


def arms_of(fitted: FittedModel, group: Group) -> tuple[float, float]:
    """Moment arms about MCP and PIP with the sign of the group's routing, in the model's units (m)."""
    routing = CABLE_NAMES[group.cable_sign]
    index = fitted.model.index
    return (
        group.cable_sign * float(fitted.fit.values[index[f"arm_mcp@{routing}"]]),
        group.cable_sign * float(fitted.fit.values[index[f"arm_pip@{routing}"]]),
    )


def measured_side(fitted: FittedModel, group: Group, kept: Kept, row: Row) -> Array:
    """The measured side: tension without the rotor's inertia (N), cable wound (m), torque (N m)."""
    h, _ = fitted.model.coefficients(fitted.fit.values, group)
    chosen = []
    for k, i in enumerate(fitted.model.active):
        f = fitted.model.layout.features[i]
        measured = f.constant == -1.0 and f.owner is None and f.scale == "direct"
        inertia = f.parameter == "rotor_inertia" and f.scale == "direct"
        if f.row == row and (measured or inertia):
            chosen.append(k)
    return np.asarray(kept.columns[:, fitted.model.pick.signals[chosen]] @ h[chosen], dtype=float)


def measured_force(reduced: Reduced, kept: Kept) -> Array:
    """Endpoint force over a stretch, (n,), in the fit's units (N)."""
    layout = reduced.layout
    return np.asarray(kept.columns[:, layout.signals[layout.features.index(FORCE)]], dtype=float)


def left_aside(
    last: Kept | None, kept: Kept, following: Kept | None, fitted: FittedModel
) -> tuple[ExcludedInterval, ...]:
    """What of a stretch, and of its run before it and behind it, is left aside.

    Args:
        last, following: the stretches before and after it; of another run, or none.
    """

    def of_this_run(other: Kept | None) -> bool:
        return other is not None and (other.session, other.run) == (kept.session, kept.run)

    half = 0.5 / NARROW_RATE_HZ
    begins = last.time[-1] + half if last is not None and of_this_run(last) else 0.0
    around = [(begins, kept.time[0] - half)]
    if not of_this_run(following):
        around.append((kept.time[-1] + half, kept.run_ends))
    reasons = {"ramp": around, "slack": _where(~kept.taut, kept.time, half)}
    if fitted.model.stiction:
        reasons["standstill"] = _where(kept.rest, kept.time, half)
    here = (kept.time[0] <= kept.repaired_at) & (kept.repaired_at <= kept.time[-1])
    reasons["spikes"] = [(t - half, t + half) for t in kept.repaired_at[here]]
    return tuple(
        ExcludedInterval(reason, float(start), float(stop))
        for reason, stretches in reasons.items()
        for start, stop in stretches
        if stop > start
    )


def _where(chosen: BoolArray, time: Array, half: float) -> list[tuple[float, float]]:
    """From where to where samples are chosen, each with half a step on either side."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], chosen, [False])).astype(int)))
    return [(time[a] - half, time[b - 1] + half) for a, b in zip(edges[::2], edges[1::2], strict=True)]


TENSION_BY_WAY, TORQUE_BY_WAY = "tension times direction of travel", "torque times direction of travel"
"""What a friction that grows with the load is drawn against: a motor alone has no cable with a tension."""


def unit_of_place(name: str) -> str:
    """SI unit of a coordinate, by its name."""
    return (
        "N m" if name == TORQUE_BY_WAY else COORDINATE_UNITS[name.removesuffix(" mcp").removesuffix(" pip")]
    )
