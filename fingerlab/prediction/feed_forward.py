"""Feed-forward: the torque over time that makes the fingertip press as wanted, learned on the bench itself.

The inverse (:mod:`fingerlab.prediction.inverse`) takes the finger's pose for a straight line of the force.
That is good to begin with; but tip and joints stick and slide, cables stretch, and play is passed, so that
pose and states of friction depend on what came before. Hence a first run is taken with that torque, and the
torque is found anew along the motion that was measured in it, less what swings by itself. It inverts each
effect that the equations hold: friction, stretch, slack, ripple, springs, masses, contact, delay. What it
cannot invert is what differs from run to run, what is faster than the motion is followed (a play that
chatters, a knock), what no measured run has come to, and an error of the load cell itself, whose reading is
what is wanted. A constant of the set-up is taken off either model's torque after practice, and a found torque
is gone as far as practice bears it out (:func:`best_share`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.text import amount
from fingerlab.diagnosis.settings import WIDE_RATE_HZ, Z90
from fingerlab.diagnosis.signals.filters import low_pass_kernel
from fingerlab.diagnosis.signals.reading_errors import in_reduced_units, with_errors
from fingerlab.diagnosis.signals.scales import reduced_rig, reduced_run
from fingerlab.diagnosis.signals.segments import segments_of
from fingerlab.physics.motion import Motion
from fingerlab.physics.nominal import JointMotion
from fingerlab.prediction.error_band import force_rate
from fingerlab.prediction.extended import ExtendedModel, Variant
from fingerlab.prediction.force import forces_of_motion, wound_beyond
from fingerlab.prediction.inverse import LEAD_S, TorquePlan, judged_plan, needed_torque, solved_torque
from fingerlab.prediction.target import ContactPose, WantedForce
from fingerlab.rig.file import Rig
from fingerlab.sessions.model import Array, Run

NOMINAL, FOUND = "nominal", "found"
"""Models of a trial: A and B."""
CUTOFF_HZ, TAPS = 8.0, 75
"""Low-pass of a learned torque, at the wide rate; the cutoff is the one of the equations that it comes from,
and what the angle sensors' noise makes of the springs' torque stays out of the motor."""
SLOWEST_HZ, HARMONICS, MOST_OF_IT = 5.0, 8.0, 0.99
"""A measured motion is followed up to so many times the frequency below which that share of the power of the
wanted force lies, and up to ``SLOWEST_HZ`` in any case (assumed: the corners where a tip begins to slide are
in it, with 5 harmonics they are not; a soft cable's swing mostly is not)."""
MISSED_N = 0.02
"""A learned torque may miss the wanted force by so much at a sample: a motion that was measured under another
torque need not have a solution everywhere (assumed: the load cell's noise)."""
CORRECTION_SHARE = 0.5
"""Share of the rig's limit of torque by which found and nominal torque may differ (assumed: at usual forces
it allows three times the nominal torque and more, and yet a wrong model cannot take the motor from rest to
its limit by itself)."""
STEADY_S = 0.2
"""Before the wanted force begins the torque stands still for longer than this (assumed)."""
LEAST_SHARE = 0.1
"""Of the force at which the wanted one begins: with less, how the tip was set down is unknown (assumed)."""
LEAST_GAIN = 0.1
"""Share by which a practice has to miss less with the found torque, for any of it to be sent (assumed: two
runs of one bench differ by less)."""


def learned_in(run: Run) -> float:
    """Seconds of a run before the wanted force begins."""
    lead = run.trajectory.get("lead_s", LEAD_S)
    return float(lead) if isinstance(lead, int | float) else LEAD_S


class Along:
    """The equations of one variant along a motion that was measured while about the wanted force was pressed.

    Raises:
        UserError: the run has gaps, or lacks a channel.
    """

    def __init__(self, variant: Variant, wanted: WantedForce, run: Run, rig: Rig, where: str) -> None:
        self._variant, self._wanted, self._where = variant, wanted, where
        scales = variant.scales
        read = with_errors(reduced_run(run, scales), in_reduced_units(variant.readings, scales))
        motions = list(segments_of(replace(read, phase="on_air"), reduced_rig(rig, scales)))
        if len(motions) != 1:
            raise UserError(
                f"Run {run.name} has gaps; close other programs, and take it again before a feed-forward is "
                "learned from it."
            )
        # Force and angles are read later than the motor: on their time the motor's channels come late.
        self._delay = variant.values.get("delay", 0.0)
        motion = calmed(motions[0].with_motor_late(self._delay / scales.time), motion_cutoff(wanted))
        self._time = motion.time * scales.time - learned_in(run)
        self._values = variant.reduced({k: v for k, v in variant.values.items() if k != "delay"}, rig)
        self._effects = [c.alone(scales) for c in variant.effects if c.effect.special != "delay"]
        self._force = np.maximum(self._pressed_as(run), 0.0) / scales.of("N")
        force = np.interp(self._time, wanted.time, wanted.force)  # held where it begins and ends
        self._aimed = np.maximum(force, 0.0) / scales.of("N")
        # In the runs of the fit the fingertip goes up and down nearly all the time. While it only comes to
        # press, the share of rubbing that is left to a lean would be another one.
        begins = int(np.searchsorted(self._time, 0.0))
        self._motion = replace(self._on_its_zero(motion), slip_mean_from=begins, _memory={})

    def torque(self, trim: float = 0.0) -> tuple[Array, Array]:
        """Torque that presses with the wanted force, and its half width, N m, (n,) each over ``wanted.time``.

        Args:
            trim: N, by which this variant predicts more than was measured, throughout.

        Raises:
            UserError: there is none.
        """
        scales, newton = self._variant.scales, self._variant.scales.of("N")
        aimed = self._aimed + trim / newton
        first = int(np.searchsorted(self._time, -STEADY_S))
        found, slope = solved_torque(self._predicted, aimed, self._where, newton, MISSED_N, first)
        torque = smooth(scales.torque * found)
        # The load cell is read ``delay`` after the motor: the torque leads by as much.
        torque = np.interp(self._wanted.time + self._delay, self._time, torque)
        band, force = self._variant.band, self._wanted.force
        if band is None:
            return np.asarray(torque), np.full(len(torque), np.nan)
        newtons = np.interp(self._wanted.time, self._time, newton / scales.torque * np.abs(slope))
        return np.asarray(torque), band.half_width(force, force_rate(force, WIDE_RATE_HZ)) / newtons

    def force(self, torque: Array) -> Array:
        """Force that this variant predicts of a torque (N m over ``wanted.time``), N, (n,)."""
        scales = self._variant.scales
        late = np.interp(self._time - self._delay, self._wanted.time, torque)
        force = scales.of("N") * self._predicted(late / scales.torque)
        return np.asarray(np.interp(self._wanted.time, self._time, smooth(force)))

    def _pressed_as(self, run: Run) -> Array:
        """The force by which the tip rubs, N, (n,): as wanted, and before that as the run came to press.

        How a tip sticks hangs on how it was set down. Before the wanted force begins that was measured; it is
        scaled to end where the wanted force begins.
        """
        wanted = self._wanted
        force = np.interp(self._time, wanted.time, wanted.force)
        read = run.load(["time", "endpoint_force"])
        if not np.isfinite(read["endpoint_force"]).all():
            return np.asarray(force)
        time, before = read["time"] - learned_in(run), self._time < 0.0
        pressed = thinned(time, read["endpoint_force"], self._time, run.sample_rate_hz)
        end = float(np.mean(pressed[before & (self._time > -STEADY_S)]))
        if end < LEAST_SHARE * wanted.force[0]:
            return np.asarray(force)
        return np.where(before, pressed * wanted.force[0] / end, force)

    def _on_its_zero(self, motion: Motion) -> Motion:
        """With the motor's angle counted as in the runs of the fit: a ripple's phase is told by it.

        The motor's zero is set anew for each session; where a taut cable has the motor tells what it was.
        """
        excess = wound_beyond(motion, self._effects, self._values, self._where)
        shift = float(np.median(excess[self._time >= 0.0]))
        return replace(motion, position=motion.position - shift, _memory={})

    def _predicted(self, torque: Array) -> Array:
        pulled = replace(self._motion, torque=self._variant.pulling(torque), _memory={})
        forces = forces_of_motion(pulled, self._effects, self._values, self._where, self._force)
        weight = self._variant.pip_weight
        mixed = weight * forces["pip"] + (1.0 - weight) * forces["mcp"]
        return np.where(np.isfinite(mixed), mixed, forces["pip"])


def thinned(time: Array, values: Array, grid: Array, rate_hz: float) -> Array:
    """Values at the times of a grid of the wide rate, low-passed at ``CUTOFF_HZ`` without delay, (n,).

    Low-passed at the recording's rate before they are thinned: a load cell's noise is white up to there.
    """
    every = max(1, round(rate_hz / WIDE_RATE_HZ))
    box = np.ones(every) / every
    mean = np.convolve(np.pad(values, (every // 2, every - 1 - every // 2), mode="edge"), box, mode="valid")
    return smooth(np.interp(grid, time, mean))


def smooth(values: Array, cutoff_hz: float = CUTOFF_HZ) -> Array:
    """Low-passed without delay, (n,) at the wide rate; the ends are held."""
    taps = 2 * round(0.5 * TAPS * CUTOFF_HZ / cutoff_hz) + 1
    kernel = low_pass_kernel(taps, cutoff_hz, WIDE_RATE_HZ)
    held = np.pad(values, taps // 2, mode="edge")
    return np.asarray(np.convolve(held, kernel, mode="valid"))


def motion_cutoff(wanted: WantedForce) -> float:
    """Up to which frequency a measured motion is followed, Hz: ``HARMONICS`` of the wanted force's own.

    What swings faster was not asked for: a soft cable's or a sliding tip's own swing. A torque that is
    learned along it would keep it alive and feed it from run to run.
    """
    force = wanted.force - wanted.force.mean()
    power = np.cumsum(np.abs(np.fft.rfft(force * np.hanning(len(force)))) ** 2)
    place = int(np.searchsorted(power, MOST_OF_IT * power[-1])) if power[-1] > 0.0 else 0
    own = place * WIDE_RATE_HZ / len(force)
    return float(np.clip(HARMONICS * own, SLOWEST_HZ, CUTOFF_HZ))


def calmed(motion: Motion, cutoff_hz: float) -> Motion:
    """The same motion without what is faster."""
    if cutoff_hz >= CUTOFF_HZ:
        return motion
    joints = None
    if motion.joints is not None:
        joints = JointMotion(*(smooth(values, cutoff_hz) for values in vars(motion.joints).values()))
    return replace(
        motion,
        position=smooth(motion.position, cutoff_hz),
        velocity=smooth(motion.velocity, cutoff_hz),
        acceleration=smooth(motion.acceleration, cutoff_hz),
        joints=joints,
        _memory={},
    )


@dataclass(frozen=True)
class Feed:
    """What one model sends, and what is predicted of it.

    Attributes:
        model: ``NOMINAL`` or ``FOUND``.
        predicted_rms: force error that the found model predicts, with its own error on held-out runs, N; NaN
            where that is unknown.
        correction: most by which the torque leaves the nominal one, N m.
    """

    model: str
    plan: TorquePlan
    predicted_rms: float
    correction: float


def first_plan(
    wanted: WantedForce, model: ExtendedModel, pose: ContactPose, rig: Rig, where: str
) -> TorquePlan:
    """Torque of the first run: the lesser of both models' for a pose that is a straight line of the force.

    The nominal model may ask for a multiple of what presses as wanted; the found one need not have a torque
    for such a pose.

    Raises:
        UserError: the nominal model has none.
    """
    nominal = needed_torque(wanted, model.nominal, pose, rig, where)
    try:
        found = needed_torque(wanted, model.extended, pose, rig, where)
    except UserError:
        return nominal
    usable = [plan for plan in (nominal, found) if not plan.beyond]
    return min(usable or [nominal], key=lambda plan: float(plan.torque.max()))


def learned_plan(
    variant: Variant,
    wanted: WantedForce,
    run: Run,
    pose: ContactPose,
    rig: Rig,
    where: str,
    trim: float = 0.0,
) -> TorquePlan:
    """The torque of a variant along the motion of ``run``, and whether the rig can give it.

    Args:
        pose: of the contact, by which motor position and sentences are told.
        trim: N, by which the variant predicts more than is measured, throughout.

    Raises:
        UserError: no torque presses with the wanted force.
    """
    torque, half_width = Along(variant, wanted, run, rig, where).torque(trim)
    motion = pose.motion(rig, wanted.time, wanted.force, torque)
    return judged_plan(wanted, pose, rig, torque, half_width, motion, variant.band)


def predicted_mean(variant: Variant, plan: TorquePlan, run: Run, rig: Rig, where: str) -> float:
    """Mean force that a variant predicts of the torque that was sent in ``run``, along its motion, N."""
    return float(np.mean(Along(variant, plan.wanted, run, rig, where).force(plan.torque)))


def best_share(nominal: Array, found: Array) -> float:
    """How far from the nominal torque to the found one, 0 to 1, so that what practice missed would be least.

    What a model does not know of a bench, such as a play that chatters, may make its torque worse than the
    nominal one. Forces add up for small changes of the torque; a constant is trimmed away in either. Where
    the least error is hardly less than the nominal model's, the nominal torque is kept: 0.

    Args:
        nominal, found: force errors of one practice of each, N, (n,) and (m,) over the same time.
    """
    length = min(len(nominal), len(found))
    before, after = (values[:length] - values[:length].mean() for values in (nominal, found))
    change = after - before
    size = float(change @ change)
    share = float(np.clip(-(before @ change) / size, 0.0, 1.0)) if size > 0.0 else 0.0
    least = float(np.std(before + share * change))
    return share if least < (1.0 - LEAST_GAIN) * float(np.std(before)) else 0.0


def between(nominal: TorquePlan, found: TorquePlan, share: float, rig: Rig) -> TorquePlan:
    """The plan that goes from the nominal torque so far to the found one."""
    if share == 1.0:
        return found
    return _with_torque(found, nominal.torque + share * (found.torque - nominal.torque), rig)


def shifted_plan(plan: TorquePlan, by: Array, rig: Rig) -> TorquePlan:
    """The plan with so much more torque, N m, (n,)."""
    return _with_torque(plan, plan.torque + by, rig)


def mean_plan(plans: Sequence[TorquePlan], rig: Rig) -> TorquePlan:
    """The plan with the mean torque of others for the same wanted force."""
    return _with_torque(plans[0], np.mean([plan.torque for plan in plans], axis=0), rig)


def _with_torque(plan: TorquePlan, torque: Array, rig: Rig) -> TorquePlan:
    motion = plan.pose.motion(rig, plan.time, plan.force, torque)
    return judged_plan(plan.wanted, plan.pose, rig, torque, plan.half_width, motion, None)


def own_error(model: ExtendedModel) -> float:
    """Error of the found model on held-out runs, one standard deviation, N; NaN where it is unknown."""
    band = model.extended.band
    return math.nan if band is None else float(np.mean(band.widths)) / Z90


def judged_feed(
    name: str,
    model: ExtendedModel,
    plan: TorquePlan,
    nominal: TorquePlan,
    run: Run,
    rig: Rig,
    where: str,
    trim: float = 0.0,
) -> Feed:
    """A plan with what the found model predicts of it along the motion of ``run``.

    Args:
        trim: N, of the found model.
    """
    predicted = Along(model.extended, plan.wanted, run, rig, where).force(plan.torque) - trim
    own = own_error(model)
    rms = math.hypot(float(np.sqrt(np.mean((predicted - plan.force) ** 2))), own)
    return Feed(name, plan, rms, float(np.abs(plan.torque - nominal.torque).max()))


def refuse_far(feed: Feed, share: float) -> None:
    """End where the found torque goes further from the nominal one than was allowed.

    Args:
        share: of the rig's limit of torque.

    Raises:
        UserError: it does, or the plan does not keep the rig's limits.
    """
    if feed.plan.beyond:
        raise UserError(feed.plan.beyond[0])
    most = share * feed.plan.torque_limit
    if feed.correction > most:
        raise UserError(
            f"The found torque goes {amount(feed.correction, 'N m', 4)} from the nominal one, more than the "
            f"{amount(most, 'N m', 4)} that are allowed; look at the model's parameters, or allow more with "
            "--most-correction."
        )
