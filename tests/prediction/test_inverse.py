"""The torque that a wanted force needs: statics by hand, forward again, and on the simulated rig."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from fingerlab.core.errors import UserError
from fingerlab.effects import CATALOGUE
from fingerlab.models.file import ParameterEstimate, write_model
from fingerlab.prediction import fit_extended, model_of_extended
from fingerlab.prediction.error_band import CELLS, Band
from fingerlab.prediction.extended import ChosenEffect, Variant
from fingerlab.prediction.force import contact_stretches, solved_forces
from fingerlab.prediction.inverse import LEAD_S, needed_torque
from fingerlab.prediction.target import ContactPose, pose_by_hand, pose_of_run, wanted_force
from fingerlab.rig.file import Finger, Motor, Rig
from fingerlab.sessions import open_session
from fingerlab.sessions.model import Run, Session
from fingerlab.thesis.onair import Parameters
from fingerlab.thesis.prediction import ParameterSet

FINGER = Finger(
    proximal_mass=0.012, distal_mass=0.013, proximal_half_length=0.0225, distal_half_length=0.024,
    proximal_inertia=2.0e-6, distal_inertia=2.5e-6, mcp_stiffness=0.12, pip_stiffness=0.06,
    wrist_angle=math.radians(15), gravity=9.81,
)  # fmt: skip
RIG = Rig(FINGER, Motor(torque_constant=0.0302, gear_ratio=4.3, pulley_radius=0.015, inertia=None))
MCP, PIP, ARM, LOSS = 0.35, 0.5, 0.008, -0.001
VALUES = {
    "arm_mcp@flexion": 0.011, "arm_pip@flexion": ARM, "loss_mcp@flexion": 0.002, "loss_pip@flexion": LOSS,
}  # fmt: skip
SINE = {"kind": "sine", "mean_n": 1.3, "amplitude_n": 0.9, "frequency_hz": 0.5, "duration_s": 12.0}


def by_hand(force: np.ndarray) -> np.ndarray:
    """Motor torque: spring, weight and contact about the PIP joint, through cable and pulley."""
    distal = MCP + PIP - math.radians(15)
    weight = 0.013 * 9.81 * 0.024 * math.cos(distal)
    about_pip = 0.06 * PIP - weight + 2 * 0.024 * math.cos(distal) * force - LOSS
    return 0.015 * about_pip / ARM


def fitted(delay: float = 0.0, half_arm: float = 0.0, half_loss: float = 0.0) -> ParameterSet:
    parameters = Parameters(
        "pip", "extension", "extension", ParameterEstimate(ARM, "m", ARM - half_arm, ARM + half_arm),
        ParameterEstimate(LOSS, "N m", LOSS - half_loss, LOSS + half_loss), 0.9, delay, 100, ("001",),
    )  # fmt: skip
    return ParameterSet("extension", "pip", "extension", {"extension": parameters})


def variant(effects: tuple[ChosenEffect, ...] = (), **values: float) -> Variant:
    band = Band(1.3, 0.6, 2.0, 0.9, (0.05,) * CELLS, 1.0, 4)
    return Variant(effects, VALUES | values, (), 1.0, 1.0, band)


def test_a_fits_parameters_in_closed_form() -> None:
    plan = needed_torque(wanted_force(SINE), fitted(), pose_by_hand(MCP, PIP), RIG, "M")
    time = np.arange(3000) / 250.0
    force = 1.3 + 0.9 * np.sin(np.pi * time)
    assert plan.force == pytest.approx(force)
    assert plan.torque == pytest.approx(by_hand(force), rel=1e-9)
    assert plan.current == pytest.approx(by_hand(force) / (0.0302 * 4.3), rel=1e-9)
    assert plan.beyond == ()


def test_its_interval_is_that_of_arm_and_loss() -> None:
    wanted, pose = wanted_force(SINE), pose_by_hand(MCP, PIP)
    torque = needed_torque(wanted, fitted(), pose, RIG, "M").torque
    arm = needed_torque(wanted, fitted(half_arm=0.05 * ARM), pose, RIG, "M")
    assert arm.half_width == pytest.approx(0.05 * torque)
    loss = needed_torque(wanted, fitted(half_loss=0.0004), pose, RIG, "M")
    assert loss.half_width == pytest.approx(np.full(3000, 0.015 * 0.0004 / ARM))


def test_a_motor_that_leads_by_the_delay() -> None:
    plan = needed_torque(wanted_force(SINE), fitted(delay=0.06), pose_by_hand(MCP, PIP), RIG, "M")
    force = 1.3 + 0.9 * np.sin(np.pi * (plan.time + 0.06))
    assert plan.torque[:2900] == pytest.approx(by_hand(force)[:2900], rel=1e-4)


@pytest.mark.parametrize("name", ["", "load_cell_gain", "coulomb_friction", "capstan_friction"])
def test_forward_prediction_of_the_inverse_is_the_wanted_force(name: str) -> None:
    """A recording in which the motor gave just that torque, predicted by the same model."""
    effects, values = (), {}
    if name:
        one = CATALOGUE[name]
        shape = dict(one.shapes[0]) if len(one.shapes) else {}
        effects = (ChosenEffect(one, shape),)
        values = {f"{name}.{gain}": 0.3 * known.typical for gain, known in one.gains.items()}
    model = variant(effects, **values)
    pose = ContactPose("flexion", (MCP, -0.004), (PIP, 0.01), (0.4, 0.02), "by hand")
    plan = needed_torque(wanted_force(SINE), model, pose, RIG, "M")
    rate = 1000.0
    time = np.arange(12_000) / rate
    force = 1.3 + 0.9 * np.sin(np.pi * time)
    channels = {
        "motor_position": 0.4 + 0.02 * force, "motor_torque": np.interp(time, plan.time, plan.torque),
        "mcp_angle": MCP - 0.004 * force, "pip_angle": PIP + 0.01 * force,
    }  # fmt: skip
    run = Run.from_arrays(channels, phase="contact", cable="flexion", sample_rate_hz=rate, trajectory=SINE)
    made = Session(Path("made.h5"), "", "", RIG, (run,))
    (stretch,) = contact_stretches(made, run)
    again = solved_forces(stretch, [c.alone() for c in effects], model.values, "M")["pip"]
    expected = np.interp(stretch.time, time, force)
    # Where the finger turns round a dry friction steps, which the prediction's low-pass at 8 Hz rounds off.
    close = np.abs(again - expected) < 5e-3
    assert close.mean() > (0.75 if "friction" in name else 0.999)
    assert np.sqrt(np.mean((again - expected) ** 2)) < 0.03


def test_the_interval_of_the_force_becomes_one_of_torque() -> None:
    plan = needed_torque(wanted_force(SINE), variant(), pose_by_hand(MCP, PIP), RIG, "M")
    distal = MCP + PIP - math.radians(15)
    newton_per_newton_metre = ARM / 0.015 / (2 * 0.024 * math.cos(distal))
    assert plan.half_width == pytest.approx(np.full(3000, 0.05 / newton_per_newton_metre), rel=1e-6)


def test_a_force_far_beyond_the_recorded_ones_is_told_and_its_interval_widens() -> None:
    near = needed_torque(wanted_force(SINE), variant(), pose_by_hand(MCP, PIP), RIG, "M")
    assert not any("extrapolation" in warning for warning in near.warnings)
    # The model was judged on 1.3 ± 0.9 N; 4.0 + 0.9 N lie four times as far from there.
    far = needed_torque(wanted_force({**SINE, "mean_n": 4.0}), variant(), pose_by_hand(MCP, PIP), RIG, "M")
    assert far.warnings[0] == (
        "4.9 N is an extrapolation: the model was judged on 0.4 to 2.2 N, so its interval is taken up to 4 "
        "times as wide."
    )
    assert far.half_width.max() == pytest.approx(4.0 * near.half_width.max(), rel=1e-3)


@pytest.mark.parametrize(
    ("wish", "rig", "words"),
    [
        ({"mean_n": 7.0}, {"torque": 0.3}, "allow 285 mN m"),
        ({"mean_n": 7.0}, {"current": 1.0}, "allow 123.4 mN m"),
        ({"frequency_hz": 40.0}, {"tension_rise": 300.0}, "limit is 300 N/s"),
    ],
)
def test_limits_are_told_in_a_sentence(wish: dict[str, float], rig: dict[str, float], words: str) -> None:
    bench = replace(RIG, extra={"limits": rig})
    plan = needed_torque(wanted_force(SINE | wish), fitted(), pose_by_hand(MCP, PIP), bench, "M")
    assert any(words in sentence for sentence in plan.beyond), plan.beyond
    with pytest.raises(UserError):
        plan.trajectory()


@pytest.mark.parametrize("predictor", [fitted, variant])
def test_a_force_above_the_rigs_limit_is_refused_before_a_torque_is_asked_for(predictor: Any) -> None:
    """Out there the pose, a straight line of the force, gives -5 N m, and a torque that no secant finds."""
    for wish in ({"mean_n": 40.0}, {"mean_n": 20.0, "amplitude_n": 20.0}):
        wanted, pose = wanted_force(SINE | wish), pose_by_hand(MCP, PIP)
        with pytest.raises(UserError, match=r"reaches 40(\.9)? N; the rig's limit is 10 N: ask for less\.$"):
            needed_torque(wanted, predictor(), pose, RIG, "M")


def test_a_cable_cannot_push() -> None:
    weak = {**SINE, "mean_n": 0.1, "amplitude_n": 0.1}
    plan = needed_torque(wanted_force(weak), fitted(), pose_by_hand(-0.5, -0.6), RIG, "M")
    assert "push" in plan.beyond[0]
    assert plan.beyond[0].endswith("ask for more force, or another pose.")


def test_the_trajectory_begins_softly_at_nothing() -> None:
    plan = needed_torque(wanted_force(SINE), fitted(), pose_by_hand(MCP, PIP), RIG, "M")
    made = plan.trajectory()
    time, torque = np.array(made["time_s"]), np.array(made["torque_n_m"])
    assert torque[0] == 0.0
    assert time[-1] == pytest.approx(LEAD_S + 12.0 - 0.02)
    force = 1.3 + 0.9 * np.sin(np.pi * (5.0 - LEAD_S))
    assert np.interp(5.0, time, torque) == pytest.approx(float(by_hand(np.array(force))), rel=1e-5)


@pytest.mark.parametrize(
    ("wish", "words"),
    [
        ("nothing", "cannot be read|No such file|does not exist|nothing"),
        ("{", "not JSON"),
        ({"kind": "chirp"}, "should be one of sine"),
        ({"kind": "sine", "mean_n": 1.0}, "amplitude_n"),
        ({**SINE, "mean_n": 0.5}, "falls to -0.4 N"),
        ({**SINE, "duration_s": 0.1}, "from 1 to 300 s"),
        ({"kind": "file", "time_s": [0, 1], "force_n": [1]}, "2 times and 1 forces"),
    ],
)
def test_what_is_no_wanted_force_is_one_sentence(wish: Any, words: str) -> None:
    with pytest.raises(UserError, match=words):
        wanted_force(wish)


def test_ramps_steps_and_a_table(tmp_path: Path) -> None:
    ramp = wanted_force({"kind": "ramp_hold", "mean_n": 1.0, "amplitude_n": 0.5, "frequency_hz": 0.25})
    assert ramp.force[[0, 250, 500, 750]] == pytest.approx([0.5, 1.5, 1.5, 0.5])
    steps = wanted_force({"kind": "steps", "mean_n": 1.0, "amplitude_n": 0.5})
    assert 0.5 <= steps.force.min() < steps.force.max() <= 1.5
    table = tmp_path / "wish.txt"
    table.write_text("time force\n0 1\n4 2\n8 0.5\n", encoding="utf-8")
    wish = wanted_force(str(table))
    assert wish.force[[0, 500, 1500]] == pytest.approx([1.0, 1.5, 1.25])


@pytest.fixture(scope="module")
def practised(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A simulated session with contact, and the model fitted to it."""
    from fingerlab.twin.protocols import load_preset, single_run
    from fingerlab.twin.session import write_session

    folder = tmp_path_factory.mktemp("inverse")
    air = {"kind": "multisine", "frequency_hz": 0.7, "duration_s": 12.0}
    plans = [
        single_run({**air, "amplitude_deg": 12.0, "offset_deg": 22.0}, "on_air", "extension"),
        single_run({**air, "amplitude_deg": 8.0, "offset_deg": 14.0}, "on_air", "flexion"),
    ]
    for amplitude, frequency in ((1.2, 0.5), (1.6, 0.8), (1.0, 0.4)):
        motion = {"kind": "sine", "amplitude_deg": amplitude, "frequency_hz": frequency, "duration_s": 12.0}
        plans.append(single_run(motion, "contact"))
    session, model = folder / "S.h5", folder / "M.json"
    write_session(session, load_preset("practice"), "inverse", plans, {}, 3)
    write_model(model_of_extended(fit_extended([open_session(session)], [])), model)
    return session, model


