"""Simulated recordings: runs of a plan on one bench, whole or one sample at a time.

One sample at a time has the physics of a whole recording, step for step; noise is drawn from the same
distributions but in another order, since nobody knows how long a stream will be.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fingerlab.acquisition.control.motion import Gains, braked
from fingerlab.acquisition.control.trajectories import read_trajectory
from fingerlab.core.errors import UserError
from fingerlab.rig.file import intervention_of
from fingerlab.sessions.model import Array
from fingerlab.twin.bench import build_bench, draw_truth, place_bench
from fingerlab.twin.effects import EFFECTS, Effects, apply_effects
from fingerlab.twin.integrate import run_loop, run_sample
from fingerlab.twin.plant import BRISTLES, OUTPUTS, STATE, Plant, Sensors, Truth
from fingerlab.twin.protocols import RATE_HZ, Preset, RunPlan

STEPS = 10
"""Internal steps a sample: 10 kHz. Tests halve the step and bound the change of the recording."""

APPROACH_DEG_PER_S = 12.0
APPROACH_LIMIT_DEG = 150.0
"""The operator's approach to the load cell: slow, and given up after this much at the pulley (assumed)."""


@dataclass(frozen=True)
class Recorded:
    """One simulated run.

    Attributes:
        plan: with the trajectory as run (the contact offset filled in).
        channels: name -> values of shape (n,), SI, as the session format names them.
        truth: what really happened, by ``plant.OUTPUTS``, each of shape (n,), SI; never stored.
    """

    plan: RunPlan
    channels: dict[str, Array]
    truth: dict[str, Array]


class RanAway(UserError):
    """The bench left all bounds."""


def simulate_session(
    preset: Preset, plans: Sequence[RunPlan], effects: Effects, seed: int, steps: int = STEPS
) -> Iterator[Recorded]:
    """Take the runs of a session one after another on one bench.

    The same seed draws the same bench, the same friction from run to run and the same noise, whatever
    the effects are.

    Args:
        effects: id -> parameter -> value, SI; those of the preset are built in beside them.
        steps: internal steps a sample.

    Raises:
        UserError: a trajectory is impossible, or the finger does not reach the load cell.
    """
    bench_seed, *run_seeds = np.random.SeedSequence(seed).spawn(1 + len(plans))
    truth = draw_truth(preset, np.random.default_rng(bench_seed))
    offset_deg: float | None = None
    for plan, run_seed in zip(plans, run_seeds, strict=True):
        trajectory = dict(plan.trajectory)
        if plan.phase == "contact" and "offset_deg" not in trajectory and trajectory.get("kind") != "torque":
            if offset_deg is None:
                try:
                    offset_deg = approach(preset, truth, effects, plan.cable)
                except RanAway:
                    raise UserError(_who_ran_away(effects)) from None
            trajectory["offset_deg"] = offset_deg
        ready = RunPlan(plan.phase, plan.cable, trajectory, plan.load_torque, plan.attributes)
        try:
            recorded = simulate_run(preset, truth, ready, effects, np.random.default_rng(run_seed), steps)
        except RanAway:
            raise UserError(_who_ran_away(effects)) from None
        yield recorded


def _who_ran_away(effects: Effects) -> str:
    """The sentence that names what is beyond its range, and the range."""
    for name, values in effects.items():
        for one in EFFECTS[name].parameters:
            value, unit = values[one.name], one.unit.replace("1", "")
            if not one.low <= value <= one.high:
                return (
                    f"The simulated bench ran away with {name} at {value:g} {unit}".rstrip()
                    + f"; choose {one.low:g} to {one.high:g} {unit}".rstrip()
                    + "."
                )
    return f"The simulated bench ran away with {', '.join(effects) or 'no effect'}; choose weaker effects."


def simulate_run(
    preset: Preset,
    truth: Truth,
    plan: RunPlan,
    effects: Effects,
    rng: np.random.Generator,
    steps: int = STEPS,
) -> Recorded:
    """Take one run on a bench."""
    trajectory = read_trajectory(plan.trajectory)
    count = round(trajectory.duration * RATE_HZ)
    if count < 2:
        raise UserError(f"A run of {trajectory.duration:g} s holds no motion; give a longer 'duration_s'.")
    command = trajectory.command(np.arange(count) / RATE_HZ)
    bench = prepare_bench(preset, truth, plan, effects, rng)
    if trajectory.is_torque:
        result = pull(bench, command, preset, plan.phase == "contact", steps)
        command = result["theta"]  # no angle was asked for
    else:
        result = drive(bench, command, plan.phase == "contact", steps)
    channels = _record(preset, bench.sensors, plan, command, result, rng)
    return Recorded(replace(plan, trajectory=dict(trajectory.settings)), channels, result)


