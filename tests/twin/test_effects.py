"""Each effect changes the recording in the channels where it acts, and only there."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.twin.effects import EFFECTS, parse_effects
from fingerlab.twin.protocols import RunPlan, load_preset
from fingerlab.twin.recording import Recorded, simulate_session

PLANS = (
    RunPlan(
        "on_air", "extension", {"kind": "sine", "amplitude_deg": 14.0, "offset_deg": 22.0, "duration_s": 6.0}
    ),
    RunPlan(
        "on_air", "flexion", {"kind": "sine", "amplitude_deg": 8.0, "offset_deg": 15.0, "duration_s": 6.0}
    ),
    RunPlan("contact", "flexion", {"kind": "sine", "amplitude_deg": 2.0, "duration_s": 6.0}),
)
CHANNELS = ("motor_position", "motor_torque", "mcp_angle", "pip_angle", "endpoint_force")
SENSING = {"transport_delay", "angle_sensor_nonlinearity", "sensor_drift", "load_cell_gain"}
KINEMATICS = {"cable_slack", "cable_stretch", "backlash"}
MOTOR = {
    "motor_coulomb_friction", "motor_viscous_friction", "motor_inertia", "motor_stribeck_friction",
    "motor_presliding", "asymmetric_friction", "load_dependent_friction", "motor_spring", "torque_ripple",
}  # fmt: skip
INVISIBLE = {"distal_rotation"}
"""Some 1e-5 N m at finger speeds: below any bench's noise, which is the honest answer about it."""


@cache
def recorded(effect: str | None) -> tuple[Recorded, ...]:
    effects = parse_effects([effect]) if effect else {}
    return tuple(simulate_session(load_preset(), PLANS, effects, 11))


def smooth(values: Any) -> Any:
    """Means over 25 ms after the ramp: noise and chance of single counts fall away."""
    return values[2000:6000].reshape(-1, 25).mean(axis=1)


def change(effect: str, run: int, channel: str) -> float:
    """Change of a channel against the bench without the effect, in units of its smoothed noise."""
    with_it, without = recorded(effect)[run].channels[channel], recorded(None)[run].channels[channel]
    scale = {"motor_position": 7e-4, "motor_torque": 1e-3, "endpoint_force": 5e-3}.get(channel, 4e-4)
    return float(np.sqrt(np.mean((smooth(with_it) - smooth(without)) ** 2)) / scale)


def balance(effect: str | None) -> float:
    """Residual of the static and inertial balance of both joints against the true tension, N m rms.

    Written out here from the thesis (3.16, 3.17), with the bench's own constants.
    """
    from fingerlab.twin.bench import draw_truth

    truth = draw_truth(load_preset(), np.random.default_rng(np.random.SeedSequence(11).spawn(1)[0]))
    f = {k: v * truth.factors[k] for k, v in vars(load_preset().rig.finger).items()}
    t = recorded(effect)[0].truth
    q1, q2, w1, w2 = t["q1"], t["q2"], t["w1"], t["w2"]
    a1, a2 = np.gradient(w1, 1e-3), np.gradient(w2, 1e-3)
    m2, l1, l2, g = f["distal_mass"], f["proximal_half_length"], f["distal_half_length"], 9.81
    cross = 2 * m2 * l1 * l2
    distal = m2 * g * l2 * np.cos(q1 + q2 - f["wrist_angle"])
    left = (
        (m2 * l2**2 + cross * np.cos(q2)) * a1
        + (m2 * l2**2 + f["distal_inertia"]) * a2
        + cross * np.sin(q2) * w1**2
    )
    residual = left - distal + f["pip_stiffness"] * q2 + truth.arms["extension"][1] * t["tension"]
    return float(np.sqrt(np.mean(smooth(residual) ** 2)))


def test_table_holds_the_catalogue() -> None:
    contract = Path(__file__).parents[3] / "shared" / "contracts" / "effects.md"
    if not contract.is_file():
        pytest.skip(f"the contract is not at {contract}")
    ids = re.findall(r"^\| ([a-z_]+) \|", contract.read_text(encoding="utf-8"), re.MULTILINE)
    assert [i for i in ids if i != "id"] == list(EFFECTS)


@pytest.mark.parametrize("effect", list(EFFECTS))
def test_default_is_plausible_and_every_number_has_a_source(effect: str) -> None:
    for p in EFFECTS[effect].parameters:
        assert p.low <= p.default <= p.high
        assert p.source


