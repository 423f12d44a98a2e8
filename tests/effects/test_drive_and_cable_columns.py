"""Torque lost on the motor side, cable lengths and bent sensors: each column against a closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fingerlab.diagnosis.equations.columns import all_columns
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Row, Term
from fingerlab.effects.sensor_drift import STEADY_S
from fingerlab.effects.transmission import LATE, as_effects_see_it, driven_tension
from fingerlab.physics import nominal
from fingerlab.physics.nominal import JointMotion
from fingerlab.sessions.model import CABLE_SIGN
from tests.physics.test_friction_states import looped_stop

from .moving import FINGER, MOTOR, bench, column, moving

DRIVE = sorted(name for name, e in CATALOGUE.items() if e.acts_on == ("motor_torque",))
RADIUS = 0.015


def by_row(terms: list[Term]) -> dict[Row, list[Term]]:
    return {row: [t for t in terms if t.row == row] for row in Row if any(t.row == row for t in terms)}


@pytest.mark.parametrize("name", DRIVE)
def test_a_motor_torque_is_the_same_tension_in_both_joints(name: str) -> None:
    """Torque over pulley radius, in MCP and PIP alike; the cable feels that much less and stretches less."""
    effect, motion = CATALOGUE[name], moving()
    for shape in effect.shapes:
        rows = by_row(effect.columns(motion, shape))
        assert set(rows) == {Row.MCP, Row.PIP, Row.CABLE}
        for mcp, pip, cable in zip(rows[Row.MCP], rows[Row.PIP], rows[Row.CABLE], strict=True):
            assert mcp.gain == pip.gain == cable.gain
            assert mcp.scale == pip.scale == "direct"
            assert cable.scale == "compliance"
            assert np.array_equal(mcp.values, pip.values)
            assert np.array_equal(mcp.values, cable.values)
        if effect.bench:
            alone = {term.gain: term.values for term in effect.columns(bench(), shape)}
            for term in rows[Row.MCP]:
                assert alone[term.gain] == pytest.approx(RADIUS * term.values)
            assert {effect.gains[gain].cable for gain in alone.keys() - {t.gain for t in rows[Row.MCP]}} <= {
                "none"
            }


def test_a_sheath_may_rub_by_the_speed() -> None:
    """Where a part z of the wrap slides, exp(-z mu phi) of the tension is left: s = 1 - exp(-mu phi)."""
    motion, width = moving(), 0.05
    shape = {"reversal_speed": width, "stretch_behind": 1.0, "held": 0.0}
    cable = next(name for name, sign in CABLE_SIGN.items() if sign == motion.cable_sign)
    for share in (0.0, 0.3):
        told = {**shape, f"share_{cable}": share}
        state = np.tanh(motion.velocity / width)
        wrap = -np.log(1.0 - share)
        taken = (1.0 - np.exp(-wrap * state)) / share if share else state
        expected = driven_tension(motion, told) * taken
        terms = CATALOGUE["capstan_friction"].columns(motion, told)
        assert column(terms, Row.MCP, cable) == pytest.approx(expected)


SHARP = CATALOGUE["motor_coulomb_friction"].shapes[0]
"""Friction that builds up over the least travel, as the other effects of the drive take it."""


@pytest.mark.parametrize(
    "name", [n for n in DRIVE if "friction" in n or "presliding" in n or "stribeck" in n]
)
def test_motor_friction_costs_work_in_either_direction(name: str) -> None:
    motion = moving(seconds=8.0)
    for shape in CATALOGUE[name].shapes:
        for term in CATALOGUE[name].columns(motion, shape):
            if term.row != Row.MCP or term.gain in CATALOGUE[name].offsets:
                continue
            power = (term.values * motion.velocity)[1000:]  # three whole cycles
            assert power.sum() > 0
            # Only where it builds up over a travel does a little come back after each reversal.
            sharp = name in ("motor_viscous_friction", "motor_coulomb_friction", "asymmetric_friction")
            if sharp and shape.get("travel_deg", 0.0) < 0.2:
                assert power.min() > -0.05 * power.max()


def test_motor_columns_have_their_closed_forms() -> None:
    motion = bench()
    t = motion.time

    def of(name: str, shape: dict[str, float] | None = None, gain: str | None = None) -> np.ndarray:
        return column(CATALOGUE[name].columns(motion, shape or CATALOGUE[name].shapes[0]), Row.BENCH, gain)

    angle = 0.5 + 0.4 * np.sin(2 * np.pi * 0.75 * t + 0.8)
    omega = 2 * np.pi * 0.75
    speed = 0.4 * omega * np.cos(omega * t + 0.8)
    assert of("motor_viscous_friction") == pytest.approx(speed)
    assert of("motor_inertia") == pytest.approx(-(omega**2) * (angle - 0.5))
    assert of("motor_spring") == pytest.approx(angle)
    for shape in CATALOGUE["torque_ripple"].shapes:
        n = shape["order"]
        assert of("torque_ripple", shape, "sine") == pytest.approx(np.sin(n * angle))
        assert of("torque_ripple", shape, "cosine") == pytest.approx(np.cos(n * angle))
        assert of("torque_ripple", shape, "double_sine") == pytest.approx(np.sin(2 * n * angle))
        assert of("torque_ripple", shape, "double_cosine") == pytest.approx(np.cos(2 * n * angle))
    fast = (np.abs(speed) > 0.6) & (t > 0.1)  # several travels behind every reversal
    assert of("motor_coulomb_friction")[fast] == pytest.approx(np.sign(speed[fast]), abs=0.02)
    load = 0.05 + 0.02 * np.sin(2 * np.pi * 0.25 * t) - (motion.motor.inertia or 0.0) * motion.acceleration
    assert of("load_dependent_friction")[fast] == pytest.approx((load * np.sign(speed))[fast], abs=0.0015)


def test_load_dependent_friction_takes_the_known_load_where_there_is_one() -> None:
    """A spring of 0.1 N m over half the travel of 0.6 degrees, that slides at the load of 0.09 N m."""
    motion = bench(load=np.full(1000, -0.09))
    shape = {"travel_deg": 0.6, "sharpness": 1.0}
    share = column(CATALOGUE["load_dependent_friction"].columns(motion, shape), Row.BENCH)
    assert share == pytest.approx(0.09 * looped_stop(motion.position, 0.9 * np.radians(0.3)))


def test_what_gears_lose_is_a_share_of_what_they_pass_on() -> None:
    """A tenth of 50 mN m: the motor gives 55 winding in and 45 paying out, and 5 of both are the loss."""
    still = moving()
    winding = still.velocity > 0.6
    paying = still.velocity < -0.6
    torque = 0.05 + np.where(winding, 0.005, np.where(paying, -0.005, 0.0))
    motion = replace(still, torque=torque, acceleration=np.zeros_like(torque))
    for held in (0.0, 1.0):
        shape = {"travel_deg": 0.02, "sharpness": held, "held": held, "load_share": 0.1}
        lost = 0.1 * RADIUS * column(CATALOGUE["load_dependent_friction"].columns(motion, shape), Row.PIP)
        settled = motion.time > 0.1
        assert lost[winding & settled] == pytest.approx(0.005, rel=1e-3)
        assert lost[paying & settled] == pytest.approx(-0.005, rel=1e-3)


def test_asymmetric_friction_has_the_sum_one_way_and_the_difference_the_other() -> None:
    """6 mN m winding in and 2 paying out are 4 and half of 4."""
    motion = moving()
    shape, settled = SHARP, motion.time > 0.1
    terms = CATALOGUE["asymmetric_friction"].columns(motion, shape)
    torque = RADIUS * (4e-3 * column(terms, Row.PIP, "coulomb") + 2e-3 * column(terms, Row.PIP, "difference"))
    assert torque[settled & (motion.velocity > 0.6)] == pytest.approx(6e-3, rel=0.02)
    assert torque[settled & (motion.velocity < -0.6)] == pytest.approx(-2e-3, rel=0.05)
    both = column(terms, Row.PIP, "coulomb")
    assert both == pytest.approx(column(CATALOGUE["motor_coulomb_friction"].columns(motion, shape), Row.PIP))


def test_capstan_loss_is_a_share_of_the_tension_against_the_travel() -> None:
    """Euler-Eytelwein to first order: winding in, the motor pulls more than the finger feels.

    What the rotor's inertia takes never reaches the sheath; the cable stretches before or behind it.
    """
    motion = moving()
    fast = (np.abs(motion.velocity) > 0.6) & (motion.time > 0.1)
    tension = (motion.torque - (motion.motor.inertia or 0.0) * motion.acceleration) / RADIUS
    expected = (tension * np.sign(motion.velocity))[fast]
    for shape in CATALOGUE["capstan_friction"].shapes:
        if shape["travel_deg"] < 0.2:
            terms = CATALOGUE["capstan_friction"].columns(motion, shape)
            for row in (Row.MCP, Row.PIP):
                error = column(terms, row)[fast] - expected
                assert np.abs(error).max() < 0.02 * np.abs(expected).max()
            assert any(t.row == Row.CABLE for t in terms) == bool(shape["stretch_behind"])


def test_a_sheath_takes_its_share_of_what_motor_and_gearbox_leave_and_a_delay_moves_both() -> None:
    """Grease, inertia, ripple, friction and a spring in closed form; late by 11 ms, the same sines."""
    motion = moving()
    told = {"drive_viscous": 2e-3, "drive_inertia": 2e-4, "drive_coulomb": 0.0}
    kept = (MOTOR.inertia + 2e-4) * motion.acceleration + 2e-3 * motion.velocity
    assert driven_tension(motion, told) == pytest.approx((motion.torque - kept) / RADIUS)
    ripple = {"drive_order": 8.0, "drive_sine": 3e-3, "drive_cosine": -1e-3, "drive_double_sine": 5e-4}
    turn = 8.0 * motion.position
    kept = kept + 3e-3 * np.sin(turn) - 1e-3 * np.cos(turn) + 5e-4 * np.sin(2.0 * turn)
    assert driven_tension(motion, told | ripple) == pytest.approx((motion.torque - kept) / RADIUS)
    friction = {"drive_coulomb": 4e-3, "drive_travel_deg": 0.6, "drive_sharpness": 1.0}
    rubs = looped_stop(motion.position, np.radians(0.3))  # from rest; from slide to slide twice that
    kept = MOTOR.inertia * motion.acceleration + 4e-3 * rubs
    assert driven_tension(motion, friction) == pytest.approx((motion.torque - kept) / RADIUS)
    law = {"drive_stribeck_travel_deg": 0.6, "drive_stribeck_sharpness": 1.0, "drive_stribeck_speed": 0.4}
    falling = {"drive_stribeck_coulomb": 3e-3, "drive_stribeck_extra": 2e-3, **law, "drive_difference": 1e-3}
    kept = kept + 1e-3 + (3e-3 + 2e-3 * np.exp(-((motion.velocity / 0.4) ** 2))) * rubs
    assert driven_tension(motion, friction | falling) == pytest.approx((motion.torque - kept) / RADIUS)
    kept = MOTOR.inertia * motion.acceleration + 0.03 * motion.position
    assert driven_tension(motion, {"drive_stiffness": 0.03}) == pytest.approx((motion.torque - kept) / RADIUS)
    late = as_effects_see_it(motion, [replace(CATALOGUE["transport_delay"], shapes=({LATE: 0.011},))])
    then = motion.time[3:] - 0.011
    turn = 2 * np.pi * 0.75 * then + 0.8
    assert late.position[3:] == pytest.approx(0.5 + 0.4 * np.sin(turn), abs=1e-4)  # linear between samples
    assert late.torque[3:] == pytest.approx(0.05 + 0.02 * np.sin(2 * np.pi * 0.25 * then), abs=1e-6)
    assert late.joints is motion.joints
    assert as_effects_see_it(motion, [CATALOGUE["transport_delay"]]) is motion


def test_a_cable_that_sticks_in_its_sheath_keeps_its_friction_while_the_tension_rises() -> None:
    """Wound in by three degrees it slides; then it stands, and the motor pulls half as hard again."""
    time = np.arange(500) / 250.0
    position = np.radians(3.0) * np.minimum(time, 1.0)
    torque = RADIUS * np.where(time < 1.2, 4.0, 6.0)
    velocity = np.gradient(position, time)
    motion = moving(seconds=2.0, position=position, velocity=velocity, acceleration=0 * time, torque=torque)
    shape = {"travel_deg": 0.6, "stretch_behind": 1.0, "sharpness": 1.0}
    for held, after in ((0.0, 6.0), (1.0, 4.0)):
        terms = CATALOGUE["capstan_friction"].columns(motion, shape | {"held": held})
        lost = column(terms, Row.PIP)
        assert lost[(time > 0.9) & (time < 1.1)] == pytest.approx(4.0)
        assert lost[time > 1.3] == pytest.approx(after)
    # A spring of 5 N over half the travel: 4 N, and sliding, after 0.24 degrees of its 0.3.
    way = np.degrees(position)
    assert lost[way < 0.23] == pytest.approx(5.0 * way[way < 0.23] / 0.3, abs=1e-9)
    assert lost[(way > 0.25) & (time < 1.0)] == pytest.approx(4.0)


def test_a_stretch_that_lags_lags_behind_what_the_sheath_leaves() -> None:
    """A pull of 2, then 5 N, of which the sheath takes a third: the rest through a lag of 20 ms.

    Where the stretch lies before the sheath it lags behind the whole pull.
    """
    time = np.arange(500) / 250.0
    torque = RADIUS * np.where(time < 1.0, 2.0, 5.0)
    motion = moving(seconds=2.0, position=time, velocity=1.0 + 0 * time, acceleration=0 * time, torque=torque)
    sheath = {"share_extension": 1 / 3, "sheath_travel_deg": 0.1, "sheath_sharpness": 0.0, "sheath_held": 0.0}
    since = time[time >= 1.0] - 1.0
    rise = 3.0 * (0.02 / 0.004) * (1.0 - np.exp(-0.004 / 0.02))  # evenly, from one sample to the next
    assert motion.cable_sign == CABLE_SIGN["extension"]
    for behind, left in ((1.0, 2 / 3), (0.0, 1.0)):
        shape = {"time_constant": 0.02, **sheath, "sheath_stretch_behind": behind}
        (term,) = CATALOGUE["cable_stretch"].columns(motion, shape)
        assert term.values[time >= 1.0] == pytest.approx(-left * rise * np.exp(-since / 0.02), abs=2e-3)
        assert term.values[(time > 0.5) & (time < 0.99)] == pytest.approx(0.0, abs=1e-6)


def test_play_follows_the_last_reversal() -> None:
    """While the motor winds in it is ahead of the cable by half the play, and behind while it pays out."""
    motion = moving()
    for shape in CATALOGUE["backlash"].shapes:
        play = column(CATALOGUE["backlash"].columns(motion, shape), Row.CABLE)
        half = 0.5 * np.radians(shape["gap_deg"])
        settled = (np.abs(motion.velocity) > 0.6) & (motion.time > 0.4)
        away = np.minimum(np.abs(motion.position - 0.9), np.abs(motion.position - 0.1)) > 2 * half
        chosen = settled & away
        assert chosen.sum() > 100
        assert play[chosen] == pytest.approx(RADIUS * np.sign(motion.velocity[chosen]))
        assert np.abs(play).max() <= RADIUS * (1 + 1e-9)


def test_varying_arm_obeys_virtual_work() -> None:
    """The arm is the slope of the cable length with the angle, to first order in the growth.

    The cable column is d(length)/d(growth); the torque column is d(tension)/d(growth) times the arm. With a
    torque tau = s a(theta) T and a(theta) = d(length)/d(theta), both follow from one length.
    """
    motion = moving(force=1.0)
    q = motion.joints
    assert q is not None
    terms = CATALOGUE["varying_moment_arm"].columns(motion, {})
    cable = {t.gain: t for t in terms if t.row == Row.CABLE}
    assert {t.scale for t in cable.values()} == {"arm_mcp", "arm_pip"}
    growth, arm = 1e-5, 0.01
    for row, gain, angle, lhs in (
        (Row.MCP, "growth_mcp", q.mcp, nominal.mcp_torque(FINGER, q).total),
        (Row.PIP, "growth_pip", q.pip, nominal.pip_torque(FINGER, q).total),
    ):
        length = np.polynomial.Polynomial.fit(angle, arm * (angle + growth * cable[gain].values), 4)
        torque = lhs + contact_lever(row, q) * motion.force
        expected = (torque / length.deriv()(angle) - torque / arm) / growth
        found = column(terms, row, gain) / arm
        assert found == pytest.approx(expected, abs=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize("sign", [-1, 1])
def test_around_the_growth_that_was_found_the_arm_is_told_exactly(sign: int) -> None:
    """All that a joint calls for is over a (1 + p angle): sideways forces, other effects' torques, too."""
    motion = moving(sign=sign, force=1.0)
    q = motion.joints
    assert q is not None
    found = {"growth_mcp": 0.3, "growth_pip": -0.2, "turn_mcp": 0.3, "turn_pip": 0.35}
    bends = replace(CATALOGUE["varying_moment_arm"], shapes=(found,))
    rubs = replace(CATALOGUE["coulomb_friction"], shapes=({"travel_deg": 0.12},))
    other = [feature for _, _, _, make in all_columns(moving(sign=-sign, force=1.0), [bends, rubs])
             if (feature := make())]  # fmt: skip
    mine = [feature for _, _, _, make in all_columns(motion, [bends, rubs]) if (feature := make())]
    assert [(f.row, f.parameter) for f in mine] == [(f.row, f.parameter) for f in other]
    rng = np.random.default_rng(1)
    strengths = {f.parameter or "": rng.uniform(0.1, 0.5) for f in mine} | found | {"": 0.0}

    def called_for(row: Row, effects: list) -> np.ndarray:
        parts = [(make(), values) for values, _, _, make in all_columns(motion, effects)]
        mine = [(f, values) for f, values in parts if f.row is row and f.scale == "joint"]
        return np.sum([values * (f.constant + strengths[f.parameter or ""]) for f, values in mine], axis=0)

    for row, angle, grown in (
        (Row.MCP, q.mcp, 0.3 + 0.3 * sign),
        (Row.PIP, q.pip, -0.2 + 0.35 * sign),
    ):
        straight = called_for(row, [rubs])
        assert called_for(row, [bends, rubs]) == pytest.approx(straight / (1.0 + grown * angle), rel=1e-9)