def call(*arguments: str) -> Any:
    from fingerlab.cli.predict import inverse
    from fingerlab.cli.record import record
    from fingerlab.cli.simulate import simulate

    word, *rest = arguments
    command = {"inverse": inverse, "record": record, "simulate": simulate}[word]
    return CliRunner().invoke(command, rest, catch_exceptions=False)


@pytest.mark.parametrize("word", ["record", "simulate"])
def test_on_the_simulated_rig_the_force_is_the_wanted_one(
    practised: tuple[Path, Path], tmp_path: Path, word: str
) -> None:
    session, model = practised
    wish = {"kind": "sine", "mean_n": 0.9, "amplitude_n": 0.4, "frequency_hz": 0.4, "duration_s": 10.0}
    path, taken = tmp_path / "T.json", tmp_path / "taken.h5"
    told = json.loads(
        call(
            "inverse", str(session), "--model", str(model), "--wanted", json.dumps(wish), "--out", str(path),
            "--json", "-",
        ).stdout
    )  # fmt: skip
    assert told["beyond"] == []
    arguments = ["--trajectory", str(path), "--seed", "3"]
    arguments += ["--device", "simulated"] if word == "record" else []
    assert call(word, *arguments, "--out", str(taken)).exit_code == 0
    run = open_session(taken).runs[0]
    assert run.trajectory["kind"] == "torque"
    time = run.channel("time") - LEAD_S
    inside = (time > 1.0) & (time < 9.8)
    cell = np.convolve(run.channel("endpoint_force"), np.ones(101) / 101, mode="same")
    error = (cell - (0.9 + 0.4 * np.sin(2 * np.pi * 0.4 * time)))[inside]
    limit = told["interval"]["high"] - told["torque"]["high"]  # N m
    plan_slope = 0.8 / (told["torque"]["high"] - told["torque"]["low"])  # N per N m
    # The interval comes from three contact runs, and is taken where the force is largest: near 90 %.
    assert np.mean(np.abs(error) < limit * plan_slope) > 0.85
    assert np.sqrt(np.mean(error**2)) < 0.1


