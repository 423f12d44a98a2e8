"""The force that the equations imply, against statics written out by hand."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.effects import CATALOGUE
from fingerlab.prediction.force import contact_stretches, solved_forces
from fingerlab.rig.file import Finger, Motor, Rig
from fingerlab.sessions.model import Run, Session

FINGER = Finger(
    proximal_mass=0.012, distal_mass=0.013, proximal_half_length=0.0225, distal_half_length=0.024,
    proximal_inertia=2.0e-6, distal_inertia=2.5e-6, mcp_stiffness=0.12, pip_stiffness=0.06,
    wrist_angle=math.radians(15), gravity=9.81,
)  # fmt: skip
RADIUS = 0.015
ARM_MCP, ARM_PIP = 0.011, 0.008
LOSS_MCP, LOSS_PIP = 0.002, -0.001
RATE_HZ = 1000.0
TIME = np.arange(12_000) / RATE_HZ
TRUE_FORCE = 1.3 - 1.1 * np.cos(2 * np.pi * 0.5 * TIME)  # 0.2 to 2.4 N
MCP, PIP = 0.35, 0.5
VALUES = {
    "arm_mcp@flexion": ARM_MCP, "arm_pip@flexion": ARM_PIP, "loss_mcp@flexion": LOSS_MCP,
    "loss_pip@flexion": LOSS_PIP,
}  # fmt: skip


def lever_pip() -> float:
    """Arm of a vertical force at the fingertip about the PIP joint."""
    return 2 * 0.024 * math.cos(MCP + PIP - math.radians(15))


def lever_mcp() -> float:
    return lever_pip() + 2 * 0.0225 * math.cos(math.radians(15) - MCP)


def tension(joint: str, force: np.ndarray) -> np.ndarray:
    """Cable tension that holds the finger still against the force: spring, weight and contact."""
    weight_pip = 0.013 * 9.81 * 0.024 * math.cos(MCP + PIP - math.radians(15))
    if joint == "pip":
        return (0.06 * PIP - weight_pip + lever_pip() * force - LOSS_PIP) / ARM_PIP
    weight_mcp = weight_pip + 9.81 * (0.012 + 2 * 0.013) * 0.0225 * math.cos(math.radians(15) - MCP)
    return (0.12 * MCP - weight_mcp + lever_mcp() * force - LOSS_MCP) / ARM_MCP


def session(pull: np.ndarray, cell: np.ndarray | None, pip: np.ndarray | None = None) -> Session:
    channels = {
        "motor_position": np.full_like(TIME, 0.4), "motor_torque": RADIUS * pull,
        "mcp_angle": np.full_like(TIME, MCP), "pip_angle": np.full_like(TIME, PIP) if pip is None else pip,
    }  # fmt: skip
    if cell is not None:
        channels["endpoint_force"] = cell
    run = Run.from_arrays(
        channels, phase="contact", cable="flexion", sample_rate_hz=RATE_HZ,
        trajectory={"kind": "sine", "frequency_hz": 0.5},
    )  # fmt: skip
    motor = Motor(torque_constant=0.0302, gear_ratio=4.3, pulley_radius=RADIUS, inertia=None)
    return Session(Path("by-hand.h5"), "", "", Rig(motor=motor, finger=FINGER), (run,))


@pytest.mark.parametrize("joint", ["pip", "mcp"])
def test_the_force_of_a_finger_that_stands_still(joint: str) -> None:
    made = session(tension(joint, TRUE_FORCE), TRUE_FORCE)
    (stretch,) = contact_stretches(made, made.runs[0])
    force = solved_forces(stretch, [], VALUES, "M")[joint]
    # 0.5 Hz passes the 8 Hz low-pass unchanged, so the true force is known at each sample.
    assert force == pytest.approx(np.interp(stretch.time, TIME, TRUE_FORCE), abs=2e-4)
    assert stretch.measured == pytest.approx(force, abs=2e-4)


@pytest.mark.parametrize("joint", ["pip", "mcp"])
def test_the_load_cell_takes_no_part(joint: str) -> None:
    wrong = session(tension(joint, TRUE_FORCE), 7.0 + 3.0 * TRUE_FORCE)
    none = session(tension(joint, TRUE_FORCE), None)
    values = VALUES | {"force_gain": 0.01, "lateral": 0.05, "lateral_constant": 0.03, "lateral_rub": 0.2}
    (a,) = (solved_forces(s, [], values, "M")[joint] for s in contact_stretches(wrong, wrong.runs[0]))
    (b,) = (solved_forces(s, [], values, "M")[joint] for s in contact_stretches(none, none.runs[0]))
    assert np.array_equal(a, b)
    assert np.isnan(next(iter(contact_stretches(none, none.runs[0]))).measured).all()


def test_a_load_cell_that_leaves_a_fifth_out() -> None:
    """The effect's gain is the share left out: the true force is 1 + gain times what the cell reads."""
    made = session(tension("pip", TRUE_FORCE), None)
    one = CATALOGUE["load_cell_gain"]
    (stretch,) = contact_stretches(made, made.runs[0])
    force = solved_forces(stretch, [one], VALUES | {"load_cell_gain.gain": 0.25}, "M")["pip"]
    assert force == pytest.approx(np.interp(stretch.time, TIME, TRUE_FORCE) / 1.25, abs=2e-4)