def contact_lever(row: Row, q: JointMotion) -> np.ndarray:
    """Tip travel with a joint's angle, downwards: written out from the finger's geometry."""
    distal = 2 * FINGER.distal_half_length * np.cos(q.mcp + q.pip - FINGER.wrist_angle)
    if row == Row.PIP:
        return distal
    return distal + 2 * FINGER.proximal_half_length * np.cos(q.mcp - FINGER.wrist_angle)


@pytest.mark.parametrize(
    "time_constant", sorted({s["time_constant"] for s in CATALOGUE["cable_stretch"].shapes})
)
def test_a_lagging_stretch_is_a_first_order_lag(time_constant: float) -> None:
    """Under a tension sine: 1 / (1 + i w tau) times the tension stretches the cable."""
    seconds, omega = 8.0, 2 * np.pi * 2.0
    time = np.arange(round(250 * seconds)) / 250.0
    still = np.zeros_like(time)
    motion = moving(seconds=seconds, torque=RADIUS * (3 + np.sin(omega * time)), acceleration=still)
    terms = CATALOGUE["cable_stretch"].columns(motion, {"time_constant": time_constant})
    if time_constant == 0:
        assert not terms
        return
    # constant -1 on scale "compliance": minus the compliance times minus (lagging - present) is added.
    change = -np.sum([t.constant * t.values for t in terms if t.constant == -1.0], axis=0)
    expected = np.imag(np.exp(1j * omega * time) / (1 + 1j * omega * time_constant)) - np.sin(omega * time)
    assert change[-1000:] == pytest.approx(expected[-1000:], abs=3e-4)
    assert {t.scale for t in terms} == {"compliance"}
    assert [t.constant for t in terms] == [-1.0]


