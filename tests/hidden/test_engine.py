"""The second engine against closed forms, and blind diagnoses of its sessions.

The closed forms are written out here by hand, from free bodies: they check MuJoCo's model of the bench,
not the project's equations.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.sessions import check_session, open_session
from tests.hidden.sweep.surroundings import open_varied, population, record_varied

from .engine.bench import Bench, draw_bench
from .engine.effects import EFFECTS
from .engine.model import build, settle
from .engine.session import POSTURE, record
from .engine.simulate import Truth, run
from .engine.trajectories import command
from .engine.trials import blind_trial


def quiet_bench(seed: int = 3) -> Bench:
    """A bench without any friction, so that closed forms are exact."""
    bench = draw_bench(np.random.default_rng(seed))
    bench.viscous, bench.motor_viscous, bench.tip_friction = [1e-5, 1e-5], 0.0, 0.0
    return bench


def drive(bench: Bench, cable: str, wanted: np.ndarray, contact: bool = False) -> Truth:
    return run(bench, build(bench, cable, contact, POSTURE, 1.0), cable, wanted, 1.0)


def weight_torques(bench: Bench, mcp: float, pip: float) -> tuple[float, float]:
    """Torques of the weight that bend the joints, N m: mass times horizontal lever, body by body."""
    f = bench.finger
    l1, l2 = f["proximal_half_length"], f["distal_half_length"]
    proximal = math.cos(mcp - f["wrist_angle"])
    distal = math.cos(mcp + pip - f["wrist_angle"])
    about_pip = f["distal_mass"] * l2 * distal
    about_mcp = f["proximal_mass"] * l1 * proximal + f["distal_mass"] * 2 * l1 * proximal + about_pip
    return f["gravity"] * about_mcp, f["gravity"] * about_pip


def test_finger_hangs_where_springs_carry_the_weight() -> None:
    bench = quiet_bench()
    built = build(bench, "extension", False, POSTURE, 1.0)
    rest = settle(built, seconds=4.0).qpos
    mcp, pip = float(rest[built.mcp]), float(rest[built.pip])
    heavy = weight_torques(bench, mcp, pip)
    assert mcp > 0.05  # the weight flexes
    assert bench.finger["mcp_stiffness"] * mcp == pytest.approx(heavy[0], rel=1e-3)
    assert bench.finger["pip_stiffness"] * pip == pytest.approx(heavy[1], rel=1e-3)


@pytest.mark.parametrize(("cable", "sign"), [("extension", -1), ("flexion", 1)])
def test_cable_at_rest_balances_both_joints(cable: str, sign: int) -> None:
    bench = quiet_bench()
    bench.cubic = [0.3, 0.2]
    truth = drive(
        bench, cable, command({"kind": "sine", "amplitude_deg": 0, "frequency_hz": 1, "offset_deg": 20}, 4.0)
    )
    mcp, pip, tension = (float(x[-500:].mean()) for x in (truth.mcp, truth.pip, truth.tension))
    a, b = bench.arms[cable]
    heavy = weight_torques(bench, mcp, pip)
    springs = (
        bench.finger["mcp_stiffness"] * mcp + 0.3 * mcp**3,
        bench.finger["pip_stiffness"] * pip + 0.2 * pip**3,
    )
    assert tension > 1.0
    assert sign * a * tension == pytest.approx(springs[0] - heavy[0], rel=0.01)
    assert sign * b * tension == pytest.approx(springs[1] - heavy[1], rel=0.01)
    gain = bench.motor["torque_constant"] * bench.motor["gear_ratio"]
    pulled = gain * float(truth.current[-500:].mean()) / bench.motor["pulley_radius"]
    assert pulled == pytest.approx(tension, rel=0.01)
    wound = bench.motor["pulley_radius"] * float(truth.motor[-1])
    joints = sign * (a * (mcp - truth.mcp[0]) + b * (pip - truth.pip[0]))
    loose = wound - joints - tension / bench.cable_stiffness
    assert loose == pytest.approx(bench.pretravel[cable], abs=1.5e-5)  # an encoder count is 1.1e-5 m


@pytest.mark.parametrize("lean", [0.0, 0.4, -0.3])
def test_contact_force_leans_and_loads_both_joints(lean: float) -> None:
    bench = quiet_bench()
    bench.lean = lean
    truth = drive(
        bench,
        "flexion",
        command({"kind": "sine", "amplitude_deg": 0, "frequency_hz": 1, "offset_deg": 28}, 5.0),
        True,
    )
    mcp, pip, tension, up = (
        float(x[-500:].mean()) for x in (truth.mcp, truth.pip, truth.tension, truth.force)
    )
    out = up * math.tan(lean)  # along x, of a frictionless face whose normal leans
    f = bench.finger
    down1, down2 = mcp - f["wrist_angle"], mcp + pip - f["wrist_angle"]
    x2, z2 = 2 * f["distal_half_length"] * np.array([math.cos(down2), -math.sin(down2)])
    x1, z1 = 2 * f["proximal_half_length"] * np.array([math.cos(down1), -math.sin(down1)])
    about_pip = x2 * up - z2 * out  # extends
    about_mcp = (x1 + x2) * up - (z1 + z2) * out
    a, b = bench.arms["flexion"]
    heavy = weight_torques(bench, mcp, pip)
    assert up > 0.3
    assert a * tension + heavy[0] - f["mcp_stiffness"] * mcp == pytest.approx(about_mcp, rel=0.02)
    assert b * tension + heavy[1] - f["pip_stiffness"] * pip == pytest.approx(about_pip, rel=0.02)


def dissipated(bench: Bench, frequency: float = 1.0) -> tuple[float, float]:
    """Work of the motor in one cycle (J) and the cycle's amplitude (rad), third cycle of a free sine."""
    wave = {"kind": "sine", "amplitude_deg": 12.0, "frequency_hz": frequency, "offset_deg": 22.0}
    truth = drive(bench, "extension", command(wave, 2.0 + 3.0 / frequency))
    last = slice(-round(1000 / frequency) - 1, None)
    torque = bench.motor["torque_constant"] * bench.motor["gear_ratio"] * truth.current[last]
    angle = truth.motor[last]
    # The current of a millisecond acts until the next one.
    return float(np.sum(torque[:-1] * np.diff(angle))), float(np.ptp(angle)) / 2