def test_pose_of_a_contact_run(practised: tuple[Path, Path]) -> None:
    run = open_session(practised[0]).runs[2]
    pose = pose_of_run(run)
    cell = run.channel("endpoint_force")[2000:]
    for name, line in (("mcp_angle", pose.mcp), ("pip_angle", pose.pip)):
        pressed = run.channel(name)[2000:][cell > 0.5]
        assert line[0] + line[1] * cell[cell > 0.5].mean() == pytest.approx(pressed.mean(), abs=0.005)
    with pytest.raises(UserError, match="no contact run"):
        pose_of_run(open_session(practised[0]).runs[0])


def test_the_command_says_what_is_wrong(practised: tuple[Path, Path]) -> None:
    session, model = practised
    common = ("inverse", str(session), "--model", str(model), "--wanted", json.dumps(SINE))
    with pytest.raises(UserError, match="no contact run '009'; it has 003, 004, 005"):
        call(*common, "--run", "009")
    too_much = (*common[:4], "--wanted", json.dumps({**SINE, "mean_n": 40.0}))
    with pytest.raises(UserError, match=r"reaches 40\.9 N; the rig's limit is 10 N"):
        call(*too_much, "--run", "004")
    with pytest.raises(UserError, match="no predictor 'best'"):
        call(*common, "--parameters", "best")
    text = call(*common, "--run", "004").stdout
    assert "run 004" in text
    assert "mN m" in text
