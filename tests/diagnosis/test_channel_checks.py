"""A channel that is dead, in another unit or of the other sense is told as that, before any physics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.signals.scales import Scales, reduced_sessions
from fingerlab.sessions.model import Array, Run, Session

from . import closed_form as made

Change = Callable[[Array], Array]


def changed(session: Session, changes: Mapping[str, Change]) -> Session:
    runs = []
    for run in session.runs:
        channels = run.load()
        for name, change in changes.items():
            channels[name] = change(channels[name])
        names = {"name": run.name, "phase": run.phase, "cable": run.cable}
        runs.append(
            Run.from_arrays(channels, **names, sample_rate_hz=run.sample_rate_hz, trajectory=run.trajectory)
        )
    return replace(session, runs=tuple(runs))


@pytest.fixture(scope="module")
def session() -> Session:
    return made.session(made.Bench(), 3, contact=2)


def noise(values: Array) -> Array:
    return 1e-3 * np.random.default_rng(2).standard_normal(len(values))


@pytest.mark.parametrize(
    ("channel", "change", "sentence"),
    [
        ("mcp_angle", noise, "'mcp_angle' does not move in any run while the other joint does"),
        ("pip_angle", np.zeros_like, "'pip_angle' does not move in any run while the other joint does"),
        ("motor_position", np.zeros_like, "'motor_position' does not move in any run"),
        ("motor_position", np.degrees, "'motor_position' moves 57.3 times as far as its command"),
        ("motor_position", np.negative, "'motor_position' turns against its command"),
        (
            "motor_torque",
            lambda v: 1e3 * v,
            "'motor_torque' swings by far more than the joints' springs take",
        ),
        ("motor_torque", lambda v: 1e-3 * v, "'motor_torque' swings by far less than the joints' springs"),
        ("endpoint_force", noise, "'endpoint_force' reads next to nothing in every contact run"),
        (
            "endpoint_force",
            lambda v: 0.0 * v + 1.2 + noise(v),
            "'endpoint_force' stands still in every con",
        ),
        ("endpoint_force", np.negative, "'endpoint_force' is negative in every contact run"),
        ("endpoint_force", lambda v: 1e3 * v, "'endpoint_force' is far more than the cable's tension"),
    ],
)
@pytest.mark.parametrize("size", [1.0, 40.0])
def test_what_cannot_be_is_told(
    session: Session, channel: str, change: Change, sentence: str, size: float
) -> None:
    wrong = changed(session, {channel: change})
    if size != 1.0:
        # Torques, forces, masses and springs as if one unit of torque were so many.
        wrong = reduced_sessions([wrong], Scales(torque=1.0 / size))[0]
    with pytest.raises(UserError, match=sentence):
        Reduction([wrong]).of([])


def test_both_position_and_command_in_degrees_are_told_by_geometry(session: Session) -> None:
    wrong = changed(session, {"motor_position": np.degrees, "motor_command": np.degrees})
    with pytest.raises(UserError, match=r"cable moves much further than the joints turn .* in rad"):
        Reduction([wrong]).of([])


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"motor_torque": lambda v: 1e3 * v}, "'motor_torque' is 1000 times what motor_current"),
        ({"motor_torque": np.negative}, "'motor_torque' is -1 times .* turn its sign"),
        ({"motor_position": np.zeros_like}, "'motor_position' does not move in any run"),
    ],
)
def test_a_motor_alone_is_checked_too(change: Mapping[str, Change], sentence: str) -> None:
    time = np.arange(12_000) / 1000.0
    torque = 0.02 * np.sin(2 * np.pi * time) + 1e-4 * np.random.default_rng(1).standard_normal(len(time))
    motor = replace(made.RIG.motor, torque_constant=0.01, gear_ratio=5.0)
    run = Run.from_arrays(
        {
            "time": time,
            "motor_position": -0.5 * np.sin(2 * np.pi * time),
            "motor_torque": torque,
            "motor_current": torque / 0.05,
        },
        name="001",
        phase="motor_bench",
        cable="none",
        sample_rate_hz=1000.0,
        trajectory={"kind": "sine", "frequency_hz": 1.0},
    )
    bench = Session(
        made.Path("motor.h5"), "motor", "2026-11-01T09:00:00+01:00", replace(made.RIG, motor=motor), (run,)
    )
    Reduction([bench]).of([])
    with pytest.raises(UserError, match=sentence):
        Reduction([changed(bench, change)]).of([])


def test_a_finger_without_length_says_nothing_of_the_load_cell(session: Session) -> None:
    """No lever, no ratio to compare; such a rig once ended in a division by zero."""
    assert session.rig.finger is not None
    none = replace(session.rig.finger, proximal_half_length=0.0, distal_half_length=0.0)
    reduced = Reduction([replace(session, rig=replace(session.rig, finger=none))]).of([])
    assert {group.in_contact for group in reduced.groups} == {False, True}
