"""The inverse of a force prediction: the motor torque that a wanted endpoint force needs.

A set of fitted parameters is one joint's equation, which gives the torque in closed form. An extended model
predicts the force from the torque by way of its effects, whatever they are; the torque whose prediction is
the wanted force is found by the secant method at every sample, so that the physics stands in one place: what
predicts also inverts. The interval is the force's, divided by what a newton metre adds to the force. No
recording tells where the tip will be set down, where a spring along the load cell's face begins: the interval
is wider by what that spring would do from the place of first touch on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fingerlab.acquisition.control.motion import most_torque
from fingerlab.core.errors import UserError
from fingerlab.core.text import LEVEL, amount, significant
from fingerlab.diagnosis.equations.parameters import SET_DOWN
from fingerlab.diagnosis.settings import WIDE_RATE_HZ
from fingerlab.diagnosis.signals.scales import reduced_motion
from fingerlab.models.file import DIAGNOSIS_METHOD, SavedModel
from fingerlab.physics import nominal
from fingerlab.physics.motion import Motion, tip_reach
from fingerlab.prediction.error_band import MOST_STRETCH, Band, force_rate
from fingerlab.prediction.extended import Variant, extended_model
from fingerlab.prediction.force import forces_of_motion
from fingerlab.prediction.target import ContactPose, WantedForce, words_of
from fingerlab.rig.file import Rig
from fingerlab.rig.limits import Limits
from fingerlab.sessions.model import Array
from fingerlab.signals.periods import REGION_TITLES
from fingerlab.thesis.contact import parameter_sets
from fingerlab.thesis.prediction import ParameterSet
from fingerlab.thesis.traces import JOINT_TITLES

Predictor = ParameterSet | Variant

LEAD_S = 2.0
"""Before the profile the torque rises to its start within ``RISE_S``, and stays for the rest (assumed)."""
RISE_S = 1.5
POINTS_PER_S = 50.0
CLOSE_N = 1e-5
MOST_STEPS = 20
STEEPER = np.log(5.0)
"""Of the slope from torque to force: by so much it may differ from the one at first (assumed)."""
FIRST_TORQUES = (0.02, 0.06)
"""N m; where the secant method begins. Any two do for an equation that is a straight line."""


@dataclass(frozen=True)
class TorquePlan:
    """A wanted force and the motor torque that it needs; arrays (n,) over ``time`` (s of the profile).

    Attributes:
        force: N. torque: N m at the gearbox output. half_width: half the 90 % interval of the torque, N m,
            NaN where the model has none. current: A. position: where the motor will stand, rad, or None.
        torque_limit, current_limit: what the control loop sends at most.
        beyond: one sentence for each limit that the plan does not keep; empty where it can run.
        warnings: what should be known before it runs.
    """

    wanted: WantedForce
    pose: ContactPose
    time: Array
    force: Array
    torque: Array
    half_width: Array
    current: Array
    position: Array | None
    torque_limit: float
    current_limit: float
    beyond: tuple[str, ...]
    warnings: tuple[str, ...]

    def trajectory(self) -> dict[str, Any]:
        """The torque as a trajectory for Acquire, ``record`` and ``simulate``; it begins at zero.

        Its end needs no way down: there the position loop takes over with the current that it finds.

        Raises:
            UserError: the plan does not keep the rig's limits.
        """
        if self.beyond:
            raise UserError(self.beyond[0])
        rise = np.arange(round(RISE_S * POINTS_PER_S)) / POINTS_PER_S
        step = round(WIDE_RATE_HZ / POINTS_PER_S)
        time, torque = self.time[::step], self.torque[::step]
        moments = np.concatenate((rise, LEAD_S + time))
        values = np.concatenate((torque[0] * (0.5 - 0.5 * np.cos(np.pi * rise / RISE_S)), torque))
        # Between the rise and the profile the points are a line, which stays at the profile's first torque.
        moments, values = np.insert(moments, len(rise), RISE_S), np.insert(values, len(rise), torque[0])
        return {
            "kind": "torque",
            "time_s": [round(float(t), 4) for t in moments],
            "torque_n_m": [round(float(v), 7) for v in values],
            "ramp_s": 0.0,
            "duration_s": round(float(moments[-1]), 4),
            "lead_s": LEAD_S,
            "wanted_force": {k: v for k, v in self.wanted.settings.items() if not isinstance(v, list)},
        }

    def experiment(self) -> dict[str, Any]:
        """What ``record --trajectory FILE`` takes: the trajectory with phase and cable."""
        return {"trajectory": self.trajectory(), "phase": "contact", "cable": self.pose.cable}


def needed_torque(
    wanted: WantedForce, predictor: Predictor, pose: ContactPose, rig: Rig, where: str
) -> TorquePlan:
    """The torque, its interval, and whether the rig can give it.

    Args:
        predictor: one set of parameters of a fit, or a diagnosis' model (nominal or extended).
        where: the model's name, for the errors' sentences.

    Raises:
        UserError: the force is above the rig's limit, or the model cannot say (no lever, another cable,
            parameters that switch with the region).
    """
    most, limit = float(wanted.force.max()), rig.limits.force
    if most > limit:  # the pose is a line of the force: out there it is nonsense
        raise UserError(
            f"The wanted force reaches {most:.3g} N; the rig's limit is {limit:.3g} N: ask for less."
        )
    zero = np.zeros_like(wanted.time)
    motion = pose.motion(rig, wanted.time, wanted.force, zero)
    if isinstance(predictor, ParameterSet):
        torque, half_width, delay = _by_set(wanted.force, predictor, motion, pose, where)
    else:
        torque, half_width, delay = _by_variant(wanted.force, predictor, motion, pose, rig, where)
    # The load cell is read ``delay`` after the motor: the torque leads by as much.
    torque, half_width = (_earlier(values, wanted.time, delay) for values in (torque, half_width))
    band = None if isinstance(predictor, ParameterSet) else predictor.band
    return judged_plan(wanted, pose, rig, torque, half_width, motion, band)


def _by_set(
    force: Array, given: ParameterSet, motion: Motion, pose: ContactPose, where: str
) -> tuple[Array, Array, float]:
    """Closed form: T = (F lever + LHS - L) / (s a)."""
    if given.switches:
        raise UserError(
            f"{where} switches its parameters with the region, which a torque to come cannot; "
            "choose the parameters of one region."
        )
    region = next(iter(given.regions.values()))
    finger, joints = motion.finger_and_joints
    if given.joint == "pip":
        lever, lhs = (
            nominal.contact_lever_pip(finger, joints.mcp, joints.pip),
            nominal.pip_torque(finger, joints),
        )
    else:
        lever, lhs = (
            nominal.contact_lever_mcp(finger, joints.mcp, joints.pip),
            nominal.mcp_torque(finger, joints),
        )
    arm, loss = region.moment_arm, region.loss
    if lever.min() <= 0.0 or arm.value <= 0.0:
        raise UserError(
            f"{where} gives no torque here: the moment arm is {1e3 * arm.value:.3g} mm and the contact "
            f"force's lever {1e3 * lever.min():.3g} mm; both should be above zero."
        )
    tension = (force * lever + lhs.total - loss.value) / (pose.cable_sign * arm.value)
    radius = motion.radius
    torque = radius * tension + (motion.motor.inertia or 0.0) * motion.acceleration
    # Moment arm and loss are taken as independent: the model file does not say how they go together.
    of_arm = tension * (arm.high - arm.low) / 2.0 / arm.value
    of_loss = (loss.high - loss.low) / 2.0 / arm.value
    return np.asarray(torque), np.asarray(radius * np.hypot(of_arm, of_loss)), region.delay_s


def _by_variant(
    force: Array, variant: Variant, motion: Motion, pose: ContactPose, rig: Rig, where: str
) -> tuple[Array, Array, float]:
    scales = variant.scales
    newton, delay = scales.of("N"), variant.values.get("delay", 0.0)
    values = variant.reduced({k: v for k, v in variant.values.items() if k != "delay"}, rig)
    effects = [chosen.alone(scales) for chosen in variant.effects]
    reduced, wanted = reduced_motion(motion, scales), force / newton

    def predicted(torque: Array, by: Mapping[str, float] = values) -> Array:
        pulled = replace(reduced, torque=variant.pulling(torque), _memory={})
        forces = forces_of_motion(pulled, effects, by, where, wanted)
        weight = variant.pip_weight
        mixed = weight * forces["pip"] + (1.0 - weight) * forces["mcp"]
        return np.where(np.isfinite(mixed), mixed, forces["pip"])

    solved, slope = solved_torque(predicted, wanted, where, newton)
    torque, steep = scales.torque * solved, newton / scales.torque * slope
    if variant.band is None:
        return torque, np.full_like(torque, np.nan), delay
    half_width = variant.band.half_width(force, force_rate(force, WIDE_RATE_HZ)) / np.abs(steep)
    zero = np.zeros_like(force)
    free = reduced_motion(pose.motion(rig, motion.time, zero, zero), scales)
    # The same all through the run, it is added whole, not in squares.
    apart = predicted(solved, _set_down_at(free, reduced, values)) - predicted(solved)
    return torque, half_width + scales.torque * np.abs(apart / slope), delay


def _set_down_at(free: Motion, pressed: Motion, values: Mapping[str, float]) -> Mapping[str, float]:
    """Values by which the tip's spring begins where the tip stands without force, not amid its travel."""
    spring = values.get("lateral_spring", 0.0)
    travel = float(np.mean(tip_reach(pressed)) - np.mean(tip_reach(free)))
    return {**values, SET_DOWN: values.get(SET_DOWN, 0.0) + spring * travel}


