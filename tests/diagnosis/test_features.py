"""Features against the equations written out again: shifts, signs and sizes of what every model carries."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fingerlab.diagnosis.equations.coefficients import SHIFTS_S, SLOPE, shift_weights, slope_weights
from fingerlab.diagnosis.equations.features import (
    base_columns,
    turned_columns,
)
from fingerlab.diagnosis.equations.model import build
from fingerlab.diagnosis.equations.parameters import nuisance_ranges
from fingerlab.diagnosis.fit.noise import row_covariance
from fingerlab.diagnosis.gram.sums import Reduced
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Row
from fingerlab.physics.motion import Motion, tip_reach
from fingerlab.physics.nominal import JointMotion
from fingerlab.rig.file import Finger
from tests.effects.moving import FINGER, moving
from tests.reduced import reduce_sessions

from . import closed_form as made

QUIET = dict.fromkeys(("angle_noise", "torque_noise", "position_noise", "force_noise"), 0.0)


def shifted_sine(frequency: float, weights: np.ndarray, time: np.ndarray) -> np.ndarray:
    """What the weights make of a sine and its derivative."""
    omega = 2 * np.pi * frequency
    kept = [np.sin(omega * (time - shift)) for shift in SHIFTS_S]
    return np.sum([w * k for w, k in zip(weights, kept, strict=False)], axis=0) + weights[SLOPE] * (
        omega * np.cos(omega * time)
    )


@pytest.mark.parametrize(("frequency", "within"), [(0.5, 1e-7), (1.0, 1e-6), (3.0, 1e-4), (8.0, 0.02)])
def test_shift_weights_delay_a_sine(frequency: float, within: float) -> None:
    time = np.linspace(0.0, 2.0, 101)
    for delay in np.linspace(-0.001, 0.19, 60):
        expected = np.sin(2 * np.pi * frequency * (time - delay))
        assert shifted_sine(frequency, shift_weights(delay)[0], time) == pytest.approx(expected, abs=within)


@pytest.mark.parametrize("delay", SHIFTS_S[2:10])
def test_a_kept_shift_is_exact(delay: float) -> None:
    weights, _ = shift_weights(delay)
    assert weights == pytest.approx([float(s == delay) for s in SHIFTS_S] + [0.0], abs=1e-9)


def test_slope_weights_delay_a_sine_by_less_than_a_millisecond() -> None:
    time = np.linspace(0.0, 2.0, 101)
    for delay in (-0.001, 0.0, 0.0006):
        expected = np.sin(2 * np.pi * 3.0 * (time - delay))
        assert shifted_sine(3.0, slope_weights(delay)[0], time) == pytest.approx(expected, abs=2e-4)


@pytest.mark.parametrize("weigh", [shift_weights, slope_weights])
@pytest.mark.parametrize("delay", [0.0003, 0.011, 0.0371, 0.0725, 0.162])
def test_slopes_are_derivatives(weigh, delay: float) -> None:
    step = 1e-6
    numeric = (weigh(delay + step)[0] - weigh(delay - step)[0]) / (2 * step)
    assert weigh(delay)[1] == pytest.approx(numeric, abs=1e-5 * max(1.0, np.abs(numeric).max()))


def test_nuisances_move_within_two_and_a_half_tolerances() -> None:
    ranges = nuisance_ranges(made.RIG)
    assert ranges["mcp_stiffness"].high == pytest.approx(0.05)  # 2.5 times the 2 % of a constant not named
    assert ranges["rotor_inertia"].high == pytest.approx(2.5 * 0.2 * made.INERTIA)
    assert all(g.low < g.high and g.typical > 0 and g.unit for g in ranges.values())


def test_a_rotors_trace_of_friction_goes_by_the_rotor() -> None:
    """As the thesis' motor coasts, 2.9e-4 kg m^2 with 5e-5 N m s/rad; torque constants by tolerance."""
    rig = replace(
        made.RIG, motor=replace(made.RIG.motor, inertia=5.8e-3), tolerance={"torque_constant": 0.04}
    )
    ranges = nuisance_ranges(rig)
    assert ranges["bench_trace"].typical == pytest.approx(1e-3, rel=0.05)
    assert ranges["torque_gain"].high == pytest.approx(0.1)
    untold = replace(rig, motor=replace(rig.motor, inertia=None), finger=None)
    assert nuisance_ranges(untold)["bench_trace"].typical == 5e-5


@pytest.mark.parametrize("mcp", [0.0, 0.7])
def test_what_a_length_does_to_the_weight_of_a_finger_at_rest(mcp: float) -> None:
    """Both masses hang on the proximal phalanx' length; no lever of the contact force is among it."""
    motion = moving(force=2.0)
    still = np.zeros(len(motion.time))
    motion = replace(motion, joints=JointMotion(still + mcp, still + 0.4, still, still, still, still))
    found = {
        (f.row, f.parameter): v
        for f, v in base_columns(motion)
        if (f.parameter or "").endswith("half_length")
    }
    f, g = FINGER, FINGER.gravity
    near = -g * (f.proximal_mass + 2.0 * f.distal_mass) * f.proximal_half_length * np.cos(f.wrist_angle - mcp)
    far = -g * f.distal_mass * f.distal_half_length * np.cos(mcp + 0.4 - f.wrist_angle)
    expected = {
        (Row.MCP, "proximal_half_length"): near,
        (Row.MCP, "distal_half_length"): far,
        (Row.PIP, "proximal_half_length"): 0.0,
        (Row.PIP, "distal_half_length"): far,
    }
    assert found.keys() == expected.keys()
    for key, value in expected.items():
        assert found[key] == pytest.approx(value, abs=1e-12)