def test_a_cable_that_stiffens_is_stretched_less() -> None:
    """Of the tension k x + k2 x^2, with k = 7 N/mm and k2 = 2 N/mm^2 (k^2 / k2 = 24.5 N): by x."""
    stretch = np.linspace(0.0, 1.2e-3, 50)
    tension = 7e3 * stretch + 2e6 * stretch**2
    still = np.zeros_like(tension)
    motion = moving(seconds=len(tension) / 250.0, torque=RADIUS * tension, acceleration=still)
    (term,) = CATALOGUE["cable_stretch"].columns(motion, {"time_constant": 0.0, "stiffens_at": 24.5})
    assert (term.scale, term.constant) == ("compliance", -1.0)
    assert (tension + term.values) / 7e3 == pytest.approx(stretch, abs=1e-12)


def test_a_stretch_lags_behind_the_tension_that_motor_and_gearbox_leave() -> None:
    """Of sines of torque and angle in closed form: what the rotor takes of the torque never lags."""
    motion, shape = moving(seconds=8.0), {"time_constant": 0.016, "drive_inertia": 2e-4}
    turn, beat, settled = 2 * np.pi * 0.75, 2 * np.pi * 0.25, motion.time > 4.0

    def missed(omega: float, phase: float) -> np.ndarray:
        lag = 1.0 / (1.0 + 1j * omega * 0.016) - 1.0
        return np.asarray(np.imag(lag * np.exp(1j * (omega * motion.time + phase))))

    inertia = MOTOR.inertia + 2e-4
    expected = (0.02 * missed(beat, 0.0) + inertia * 0.4 * turn**2 * missed(turn, 0.8)) / RADIUS
    (term,) = CATALOGUE["cable_stretch"].columns(motion, shape)
    assert term.constant == -1.0
    assert term.values[settled] == pytest.approx(expected[settled], abs=2e-4)