def solved_torque(
    predicted: Callable[[Array], Array],
    force: Array,
    where: str,
    newton: float,
    missed_n: float = CLOSE_N,
    first: int = 0,
) -> tuple[Array, Array]:
    """Torque whose prediction is ``force``, and what a unit of torque adds to the force; in reduced units.

    Args:
        newton: how many a reduced one has. missed_n: by how much the force may be missed, N, where nothing
            closer is found. first: sample from which on it has to be met.

    Raises:
        UserError: no torque presses with that force.
    """
    before, torque = (np.full_like(force, value) for value in FIRST_TORQUES)
    last, now = predicted(before), predicted(torque)
    slope = begun = (now - last) / (torque - before)
    for _ in range(MOST_STEPS):
        if not (np.isfinite(slope).all() and np.abs(slope).min() > 0.0):
            raise UserError(
                f"By {where} no torque presses with the wanted force: in this pose the cable does not move "
                "the fingertip; choose another contact run."
            )
        missed = force - now
        if np.abs(missed)[first:].max() < CLOSE_N:
            return torque, slope
        before, torque = torque, torque + missed / slope
        last, now = now, predicted(torque)
        moved = np.abs(torque - before) > 1e-12
        anew = (now - last) / np.where(moved, torque - before, 1.0)
        # Beside a kink, or where friction hangs on the samples around, a small step tells no slope.
        usable = moved & (anew * begun > 0.0) & (np.abs(np.log(np.abs(anew / begun) + 1e-300)) < STEEPER)
        slope = np.where(usable, anew, slope)
    missing = newton * float(np.max(np.nan_to_num(np.abs(force - now)[first:], nan=np.inf)))
    if missing < missed_n:
        return torque, slope
    far = f" ({missing:.2g} N are missing)" if np.isfinite(missing) else ""
    raise UserError(
        f"By {where} no torque was found that presses with the wanted force{far}; choose a smaller or slower "
        "force."
    )