@pytest.fixture(scope="module")
def quiet() -> Reduced:
    """A bench without noise whose constants are the rig file's."""
    bench = made.Bench(finger=made.NOMINAL, missing=made.Missing(), **QUIET)
    return reduce_sessions([made.session(bench, contact=2)], [])


def truth(model, bench: made.Bench) -> np.ndarray:
    values = model.start()
    known = {
        **dict.fromkeys(("offset@extension", "offset@flexion"), 0.004),
        **{f"loss_mcp@{c}": bench.losses[0] for c in ("extension", "flexion")},
        **{f"loss_pip@{c}": bench.losses[1] for c in ("extension", "flexion")},
        "trace_mcp": bench.trace,
        "trace_pip": bench.trace,
        **{f"arm_{j}@extension": bench.arms[-1][i] for i, j in enumerate(("mcp", "pip"))},
        **{f"arm_{j}@flexion": bench.arms[1][i] for i, j in enumerate(("mcp", "pip"))},
    }
    for key, value in known.items():
        values[model.index[key]] = value
    return values


def test_the_true_model_leaves_nothing(quiet: Reduced) -> None:
    """Residuals of tension (N) and cable length (m) at the true unknowns, beside what the signals vary by."""
    model = build(quiet.layout, quiet.groups, [])
    values = truth(model, made.Bench())
    for group in quiet.groups:
        for fold in group.folds:
            left = row_covariance(model, values, group, fold.of(model.pick), fold.taut_samples)
            assert left[Row.MCP, Row.MCP] < 0.002**2  # of tensions that swing by newtons
            assert left[Row.PIP, Row.PIP] < 0.002**2
            assert left[Row.CABLE, Row.CABLE] < 1e-8**2  # of lengths that swing by millimetres


@pytest.mark.parametrize(
    ("key", "change", "row", "expected"),
    [
        ("loss_mcp@extension", 1e-3, Row.MCP, 1e-3 / 0.0104),
        ("loss_pip@extension", 1e-3, Row.PIP, 1e-3 / 0.0083),
        ("offset@extension", 1e-4, Row.CABLE, 1e-4),
    ],
)
def test_a_wrong_constant_shows_by_its_closed_form(
    quiet: Reduced, key: str, change: float, row: Row, expected: float
) -> None:
    model = build(quiet.layout, quiet.groups, [])
    values = truth(model, made.Bench())
    values[model.index[key]] += change
    group = next(g for g in quiet.groups if g.key == ("extension", "free"))
    whole = group.whole
    left = row_covariance(model, values, group, whole.of(model.pick), whole.taut_samples)
    assert np.sqrt(left[row, row]) == pytest.approx(expected, rel=0.01)


def test_samples_are_those_of_the_runs(quiet: Reduced) -> None:
    """Ten seconds less two of settling, two filters and the room for shifts, at 25 Hz."""
    assert [g.key for g in quiet.groups] == [
        ("extension", "free"),
        ("flexion", "free"),
        ("flexion", "contact"),
    ]
    assert [len(g.folds) for g in quiet.groups] == [5, 3, 2]
    for group in quiet.groups:
        for fold in group.folds:
            assert fold.slack_samples == 0
            assert (
                25 * (10 - 2 - 0.32 - 0.06 - 2 * 0.22) - 2 <= fold.taut_samples <= 25 * (10 - 2 - 0.32 - 0.4)
            )


def test_friction_on_a_turned_face_has_the_levers_of_that_face() -> None:
    """Virtual work: a force along the face turns a joint by how far the tip moves along the face with it."""
    motion, tilt = moving(force=1.0), CATALOGUE["gravity_tilt"]
    shape = next(i for i, s in enumerate(tilt.shapes) if s["cell_stays"] and s["turn_deg"] > 12.0)
    turned = replace(FINGER, wrist_angle=FINGER.wrist_angle + np.radians(tilt.shapes[shape]["turn_deg"]))
    level = {(f.row, f.parameter): values for f, values in base_columns(motion)}
    friction = np.asarray(motion.tip_slip_force(18.0))
    for row, joint in ((Row.MCP, "mcp"), (Row.PIP, "pip")):
        told = level[row, "lateral_slip_18"] + sum(
            f.factor * values
            for f, values in turned_columns(motion, tilt, shape)
            if (f.row, f.parameter) == (row, "lateral_slip_18")
        )
        assert told == pytest.approx(-friction * slope_of_the_reach(turned, motion, joint), abs=1e-8)


def slope_of_the_reach(finger: Finger, motion: Motion, joint: str, step: float = 1e-5) -> np.ndarray:
    """By how much the tip moves along the face as a joint turns, m/rad, by a difference."""
    reaches = []
    for sign in (1.0, -1.0):
        q = vars(motion.joints) | {joint: getattr(motion.joints, joint) + sign * step}
        reaches.append(tip_reach(replace(motion, finger=finger, joints=JointMotion(**q), _memory={})))
    return np.asarray((reaches[0] - reaches[1]) / (2.0 * step))