def test_a_bent_angle_sensor_bends_spring_torque_and_cable_alike() -> None:
    """The sensor reads e too much: spring torque falls by K e and cable length by the arm times e.

    Without weight: what gravity and contact make of it is in ``test_sensing_columns``.
    """
    motion = moving(finger=replace(FINGER, gravity=0.0))
    q = motion.joints
    assert q is not None
    for shape in CATALOGUE["angle_sensor_nonlinearity"].shapes:
        terms = CATALOGUE["angle_sensor_nonlinearity"].columns(motion, shape)
        for part, function in (("sine", np.sin), ("cosine", np.cos)):
            error = {"mcp": function(shape["harmonic"] * q.mcp), "pip": function(shape["harmonic"] * q.pip)}
            check_angle_error(terms, part, error)
    for warm in (5.0, 40.0):
        drift = CATALOGUE["sensor_drift"].columns(motion, {"time_constant": warm})
        error = warm * (1.0 - np.exp(-motion.time / warm))
        check_angle_error(drift, "rate", {"mcp": error, "pip": error})


def test_a_sensor_that_warms_up_slowly_drifts_steadily() -> None:
    motion = moving()
    terms = CATALOGUE["sensor_drift"].columns(motion, {"time_constant": STEADY_S})
    (cable,) = [t for t in terms if t.row == Row.CABLE and t.gain == "rate_mcp"]
    assert -cable.values == pytest.approx(motion.time, rel=motion.time.max() / STEADY_S)


def check_angle_error(terms: list[Term], gain: str, error: dict[str, np.ndarray]) -> None:
    stiffness = {"mcp": FINGER.mcp_stiffness, "pip": FINGER.pip_stiffness}
    for joint, row in (("mcp", Row.MCP), ("pip", Row.PIP)):
        torque = column(terms, row, f"{gain}_{joint}")
        assert torque == pytest.approx(-stiffness[joint] * error[joint])
        (cable,) = [t for t in terms if t.row == Row.CABLE and t.gain == f"{gain}_{joint}"]
        assert cable.scale == f"arm_{joint}"
        assert cable.values == pytest.approx(-error[joint])


def test_each_cable_has_a_sheath_of_its_own() -> None:
    """The palmar cable's share says nothing of the dorsal one: its column is empty there, and no other is."""
    motion = moving()
    for sign, own in ((-1, "extension"), (1, "flexion")):
        for shape in CATALOGUE["capstan_friction"].shapes:
            terms = CATALOGUE["capstan_friction"].columns(replace(motion, cable_sign=sign, _memory={}), shape)
            assert {t.gain for t in terms if np.any(t.values)} == {own}
            assert {t.gain for t in terms} == {"extension", "flexion"}
