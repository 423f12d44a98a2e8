"""Which channels contradict the rig or each other.

A dead sensor, a load cell that reads nothing, degrees in place of radians, mN m in place of N m: each makes a
physical effect of its own, and a confident one. All that is compared here is a ratio that a bench keeps
within a factor of a few, whatever its size; a wrong unit is off by more than fifty.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.plain_data import read_object
from fingerlab.core.text import significant
from fingerlab.diagnosis.settings import (
    ANOTHER_UNIT,
    COMMAND_CORRELATION,
    DEAD_SHARE,
    FIRST_LOOK_S,
    LARGEST_ARM_M,
    LEAST_ARM_M,
    MOVED_DEG,
    OFF_CURRENT,
    PULLS_SHARE,
    SAME_TORQUE,
    SWING_SAMPLES,
)
from fingerlab.diagnosis.signals.scales import is_still
from fingerlab.physics.motion import Motion
from fingerlab.rig.file import Rig
from fingerlab.sessions.model import Array, Run

NOT_KNOWN = float("nan")
USUAL_ARM_M = float(np.sqrt(LEAST_ARM_M * LARGEST_ARM_M))
"""Of which nothing is known, m: in the middle of the plausible ones, by ratio."""


@dataclass(frozen=True)
class ChannelRatios:
    """What one run says of its channels, in numbers without a unit; NaN where it says nothing.

    Attributes:
        current: motor_torque over what motor_current and the rig's constants make it.
        command: travel of the motor over that of its command; agrees: their correlation.
        still: channels that do not move while another one says that they should.
        arm: moment arm (m) that both joints together would need to follow the cable.
        spring: moment arm (m) that the springs' torque has by the swing of the tension.
        force: the load cell's force over what the cable's tension is good for; swing: that of its swing.
    """

    run: str
    on_bench: bool
    current: float = NOT_KNOWN
    command: float = NOT_KNOWN
    agrees: float = NOT_KNOWN
    still: tuple[str, ...] = ()
    arm: float = NOT_KNOWN
    spring: float = NOT_KNOWN
    force: float = NOT_KNOWN
    swing: float = NOT_KNOWN


def facts_of(run: Run, motion: Motion, rig: Rig) -> ChannelRatios:
    """Of the first stretch of a run."""
    inner = slice(motion.lead, None)
    wound = motion.radius * motion.position[inner]
    current, command, agrees = _beside(run, rig)
    still = ["motor_position"] if is_still(motion.position[inner]) else []
    if np.ptp(motion.torque[inner]) == 0:
        still.append("motor_torque")
    if motion.joints is None or rig.finger is None:
        return ChannelRatios(run.name, True, current, command, agrees, tuple(still))
    q = motion.joints
    mcp, pip = _swing(q.mcp[inner]), _swing(q.pip[inner])
    pull = motion.tension[inner]
    if motion.force is not None:
        force = motion.force[inner]
        # A fingertip's lever is a phalanx, the cable's an arm.
        lever = 2.0 * rig.finger.distal_half_length
        newton = USUAL_ARM_M / lever if lever > 0 else NOT_KNOWN
        mean, varies = max(float(np.mean(pull)), 0.0), _swing(pull)
        share = float(np.mean(force)) / (newton * mean) if mean > 0 else NOT_KNOWN
        swing = _swing(force) / (newton * varies) if varies > PULLS_SHARE * mean > 0 else NOT_KNOWN
        return ChannelRatios(
            run.name, False, current, command, agrees, tuple(still), force=share, swing=swing
        )
    moved = np.radians(MOVED_DEG)
    for name, mine, other in (("mcp_angle", mcp, pip), ("pip_angle", pip, mcp)):
        if other > moved and mine < DEAD_SHARE * other:
            still.append(name)
    arm = _swing(wound) / (mcp + pip) if mcp + pip > 0 else NOT_KNOWN
    torque = float(np.hypot(rig.finger.mcp_stiffness * mcp, rig.finger.pip_stiffness * pip))
    swing = _swing(pull)
    spring = torque / swing if swing > 0 and max(mcp, pip) > moved else NOT_KNOWN
    return ChannelRatios(
        run.name, False, current, command, agrees, tuple(still), arm if max(mcp, pip) > moved else NOT_KNOWN,
        spring,
    )  # fmt: skip


def _beside(run: Run, rig: Rig) -> tuple[float, float, float]:
    """Torque over current, travel over command, and their agreement, from the samples as they are."""
    names = [n for n in ("motor_current", "motor_torque", "motor_position", "motor_command") if run.has(n)]
    first = run.length // 10  # the ramp from rest
    samples = run.load(names, first, first + int(FIRST_LOOK_S * run.sample_rate_hz))
    gain = rig.ampere
    current = command = agrees = NOT_KNOWN
    if "motor_current" in samples and gain > 0:
        amperes = samples["motor_current"]
        large = np.abs(amperes) > np.median(np.abs(amperes))
        if large.any() and np.isfinite(amperes).all():
            current = float(np.median(samples["motor_torque"][large] / amperes[large])) / gain
    if "motor_command" in samples and np.isfinite(samples["motor_command"]).all():
        commanded, done = samples["motor_command"], samples["motor_position"]
        if _swing(commanded) > np.radians(MOVED_DEG) and _swing(done) > 0:
            command = _swing(done) / _swing(commanded)
            agrees = float(np.corrcoef(commanded, done)[0, 1])
    return current, command, agrees


def torque_of_an_ampere(run: Run, rig: Rig) -> float:
    """What an ampere gives at the output, N m/A, where a run's torque is that of a current that was measured.

    0 where the run holds no current, or one that was made of its torque, or the rig's constants do not make
    the one of the other: a log of one axis may have come without them.
    """
    made = read_object(
        str(run.attributes.get("derived") or "{}"), f"Run {run.name}, 'derived'", "import it again"
    )
    if not run.has("motor_current") or "motor_current" in made:
        return 0.0
    agrees = abs(_beside(run, rig)[0] - 1.0) < SAME_TORQUE
    return rig.ampere if agrees else 0.0


def _swing(values: Array) -> float:
    """From nearly the lowest value to nearly the highest, which no spike moves."""
    some = np.sort(values[:: max(len(values) // SWING_SAMPLES, 1)])
    edge = len(some) // 50
    return float(some[-1 - edge] - some[edge]) if len(some) else 0.0


def check_channels(seen: Sequence[ChannelRatios]) -> None:
    """Refuse recordings whose channels contradict the rig, geometry or each other in every run that tells.

    Raises:
        UserError: with the channel, by how much, and what would be right.
    """
    for wrong in (_dead, _units, _force):
        sentence = wrong(seen)
        if sentence:
            raise UserError(sentence)


def _dead(seen: Sequence[ChannelRatios]) -> str:
    for channel in ("motor_position", "motor_torque", "mcp_angle", "pip_angle"):
        those = [f for f in seen if not (channel.endswith("angle") and np.isnan(f.arm))]
        if those and all(channel in f.still for f in those):
            beside = "" if channel.startswith("motor") else " while the other joint does"
            or_not = "the axis does not move, or its" if channel == "motor_position" else "its"
            return (
                f"Channel '{channel}' does not move in any run{beside} (run {those[0].run}, for one); "
                f"{or_not} sensor is dead or not connected: mend that and record again."
            )
    return ""


def _units(seen: Sequence[ChannelRatios]) -> str:
    ratios = _known(seen, lambda f: f.current)
    if ratios and (min(v for _, v in ratios) > OFF_CURRENT or max(v for _, v in ratios) < 1.0 / OFF_CURRENT):
        run, value = ratios[0]
        turned = "turn its sign" if value < 0 else "write it in N m at the gearbox output"
        return (
            f"Channel 'motor_torque' is {significant(value)} times what motor_current and the rig's torque "
            f"constant and gear ratio make it (run {run}, for one); {turned}, or correct the rig."
        )
    signs = _known(seen, lambda f: f.agrees)
    if signs and max(v for _, v in signs) < -COMMAND_CORRELATION:
        return (
            f"Channel 'motor_position' turns against its command in every run (run {signs[0][0]}, for one); "
            "turn the sign of one of them."
        )
    ratios = _known(seen, lambda f: f.command)
    if ratios and (
        min(v for _, v in ratios) > ANOTHER_UNIT or max(v for _, v in ratios) < 1.0 / ANOTHER_UNIT
    ):
        return (
            f"Channel 'motor_position' moves {ratios[0][1]:.3g} times as far as its command in run "
            f"{ratios[0][0]}; write both in rad at the pulley."
        )
    arms = _known(seen, lambda f: f.arm)
    if arms and not LEAST_ARM_M < np.median([v for _, v in arms]) < LARGEST_ARM_M:
        far = np.median([v for _, v in arms]) > LARGEST_ARM_M
        contrary = "much further than the joints turn" if far else "next to nothing while the joints turn"
        return (
            f"The cable moves {contrary} (run {arms[0][0]}, for one); write all angles in rad, the motor's "
            "at the pulley, and the pulley's radius in m."
        )
    arms = _known(seen, lambda f: f.spring)
    middle = float(np.median([v for _, v in arms])) if arms else NOT_KNOWN
    if middle * ANOTHER_UNIT < LEAST_ARM_M or middle > ANOTHER_UNIT * LARGEST_ARM_M:
        times = "more" if middle < LEAST_ARM_M else "less"
        return (
            f"Channel 'motor_torque' swings by far {times} than the joints' springs take (run {arms[0][0]}, "
            "for one); write it in N m at the gearbox output, or correct the rig's stiffnesses."
        )
    return ""


def _force(seen: Sequence[ChannelRatios]) -> str:
    forces = _known(seen, lambda f: f.force)
    if not forces:
        return ""
    run, values = forces[0][0], np.array([v for _, v in forces])
    if (np.abs(values) < 1.0 / ANOTHER_UNIT).all():
        return (
            f"Channel 'endpoint_force' reads next to nothing in every contact run (run {run}, for one) while "
            "the cable pulls; the load cell is dead, not connected, or not in N."
        )
    moves = _known(seen, lambda f: f.swing)
    if moves and max(v for _, v in moves) < 1.0 / ANOTHER_UNIT:
        return (
            f"Channel 'endpoint_force' stands still in every contact run (run {moves[0][0]}, for one) while "
            "the cable's tension swings; the load cell is stuck or not connected: mend it and record again."
        )
    if (values < 0).all():
        return (
            f"Channel 'endpoint_force' is negative in every contact run (run {run}, for one); turn its sign, "
            "compression is positive."
        )
    if (values > ANOTHER_UNIT).all():
        return (
            f"Channel 'endpoint_force' is far more than the cable's tension is good for in every contact run "
            f"(run {run}, for one); write it in N."
        )
    return ""


def _known(seen: Sequence[ChannelRatios], what: Callable[[ChannelRatios], float]) -> list[tuple[str, float]]:
    """Runs that tell a number, and the number."""
    return [(f.run, what(f)) for f in seen if np.isfinite(what(f))]