def prepare_bench(
    preset: Preset, truth: Truth, plan: RunPlan, effects: Effects, rng: np.random.Generator
) -> Plant:
    """The bench of one run: its effects, and the friction and slack that it happens to have this time."""
    bench = _bench(preset, truth, plan, effects)
    _wander(bench, preset, rng)
    return bench


def state_at_rest(bench: Plant, in_contact: bool) -> Any:
    """Hang the finger, place the load cell; an array of one record of ``plant.STATE``."""
    state = np.zeros(1, STATE)
    q1, q2 = place_bench(bench, in_contact)
    state["q1"] = state["relaxed_1"] = q1
    state["q2"] = state["relaxed_2"] = q2
    state["elongation"] = -bench.plant["slack"]
    return state


def drive(bench: Plant, command: Array, in_contact: bool, steps: int = STEPS) -> dict[str, Array]:
    """Let the position loop follow ``command`` (rad, shape (n,)) from rest; what really happened."""
    state = state_at_rest(bench, in_contact)[0]
    out = np.empty((len(command), len(OUTPUTS)))
    memory = np.zeros(BRISTLES)
    run_loop(bench.plant, bench.friction, bench.control, memory, state, command, steps, 1.0 / RATE_HZ, out)
    return _outcome(out)


def pull(
    bench: Plant, torque: Array, preset: Preset, in_contact: bool, steps: int = STEPS
) -> dict[str, Array]:
    """Drive the motor by ``torque`` (N m at the gearbox output, shape (n,)) from rest, as the loop does.

    The amplifier is taken to know the motor's nominal torque constant, as the loop does.
    """
    motor, gain = preset.rig.motor, Gains().derivative
    current = torque / (motor.torque_constant * motor.gear_ratio)
    limit = float(bench.control["current_limit"])
    state, memory = state_at_rest(bench, in_contact), np.zeros(BRISTLES)  # places the load cell, too
    plant = np.array([bench.plant], dtype=bench.plant.dtype)
    row, out = np.zeros(len(OUTPUTS)), np.empty((len(torque), len(OUTPUTS)))
    omega = OUTPUTS.index("omega")
    for k, wanted in enumerate(current.tolist()):
        command = min(max(braked(wanted, float(row[omega]), gain), -limit), limit)
        run_sample(plant, bench.friction, memory, state, command, steps, 1.0 / RATE_HZ, row)
        out[k] = row
    return _outcome(out)


def _outcome(out: Array) -> dict[str, Array]:
    if not np.isfinite(out).all():
        raise RanAway("The simulated bench ran away; choose effect strengths within their ranges.")
    return {name: out[:, k].copy() for k, name in enumerate(OUTPUTS)}


def approach(preset: Preset, truth: Truth, effects: Effects, cable: str) -> float:
    """Motor angle (degrees) at which an operator who winds slowly has the wanted mean contact force.

    Raises:
        UserError: the load cell is never reached.
    """
    bench = _bench(preset, truth, RunPlan("contact", cable, {}), effects)
    time = np.arange(0.0, APPROACH_LIMIT_DEG / APPROACH_DEG_PER_S, 1.0 / RATE_HZ)
    command = np.radians(APPROACH_DEG_PER_S * time)
    wanted = preset.numbers["protocol"]["contact_force"]
    result = drive(bench, command, in_contact=True)
    reached = np.flatnonzero(result["force"] >= wanted)
    if not reached.size:
        raise UserError(
            f"The fingertip does not press the cell with {wanted:g} N before {APPROACH_LIMIT_DEG:g} degrees "
            f"at the pulley; choose weaker effects."
        )
    # Where the motor is, not where it was told to be: the loop's integral makes the two agree in the end.
    return round(math.degrees(float(result["theta"][reached[0]])), 2)


def _bench(preset: Preset, truth: Truth, plan: RunPlan, effects: Effects) -> Plant:
    bench = build_bench(preset, truth, plan.cable)
    bench.plant["load_torque"] = plan.load_torque
    apply_effects(bench, preset.effects)
    apply_effects(bench, effects)
    if change := intervention_of(plan.attributes, "of the plan"):
        # What an operator changes on purpose, on top of whatever the bench is.
        bench.plant["hung_mass"], bench.plant["hung_at"] = change.added_mass, change.added_mass_at
        bench.plant["load_torque"] += change.load_torque
        bench.plant["stiffness_1"] += change.mcp_stiffness
        bench.plant["stiffness_2"] += change.pip_stiffness
        bench.plant["arm_1"] *= change.mcp_arm
        bench.plant["arm_2"] *= change.pip_arm
    return bench