@pytest.mark.parametrize("effect", sorted(set(EFFECTS) - INVISIBLE))
def test_effect_shows_in_the_recording(effect: str) -> None:
    assert max(change(effect, run, channel) for run in range(3) for channel in CHANNELS) > 3.0


def test_distal_rotation_is_too_small_to_see() -> None:
    assert max(change("distal_rotation", 0, c) for c in ("mcp_angle", "pip_angle")) < 1.0


@pytest.mark.parametrize("effect", sorted(SENSING))
def test_sensing_leaves_the_motor_channels_untouched(effect: str) -> None:
    for run in range(2):
        for channel in ("motor_position", "motor_torque"):
            assert np.array_equal(
                recorded(effect)[run].channels[channel], recorded(None)[run].channels[channel]
            )


@pytest.mark.parametrize("effect", ["load_cell_gain", "contact_angle", "contact_compliance"])
def test_contact_effects_leave_free_motion_untouched(effect: str) -> None:
    for run in range(2):
        for channel in CHANNELS:
            assert np.array_equal(
                recorded(effect)[run].channels[channel], recorded(None)[run].channels[channel]
            )
    assert change(effect, 2, "endpoint_force") > 1.0


def test_routing_change_leaves_the_extension_cable_untouched() -> None:
    for channel in CHANNELS:
        assert np.array_equal(
            recorded("routing_change")[0].channels[channel], recorded(None)[0].channels[channel]
        )
    assert change("routing_change", 1, "pip_angle") > 10.0


@pytest.mark.parametrize("effect", sorted(KINEMATICS | MOTOR | SENSING))
def test_effects_outside_the_joints_leave_the_joint_balance_intact(effect: str) -> None:
    assert balance(effect) < 2.5e-4


@pytest.mark.parametrize(
    "effect", ["viscous_friction", "coulomb_friction", "spring_hardening", "stiffness_error", "added_mass"]
)
def test_effects_in_the_joints_break_the_joint_balance(effect: str) -> None:
    assert balance(effect) > 3 * balance(None)


@pytest.mark.parametrize("effect", sorted(MOTOR))
def test_motor_effects_show_in_the_torque_and_hardly_in_the_finger(effect: str) -> None:
    assert change(effect, 0, "motor_torque") > 1.0
    assert np.abs(recorded(effect)[0].truth["q1"] - recorded(None)[0].truth["q1"]).max() < 0.02


@pytest.mark.parametrize("effect", sorted(KINEMATICS))
def test_cable_effects_show_in_the_joints_at_the_same_motor_angle(effect: str) -> None:
    assert change(effect, 0, "motor_position") < 4.0  # 0.16 degrees of 14
    assert change(effect, 0, "pip_angle") > 10.0


def test_drift_is_slow_and_grows_over_the_run() -> None:
    extra = recorded("sensor_drift")[0].channels["mcp_angle"] - recorded(None)[0].channels["mcp_angle"]
    assert abs(extra[:50].mean()) < 1e-3
    assert abs(extra[-50:].mean()) == pytest.approx(0.03, abs=2e-3)


def test_delay_shifts_the_joints_by_its_length() -> None:
    late, early = (
        recorded("transport_delay")[0].channels["pip_angle"],
        recorded(None)[0].channels["pip_angle"],
    )
    errors = [float(np.mean((smooth(np.roll(early, n)) - smooth(late)) ** 2)) for n in range(80)]
    assert int(np.argmin(errors)) == pytest.approx(40, abs=2)


def test_strength_is_si_or_a_factor_of_the_default() -> None:
    default = EFFECTS["cable_slack"].parameters[0].default
    assert parse_effects(["cable_slack"])["cable_slack"]["travel"] == default
    assert parse_effects(["cable_slack=0.002"])["cable_slack"]["travel"] == 0.002
    assert parse_effects(["cable_slack=x0.5"])["cable_slack"]["travel"] == pytest.approx(0.5 * default)


@pytest.mark.parametrize(
    ("requests", "words"),
    [
        (["glue"], "no effect 'glue'"),
        (["cable_slack=long"], "strength of 'cable_slack'"),
        (["cable_slack=nan"], "strength of 'cable_slack'"),
        (["cable_slack", "cable_slack=x2"], "given twice"),
    ],
)
def test_bad_effects_are_refused(requests: list[str], words: str) -> None:
    with pytest.raises(UserError, match=words):
        parse_effects(requests)