@pytest.mark.parametrize("travel", [0.0, 4e-3])
def test_dry_friction_of_the_motor_costs_four_times_torque_times_amplitude(travel: float) -> None:
    bench, smooth = quiet_bench(), quiet_bench()
    bench.motor_dry, bench.stick = 0.008, {"joint": 0.0, "motor": travel}
    work, amplitude = dissipated(bench)
    expected = 4 * 0.008 * (amplitude - travel)
    assert work - dissipated(smooth)[0] == pytest.approx(expected, rel=0.03)


def test_viscous_friction_of_the_motor_costs_pi_c_omega_amplitude_squared() -> None:
    bench, smooth = quiet_bench(), quiet_bench()
    bench.motor_viscous = 5e-3
    work, amplitude = dissipated(bench)
    expected = math.pi * 5e-3 * 2 * math.pi * amplitude**2
    assert work - dissipated(smooth)[0] == pytest.approx(expected, rel=0.03)


def test_slack_cable_pulls_only_after_its_dead_travel() -> None:
    bench = quiet_bench()
    EFFECTS["cable_slack"].change(bench, 4e-3, np.random.default_rng(0))
    ramp = np.radians(np.linspace(0.0, 30.0, 3000))
    truth = drive(bench, "extension", ramp)
    taut = np.flatnonzero(truth.tension > 0.02)[0]
    wound = bench.motor["pulley_radius"] * truth.motor[taut]
    assert wound == pytest.approx(bench.pretravel["extension"], abs=1e-4)
    assert np.ptp(truth.mcp[: taut - 10]) < 1e-3
    assert (truth.tension >= 0).all()  # a cable does not push