def _wander(bench: Plant, preset: Preset, rng: np.random.Generator) -> None:
    """Friction is never quite the same twice, nor does the cable hang equally loose."""

    def chance() -> float:
        return float(np.clip(rng.standard_normal(), -2.0, 2.0))

    def factor() -> float:
        return 1.0 + preset.numbers["joints"]["wander"] * chance()

    for law in bench.friction:
        share = factor()
        for name in ("forward", "backward", "breakaway", "spread", "load_share"):
            law[name] *= share
    for name in ("viscous_1", "viscous_2", "motor_viscous", "wrap", "tip_friction"):
        bench.plant[name] *= factor()
    bench.plant["slack"] = max(bench.plant["slack"] + preset.numbers["cable"]["scatter"] * chance(), 0.0)


def _record(
    preset: Preset,
    sensors: Sensors,
    plan: RunPlan,
    command: Array,
    result: dict[str, Array],
    rng: np.random.Generator,
) -> dict[str, Array]:
    noise = rng.standard_normal((4, len(command)))
    motor = preset.rig.motor
    count = 2.0 * math.pi / preset.numbers["control"]["counts"]
    current = _quantised(result["current"] + sensors.current_noise * noise[0], sensors.current_step)
    channels = {
        "motor_command": command,
        "motor_position": np.floor(result["theta"] / count) * count,
        "motor_current": current,
        "motor_torque": motor.torque_constant * motor.gear_ratio * current,
    }
    if plan.phase == "motor_bench":
        channels["load_torque"] = np.full(len(command), plan.load_torque)
        return channels
    late = _late(sensors.delay, len(command))
    drift = {"mcp_angle": _warm_up(len(command)) * sensors.drift}
    for row, (name, angle) in enumerate((("mcp_angle", "q1"), ("pip_angle", "q2")), start=1):
        seen = _bridge(late(result[angle]), sensors) + drift.get(name, 0.0)
        channels[name] = _quantised(seen + sensors.angle_noise * noise[row], sensors.angle_step)
    force = sensors.force_gain * late(result["force"]) + sensors.force_noise * noise[3]
    channels["endpoint_force"] = _quantised(force, sensors.force_step)
    return channels


def _quantised(values: Array, step: float) -> Array:
    return np.asarray(np.round(values / step) * step) if step > 0 else values


def _late(delay: float, count: int) -> Any:
    """A function that delays a channel by ``delay`` seconds; before the start it shows the rest."""
    time = np.arange(count) / RATE_HZ
    return (lambda values: values) if delay == 0 else (lambda values: np.interp(time - delay, time, values))


def _bridge(angle: Array, sensors: Sensors) -> Array:
    """What two magnetoresistive bridges at 45 degrees make of a shaft angle; zeroed at zero."""
    if sensors.bridge_offset == 0 and sensors.bridge_mismatch == 0:
        return angle
    wide = 1.0 + sensors.bridge_mismatch
    seen = 0.5 * np.arctan2(np.sin(2.0 * angle) + sensors.bridge_offset, wide * np.cos(2.0 * angle))
    return np.asarray(seen - 0.5 * math.atan2(sensors.bridge_offset, wide))


def _warm_up(count: int) -> Array:
    """From 0 to 1 over the run, fast first (time constant: half the run)."""
    share = np.arange(count) / count
    return np.asarray((1.0 - np.exp(-2.0 * share)) / (1.0 - math.exp(-2.0)))


PERIOD = 1.0 / RATE_HZ
WARM_UP = 15.0
"""s, time constant of a drifting sensor: half a run of the thesis, as in a simulated recording."""

_NOISE_BLOCK = 4096
_THETA, _CURRENT, _Q1, _Q2, _FORCE = (OUTPUTS.index(n) for n in ("theta", "current", "q1", "q2", "force"))


