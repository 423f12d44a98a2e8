"""Coefficients of the features: their derivatives, and the sign in which each unknown enters."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.diagnosis.equations.model import Choice, Model, build
from fingerlab.diagnosis.gram.sums import Group, Reduced
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Row
from tests.reduced import reduce_sessions

from . import closed_form as made


@pytest.fixture(scope="module")
def reduced() -> Reduced:
    session = made.session(made.Bench(), contact=1)
    runs = [r for r in session.runs if r.name in ("001", "006", "009")]
    return reduce_sessions(
        [made.Session(session.path, "", "", session.rig, tuple(runs))], list(CATALOGUE.values())
    )


def model_with(reduced: Reduced, *effects: str, shape: int = 0) -> Model:
    choices = [Choice(CATALOGUE[e], min(shape, len(CATALOGUE[e].shapes) - 1)) for e in effects]
    return build(reduced.layout, reduced.groups, choices)


def drawn(model: Model, rng: np.random.Generator) -> np.ndarray:
    """Values well inside the bounds, so that a small step either way is allowed."""
    return model.low + (model.high - model.low) * rng.uniform(0.2, 0.8, len(model.unknowns))


COMBINATIONS = [
    (),
    ("transport_delay",),
    ("transport_delay", "cable_stretch", "motor_coulomb_friction"),
    ("contact_angle", "stribeck_friction", "varying_moment_arm"),
    ("cable_slack", "added_mass", "angle_sensor_nonlinearity", "torque_ripple"),
    *((name,) for name in CATALOGUE),
]


@pytest.mark.parametrize("effects", COMBINATIONS, ids=lambda e: "+".join(e) or "nominal")
def test_derivatives_are_finite_differences(reduced: Reduced, effects: tuple[str, ...]) -> None:
    model = model_with(reduced, *effects, shape=1)
    values = drawn(model, np.random.default_rng(len(model.unknowns)))
    for group in reduced.groups:
        _, jacobian = model.coefficients(values, group)
        assert jacobian.shape == (len(model.active), len(values))
        for i, unknown in enumerate(model.unknowns):
            step = 1e-5 * (unknown.parameter.high - unknown.parameter.low)
            up, down = values.copy(), values.copy()
            up[i] += step
            down[i] -= step
            numeric = (model.coefficients(up, group)[0] - model.coefficients(down, group)[0]) / (2 * step)
            scale = max(np.abs(numeric).max(), 1.0)
            assert jacobian[:, i] == pytest.approx(numeric, abs=1e-6 * scale), unknown.key


def test_the_torque_counts_as_it_was_measured(reduced: Reduced) -> None:
    """A torque that reads 4 % too high makes springs and masses more of it, not the torque less of them.

    Else all that a model leaves of a joint would shrink with its springs, masses and torque together.
    """
    model = model_with(reduced)
    one, other = model.start(), model.start()
    other[model.index["torque_gain"]] = 0.04
    group = reduced.groups[0]
    before, after = model.features(one, group), model.features(other, group)
    parameters = np.array([model.layout.features[i].parameter for i in model.active])
    in_joints = np.isin(model.rows, (Row.MCP, Row.PIP)) & (before != 0.0)
    torque = in_joints & (parameters == "torque_gain")
    assert torque.sum() > 1
    assert after[torque] == pytest.approx(before[torque])
    others = in_joints & (parameters != "torque_gain")
    assert after[others] == pytest.approx(before[others] / 0.96)
    cable = (model.rows == Row.CABLE) & (parameters != "torque_gain")
    assert after[cable] == pytest.approx(before[cable])


def routing(reduced: Reduced, sign: int) -> Group:
    return next(g for g in reduced.groups if g.cable_sign == sign)


@pytest.mark.parametrize("sign", [-1, 1])
def test_each_routing_has_arms_of_its_own(reduced: Reduced, sign: int) -> None:
    model = model_with(reduced)
    values = drawn(model, np.random.default_rng(0))
    _, jacobian = model.coefficients(values, routing(reduced, sign))
    own, other = ("extension", "flexion") if sign < 0 else ("flexion", "extension")
    for arm in ("arm_mcp", "arm_pip", "loss_mcp", "offset"):
        assert jacobian[:, model.index[f"{arm}@{own}"]].any()
        assert not jacobian[:, model.index[f"{arm}@{other}"]].any()


@pytest.mark.parametrize("sign", [-1, 1])
def test_residuals_fall_with_what_a_term_explains(reduced: Reduced, sign: int) -> None:
    """Residual is measured minus modelled: joint terms over the signed arm, angles times it."""
    model = model_with(reduced, "viscous_friction", "motor_viscous_friction", "backlash", "sensor_drift")
    values = drawn(model, np.random.default_rng(4))
    known = dict(zip((u.key for u in model.unknowns), values, strict=True))
    cable = "extension" if sign < 0 else "flexion"
    a, compliance = known[f"arm_mcp@{cable}"], known["cable_compliance"]
    h, _ = model.coefficients(values, routing(reduced, sign))
    expected = {
        ("viscous_friction", "viscous_mcp", Row.MCP): -known["viscous_friction.viscous_mcp"] / (sign * a),
        ("motor_viscous_friction", "viscous", Row.PIP): -known["motor_viscous_friction.viscous"],
        ("motor_viscous_friction", "viscous", Row.CABLE): known["motor_viscous_friction.viscous"]
        * compliance,
        ("backlash", "half_gap", Row.CABLE): -known["backlash.half_gap"],
        ("sensor_drift", "rate_mcp", Row.CABLE): -known["sensor_drift.rate_mcp"] * sign * a,
    }
    found = {}
    for k, index in enumerate(model.active):
        feature = model.layout.features[index]
        found[feature.owner, feature.parameter, feature.row] = h[k]
    for key, value in expected.items():
        as_measured = 1.0 if key[2] == Row.CABLE else 1.0 - known["torque_gain"]
        assert found[key] == pytest.approx(value / as_measured), key


def test_contact_unknowns_need_contact_runs(reduced: Reduced) -> None:
    free = [g for g in reduced.groups if g.key[1] == "free"]
    without = {u.key for u in build(reduced.layout, free, []).unknowns}
    within = {u.key for u in build(reduced.layout, reduced.groups, []).unknowns}
    assert {"force_gain", "lateral"} <= within - without


def test_delay_and_slack_change_the_model_itself(reduced: Reduced) -> None:
    late, loose = model_with(reduced, "transport_delay"), model_with(reduced, "cable_slack")
    assert late.delayed
    assert not loose.delayed
    assert loose.slack_free
    assert not late.slack_free
    assert late.high[late.index["delay"]] == pytest.approx(0.19)
    assert loose.high[loose.index["delay"]] == pytest.approx(0.001)