def _earlier(values: Array, time: Array, delay: float) -> Array:
    return values if delay == 0.0 else np.asarray(np.interp(time + delay, time, values))


def judged_plan(
    wanted: WantedForce,
    pose: ContactPose,
    rig: Rig,
    torque: Array,
    half_width: Array,
    motion: Motion,
    band: Band | None,
) -> TorquePlan:
    limits = rig.limits
    per_amp = rig.motor.torque_constant * rig.motor.gear_ratio
    most = most_torque(limits, per_amp)
    position = None if pose.position is None else motion.position
    return TorquePlan(
        wanted, pose, wanted.time, wanted.force, torque, half_width, torque / per_amp, position, most,
        most / per_amp, _beyond(limits, most, motion, wanted, torque, position),
        (*_extrapolation(wanted.force, band), *_warnings(wanted, torque, half_width, most)),
    )  # fmt: skip


def _beyond(
    limits: Limits, most: float, motion: Motion, wanted: WantedForce, torque: Array, position: Array | None
) -> tuple[str, ...]:
    found = []
    worst = int(np.argmax(np.abs(torque)))
    if abs(torque[worst]) > most:
        found.append(
            f"{significant(wanted.force[worst])} N need {amount(torque[worst], 'N m', 4)}; the rig's limits "
            f"of torque and current allow {amount(most, 'N m', 4)}."
        )
    elif torque.min() < 0.0:
        at = int(np.argmin(torque))
        more = "ask for more force, or " if _more_helps(wanted.force, torque) else "choose "
        pushed = amount(torque[at], "N m")
        found.append(
            f"{significant(wanted.force[at])} N would need a cable that pushes ({pushed}); "
            f"{more}another pose."
        )
    rise = float(np.abs(np.gradient(torque, 1.0 / WIDE_RATE_HZ)).max()) / motion.radius
    if rise > limits.tension_rise:
        found.append(
            f"The cable would tighten by {rise:.4g} N/s; the rig's limit is {limits.tension_rise:.4g} N/s: "
            "take a slower force."
        )
    if position is not None and not (
        limits.position_low <= position.min() and position.max() <= limits.position_high
    ):
        found.append(
            f"The motor would stand at {np.degrees(position.min()):.3g}° to "
            f"{np.degrees(position.max()):.3g}°; the rig's limits are "
            f"{np.degrees(limits.position_low):.3g}° to {np.degrees(limits.position_high):.3g}°."
        )
    return tuple(found)