def test_a_leaning_force_shortens_or_lengthens_the_lever() -> None:
    made = session(tension("pip", TRUE_FORCE), None)
    (stretch,) = contact_stretches(made, made.runs[0])
    tangent = 0.4
    force = solved_forces(stretch, [], VALUES | {"lateral": tangent}, "M")["pip"]
    distal = MCP + PIP - math.radians(15)
    leaning = 2 * 0.024 * (math.cos(distal) + tangent * math.sin(distal))
    assert force == pytest.approx(np.interp(stretch.time, TIME, TRUE_FORCE) * lever_pip() / leaning, abs=3e-4)


def test_a_spring_at_the_tip_begins_where_it_was_set_down() -> None:
    """The finger comes down from 6 degrees above the load cell; before it moves, friction holds 2 N."""
    down = np.clip((TIME - 1.0) / 0.8, 0.0, 1.0)
    down = down * down * (3.0 - 2.0 * down)
    true = (TRUE_FORCE + 0.3) * (down == 1.0)  # above what lets a tip go
    pip = PIP - 0.1 * (1.0 - down) + 0.004 * np.sin(2 * np.pi * 0.4 * TIME) * down
    distal = MCP + pip - math.radians(15)
    reach = 2 * 0.0225 * math.cos(math.radians(15) - MCP) + 2 * 0.024 * np.cos(distal)
    sideways = 800.0 * (reach - reach[down == 1.0].mean()) * (down == 1.0)  # N
    moment = 2 * 0.024 * (true * np.cos(distal) + sideways * np.sin(distal))
    pull = (0.06 * pip - 0.013 * 9.81 * 0.024 * np.cos(distal) + moment - LOSS_PIP) / ARM_PIP
    made = session(pull + 2.0 * (TIME < 1.0), None, pip)
    (stretch,) = contact_stretches(made, made.runs[0])
    force = solved_forces(stretch, [], VALUES | {"lateral_spring": 800.0}, "M")["pip"]
    # Taken to begin amid all that the finger did, it would be 0.15 N off throughout.
    assert force == pytest.approx(np.interp(stretch.time, TIME, true), abs=0.01)


def test_a_delay_is_taken_out() -> None:
    """Angles and force recorded 63 ms late: the motor's channels must be moved to later by as much."""
    made = session(tension("pip", TRUE_FORCE), None)
    (stretch,) = contact_stretches(made, made.runs[0])
    one = CATALOGUE["transport_delay"]
    force = solved_forces(stretch, [one], VALUES | {"delay": 0.063}, "M")["pip"]
    late = np.interp(stretch.time - 0.063, TIME, TRUE_FORCE)
    assert force == pytest.approx(late, abs=5e-4)


def test_a_cable_that_the_model_has_not_seen() -> None:
    made = session(tension("pip", TRUE_FORCE), None)
    (stretch,) = contact_stretches(made, made.runs[0])
    with pytest.raises(UserError, match="not fitted with the flexion cable"):
        solved_forces(stretch, [], {"arm_pip@extension": 0.01}, "M.json")


def test_the_stretches_of_a_long_run_neither_overlap_nor_hold_the_ramp_from_rest() -> None:
    """Two stretches of 150 s: behind the first two seconds, time goes on from one to the next."""
    time = np.arange(int(150 * RATE_HZ)) / RATE_HZ
    still = np.ones_like(time)
    channels = {
        "time": time, "motor_position": 0.4 * still, "motor_torque": 0.05 * still, "mcp_angle": MCP * still,
        "pip_angle": PIP * still, "endpoint_force": still,
    }  # fmt: skip
    run = Run.from_arrays(channels, phase="contact", cable="flexion", sample_rate_hz=RATE_HZ)
    motor = Motor(torque_constant=0.0302, gear_ratio=4.3, pulley_radius=RADIUS, inertia=None)
    long = Session(Path("by-hand.h5"), "", "", Rig(motor=motor, finger=FINGER), (run,))
    parts = [stretch.time for stretch in contact_stretches(long, run)]
    assert len(parts) > 1
    assert parts[0][0] >= 2.0
    assert np.diff(np.concatenate(parts)).min() > 0
    for stretch in contact_stretches(long, run):
        assert len(stretch.measured) == len(stretch.time)