class BenchStream:
    """A bench with one cable on (or none), driven by a current, seen through its sensors.

    Args:
        rng: of this set-up's friction and of the noise. steps: internal steps a sample.
        counts_per_turn: of the encoder at the output; that of the preset where it is not given.

    Attributes:
        now: what really is, in the order of ``plant.OUTPUTS``, SI.
    """

    def __init__(
        self,
        preset: Preset,
        truth: Truth,
        plan: RunPlan,
        effects: Effects,
        rng: np.random.Generator,
        steps: int = STEPS,
        counts_per_turn: float | None = None,
    ) -> None:
        self._bench = prepare_bench(preset, truth, plan, effects, rng)
        self._state = state_at_rest(self._bench, plan.phase == "contact")
        self._plant = np.array([self._bench.plant], dtype=self._bench.plant.dtype)
        self._memory = np.zeros(BRISTLES)
        self._steps = steps
        self._limit = float(self._bench.control["current_limit"])
        self._rng = rng
        self._sensors = self._bench.sensors
        self._bridged = self._sensors.bridge_offset != 0.0 or self._sensors.bridge_mismatch != 0.0
        self._count = 2.0 * math.pi / (counts_per_turn or preset.numbers["control"]["counts"])
        self._noise: list[list[float]] = []
        self._noise_at = 0
        self._past: deque[tuple[float, float, float]] = deque(
            maxlen=2 + math.ceil(self._sensors.delay / PERIOD)
        )
        self._samples = 0
        self.has_finger = plan.phase != "motor_bench"
        self._row = np.zeros(len(OUTPUTS))
        self._row[_Q1], self._row[_Q2] = self._state["q1"][0], self._state["q2"][0]
        self.now: list[float] = self._row.tolist()
        self._remember()

    def advance(self, current: float) -> None:
        """One sample further at a constant current command (A), within what the amplifier can give.

        Raises:
            UserError: the bench ran away.
        """
        limit = self._limit
        command = -limit if current < -limit else limit if current > limit else current
        run_sample(
            self._plant,
            self._bench.friction,
            self._memory,
            self._state,
            command,
            self._steps,
            PERIOD,
            self._row,
        )
        self.now = self._row.tolist()  # plain numbers are several times quicker than numpy's scalars
        if not math.isfinite(self.now[_THETA]):
            raise UserError(
                "The simulated bench ran away; choose effect strengths within the range of the catalogue."
            )
        self._samples += 1
        self._remember()

    def brake(self, viscous: float) -> None:
        """From now on so much (N m s/rad) is added to the motor's own viscous friction, at the output."""
        self._plant["motor_viscous"] = self._bench.plant["motor_viscous"] + viscous

    def hang(self, load_torque: float) -> None:
        """From now on this known load (N m) is on the motor of a motor bench."""
        self._plant["load_torque"] = load_torque

    def seen(self) -> tuple[float, float, float, float, float]:
        """What the sensors make of it: force (N), MCP, PIP (rad), current (A), encoder (whole counts).

        Force and angles are NaN where there is no finger. Each call has noise of its own.
        """
        if self._noise_at == len(self._noise):
            self._noise = self._rng.standard_normal((_NOISE_BLOCK, 4)).tolist()
            self._noise_at = 0
        self._noise_at += 1
        noise = self._noise[self._noise_at - 1]
        sensors, now = self._sensors, self.now
        current = _quantised_value(now[_CURRENT] + sensors.current_noise * noise[0], sensors.current_step)
        counts = float(math.floor(now[_THETA] / self._count))
        if not self.has_finger:
            return math.nan, math.nan, math.nan, current, counts
        force, q1, q2 = self._late()
        if self._bridged:
            q1, q2 = bridge_angle(q1, sensors), bridge_angle(q2, sensors)
        if sensors.drift:
            q1 += self._drift()
        mcp, pip = q1 + sensors.angle_noise * noise[1], q2 + sensors.angle_noise * noise[2]
        return (
            _quantised_value(sensors.force_gain * force + sensors.force_noise * noise[3], sensors.force_step),
            _quantised_value(mcp, sensors.angle_step),
            _quantised_value(pip, sensors.angle_step),
            current,
            counts,
        )

    def _remember(self) -> None:
        self._past.appendleft((self.now[_FORCE], self.now[_Q1], self.now[_Q2]))

    def _late(self) -> tuple[float, float, float]:
        """Force and angles as they were ``delay`` ago; before the start they were at rest."""
        if self._sensors.delay == 0.0:
            return self._past[0]
        back = self._sensors.delay / PERIOD
        whole = int(back)
        newer = self._past[min(whole, len(self._past) - 1)]
        older = self._past[min(whole + 1, len(self._past) - 1)]
        share = back - whole
        a, b, c = (n + share * (o - n) for n, o in zip(newer, older, strict=True))
        return a, b, c

    def _drift(self) -> float:
        warm = 1.0 - math.exp(-self._samples * PERIOD / WARM_UP)
        return self._sensors.drift * warm / (1.0 - math.exp(-2.0))


def bridge_angle(angle: float, sensors: Sensors) -> float:
    """What two magnetoresistive bridges at 45 degrees make of a shaft angle (rad); zeroed at zero."""
    if sensors.bridge_offset == 0.0 and sensors.bridge_mismatch == 0.0:
        return angle
    wide = 1.0 + sensors.bridge_mismatch
    seen = math.atan2(math.sin(2.0 * angle) + sensors.bridge_offset, wide * math.cos(2.0 * angle))
    return 0.5 * seen - 0.5 * math.atan2(sensors.bridge_offset, wide)


def seeded_truth(preset: Preset, seed: int) -> tuple[Truth, Any]:
    """The bench that ``seed`` draws (the same as in a simulated session) and seeds for what follows."""
    seeds = np.random.SeedSequence(seed)
    return draw_truth(preset, np.random.default_rng(seeds.spawn(1)[0])), seeds


def _quantised_value(value: float, step: float) -> float:
    return round(value / step) * step if step > 0.0 else value