def _more_helps(force: Array, torque: Array) -> bool:
    """Whether the cable pulls the more, the harder the fingertip is to press."""
    hard = force >= 0.5 * (force.min() + force.max())
    return bool(torque[hard].mean() >= torque[~hard].mean()) if not hard.all() else True


TOUCHING_LEAST_N = 0.05
"""Below this a fingertip may lift off, and what follows is a knock (assumed: the load cell's noise)."""


CLEARLY_FURTHER = 1.1
"""Times the distance of the recorded forces from their mean, from which on it is told (assumed)."""


def _extrapolation(force: Array, band: Band | None) -> tuple[str, ...]:
    """That the force goes beyond what the model was judged on; nothing where it does not."""
    further = 1.0 if band is None else band.times_as_far(force)
    if band is None or further <= CLEARLY_FURTHER:
        return ()
    low, high = max(band.centre - band.reach, 0.0), band.centre + band.reach
    return (
        f"{significant(force.max())} N is an extrapolation: the model was judged on {significant(low, 2)} to "
        f"{significant(high, 2)} N, so its interval is taken up to "
        f"{min(further, MOST_STRETCH):.2g} times as wide.",
    )


def _warnings(wanted: WantedForce, torque: Array, half_width: Array, most: float) -> tuple[str, ...]:
    found = []
    if wanted.force.min() < TOUCHING_LEAST_N:
        found.append(f"At {wanted.force.min():.2g} N the fingertip may lift off the load cell.")
    if not np.isfinite(half_width).any():
        found.append("The model has no interval; it takes two contact runs or more in its fit.")
    elif float(np.nanmax(torque + half_width)) > most >= float(torque.max()):
        found.append(
            f"Within its interval the torque may reach the {amount(most, 'N m', 4)} that the rig's limits "
            "allow."
        )
    return tuple(found)


def plan_json(plan: TorquePlan) -> dict[str, Any]:
    """The JSON of ``inverse``: SI units, None where there is no number."""
    low, high = float((plan.torque - plan.half_width).min()), float((plan.torque + plan.half_width).max())
    known = np.isfinite((low, high)).all()
    return {
        "schema": 1,
        "wanted": {k: v for k, v in plan.wanted.settings.items() if not isinstance(v, list)},
        "pose": {"source": plan.pose.source, "cable": plan.pose.cable, **words_of(plan.pose)},
        "force": {"unit": "N", "low": float(plan.force.min()), "high": float(plan.force.max())},
        "torque": {"unit": "N m", "low": float(plan.torque.min()), "high": float(plan.torque.max())},
        "interval": {"level": LEVEL, "low": low, "high": high} if known else None,
        "current": {"unit": "A", "low": float(plan.current.min()), "high": float(plan.current.max())},
        "limit": {"torque": plan.torque_limit, "current": plan.current_limit},
        "beyond": list(plan.beyond),
        "warnings": list(plan.warnings),
    }


FIRST = ("extension", "whole", "flexion")
"""Regions in the order of trust: the thesis ended with those of extension."""


def predictors(model: SavedModel, where: str, cable: str = "flexion") -> Mapping[str, Predictor]:
    """Predictors that do not switch with the region, by words for a list; the best first.

    Args:
        where: the model's file, for the error's sentence. cable: of the contact; its sets come first.

    Raises:
        UserError: the model predicts no force.
    """
    if model.method == DIAGNOSIS_METHOD:
        found = extended_model(model, where)
        return {
            found.words if name == "extended" else "nominal model": v for name, v in found.variants.items()
        }
    sets = [one for one in parameter_sets(model, where).values() if not one.switches]
    sets.sort(key=lambda one: (one.joint != "pip", one.cable != cable, FIRST.index(one.name)))
    return {
        f"{JOINT_TITLES[one.joint]}, {REGION_TITLES.get(one.name, one.name)}, {one.cable} cable": one
        for one in sets
    }