def test_session_is_sound_and_repeats_by_seed(tmp_path: Path) -> None:
    told = record(tmp_path / "a.h5", "rich", {"spring_hardening": None}, seed=5, duration_s=2.5)
    again = record(tmp_path / "b.h5", "rich", {"spring_hardening": None}, seed=5, duration_s=2.5)
    assert told == again
    effect = EFFECTS["spring_hardening"]
    assert effect.low <= told["effects"]["spring_hardening"] <= effect.high
    first, second = open_session(tmp_path / "a.h5"), open_session(tmp_path / "b.h5")
    assert not check_session(first).errors
    assert {(run.phase, run.cable) for run in first.runs} == {
        ("on_air", "extension"),
        ("on_air", "flexion"),
        ("contact", "flexion"),
    }
    for one, other in zip(first.runs, second.runs, strict=True):
        assert np.array_equal(one.channel("motor_torque"), other.channel("motor_torque"))


@pytest.mark.parametrize(("effect", "seed"), [(None, 1), ("cable_stretch", 3)])
def test_blind_diagnosis_of_the_second_engine(effect: str | None, seed: int, tmp_path: Path) -> None:
    trial = blind_trial({effect: None} if effect else {}, seed, "rich", tmp_path, duration_s=10.0)
    assert trial.in_set, trial.line()
    assert trial.first, trial.line()
    if effect is None:
        assert trial.verdict == "nothing_missing", trial.line()
        assert trial.score < 1.3, trial.line()  # 1 is the floor: signs and constants are understood alike
    else:
        assert trial.verdict == "missing_effect", trial.line()


def test_the_bench_is_driven_as_a_device_of_one_s_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """An ampere winds the flexion cable: the fingertip presses, and lets go where it is made safe."""
    from fingerlab.devices.choosing import own_device
    from fingerlab.rig.file import parse_rig
    from tests.hidden.engine import own_device as file

    monkeypatch.setenv(file.VARIABLE, json.dumps({"effects": {"coulomb_friction": 0.002}, "seed": 3}))
    daq = parse_rig(file.rig_text(), "the engine's rig").daq
    device = own_device(Path(file.__file__), daq.rate_hz)
    device.open()
    device.start()
    device.set_enable(True)
    for ampere in np.linspace(0.0, 1.0, 400):
        sample = device.exchange(daq.command.volts(float(ampere)))
    for _ in range(400):
        sample = device.exchange(daq.command.volts(1.0))
    force, mcp, pip, current = (
        float(line.quantity(volts)) for line, volts in zip(daq.inputs, sample.raw, strict=False)
    )
    assert force > 0.3  # N
    assert current == pytest.approx(1.0, abs=0.1)  # A; its noise is 0.02
    assert (mcp, pip) == pytest.approx((0.40, 0.36), abs=0.1)  # rad: where the load cell stands
    assert sample.raw[4] > 0.0  # counts
    assert device.make_safe()
    device.start()
    for _ in range(300):
        sample = device.exchange(0.0)
    assert abs(float(daq.load_cell.quantity(sample.raw[0]))) < 0.1


def test_a_late_recording_is_not_taken_for_angles_behind_a_filter(tmp_path: Path) -> None:
    """Two numbers of a reading leave a little less than one delay: 0.50 for 0.68 floors."""
    (trial,) = population(11054, 1)
    assert (trial.source, trial.effects) == ("engine", ("transport_delay",))
    record_varied(trial, tmp_path / "late.h5")
    found = diagnose([open_varied(trial, tmp_path / "late.h5")], with_curves=False)
    assert found.final_model == ("transport_delay",)
    assert not [one for one in found.bench if one.kind == "skew"]
